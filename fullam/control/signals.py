"""What passes between estimator, law and allocation, as records of numbers; world axes."""

from __future__ import annotations

from typing import NamedTuple

from fullam.dynamics.spatial import Pose, Spatial
from fullam.numbers.kernel import Number


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
