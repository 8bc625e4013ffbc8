"""Writing a `VehicleDesign` as a URDF, through yourdfpy, with shapes that look like the thing."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from yourdfpy import urdf as yourdf

    from fullam.model.design import Rod, VehicleDesign

Array = NDArray[np.float64]

PLATFORM, TOOL = "platform", "tool"
DIGITS = 13
"""Significant digits written: below the rounding of sines and cosines, which libraries differ in,
and well above what anything computed from the URDF can notice."""
ZERO = 1e-15
"""Smaller numbers are written as 0: they are rounding, e.g. cos(90 deg)."""

BODY_RADIUS, BODY_HEIGHT, BOOM_RADIUS, DISC_HEIGHT = 0.11, 0.07, 0.009, 0.004
MOTOR_RADIUS, MOTOR_LENGTH = 0.016, 0.03
SERVO = (0.032, 0.050, 0.040)
"""Case of a Dynamixel AX-12A [m]."""
COLOURS = {
    "carbon": (0.16, 0.17, 0.19, 1.0),
    "shell": (0.85, 0.87, 0.90, 1.0),
    "motor": (0.45, 0.46, 0.50, 1.0),
    "disc_positive": (0.12, 0.47, 0.71, 0.45),
    "disc_negative": (0.90, 0.45, 0.10, 0.45),
    "link": (0.75, 0.76, 0.78, 1.0),
    "servo": (0.10, 0.10, 0.11, 1.0),
    "gripper": (0.20, 0.62, 0.35, 1.0),
}


def urdf_text(design: VehicleDesign, name: str) -> str:
    """The URDF of a design.

    The root is the platform's link, whose frame is {A}; there is no floating joint. Each rotor is
    a link without mass whose z is its thrust axis; the arm's joints turn about their z.

    Args:
        design: The parameters.
        name: Name of the robot.
    """
    from yourdfpy import URDF, Robot
    from yourdfpy import urdf as yourdf

    robot = Robot(name=name)
    robot.materials = [
        yourdf.Material(key, yourdf.Color(np.array(rgba))) for key, rgba in COLOURS.items()
    ]
    _add_platform(robot, design)
    _add_rotors(robot, design)
    _add_arm(robot, design)
    raw = URDF(robot=robot, build_scene_graph=False, load_meshes=False).write_xml_string()
    return _tidy(raw)


def _tidy(raw: bytes) -> str:
    root = ElementTree.fromstring(raw)
    for element in root.iter():
        for key, value in element.attrib.items():
            if key not in ("name", "link", "type"):
                element.set(key, " ".join(_format(float(token)) for token in value.split()))
    ElementTree.indent(root)
    note = "<!-- Written by fullam.model.design from the [design] table of the TOML. -->"
    body = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="utf-8"?>\n{note}\n{body}\n'


def _format(value: float) -> str:
    return "0" if abs(value) < ZERO else f"{value:.{DIGITS}g}"


def _pose(position: ArrayLike, rotation: Array | None = None) -> Array:
    pose = np.eye(4)
    pose[:3, 3] = position
    if rotation is not None:
        pose[:3, :3] = rotation
    return pose


def _towards(direction: Array) -> Array:
    """A rotation whose z points along `direction`."""
    z = direction / np.linalg.norm(direction)
    helper = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = helper - z * (helper @ z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _add_shape(
    link: yourdf.Link, geometry: yourdf.Geometry, pose: Array, colour: str, collide: bool = False
) -> None:
    from yourdfpy import urdf as yourdf

    link.visuals.append(
        yourdf.Visual(origin=pose, geometry=geometry, material=yourdf.Material(name=colour))
    )
    if collide:
        number = len(link.collisions) + 1
        link.collisions.append(
            yourdf.Collision(name=f"{link.name}_{number}", origin=pose, geometry=geometry)
        )


def _cylinder(radius: float, length: float) -> yourdf.Geometry:
    from yourdfpy import urdf as yourdf

    return yourdf.Geometry(cylinder=yourdf.Cylinder(radius, length))


def _box(size: ArrayLike) -> yourdf.Geometry:
    from yourdfpy import urdf as yourdf

    return yourdf.Geometry(box=yourdf.Box(np.asarray(size, dtype=float)))


def _add_platform(robot: yourdf.Robot, design: VehicleDesign) -> None:
    from yourdfpy import urdf as yourdf

    inertia = np.diag(design.platform_inertia)
    link = yourdf.Link(PLATFORM, yourdf.Inertial(np.eye(4), design.platform_mass, inertia))
    _add_shape(link, _cylinder(BODY_RADIUS, BODY_HEIGHT), np.eye(4), "shell", collide=True)
    for index in range(design.rotor_count):
        hub = design.rotor_placement(index)[:3, 3]
        boom = _cylinder(BOOM_RADIUS, float(np.linalg.norm(hub)))
        _add_shape(link, boom, _pose(0.5 * hub, _towards(hub)), "carbon", collide=True)
    post = np.asarray(design.mount_position)
    if np.linalg.norm(post) > 0.0:
        shape = _cylinder(BOOM_RADIUS, float(np.linalg.norm(post)))
        _add_shape(link, shape, _pose(0.5 * post, _towards(post)), "carbon")
    robot.links.append(link)


def _add_rotors(robot: yourdf.Robot, design: VehicleDesign) -> None:
    from yourdfpy import urdf as yourdf

    for index, name in enumerate(design.rotor_names()):
        link = yourdf.Link(name)
        colour = "disc_positive" if design.spins()[index] > 0 else "disc_negative"
        disc = _cylinder(design.propeller_radius, DISC_HEIGHT)
        _add_shape(link, disc, np.eye(4), colour, collide=True)
        motor = _cylinder(MOTOR_RADIUS, MOTOR_LENGTH)
        _add_shape(link, motor, _pose([0.0, 0.0, -0.5 * MOTOR_LENGTH]), "motor")
        robot.links.append(link)
        robot.joints.append(
            yourdf.Joint(
                name=f"{name}_joint",
                type="fixed",
                parent=PLATFORM,
                child=name,
                origin=design.rotor_placement(index),
            )
        )


def _add_arm(robot: yourdf.Robot, design: VehicleDesign) -> None:
    from yourdfpy import urdf as yourdf

    rods, joints = design.rods(), design.joint_names
    limit = yourdf.Limit(
        effort=design.joint_effort,
        velocity=design.joint_speed_rpm * 2.0 * np.pi / 60.0,
        lower=-np.deg2rad(design.joint_range_deg),
        upper=np.deg2rad(design.joint_range_deg),
    )
    parent = PLATFORM
    for row, joint in enumerate(joints):
        child = f"link_{row + 1}"
        link = _arm_link(child, rods[row], "link")
        _add_shape(link, _box(SERVO), np.eye(4), "servo")
        robot.links.append(link)
        robot.joints.append(
            yourdf.Joint(
                name=joint,
                type="revolute",
                parent=parent,
                child=child,
                origin=design.joint_origin(row),
                axis=np.array([0.0, 0.0, 1.0]),
                limit=limit,
            )
        )
        parent = child
    robot.links.append(_gripper(rods[-1]))
    robot.joints.append(
        yourdf.Joint(
            name=f"{TOOL}_joint",
            type="fixed",
            parent=parent,
            child=TOOL,
            origin=design.joint_origin(len(joints)),
        )
    )


def _arm_link(name: str, rod: Rod, colour: str, share: float = 1.0) -> yourdf.Link:
    """A link with the rod's mass, drawn as the first `share` of the rod."""
    from yourdfpy import urdf as yourdf

    link = yourdf.Link(name, yourdf.Inertial(_pose(rod.com), rod.mass, rod.inertia))
    middle = rod.start + 0.5 * share * (rod.end - rod.start)
    pose = _pose(middle, _towards(rod.end - rod.start))
    _add_shape(link, _cylinder(rod.radius, share * rod.length), pose, colour, collide=True)
    return link


def _gripper(rod: Rod) -> yourdf.Link:
    """The tool: a palm on the first third of the rod, two fingers on the rest."""
    link = _arm_link(TOOL, rod, "gripper", share=1.0 / 3.0)
    axes = _towards(rod.end - rod.start)
    length = 2.0 / 3.0 * rod.length
    centre = rod.end - 0.5 * length * axes[:, 2]
    palm = _box([5.0 * rod.radius, 2.0 * rod.radius, 0.008])
    _add_shape(link, palm, _pose(rod.end - length * axes[:, 2], axes), "gripper")
    finger = _box([0.5 * rod.radius, 1.5 * rod.radius, length])
    for side in (-1.0, 1.0):
        place = centre + side * 2.25 * rod.radius * axes[:, 0]
        _add_shape(link, finger, _pose(place, axes), "gripper", collide=True)
    return link
