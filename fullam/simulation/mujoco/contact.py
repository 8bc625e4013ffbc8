"""What the tool touches in MuJoCo: shapes, pairs, and the material of a scenario's surfaces.

Pairs of shapes touch each other explicitly: the tool's with the scenario's surfaces, and with every
shape of the scene that collides at all. Nothing else of the vehicle touches anything.

A scenario's surface (`world.surfaces`) is a spring of Hertz's law, damped as Hunt and Crossley have
it; MuJoCo's contact is a constraint that gives way, f = (a_ref - a_0) / (A + R), where A tells how
the contact's point yields to force, A^ its estimate, R = (1 - d) / d A^ and a_ref = -b v - k r for
a depth r. With an impedance d as small as `IMPEDANCE`, R is so much larger than A that f = a_ref /
R whatever moves: a spring k / R and a damper b / R, which have the surface's secant stiffness and
its damping under the load `LOAD`. In the same way friction is a damper mu LOAD / s along the
surface, until it slips. Friction's own R is smaller by `IMPRATIO`, so that what is cut off at the
cone takes next to nothing to the normal: with equal ones the convex cone lifts what slides off the
surface.

A scene's own shapes keep their own material, stiff by default; there a reference for friction that
is ten times slower than the normal one's keeps the tool on the surface (`SLIDING`).

The ball has a radius, the point of the other plants has none: a scenario's surfaces stand back by
it, a scene's own shapes do not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.exceptions import ScenarioError
from fullam.model.vehicle import Vehicle
from fullam.simulation.mujoco.spec import PREFIX, TOOL, load_mujoco, scene_spec
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.world.surfaces import Box, Plane, Sphere, Surface
from fullam.simulation.world.world_file import WorldFile

if TYPE_CHECKING:
    import mujoco

Array = NDArray[np.float64]

IMPEDANCE, IMPRATIO = 1e-4, 100.0
"""d, the least that MuJoCo takes; and the normal's R in those of friction."""

LOAD = 5.0
"""At which a spring of Hertz's is taken for a linear one [N]."""

SLIDING = (0.2, 1.0)
"""Time constant [s] and damping ratio of friction against a scene's own shapes."""

TIP = f"{PREFIX}tip"
"""Name of the ball at the tool."""

MOUNTED = f"{PREFIX}mounted/"
"""Before every name of what a scene mounts on the tool."""


class SurfacePair(NamedTuple):
    """Name of a pair, and the surface that takes part in it."""

    name: str
    surface: Surface


def add_world(
    spec: mujoco.MjSpec, vehicle: Vehicle, scenario: Scenario, radius: float
) -> list[SurfacePair]:
    """Add surfaces, the tool's shapes and what may touch what; scene and vehicle are in the spec.

    Returns:
        The pairs whose material `set_materials` writes.

    Raises:
        ScenarioError: A box is too small for the ball to touch it.
    """
    surfaces, world_file = scenario.world, scenario.world_file
    if spec.body(TOOL) is not None:
        spec.delete(spec.body(TOOL))
    others = [
        geom
        for geom in spec.geoms
        if (geom.contype or geom.conaffinity) and not geom.name.startswith(PREFIX)
    ]
    for i, geom in enumerate(others):
        geom.name = geom.name or f"{PREFIX}scene {i}"
    tools = _mount_tool(spec, vehicle, world_file, radius)
    found = []
    for i, surface in enumerate(surfaces):
        name = f"{PREFIX}surface {i}"
        _add_surface(spec, name, surface, radius if tools == [TIP] else 0.0)
        for tool in tools:
            pair = SurfacePair(f"{name} {tool}", surface)
            _add_pair(spec, pair.name, tool, name)
            found.append(pair)
    for geom in others:
        for tool in tools:
            pair = _add_pair(spec, f"{tool} {geom.name}", tool, geom.name)
            pair.solref, pair.solimp = geom.solref, geom.solimp
            pair.margin, pair.gap = geom.margin, geom.gap
            pair.condim = geom.condim
            slide, turn, roll = geom.friction
            pair.friction = [slide, slide, turn, roll, roll]
            pair.solreffriction = SLIDING
    return found


