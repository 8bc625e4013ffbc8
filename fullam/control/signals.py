"""What passes between estimator, law and allocation, as records of numbers; world axes."""

from __future__ import annotations

from typing import NamedTuple

from fullam.dynamics.spatial import Pose, Spatial
from fullam.numbers.kernel import Number, kernel, select
from fullam.numbers.vectors import Vector


class Estimate(NamedTuple):
    """What the law is told of the platform: pose, and velocity [dp, w] in world axes."""

    pose: Pose
    velocity: Spatial


class Target(NamedTuple):
    """Where the platform should be: pose, velocity [dp, w] and acceleration in world axes."""

    pose: Pose
    velocity: Spatial
    acceleration: Spatial


class Command(NamedTuple):
    """What a law answers, world axes at the origin of {A}.

    The wrench wanted from the rotors; u_pid, the commanded acceleration; u_dc, the compensation.
    """

    wrench: Spatial
    u_pid: Spatial
    u_dc: Spatial


class Delivery(NamedTuple):
    """What the allocation made of a command, world axes at the origin of {A}.

    The wrench achieved; achieved minus commanded, with its moment about the centre of mass; and 1
    where bounds cost wrench, else 0.
    """

    wrench: Spatial
    missing: Spatial
    saturated: Number


class Ahead(NamedTuple):
    """By how much the reference runs ahead in a control period.

    Of what is seen of it: [p_ref - p_seen (world); log(R_seen^T R_ref) ({A})], and the difference
    of the velocities, world axes. Of what the rotors do: what the platform turns until they follow,
    R^T w_ref lag, {A} axes.
    """

    pose: Spatial
    velocity: Spatial
    turn: Vector


class Status(NamedTuple):
    """The control period in which a flight ended, `FOREVER` while it flies, and why."""

    end: Number
    cause: Number


FOREVER = 1e18
"""The period in which a flight has ended that has not."""

DIVERGED, NOT_FINITE = 1.0, 2.0
"""Why a flight ended early."""


@kernel
def ended(status, well, k, cause):
    """The status after a look in period k, unless all is well or it had ended before."""
    now = Status(1.0 * k, cause)
    return select(well, status, select(status.end > k, now, status))
