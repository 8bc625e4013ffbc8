"""What a hand does to a flying vehicle: pushes of a given force, and a pull by a spring.

A force F that acts at a point r of the vehicle (in world axes, from the origin of {A}) is the
wrench [F, r x F + M] on the platform. That is exact for a point of the arm, too: the joints'
motion is prescribed, so the servos carry what acts on the links to the platform.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.dynamics.spatial import Spatial
from fullam.model.vehicle import Vehicle
from fullam.numbers.vectors import ZERO, Vector, add, cross, dot, scale, subtract

Array = NDArray[np.float64]

POINTS = ("platform", "tool")
"""Where a hand takes hold."""

STIFFNESS, MOST_FORCE = 0.5, 0.25
"""Of the spring between a pulling hand and the vehicle [weights/m], and the most it gives, in
weights of the nominal vehicle: a hand at the tool that pulls with more turns most of them over."""


class Push(NamedTuple):
    """A force and a moment in world axes [N, N m], where, until which control period."""

    force: Vector
    moment: Vector
    at: str
    end: int


class HandForce(NamedTuple):
    """What hands do at the moment: pushes; where a pulling hand is, or None, and what it holds."""

    pushes: tuple[Push, ...] = ()
    hand: Vector | None = None
    at: str = "tool"


class Felt(NamedTuple):
    """The wrench of the hands on the platform, and the pull alone: its foot and its force."""

    wrench: Spatial
    foot: Vector
    pull: Vector


NOTHING = Felt(Spatial(ZERO, ZERO), ZERO, ZERO)


class Holds:
    """Where the points that a hand may hold are.

    Attributes:
        weight: Of the nominal vehicle [N].
    """

    def __init__(self, nominal: Vehicle) -> None:
        """Own a workspace; the true vehicle's joints are where the nominal one's are."""
        vehicle, self.weight = nominal, nominal.mass * nominal.gravity
        self._model, self._data = vehicle.model, vehicle.create_data()
        self._tool = vehicle.model.getFrameId(vehicle.tool)

    def place(self, at: str, pose: Array, arm: Array) -> Vector:
        """A point in the world [m]; pose [p, quaternion xyzw], shape (7,), and joint positions."""
        if at == "platform":
            x, y, z = pose[:3].tolist()
        else:
            pin.forwardKinematics(self._model, self._data, np.concatenate([pose, arm]))
            tool = pin.updateFramePlacement(self._model, self._data, self._tool)
            x, y, z = tool.translation.tolist()
        return x, y, z


def spring(hand: Vector, foot: Vector, weight: float) -> Vector:
    """Force of the spring on a vehicle of that weight [N]."""
    force: Vector = scale(STIFFNESS * weight, subtract(hand, foot))
    size, most = math.sqrt(dot(force, force)), MOST_FORCE * weight
    return force if size <= most else scale(most / size, force)


def felt(force: HandForce, holds: Holds, pose: Array, arm: Array) -> Felt:
    """What the vehicle feels of the hands in a pose."""
    if not force.pushes and force.hand is None:
        return NOTHING
    origin = tuple(pose[:3].tolist())
    total, moment, foot, pull = ZERO, ZERO, ZERO, ZERO
    if force.hand is not None:
        foot = holds.place(force.at, pose, arm)
        total = pull = spring(force.hand, foot, holds.weight)
        moment = cross(subtract(foot, origin), pull)
    for push in force.pushes:
        where = holds.place(push.at, pose, arm)
        total = add(total, push.force)
        moment = add(moment, add(push.moment, cross(subtract(where, origin), push.force)))
        if force.hand is None:
            foot, pull = where, push.force
    return Felt(Spatial(total, moment), foot, pull)


def still_pushing(force: HandForce, k: int) -> HandForce:
    """Without the pushes that have ended by control period k."""
    if all(push.end > k for push in force.pushes):
        return force
    return force._replace(pushes=tuple(push for push in force.pushes if push.end > k))
