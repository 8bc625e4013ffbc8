"""The flight, tick by tick: sensors, estimator, anticipation, law, allocation, plant.

`fullam.simulation.flight.Flight.ticks` is the reference and reads as a sentence; this is the same
sentence. Whatever changes during a flight is in arrays, so a flight can be flown in stretches.

Arrays are passed one by one and indexed by element: taking an array out of a tuple or slicing one
costs numba an atomic count of references, and a few hundred of them per tick were four fifths of
its time.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.simulation.compiled.allocation import Allotment, achieved, exact
from fullam.simulation.compiled.backstepping import backstepping_wrench, drain_backstepping
from fullam.simulation.compiled.box_qp import MAX_SPEED, WANTED, U
from fullam.simulation.compiled.dynamics import composite
from fullam.simulation.compiled.integrate import (
    ASKED,
    COMMANDS,
    ESTIMATE,
    POSE,
    RATE,
    READING,
    SPEEDS,
    SUBSTEPS,
    TOLD,
    TOLD_VELOCITY,
    VELOCITY,
    Craft,
    advance,
)
from fullam.simulation.compiled.jit import compiled, merged
from fullam.simulation.compiled.law import (
    BACKSTEPPING,
    COMMAND,
    KIND,
    MISC,
    U_DC,
    U_PID,
    Law,
    drain_pid,
    errors,
    filter_pose,
    keep_in_hand,
    pid_wrench,
)
from fullam.simulation.compiled.moment_about import allocate_about
from fullam.simulation.compiled.rotations import (
    add,
    copy_row,
    four,
    matrix,
    scale,
    subtract,
    three,
    turn,
    turn_back,
    turned,
    write,
    write_four,
)

Array = NDArray[np.float64]

TRUTH, FIRST_ORDER = 0, 1
ESTIMATORS = {"truth": TRUTH, "first-order": FIRST_ORDER}
"""Code of each estimator that is compiled."""

ESTIMATOR, EVERY, DELAY, FILTER_GAIN, FILTER_RATE, NOISY, LOOK, MAX_DISTANCE, MAX_ANGLE, AXES = (
    range(10)
)
"""Entries of `rules`: code of the estimator, control periods between poses, age of a pose in
control periods, gain of the pose filter and that over its period [1/s], 1.0 if there is noise,
control periods between looks at the bounds of sense, these bounds [m, rad], and 1.0 where a
position axis is controlled (3)."""

FLYING, DIVERGED, NOT_FINITE = 0, 1, 2
"""How a stretch of the flight ended."""


class Tables(NamedTuple):
    """What is known before take-off, one row a control period.

    Attributes:
        target: Reference pose that the controller is fed, shape (N, 7).
        rate: Reference velocity, world axes, shape (N, 6).
        feedforward: Reference acceleration, world axes, shape (N, 6).
        arm: The arm's motion on the half-step grid, shape (rows, n, ARM_WIDTH).
        ahead: The `Anticipation`: pose, velocity and turn side by side, shape (N, 18).
        moving: Whether its row differs from zero, shape (N,).
    """

    target: Array
    rate: Array
    feedforward: Array
    arm: Array
    ahead: Array
    moving: NDArray[np.bool_]


class Draw(NamedTuple):
    """The weather, one row a control period.

    Attributes:
        noise: Of the pose, shape (N, 6).
        gusts: On the platform, world axes, shape (N, 6).
    """

    noise: Array
    gusts: Array


class Log(NamedTuple):
    """Columns of the run that the loop writes; see `fullam.simulation.run.COLUMNS`."""

    pose: NDArray[Any]
    velocity: NDArray[Any]
    measured_pose: NDArray[Any]
    measured_velocity: NDArray[Any]
    u_pid: NDArray[Any]
    u_dc: NDArray[Any]
    command: NDArray[Any]
    residual: NDArray[Any]
    saturated: NDArray[Any]
    rotor_commands: NDArray[Any]
    rotor_speeds: NDArray[Any]


class Job(NamedTuple):
    """All that a flight needs, apart from its log.

    Attributes:
        craft: The vehicle that flies.
        law: The controller.
        memory: What it remembers, shape (7, 6).
        allotment: The allocation.
        tables: What is known before take-off.
        draw: The weather.
        rules: Rates of the sensors and bounds of sense, shape (12,).
        state: Shape (8, 7).
        speeds: Shape (2, n_r).
    """

    craft: Craft
    law: Law
    memory: Array
    allotment: Allotment
    tables: Tables
    draw: Draw
    rules: Array
    state: Array
    speeds: Array


@merged
def diverged(rules, state, target, k):
    """Whether the pose has left the bounds of sense around the target (NaN has)."""
    square = cosine = 0.0
    for i in range(3):
        square += rules[AXES + i] * (state[POSE, i] - target[k, i]) ** 2
    for i in range(3, 7):
        cosine += state[POSE, i] * target[k, i]
    cosine = abs(cosine)
    # Not min(1.0, cosine), which is 1.0 for NaN.
    angle = 0.0 if cosine >= 1.0 else 2.0 * math.acos(cosine)
    return not (math.sqrt(square) <= rules[MAX_DISTANCE] and angle <= rules[MAX_ANGLE])


@merged
def sense(rules, noise, poses, state, k):
    """Readings of period k and what the estimator makes of them: pose and velocity told.

    `poses` is the log of true poses, row k written.
    """
    new = k % int(rules[EVERY]) == 0
    if new:
        copy_row(poses, max(0, k - int(rules[DELAY])), state, READING, 7)
        if rules[NOISY] > 0.0:
            write(state, READING, 0, add(three(state, READING, 0), three(noise, k, 0)))
            write_four(state, READING, 3, turned(four(state, READING, 3), three(noise, k, 3)))
    if rules[ESTIMATOR] == TRUTH:
        copy_row(state, READING, state, TOLD, 7)
        copy_row(state, VELOCITY, state, TOLD_VELOCITY, 6)
        return
    if k == 0:
        copy_row(state, READING, state, ESTIMATE, 7)
        write(state, RATE, 0, (0.0, 0.0, 0.0))
        write(state, RATE, 3, (0.0, 0.0, 0.0))
    if new:
        filter_pose(state, rules[FILTER_GAIN], rules[FILTER_RATE])
    copy_row(state, ESTIMATE, state, TOLD, 7)
    R = matrix(four(state, TOLD, 3))
    write(state, TOLD_VELOCITY, 0, turn_back(R, three(state, RATE, 0)))
    write(state, TOLD_VELOCITY, 3, three(state, RATE, 3))


@merged
def advance_estimate(ahead, k, state):
    """Take the estimator's lag off; see `Anticipation.advance`."""
    q = four(state, TOLD, 3)
    R = matrix(q)
    v = add(turn(R, three(state, TOLD_VELOCITY, 0)), three(ahead, k, 6))
    w = add(turn(R, three(state, TOLD_VELOCITY, 3)), three(ahead, k, 9))
    q = turned(q, three(ahead, k, 3))
    write(state, TOLD, 0, add(three(state, TOLD, 0), three(ahead, k, 0)))
    write_four(state, TOLD, 3, q)
    R = matrix(q)
    write(state, TOLD_VELOCITY, 0, turn_back(R, v))
    write(state, TOLD_VELOCITY, 3, turn_back(R, w))


