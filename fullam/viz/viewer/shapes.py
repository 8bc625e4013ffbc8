"""What a vehicle looks like: shapes as plain data, from its URDF or, without meshes, its model.

A shape is a dictionary that the page turns into a three.js object: `path` in the scene tree,
`type` with its sizes, `colour`, `opacity`, and `pose` = [p, quaternion xyzw] in the parent node.
"""

from __future__ import annotations

import base64
import warnings
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from fullam.model.meshes import missing_remark, resolve_meshes
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]
Shape = dict[str, Any]

ROOT = 1
"""Pinocchio's index of the platform's joint; the arm's joints follow."""

SHELL, CARBON, STEEL, ARM = "#dfe4ea", "#2b2f36", "#70757d", "#b9bec6"
SPIN_COLOURS = {1.0: "#0072B2", -1.0: "#E69F00"}
"""Colour of a rotor by the sign of its drag torque."""


def body_path(prefix: str, joint: int) -> str:
    """Scene path of the body behind a joint of the Pinocchio model."""
    return f"{prefix}/platform" if joint == ROOT else f"{prefix}/link_{joint - ROOT}"


def pose_of(placement: pin.SE3) -> list[float]:
    """[p, quaternion xyzw] of a placement, as plain numbers."""
    return [float(x) for x in pin.SE3ToXYZQUAT(placement)]


def towards(axis: ArrayLike, position: ArrayLike = (0.0, 0.0, 0.0)) -> pin.SE3:
    """A placement at `position` whose z points along `axis`."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.asarray(axis, dtype=float))
    return pin.SE3(turn.toRotationMatrix(), np.array(position, dtype=float))


def propeller_radius(vehicle: Vehicle) -> float:
    """Radius of the rotor discs [m]: the design's, else what fits between neighbouring hubs."""
    design = vehicle.definition.get("design", {})
    if "propeller_radius" in design:
        return float(design["propeller_radius"])
    hubs = vehicle.rotors.positions
    gaps = np.linalg.norm(hubs[:, None] - hubs[None, :], axis=2) + 1e9 * np.eye(len(hubs))
    return float(min(0.42 * gaps.min(), 0.2)) if len(hubs) > 1 else 0.12


def reach(vehicle: Vehicle) -> float:
    """Radius of the platform with its rotor discs [m]; sizes of arrows and views follow it."""
    return float(np.linalg.norm(vehicle.rotors.positions, axis=1).max()) + propeller_radius(vehicle)


def vehicle_shapes(vehicle: Vehicle, prefix: str) -> list[Shape]:
    """Everything of a vehicle that is drawn once: bodies and propellers.

    A vehicle whose meshes are not all there is drawn from its joints and rotors, with a warning
    that names what is missing.
    """
    urdf, missing = resolve_meshes(vehicle)
    bodies = None if missing else _urdf_shapes(vehicle, urdf, prefix)
    if missing:
        warnings.warn(f"{vehicle.name}: {missing_remark(vehicle)}", stacklevel=2)
    if bodies is None:
        bodies = platform_shapes(vehicle, f"{prefix}/platform") + _arm_shapes(vehicle, prefix)
    return bodies + propeller_shapes(vehicle, prefix)


def _urdf_shapes(vehicle: Vehicle, urdf: str, prefix: str) -> list[Shape] | None:
    """The visual shapes of the URDF, but for the rotor discs, which `propeller_shapes` draws.

    None, with a warning, where Pinocchio cannot read a mesh.
    """
    try:
        visuals = pin.buildGeomFromUrdfString(vehicle.model, urdf, pin.GeometryType.VISUAL)
    except ValueError as error:
        warnings.warn(f"{vehicle.name}: drawn from its joints ({error})", stacklevel=3)
        return None
    shapes = []
    for item in visuals.geometryObjects:
        red, green, blue, alpha = (float(x) for x in item.meshColor)
        on_rotor = vehicle.model.frames[item.parentFrame].name in vehicle.rotors.names
        if on_rotor and alpha < 1.0:
            continue
        shape = _geometry(item)
        shape["path"] = f"{body_path(prefix, item.parentJoint)}/{item.name}"
        shape["pose"] = pose_of(item.placement)
        shape["colour"] = f"#{round(255 * red):02x}{round(255 * green):02x}{round(255 * blue):02x}"
        shape["opacity"] = alpha
        shapes.append(shape)
    return shapes


def _geometry(item: pin.GeometryObject) -> Shape:
    geometry = item.geometry
    kind = type(geometry).__name__
    if kind == "Cylinder":
        return {
            "type": "cylinder",
            "radius": geometry.radius,
            "length": 2.0 * geometry.halfLength,
        }
    if kind == "Box":
        return {"type": "box", "size": [float(2.0 * half) for half in geometry.halfSide]}
    if kind == "Sphere":
        return {"type": "sphere", "radius": geometry.radius}
    corners = [geometry.tri_indices(i) for i in range(geometry.num_tris)]
    faces = np.array([[corner[0], corner[1], corner[2]] for corner in corners])
    return mesh(np.array(geometry.vertices()), faces)


