"""The stages of a flight that belong to nobody else: watch, allocate, record.

A flight is a list of stages, called in turn in every control period:

    watch     has it left the bounds of sense?                       here
    sense     what do the sensors read?                              `sensors`
    estimate  what does the estimator make of it?                    `fullam.control.estimator`
    foresee   take the known lags off                                `anticipation`
    command   which wrench does the law want?                        `fullam.control.law`
    allocate  which rotor speeds give it?                            here, `fullam.control.allocation`
    inform    tell the law what it did not get                       `fullam.control.law`
    record    write the row of the period                            here
    move      fly the period                                         `plant`

Each is a kernel f(view, k) on a view of its own, so Python, machine code and lanes fly the same.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.control.allocation import allocate
from fullam.control.signals import Delivery
from fullam.dynamics.so3 import boxplus, rotation_matrix
from fullam.dynamics.spatial import (
    Pose,
    Spatial,
    rotate_spatial,
    rotate_spatial_back,
    subtract_spatial,
)
from fullam.numbers.kernel import Number, absolute, both, kernel, select
from fullam.numbers.vectors import ZERO, Vector, dot, multiply, subtract

FOREVER = 1e18
"""The period in which a flight has ended that has not."""

DIVERGED, NOT_FINITE = 1.0, 2.0
"""Why a flight ended early."""

LARGEST = 1e300
"""A wrench beyond this is not finite."""


class Status(NamedTuple):
    """The period in which the flight ended, `FOREVER` while it flies, and why."""

    end: Number
    cause: Number


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
    """A row of the record; see `fullam.simulation.run.COLUMNS`. Twist in body axes."""

    pose: Pose
    twist: Spatial
    measured_pose: Pose
    measured_velocity: Spatial
    u_pid: Spatial
    u_dc: Spatial
    command: Spatial
    residual: Spatial
    saturated: Number


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


class AllocateView(NamedTuple):
    """What `allocate_command` is shown; `ahead` holds the turn until the rotors follow."""

    problem: Any
    memory: Any
    estimate: Any
    ahead: Any
    command: Any
    centers: Any
    joint_rows: Any
    status: Any
    delivery: Any
    residual: Any
    commands: Any


class RecordView(NamedTuple):
    """What `record_entry` is shown."""

    state: Any
    estimate: Any
    command: Any
    delivery: Any
    residual: Any
    commands: Any
    speeds: Any
    entries: Any
    rotors: Any


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
def ended(status, well, k, cause):
    """The status after a look in period k, unless all is well or it had ended before."""
    now = Status(1.0 * k, cause)
    return select(well, status, select(status.end > k, now, status))


@kernel
def allocate_command(view, k):
    """Turn the command to {A} and allocate it; what came of it goes to `delivery`."""
    command, attitude = view.command[0].wrench, view.estimate[0].pose.attitude
    R = rotation_matrix(boxplus(attitude, view.ahead[k].turn))
    asked = rotate_spatial_back(R, command)
    f, m = asked.linear, asked.angular
    finite = absolute(f[0] + f[1] + f[2] + m[0] + m[1] + m[2]) < LARGEST
    status = ended(view.status[0], finite, k, NOT_FINITE)
    view.status[0] = status
    flying = status.end > k
    center = view.centers[k * int(view.joint_rows[0])]
    achieved, missing, short = allocate(
        view.problem, view.memory, asked, center, flying, view.commands
    )
    residual = subtract_spatial(achieved, asked)
    view.residual[0] = select(short, residual, Spatial(ZERO, ZERO))
    view.delivery[0] = Delivery(
        rotate_spatial(R, achieved), rotate_spatial(R, missing), select(short, 1.0, 0.0)
    )


@kernel
def record_entry(view, k):
    """Write the row of period k, before the vehicle moves on."""
    state, estimate, command = view.state[0], view.estimate[0], view.command[0]
    view.entries[k] = Entry(
        state.pose,
        state.twist,
        estimate.pose,
        estimate.velocity,
        command.u_pid,
        command.u_dc,
        command.wrench,
        view.residual[0],
        view.delivery[0].saturated,
    )
    for i in range(len(view.speeds)):
        view.rotors[k][i] = RotorEntry(view.commands[i], view.speeds[i])