@merged
def command(numbers, links, memory, state, target, rate, feedforward, k, arm, row):
    """The law: its wrench goes into the memory; returns the attitude that it took."""
    R = matrix(four(state, TOLD, 3))
    e, de = errors(R, state, target, rate, k)
    if numbers[MISC, KIND] == BACKSTEPPING:
        backstepping_wrench(numbers, links, memory, R, state, e, de, rate, feedforward, k, arm, row)
    else:
        w = three(state, TOLD_VELOCITY, 3)
        pid_wrench(numbers, links, memory, R, w, e, de, feedforward, k, arm, row)
    return R


@merged
def deliver(numbers, links, memory, R, R_thrust, force, moment, sixes, arm, row):
    """Tell the law the wrench that the allocation achieved, {A} axes; see `Controller.delivered`.

    Row WANTED of `sixes` is the wrench that is missing nothing about the centre of mass.
    """
    force_W, moment_W = turn(R_thrust, force), turn(R_thrust, moment)
    if numbers[MISC, KIND] == BACKSTEPPING:
        lack = subtract(force_W, three(memory, COMMAND, 0))
        twist = subtract(moment_W, three(memory, COMMAND, 3))
        drain_backstepping(numbers, links, memory, R, lack, twist, arm, row)
    else:
        lack = turn(R_thrust, subtract(force, three(sixes, WANTED, 0)))
        twist = turn(R_thrust, subtract(moment, three(sixes, WANTED, 3)))
        drain_pid(numbers, memory, R, lack, twist)
        keep_in_hand(numbers, memory, R, force_W, moment_W)