def mesh(vertices: Array, faces: NDArray[np.integer[Any]]) -> Shape:
    """A triangle mesh; vertices (n, 3) [m], faces (m, 3), both as base64 of 32-bit numbers."""
    return {
        "type": "mesh",
        "vertices": encode(vertices.astype("<f4")),
        "faces": encode(faces.astype("<u4")),
    }


def encode(numbers: NDArray[Any]) -> str:
    """Base64 of an array's bytes."""
    return base64.b64encode(np.ascontiguousarray(numbers).tobytes()).decode("ascii")


def platform_shapes(vehicle: Vehicle, path: str, **look: Any) -> list[Shape]:
    """A platform from the rotor table alone: a hub, booms, and rings where the rotors are.

    Args:
        vehicle: The vehicle.
        path: Scene path of the platform.
        look: Overrides of every shape, e.g. `colour` and `opacity` of a ghost.
    """
    size, rotors, radius = reach(vehicle), vehicle.rotors, propeller_radius(vehicle)
    hub = {"type": "cylinder", "radius": 0.22 * size, "length": 0.14 * size, "colour": SHELL}
    shapes: list[Shape] = [{"path": f"{path}/hub", **hub, **look}]
    for name, position, axis in zip(rotors.names, rotors.positions, rotors.axes, strict=True):
        shapes.append(rod(f"{path}/boom_{name}", np.zeros(3), position, 0.018 * size) | look)
        ring = {"type": "torus", "radius": radius, "tube": 0.008 * size, "colour": STEEL}
        shapes.append(
            {
                "path": f"{path}/ring_{name}",
                "pose": pose_of(towards(axis, position)),
                **ring,
                **look,
            }
        )
    return shapes


def _arm_shapes(vehicle: Vehicle, prefix: str) -> list[Shape]:
    """The arm as rods from joint to joint, with a ball at each joint."""
    model, radius = vehicle.model, 0.03 * reach(vehicle)
    tool = model.frames[model.getFrameId(vehicle.tool)]
    joints = range(ROOT + 1, model.njoints)
    rods = [(a, "rod", model.jointPlacements[b].translation) for a, b in pairwise([ROOT, *joints])]
    rods.append((tool.parentJoint, "tool", tool.placement.translation))
    ball = {"type": "sphere", "radius": 1.4 * radius, "colour": CARBON}
    shapes: list[Shape] = [
        {"path": f"{body_path(prefix, joint)}/ball", **ball} for joint in [ROOT, *joints]
    ]
    for joint, name, end in rods:
        if np.linalg.norm(end) > 1e-6:
            path = f"{body_path(prefix, joint)}/{name}"
            shapes.append(rod(path, np.zeros(3), end, radius) | {"colour": ARM})
    return shapes


def rod(path: str, start: Array, end: Array, radius: float) -> Shape:
    """A rod from one point to another, or a ball where they are the same."""
    length = float(np.linalg.norm(end - start))
    if length < 1e-9:
        return {"path": path, "type": "sphere", "radius": radius, "colour": CARBON}
    place = towards(end - start, 0.5 * (start + end))
    rod = {"type": "cylinder", "radius": radius, "length": length, "colour": CARBON}
    return {"path": path, "pose": pose_of(place), **rod}


def propeller_shapes(vehicle: Vehicle, prefix: str) -> list[Shape]:
    """A disc per rotor, with two blades in a node "spin" that turns about the thrust axis."""
    rotors, radius = vehicle.rotors, propeller_radius(vehicle)
    shapes: list[Shape] = []
    for i, name in enumerate(rotors.names):
        path = f"{prefix}/platform/propeller_{name}"
        pose = pose_of(towards(rotors.axes[i], rotors.positions[i] + 0.004 * rotors.axes[i]))
        colour = SPIN_COLOURS[float(rotors.spins[i])]
        disc = {"type": "cylinder", "radius": radius, "length": 0.002, "opacity": 0.22}
        rim = {"type": "torus", "radius": radius, "tube": 0.0022, "opacity": 0.75}
        shapes.append({"path": path, "pose": pose, "colour": colour, **disc})
        shapes.append({"path": f"{path}/rim", "colour": colour, **rim})
        for side in (-1.0, 1.0):
            pitch = pin.SE3(pin.utils.rotate("x", 0.25 * side), np.array([side * radius / 2, 0, 0]))
            blade = {"type": "box", "size": [radius, 0.16 * radius, 0.003], "colour": CARBON}
            ends = "left" if side < 0 else "right"
            shapes.append({"path": f"{path}/spin/{ends}", "pose": pose_of(pitch), **blade})
    return shapes