def _mount_tool(
    spec: mujoco.MjSpec, vehicle: Vehicle, world_file: WorldFile | None, radius: float
) -> list[str]:
    """Put on the tool what touches: a massless ball, or the scene's body; names of the shapes."""
    mujoco = load_mujoco()
    link, frame = _tool_link(spec, vehicle)
    turned = pin.Quaternion(frame.rotation)
    place = link.add_frame(pos=frame.translation, quat=[turned.w, turned.x, turned.y, turned.z])
    scene = scene_spec(world_file)
    mounted = scene.body(TOOL)
    if mounted is None:
        ball = link.add_geom(name=TIP, type=mujoco.mjtGeom.mjGEOM_SPHERE, mass=0.0)
        ball.size, ball.pos = [radius, 0.0, 0.0], frame.translation
        ball.contype = ball.conaffinity = 0
        return [TIP]
    mounted.pos, mounted.quat = np.zeros(3), [1.0, 0.0, 0.0, 0.0]
    names = []
    for i, shape in enumerate(mounted.geoms):
        shape.name = shape.name or f"shape {i}"
        shape.contype = shape.conaffinity = 0
        names.append(MOUNTED + shape.name)
    place.attach_body(mounted, MOUNTED, "")
    return names


def _tool_link(spec: mujoco.MjSpec, vehicle: Vehicle) -> tuple[Any, pin.SE3]:
    """The body that the tool moves with, and the tool's frame in it."""
    frame = vehicle.model.frames[vehicle.model.getFrameId(vehicle.tool)]
    joint = vehicle.model.names[frame.parentJoint]
    if joint in vehicle.arm_joints:
        return spec.joint(PREFIX + joint).parent, frame.placement
    return spec.body(PREFIX + vehicle.platform), frame.placement


def _add_surface(spec: mujoco.MjSpec, name: str, surface: Surface, radius: float) -> None:
    """A surface as a shape that stands back by a radius."""
    mujoco = load_mujoco()
    kind = mujoco.mjtGeom
    geom = spec.worldbody.add_geom(name=name)
    if isinstance(surface, Plane):
        normal = surface.unit_normal
        z = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal)
        geom.type, geom.size = kind.mjGEOM_PLANE, [0.0, 0.0, 1.0]
        geom.pos, geom.quat = np.array(surface.point) - radius * normal, [z.w, z.x, z.y, z.z]
    elif isinstance(surface, Sphere):
        geom.type, geom.pos = kind.mjGEOM_SPHERE, surface.center
        geom.size = [_less(surface.radius, radius, "radius", "sphere"), 0.0, 0.0]
    elif isinstance(surface, Box):
        geom.type, geom.pos = kind.mjGEOM_BOX, surface.center
        geom.size = [_less(0.5 * edge, radius, "size", "box") for edge in surface.size]
        turned = pin.Quaternion(surface.rotation)
        geom.quat = [turned.w, turned.x, turned.y, turned.z]


def _less(half: float, radius: float, field: str, kind: str) -> float:
    if not half > radius:
        raise ScenarioError(
            f"world, {kind}",
            field,
            f"leaves nothing behind the tool's ball of {radius:g} m",
            "make it larger, or tool_radius of plant 'mujoco' smaller",
        )
    return half - radius


def _add_pair(spec: mujoco.MjSpec, name: str, tool: str, other: str) -> Any:
    return spec.add_pair(name=name, geomname1=other, geomname2=tool, condim=3)


def set_materials(model: Any, pairs: Sequence[SurfacePair]) -> None:
    """Write the materials of surfaces into a compiled model, which knows A^."""
    if pairs:
        model.opt.impratio = IMPRATIO
    for name, s in pairs:
        row = model.pair(name).id
        tool = model.geom_bodyid[model.pair_geom2[row]]
        yielding = (1.0 - IMPEDANCE) * model.body_invweight0[tool, 0]
        stiffness = LOAD / (LOAD / s.stiffness) ** (2.0 / 3.0)
        model.pair_solref[row] = -yielding * stiffness, -yielding * s.dissipation * LOAD
        rubbing = yielding * s.friction * LOAD / (s.slip * IMPRATIO)
        model.pair_solreffriction[row] = -1e-9, -max(rubbing, 1e-9)
        model.pair_solimp[row] = IMPEDANCE, IMPEDANCE, 1.0, 0.5, 1.0
        model.pair_friction[row] = s.friction, s.friction, 0.0, 0.0, 0.0
        model.pair_dim[row] = 3 if s.friction > 0.0 else 1


def tool_force(model: Any, data: Any) -> Array:
    """Force of all that touches the tool on it, world axes, shape (3,) [N]."""
    mujoco = load_mujoco()
    total, six = np.zeros(3), np.zeros(6)
    for i in range(data.ncon):
        contact = data.contact[i]
        ways = [_is_tool(model, g) for g in (contact.geom1, contact.geom2)]
        if ways[0] == ways[1] or contact.efc_address < 0:
            continue
        mujoco.mj_contactForce(model, data, i, six)
        force = np.asarray(contact.frame).reshape(3, 3).T @ six[:3]
        total += force if ways[1] else -force
    return total


def _is_tool(model: Any, geom: int) -> bool:
    name = model.geom(geom).name
    return bool(name == TIP or name.startswith(MOUNTED))
