"""Poses, and quantities of two halves: velocities, accelerations, wrenches, gains."""

from __future__ import annotations

from typing import NamedTuple

from fullam.dynamics.so3 import Quaternion, boxplus, displacement, rotation_matrix
from fullam.numbers.kernel import kernel
from fullam.numbers.vectors import (
    Vector,
    add,
    axpy,
    cross,
    multiply,
    rotate,
    rotate_back,
    scale,
    subtract,
)


class Pose(NamedTuple):
    """Position in {W} and attitude of {A}."""

    position: Vector
    attitude: Quaternion


class Spatial(NamedTuple):
    """A linear and an angular half; of a wrench force and moment."""

    linear: Vector
    angular: Vector


@kernel
def add_spatial(x, y):
    """Sum x + y."""
    return Spatial(add(x.linear, y.linear), add(x.angular, y.angular))


@kernel
def subtract_spatial(x, y):
    """Difference x - y."""
    return Spatial(subtract(x.linear, y.linear), subtract(x.angular, y.angular))


@kernel
def scale_spatial(s, x):
    """Multiple s x."""
    return Spatial(scale(s, x.linear), scale(s, x.angular))


@kernel
def axpy_spatial(s, x, y):
    """Sum s x + y."""
    return Spatial(axpy(s, x.linear, y.linear), axpy(s, x.angular, y.angular))


@kernel
def multiply_spatial(x, y):
    """Product entry by entry, as with a diagonal matrix of gains."""
    return Spatial(multiply(x.linear, y.linear), multiply(x.angular, y.angular))


@kernel
def rotate_spatial(R, x):
    """Both halves turned, R x: from {A} to world axes, for an attitude R."""
    return Spatial(rotate(R, x.linear), rotate(R, x.angular))


@kernel
def rotate_spatial_back(R, x):
    """Both halves turned back, R^T x: from world axes to {A}."""
    return Spatial(rotate_back(R, x.linear), rotate_back(R, x.angular))


@kernel
def bracket(u, w):
    """Lie bracket [u, w] in se(3): the rate of a motion w that is fixed to what moves at u."""
    return Spatial(
        add(cross(u.angular, w.linear), cross(u.linear, w.angular)), cross(u.angular, w.angular)
    )


@kernel
def move(pose, twist, dt):
    """Pose after a constant body twist for the time dt: the exponential map of SE(3)."""
    v, w = scale(dt, twist.linear), scale(dt, twist.angular)
    way = rotate(rotation_matrix(pose.attitude), displacement(v, w))
    return Pose(add(pose.position, way), boxplus(pose.attitude, w))
