"""One moment of a flight, whoever flies it: what a scene draws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass
class Snapshot:
    """One moment of a flight, as a viewer needs it; a live object, rewritten each frame.

    Attributes:
        pose: [p, quaternion xyzw] of {A}.
        velocity: [dp, w] in world axes.
        arm: Joint angles [rad].
        arm_rate: Joint rates [rad/s].
        arm_acceleration: Joint accelerations [rad/s^2].
        rotor_speeds: Speeds [rad/s].
        rotor_wrench: Wrench of the rotors in world axes at {A}.
        disturbance: Gust on the platform in world axes at {A}.
        target: [p, quaternion xyzw] asked for.
        saturated: Whether the allocation met a bound.
        spin: Angles of the propellers [rad].
        u_dc: Compensation of the law, world axes.
        residual: Delivered less commanded wrench, {A} axes.
        hand: Point at which a hand pulls, and its force, world axes.
        contact: Force of the world on the tool, world axes.
        carried: Whether each payload is carried.
        scene: Coordinates of the scene's joints; None for those that the scene is drawn with.
    """

    pose: Array
    velocity: Array
    arm: Array
    arm_rate: Array
    arm_acceleration: Array
    rotor_speeds: Array
    rotor_wrench: Array
    disturbance: Array
    target: Array
    saturated: bool
    spin: Array
    u_dc: Array = field(default_factory=lambda: np.zeros(6))
    residual: Array = field(default_factory=lambda: np.zeros(6))
    hand: Array = field(default_factory=lambda: np.zeros(6))
    contact: Array = field(default_factory=lambda: np.zeros(3))
    carried: Sequence[bool] | NDArray[np.bool_] = ()
    scene: Array | None = None
