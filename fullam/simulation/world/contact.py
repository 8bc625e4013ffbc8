"""Contact of the tool's point with the world, as kernels; `surfaces` has the law."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fullam.dynamics.articulated import sweep_out
from fullam.dynamics.recursion import JointMotion
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Spatial
from fullam.model.vehicle import Vehicle
from fullam.numbers.kernel import Number, absolute, both, kernel, maximum, select, sqrt
from fullam.numbers.records import Rows
from fullam.numbers.vectors import (
    Matrix,
    Vector,
    add,
    axpy,
    cross,
    dot,
    rotate,
    rotate_back,
    scale,
    subtract,
)
from fullam.simulation.plants.servo_motion import tip_motion
from fullam.simulation.tool.held import held_tool
from fullam.simulation.world.surfaces import Box, Plane, Sphere, Surface


class Material(NamedTuple):
    """k, c, mu and s of a surface."""

    stiffness: Number
    dissipation: Number
    friction: Number
    slip: Number


class PlaneRow(NamedTuple):
    """Unit normal, its product with a point of the plane, and the material."""

    normal: Vector
    offset: Number
    material: Material


class SphereRow(NamedTuple):
    """Centre, radius, material."""

    center: Vector
    radius: Number
    material: Material


class BoxRow(NamedTuple):
    """Centre, attitude, half the edges, material."""

    center: Vector
    rotation: Matrix
    half: Vector
    material: Material


class World(NamedTuple):
    """What a contact is shown: the tool's point in the last link's axes, and the surfaces."""

    point: Any
    planes: Any
    spheres: Any
    boxes: Any


class TouchView(NamedTuple):
    """What `record_touch` is shown; `room` is `ArmRows` to work in."""

    state: Any
    links: Any
    arm: Any
    room: Any
    world: Any
    entries: Any


@kernel
def surface_force(material, depth, normal, v):
    """Force of a surface on a point that is `depth` inside it and moves at v; world axes.

    Nothing if the depth is negative.
    """
    inside = depth > 0.0
    deep = select(inside, depth, 0.0)
    out = dot(v, normal)
    push = maximum(0.0, 1.0 - material.dissipation * out)
    size = material.stiffness * deep * sqrt(deep) * push
    sliding = axpy(-out, normal, v)
    slow = sqrt(dot(sliding, sliding) + material.slip * material.slip)
    return axpy(-material.friction * size / slow, sliding, scale(size, normal))


@kernel
def ball(center, radius, p):
    """Depth of a point in a ball, and the normal there (any at its centre)."""
    away = subtract(p, center)
    distance = sqrt(dot(away, away))
    apart = distance > 1e-12
    return radius - distance, scale(1.0 / select(apart, distance, 1.0), away)


@kernel
def block(center, rotation, half, p):
    """Depth of a point in a box, and the normal of the side that is nearest."""
    y = rotate_back(rotation, subtract(p, center))
    x_left, y_left, z_left = (
        half[0] - absolute(y[0]),
        half[1] - absolute(y[1]),
        half[2] - absolute(y[2]),
    )
    by_x = both(x_left <= y_left, x_left <= z_left)
    by_y = y_left <= z_left
    depth = select(by_x, x_left, select(by_y, y_left, z_left))
    a = select(by_x, select(y[0] > 0.0, 1.0, -1.0), 0.0)
    b = select(by_x, 0.0, select(by_y, select(y[1] > 0.0, 1.0, -1.0), 0.0))
    c = select(by_x, 0.0, select(by_y, 0.0, select(y[2] > 0.0, 1.0, -1.0)))
    return depth, rotate(rotation, (a, b, c))


@kernel
def world_force(world, p, v):
    """Force of all surfaces on a point p that moves at v; world axes."""
    force = scale(0.0, p)  # zeros that have lanes where p has
    for i in range(len(world.planes)):
        plane = world.planes[i]
        depth = plane.offset - dot(plane.normal, p)
        force = add(force, surface_force(plane.material, depth, plane.normal, v))
    for i in range(len(world.spheres)):
        sphere = world.spheres[i]
        depth, normal = ball(sphere.center, sphere.radius, p)
        force = add(force, surface_force(sphere.material, depth, normal, v))
    for i in range(len(world.boxes)):
        box = world.boxes[i]
        depth, normal = block(box.center, box.rotation, box.half, p)
        force = add(force, surface_force(box.material, depth, normal, v))
    return force


@kernel
def touch(world, links, arm, pose, twist):
    """Push of the world on the last link about the origin of {A}, {A} axes, for `servo_motion`."""
    place, force = tool_force(world, arm, pose, twist)
    pushed = rotate_back(rotation_matrix(pose.attitude), force)
    return Spatial(pushed, cross(place, pushed))


@kernel
def tool_force(world, arm, pose, twist):
    """Where the tool's point is from the origin of {A}, {A} axes, and the force on it, world's."""
    R = rotation_matrix(pose.attitude)
    place, velocity = tip_motion(arm, world.point[0], twist.angular)
    p = add(pose.position, rotate(R, place))
    v = rotate(R, add(twist.linear, velocity))
    return place, world_force(world, p, v)


@kernel
def record_touch(view, k):
    """Write the force on the tool in period k, before the vehicle moves on."""
    state, room = view.state[0], view.room
    for i in range(len(view.arm)):
        motion = view.arm[i]
        room.motions[i] = JointMotion(motion.position, motion.rate, 0.0)
    sweep_out(view.links, state.twist.angular, room)
    _, force = tool_force(view.world, room, state.pose, state.twist)
    view.entries[k] = force


def world_rows(vehicle: Vehicle, surfaces: Sequence[Surface]) -> World:
    """A vehicle's tool and the surfaces of a world as rows.

    Raises:
        ScenarioError: The tool is not on the arm's last link.
    """
    point, frame = held_tool(vehicle, "touch the world")
    return World(
        Rows(Vector, (frame.T @ point)[None]),
        _rows(PlaneRow, [_plane(s) for s in surfaces if isinstance(s, Plane)]),
        _rows(SphereRow, [_sphere(s) for s in surfaces if isinstance(s, Sphere)]),
        _rows(BoxRow, [_box(s) for s in surfaces if isinstance(s, Box)]),
    )


def _rows(record: Any, rows: list[Any]) -> Rows:
    return Rows.of(record, rows) if rows else Rows.empty(record, 0)


def _material(s: Surface) -> Material:
    return Material(s.stiffness, s.dissipation, s.friction, s.slip)


def _plane(plane: Plane) -> PlaneRow:
    normal = plane.unit_normal
    return PlaneRow(tuple(normal.tolist()), float(normal @ plane.point), _material(plane))


def _sphere(sphere: Sphere) -> SphereRow:
    return SphereRow(sphere.center, sphere.radius, _material(sphere))


def _box(box: Box) -> BoxRow:
    half = tuple(0.5 * np.array(box.size))
    rotation: Any = tuple(box.rotation.ravel().tolist())
    return BoxRow(box.center, rotation, half, _material(box))
