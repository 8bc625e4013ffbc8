"""The stages of a flight, and those of them that belong to nobody else.

A flight is a list of stages, called in turn in every control period:

    watch     has it left the bounds of sense?                       here
    sense     what do the sensors read?                              here, `sensors`
    estimate  what does the estimator make of it?                    `fullam.control.estimator`
    foresee   take the known lags off                                here, `anticipation`
    govern    take the target's tilt back while force is short       `fullam.control.governor`
    expect    what does the controller know that the tool carries?   `payloads.carrying`
    steer     where shall the arm's servos go?                       `fullam.control.arm_goals`
    encode    what do encoders, or a twin, tell of the arm?          `fullam.control.arm_feedback`
    command   which wrench does the law want?                        `fullam.control.law`
    lift      what does that take beside?                            `fullam.control.payload_lift`
    allocate  which rotor speeds give it?                            `fullam.control.delivery`
    share     what of it was the law's?                              `fullam.control.payload_lift`
    inform    tell the law what it did not get                       `fullam.control.law`
    learn     what hangs at the tool that nobody told of?            `payloads.learning`
    relieve   tell the law what of that is known by now              `fullam.control.law`
    record    write the row of the period                            here
    record arm    write its joints' part                             `plants.servo_motion`
    record tool   write where its tool is, for a track               `tool.track`
    load      what does its tool carry?                              `payloads.payload`
    record touch  write what the world does to its tool              `world.contact`
    move      fly the period               `plants`, `mujoco.plant`

Eleven of them belong to an arm on servos (`OF_SERVOS`); others are left out where nothing is to
be done.

Each is a kernel f(view, k) on a view of its own, so Python, machine code and lanes fly the same.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.control.estimator import Readings
from fullam.control.signals import DIVERGED, ended
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import (
    Pose,
    Spatial,
    rotate_spatial,
)
from fullam.numbers.kernel import Number, absolute, both, kernel, select
from fullam.numbers.vectors import Vector, dot, multiply, subtract
from fullam.simulation.anticipation import advance
from fullam.simulation.plants.plant import rotor_wrench
from fullam.simulation.sensors import keep_pose, sense_inertial, sense_pose

ORDER = (
    *("watch", "sense", "estimate", "foresee", "govern", "expect", "steer", "encode", "command"),
    *("lift", "allocate", "share", "inform", "learn", "relieve", "record", "record arm"),
    *("record tool", "load", "record touch", "move"),
)
"""The stages, as a control period calls them."""

OF_SERVOS = (
    *("expect", "steer", "encode", "lift", "share", "learn", "relieve", "record arm"),
    *("record tool", "load", "record touch"),
)
"""Those that a flight with prescribed joints does without."""


class Bounds(NamedTuple):
    """Bounds of sense around the target.

    Squared distance; cosine of half the angle; 1 for each position axis that counts; control
    periods between looks.
    """

    distance: Number
    cosine: Number
    axes: Vector
    every: Number


class Entry(NamedTuple):
    """A row of the record; see `fullam.simulation.record.run.COLUMNS`."""

    pose: Pose
    velocity: Spatial
    measured_pose: Pose
    measured_velocity: Spatial
    u_pid: Spatial
    u_dc: Spatial
    command: Spatial
    delivered: Spatial
    residual: Spatial
    saturated: Number
    given_up: Number
    rotor_wrench: Spatial


class RotorEntry(NamedTuple):
    """A rotor's part of a row: speed asked for, and true one [rad/s]."""

    command: Number
    speed: Number


class WatchView(NamedTuple):
    """What `watch` is shown."""

    state: Any
    targets: Any
    bounds: Any
    status: Any


class Rates(NamedTuple):
    """Control periods between two poses, and gravity along -z of {W} [m/s^2]."""

    every: Number
    gravity: Number


class SenseView(NamedTuple):
    """What `sense` and `sense_all` are shown.

    `ring` holds the last true poses; `missing` is a number a control period, or one for all.
    """

    state: Any
    ring: Any
    noise: Any
    missing: Any
    inertial: Any
    gains: Any
    rates: Any
    readings: Any


class ForeseeView(NamedTuple):
    """What `foresee` is shown."""

    ahead: Any
    estimate: Any


class RecordView(NamedTuple):
    """What `record_entry` is shown."""

    state: Any
    estimate: Any
    command: Any
    delivery: Any
    governor: Any
    residual: Any
    commands: Any
    true_rotors: Any
    speeds: Any
    entries: Any
    rotors: Any


@kernel
def sense(view, k):
    """Read the pose; the true velocity goes along for the estimator that cheats."""
    state, last, every = view.state[0], view.readings[0], view.rates[0].every
    keep_pose(view.ring, state.pose, k)
    pose = sense_pose(view.ring, view.noise[k], last.pose, every, k)
    is_missing = view.missing[min(k, len(view.missing) - 1)] > 0.0
    pose = select(is_missing, last.pose, pose)
    is_new = select(is_missing, 0.0, 0.0 if k % int(every) else 1.0)
    view.readings[0] = Readings(pose, state.twist, last.gyroscope, last.accelerometer, is_new)


@kernel
def sense_all(view, k):
    """Read the pose and the inertial sensors."""
    sense(view, k)
    state, readings = view.state[0], view.readings[0]
    felt = sense_inertial(
        state.pose.attitude,
        state.twist,
        state.acceleration,
        view.rates[0].gravity,
        view.gains[0],
        view.inertial[k],
    )
    view.readings[0] = Readings(
        readings.pose,
        readings.velocity,
        felt.gyroscope,
        felt.accelerometer,
        readings.is_new,
    )


@kernel
def foresee(view, k):
    """Take the estimator's lag off the estimate."""
    view.estimate[0] = advance(view.estimate[0], view.ahead[k])


@kernel
def watch(view, k):
    """Note where a flight has left the bounds of sense (NaN has)."""
    bounds = view.bounds[0]
    if k % int(bounds.every) == 0:
        pose, target, status = view.state[0].pose, view.targets[k].pose, view.status[0]
        away = multiply(bounds.axes, subtract(pose.position, target.position))
        a, b = pose.attitude, target.attitude
        cosine = absolute(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3])
        near = both(dot(away, away) <= bounds.distance, cosine >= bounds.cosine)
        view.status[0] = ended(status, near, k, DIVERGED)


@kernel
def record_entry(view, k):
    """Write the row of period k, before the vehicle moves on."""
    state, estimate, command = view.state[0], view.estimate[0], view.command[0]
    R, delivery = rotation_matrix(state.pose.attitude), view.delivery[0]
    thrust = Spatial(*rotor_wrench(view.true_rotors, view.speeds))
    view.entries[k] = Entry(
        state.pose,
        rotate_spatial(R, state.twist),
        estimate.pose,
        estimate.velocity,
        command.u_pid,
        command.u_dc,
        command.wrench,
        select(delivery.saturated > 0.0, delivery.wrench, command.wrench),
        view.residual[0],
        delivery.saturated,
        view.governor[0].given_up,
        rotate_spatial(R, thrust),
    )
    rotors = view.rotors[k]
    for i in range(len(view.speeds)):
        rotors[i] = RotorEntry(view.commands[i], view.speeds[i])
