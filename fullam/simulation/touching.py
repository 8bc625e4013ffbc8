"""Contact of the tool with planes, spheres and boxes: a force at a point, as a kernel.

The tool is a ball about a point of the last link (radius 0: the point). Where it is a depth delta
inside a body, the body pushes it out along its normal n and rubs against its sliding v_t,

    N = k delta^(3/2) max(0, 1 + c ddelta),    F = N (n - mu v_t / sqrt(|v_t|^2 + v_s^2)),

Hunt and Crossley's normal force, which takes energy from every bounce and pulls at nothing, and
Coulomb's friction, regularised: below some v_s it creeps instead of sticking.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Spatial
from fullam.numbers.kernel import Number, absolute, kernel, maximum, select, sqrt
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
from fullam.simulation.servo_motion import tip_motion


class Surface(NamedTuple):
    """k [N/m^1.5], c [s/m], mu, and the sliding v_s [m/s] at which friction is 71 % of mu N."""

    stiffness: Number
    dissipation: Number
    friction: Number
    creep: Number


class Plane(NamedTuple):
    """A half space below a point of its surface, its normal pointing out; world axes."""

    point: Vector
    normal: Vector
    surface: Surface


class Sphere(NamedTuple):
    """A ball; world axes."""

    center: Vector
    radius: Number
    surface: Surface


class Box(NamedTuple):
    """A box of half lengths about its centre, turned by R_WB."""

    center: Vector
    rotation: Matrix
    half: Vector
    surface: Surface


class Tool(NamedTuple):
    """A point in the axes of the last link's row, from its joint, and the ball about it."""

    point: Vector
    radius: Number


class World(NamedTuple):
    """What may be touched: a view of rows, and one row of `Tool`."""

    tool: Any
    planes: Any
    spheres: Any
    boxes: Any


@kernel
def contact_force(surface, depth, normal, velocity):
    """Force on the tool, world axes; none where the depth is not above 0."""
    touches = depth > 0.0
    d = select(touches, depth, 0.0)
    out = dot(velocity, normal)
    pressure = surface.stiffness * d * sqrt(d) * maximum(0.0, 1.0 - surface.dissipation * out)
    sliding = axpy(-out, normal, velocity)
    slowness = dot(sliding, sliding) + surface.creep * surface.creep
    return axpy(-surface.friction * pressure / sqrt(slowness), sliding, scale(pressure, normal))


@kernel
def sphere_depth(sphere, p, radius):
    """Depth of a ball at p in a sphere, and the normal there."""
    way = subtract(p, sphere.center)
    squared = dot(way, way)
    apart = squared > 0.0
    distance = sqrt(select(apart, squared, 1.0))
    depth = sphere.radius + radius - select(apart, distance, 0.0)
    return depth, scale(1.0 / distance, way)


@kernel
def box_depth(box, p, radius):
    """Depth of a ball at p in a box, and the normal there: of the nearest face, if p is inside."""
    local = rotate_back(box.rotation, subtract(p, box.center))
    signs = (
        select(local[0] < 0.0, -1.0, 1.0),
        select(local[1] < 0.0, -1.0, 1.0),
        select(local[2] < 0.0, -1.0, 1.0),
    )
    x = absolute(local[0]) - box.half[0]
    y = absolute(local[1]) - box.half[1]
    z = absolute(local[2]) - box.half[2]
    ox, oy, oz = maximum(x, 0.0), maximum(y, 0.0), maximum(z, 0.0)
    squared = ox * ox + oy * oy + oz * oz
    outside = squared > 0.0
    distance = sqrt(select(outside, squared, 1.0))
    nearest = maximum(x, maximum(y, z))
    on_x = select(x >= nearest, 1.0, 0.0)
    on_y = select(y >= nearest, 1.0 - on_x, 0.0)
    on_z = 1.0 - on_x - on_y
    normal = (
        signs[0] * select(outside, ox / distance, on_x),
        signs[1] * select(outside, oy / distance, on_y),
        signs[2] * select(outside, oz / distance, on_z),
    )
    depth = radius - select(outside, distance, nearest)
    return depth, rotate(box.rotation, normal)


@kernel
def world_force(world, p, velocity):
    """Force of the world on the tool at p, world axes."""
    radius = world.tool[0].radius
    force = scale(0.0, p)  # zeros that have lanes where p has
    for i in range(len(world.planes)):
        plane = world.planes[i]
        depth = radius - dot(subtract(p, plane.point), plane.normal)
        force = add(force, contact_force(plane.surface, depth, plane.normal, velocity))
    for i in range(len(world.spheres)):
        sphere = world.spheres[i]
        depth, normal = sphere_depth(sphere, p, radius)
        force = add(force, contact_force(sphere.surface, depth, normal, velocity))
    for i in range(len(world.boxes)):
        box = world.boxes[i]
        depth, normal = box_depth(box, p, radius)
        force = add(force, contact_force(box.surface, depth, normal, velocity))
    return force


@kernel
def tool_contact(world, links, arm, pose, twist):
    """The contact of the tool with a `World`; see `servo_motion`."""
    R = rotation_matrix(pose.attitude)
    place, moved = tip_motion(arm, world.tool[0].point, twist.angular)
    p = add(pose.position, rotate(R, place))
    force = rotate_back(R, world_force(world, p, rotate(R, add(twist.linear, moved))))
    return Spatial(force, cross(place, force))
