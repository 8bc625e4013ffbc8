"""A reference model: how a target that a hand moves becomes a motion that can be followed.

A hand jumps; a vehicle cannot. So the target that the law sees follows the goal within limits of
acceleration and speed, position and attitude alike: from the gap e to the goal the wanted speed is

    s(e) = k e                            near the goal,
    s(e) = sqrt(2 b (e - b / (2 k^2)))    farther off, from where it brakes with b,

at most the largest speed; the acceleration is 4 k (s(e) e/|e| - v), at most the largest one, of
which b is a share. Near the goal this is critically damped, with both poles at -2 k.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from fullam.control.signals import Target
from fullam.dynamics.so3 import boxminus, boxplus, rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial
from fullam.numbers.vectors import Vector, add, axpy, dot, rotate, rotate_back, scale, subtract

RATE = 2.5
"""k [1/s]."""

BRAKING = 0.7
"""Share of the largest acceleration that braking counts on."""

ARRIVED = 1e-7
"""A gap [m, rad] and a speed [m/s, rad/s] below which the target stands on its goal."""


class Bounds(NamedTuple):
    """Largest acceleration and speed [m/s^2 and m/s, or rad/s^2 and rad/s]."""

    acceleration: float
    speed: float


def wanted_speed(gap: float, bounds: Bounds) -> float:
    """Speed at which a gap is closed; see the module's first lines."""
    braking = BRAKING * bounds.acceleration
    near = braking / RATE**2
    speed = RATE * gap if gap < near else math.sqrt(2.0 * braking * (gap - 0.5 * near))
    return min(speed, bounds.speed)


def acceleration_towards(gap: Vector, velocity: Vector, bounds: Bounds) -> Vector:
    """Acceleration that closes a gap, as vectors."""
    length = math.sqrt(dot(gap, gap))
    wanted = scale(wanted_speed(length, bounds) / length, gap) if length > 0.0 else gap
    asked: Vector = scale(4.0 * RATE, subtract(wanted, velocity))
    size = math.sqrt(dot(asked, asked))
    return asked if size <= bounds.acceleration else scale(bounds.acceleration / size, asked)


def follow_goal(
    target: Target, goal: Pose, linear: Bounds, angular: Bounds, period: float
) -> Target:
    """The target one control period on.

    Args:
        target: Where it is now; its acceleration is not read.
        goal: Where the hand wants it.
        linear: Bounds of the position.
        angular: Bounds of the attitude.
        period: Control period [s].
    """
    p, q = target.pose
    R = rotation_matrix(q)
    gap = subtract(goal.position, p)
    turn = rotate(R, boxminus(goal.attitude, q))
    v, w = target.velocity
    if max(map(abs, (*gap, *turn, *v, *w))) < ARRIVED:
        still = Spatial((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        return Target(goal, still, still)
    a = acceleration_towards(gap, v, linear)
    b = acceleration_towards(turn, w, angular)
    # Constant acceleration over the period: exact for the position, of second order in the angle.
    way = axpy(0.5 * period * period, a, scale(period, v))
    angle = axpy(0.5 * period * period, b, scale(period, w))
    pose = Pose(add(p, way), boxplus(q, rotate_back(R, angle)))
    return Target(pose, Spatial(axpy(period, a, v), axpy(period, b, w)), Spatial(a, b))
