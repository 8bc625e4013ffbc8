"""The pose filter, eq. (19), PID and dc-PID with their anti-windup.

`fullam.control.filters`, `pid` and `dc_pid` are the reference; their texts explain what is done
here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.simulation.compiled.dynamics import (
    compensation,
    platform_acceleration,
    platform_body,
    rigid_inertia,
)
from fullam.simulation.compiled.integrate import (
    ESTIMATE,
    RATE,
    READING,
    TOLD,
    TOLD_VELOCITY,
)
from fullam.simulation.compiled.jit import compiled, merged
from fullam.simulation.compiled.rotations import (
    add,
    difference,
    four,
    scale,
    six,
    subtract,
    symmetric,
    three,
    turn,
    turn_back,
    turned,
    write,
    write_four,
)

Array = NDArray[np.float64]

PID, DC_PID, DC_PID_PREVIOUS, BACKSTEPPING = 0, 1, 2, 3
"""Codes of the laws."""

OF_ERROR, OF_SLOPE, OF_RATE, OF_INTEGRATION, LIMIT, LOWER, UPPER, INERTIA, INVERSE, MISC = range(10)
"""Rows of `numbers`, shape (10, 6): K_p; backstepping's gain of the error's derivative; K_d; K_i
times the period; limit of the integrator; bounds of the wrench, infinite without one; inertia of
the rigid body that the PID takes the vehicle for and its inverse, as in `symmetric`; scalars."""

KIND, DRAIN, ROUNDS, MASS, WEIGHT, GRAVITY = range(6)
"""Entries of the row MISC: code of the law, anti-windup rate times the period, solutions of
eq. (21) per period, mass and weight of the rigid body, gravity along -z of {W}."""

INTEGRAL, AT_HAND, INERTIAL, HAS_HAND, U_PID, U_DC, COMMAND = range(7)
"""Rows of `memory`, shape (7, 6): integrator; wrench at hand and inertial wrench of the last period
in {A} axes, and 1.0 in the next row's first entry if there is one; commanded acceleration,
compensation and commanded wrench in world axes."""


class Law(NamedTuple):
    """A controller as numbers.

    Attributes:
        numbers: Shape (10, 6).
        links: Chain of the nominal vehicle, shape (n + 1, WIDTH).
    """

    numbers: Array
    links: Array


@merged
def filter_pose(state, gain, per_period):
    """Step y <- y (+) gain (x (-) y) and its rate; see `fullam.control.filters`."""
    q = four(state, ESTIMATE, 3)
    e = difference(q, four(state, READING, 3))
    for i in range(3):
        step = state[READING, i] - state[ESTIMATE, i]
        state[RATE, i] = step * per_period
        state[ESTIMATE, i] += gain * step
    write(state, RATE, 3, scale(per_period, e))
    write_four(state, ESTIMATE, 3, turned(q, scale(gain, e)))


@merged
def errors(R, state, target, rate, k):
    """Pose error and velocity error in world axes, six numbers each.

    Args:
        R: Attitude.
        state: Pose and body velocity that the controller is told.
        target: Reference poses, shape (N, 7).
        rate: Reference velocities in world axes, shape (N, 6).
        k: Row of the reference.
    """
    e = turn(R, difference(four(state, TOLD, 3), four(target, k, 3)))
    d = subtract(three(target, k, 0), three(state, TOLD, 0))
    v = subtract(three(rate, k, 0), turn(R, three(state, TOLD_VELOCITY, 0)))
    w = subtract(three(rate, k, 3), turn(R, three(state, TOLD_VELOCITY, 3)))
    return (d[0], d[1], d[2], e[0], e[1], e[2]), (v[0], v[1], v[2], w[0], w[1], w[2])


@merged
def integrate_error(numbers, memory, e):
    """Move the integrator on, within its limit."""
    for i in range(6):
        moved = memory[INTEGRAL, i] + numbers[OF_INTEGRATION, i] * e[i]
        memory[INTEGRAL, i] = max(min(moved, numbers[LIMIT, i]), -numbers[LIMIT, i])


@compiled
def release(memory, i, a, rate):
    """Let go of integral action that pushes into a limit, and of no more; see `PidLaw.drain`."""
    integral = memory[INTEGRAL, i]
    if integral * a < 0.0:
        step = min(abs(a) * rate, abs(integral))
        memory[INTEGRAL, i] = integral - step if integral > 0.0 else integral + step


@compiled
def drain_pid(numbers, memory, R, force, moment):
    """Anti-windup of the PID for a missing wrench in world axes."""
    a = scale(1.0 / numbers[MISC, MASS], force)
    b = turn(R, symmetric(six(numbers, INVERSE, 0), turn_back(R, moment)))
    for i in range(3):
        release(memory, i, a[i], numbers[MISC, DRAIN])
        release(memory, 3 + i, b[i], numbers[MISC, DRAIN])


@merged
def pid_wrench(numbers, links, memory, R, w, e, de, feedforward, k, arm, row):
    """Wrench of PID or dc-PID, into the memory, and the integrator moved on.

    Args:
        numbers: The law.
        links: Chain of the nominal vehicle.
        memory: Its memory.
        R: Attitude.
        w: Angular velocity in {A} axes.
        e: Pose error.
        de: Velocity error.
        feedforward: Reference accelerations, shape (N, 6).
        k: Row of the reference.
        arm: The arm's motion.
        row: Its row.
    """
    for i in range(6):
        a = numbers[OF_ERROR, i] * e[i] + memory[INTEGRAL, i] + numbers[OF_RATE, i] * de[i]
        memory[U_PID, i] = a + feedforward[k, i]
    integrate_error(numbers, memory, e)
    linear, angular = three(memory, U_PID, 0), three(memory, U_PID, 3)
    if numbers[MISC, KIND] == PID:
        force = scale(numbers[MISC, MASS], linear)
        force = (force[0], force[1], force[2] + numbers[MISC, WEIGHT])
        moment = turn(R, symmetric(six(numbers, INERTIA, 0), turn_back(R, angular)))
        write(memory, U_DC, 0, (0.0, 0.0, numbers[MISC, WEIGHT]))
        write(memory, U_DC, 3, (0.0, 0.0, 0.0))
    else:
        force, moment = dc_pid_wrench(
            numbers, links, memory, R, w, turn_back(R, linear), turn_back(R, angular), arm, row
        )
    write(memory, COMMAND, 0, force)
    write(memory, COMMAND, 3, moment)
    short = False
    for i in range(6):
        asked = memory[COMMAND, i]
        bounded = max(min(asked, numbers[UPPER, i]), numbers[LOWER, i])
        short = short or bounded != asked
        memory[COMMAND, i] = bounded
    if short:
        lack = subtract(three(memory, COMMAND, 0), force)
        twist = subtract(three(memory, COMMAND, 3), moment)
        drain_pid(numbers, memory, R, lack, twist)
    keep_in_hand(numbers, memory, R, three(memory, COMMAND, 0), three(memory, COMMAND, 3))


@merged
def dc_pid_wrench(numbers, links, memory, R, w, a, b, arm, row):
    """Wrench of eq. (26) in world axes for u_pid = (a, b) in {A} axes; u_dc into the memory."""
    m, s, J = platform_body(links)
    f, t = rigid_inertia(m, s, J, a, b)
    g = scale(-numbers[MISC, GRAVITY], (R[6], R[7], R[8]))
    rounds = 1
    force, moment, f_dc, t_dc = f, t, f, t
    if memory[HAS_HAND, 0] > 0.0:
        # The wrench applied last, with this period's u_pid in the place of the last one's.
        force = add(three(memory, AT_HAND, 0), subtract(f, three(memory, INERTIAL, 0)))
        moment = add(three(memory, AT_HAND, 3), subtract(t, three(memory, INERTIAL, 3)))
        rounds = int(numbers[MISC, ROUNDS])
    for _ in range(rounds):
        if memory[HAS_HAND, 0] > 0.0:
            a, b = platform_acceleration(links, arm, row, w, g, force, moment)
        f_dc, t_dc = compensation(links, arm, row, w, b, a, g)
        force, moment = add(f, f_dc), add(t, t_dc)
    write(memory, INERTIAL, 0, f)
    write(memory, INERTIAL, 3, t)
    write(memory, U_DC, 0, turn(R, f_dc))
    write(memory, U_DC, 3, turn(R, t_dc))
    return turn(R, force), turn(R, moment)


@merged
def keep_in_hand(numbers, memory, R, force, moment):
    """Keep the wrench (world axes) that eq. (21) is to be solved with in the next period."""
    if numbers[MISC, KIND] == DC_PID_PREVIOUS:
        write(memory, AT_HAND, 0, turn_back(R, force))
        write(memory, AT_HAND, 3, turn_back(R, moment))
        memory[HAS_HAND, 0] = 1.0