@merged
def ask(memory, state, sixes, R_thrust):
    """Turn the commanded wrench to {A} and ask for it; False if it is not finite."""
    force = turn_back(R_thrust, three(memory, COMMAND, 0))
    moment = turn_back(R_thrust, three(memory, COMMAND, 3))
    write(state, ASKED, 0, force)
    write(state, ASKED, 3, moment)
    write(sixes, WANTED, 0, force)
    write(sixes, WANTED, 3, moment)
    return math.isfinite(force[0] + force[1] + force[2] + moment[0] + moment[1] + moment[2])


@compiled
def fly(job, log, start, stop, last):
    """Fly control periods start to stop - 1; the plant is not moved after period `last`.

    Returns:
        The first period that was not flown, and FLYING, DIVERGED or NOT_FINITE.
    """
    links, rotors, plant = job.craft
    numbers, nominal = job.law
    box, scales, keys, maps, unknowns, sixes, sets, minimisers, counters = job.allotment
    target, rate, feedforward, arm, ahead, moving = job.tables
    noise, gusts = job.draw
    memory, rules, state, speeds = job.memory, job.rules, job.state, job.speeds
    (
        log_pose,
        log_velocity,
        log_measured_pose,
        log_measured_velocity,
        log_u_pid,
        log_u_dc,
        log_command,
        log_residual,
        log_saturated,
        log_commands,
        log_speeds,
    ) = log
    stride, look, n = 2 * int(plant[SUBSTEPS]), int(rules[LOOK]), box.shape[0]
    for k in range(start, stop):
        row = stride * k
        copy_row(state, POSE, log_pose, k, 7)
        copy_row(state, VELOCITY, log_velocity, k, 6)
        copy_row(speeds, SPEEDS, log_speeds, k, n)
        if k % look == 0 and diverged(rules, state, target, k):
            return k, DIVERGED
        sense(rules, noise, log_pose, state, k)
        if moving[k]:
            advance_estimate(ahead, k, state)
        R = command(numbers, nominal, memory, state, target, rate, feedforward, k, arm, row)
        R_thrust = R
        if moving[k]:
            R_thrust = matrix(turned(four(state, TOLD, 3), three(ahead, k, 15)))
        finite = ask(memory, state, sixes, R_thrust)
        if not finite:
            return k, NOT_FINITE
        copy_row(memory, U_PID, log_u_pid, k, 6)
        copy_row(memory, U_DC, log_u_dc, k, 6)
        copy_row(memory, COMMAND, log_command, k, 6)
        if not exact(box, unknowns, sixes, counters):
            m, s, _ = composite(nominal, arm, row)
            center = scale(1.0 / m, s)
            if allocate_about(
                box, scales, keys, maps, unknowns, sixes, sets, minimisers, counters, state, center
            ):
                force, moment = achieved(box, unknowns)
                deliver(numbers, nominal, memory, R, R_thrust, force, moment, sixes, arm, row)
                write(log_residual, k, 0, subtract(force, three(state, ASKED, 0)))
                write(log_residual, k, 3, subtract(moment, three(state, ASKED, 3)))
                log_saturated[k] = True
        for i in range(n):
            speeds[COMMANDS, i] = box[i, MAX_SPEED] * math.sqrt(unknowns[U, i])
        copy_row(state, TOLD, log_measured_pose, k, 7)
        copy_row(state, TOLD_VELOCITY, log_measured_velocity, k, 6)
        copy_row(speeds, COMMANDS, log_commands, k, n)
        if k < last:
            advance(links, rotors, plant, arm, row, state, speeds, gusts, k)
    return stop, FLYING
