"""One URDF from two: a platform's, and an arm's that is mounted on one of its links."""

from __future__ import annotations

import posixpath
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any

import numpy as np

from fullam.exceptions import VehicleError
from fullam.model import definition as read
from fullam.model.definition_keys import MOUNT, names_of
from fullam.model.physics import parse_urdf

NAMED = ("link", "joint")
"""Elements whose names must differ."""


def compose(platform: str, arm: str, table: Mapping[str, Any], root: str, where: str) -> str:
    """Mount an arm on a platform by a fixed joint, "mount".

    Args:
        platform: URDF text of the platform.
        arm: URDF text of the arm.
        table: The `arm` table of a definition: `mount` holds the platform's `link`, and `position`
            [m] and `rpy_deg` (URDF's roll, pitch, yaw about fixed axes) of the arm's root on it;
            `prefix` goes before every name of the arm.
        root: Link that carries the arm unless the mount names another.
        where: What an error message names as its source.

    Returns:
        URDF text.

    Raises:
        VehicleError: There is no such link, the arm has not one root, or both use a name.
    """
    whole = parse_urdf(platform, f"{where} (the platform's URDF)")
    added = parse_urdf(arm, f"{where} (the arm's URDF)")
    mount = read.subtable(table, "mount", where)
    read.check_keys(mount, names_of(MOUNT), where, "arm.mount")
    prefix = read.text(table, "prefix", where, "")
    _prefix_names(added, prefix)
    _rename_materials(added, {m.get("name") for m in whole.findall("material")})
    for kind in NAMED:
        taken = {element.get("name") for element in whole.findall(kind)}
        for element in added.findall(kind):
            if element.get("name") in taken:
                raise VehicleError(
                    where,
                    "arm.urdf",
                    f"has a {kind} '{element.get('name')}', as the platform has",
                    "give `prefix`, which goes before every name of the arm",
                )
    carrier = read.text(mount, "link", where, root)
    links = [link.get("name", "") for link in whole.findall("link")]
    if carrier not in links:
        raise VehicleError(
            where, "arm.mount.link", f"'{carrier}' is no link of the platform", f"it has {links}"
        )
    whole.append(_mount_joint(mount, carrier, _root(added, where), f"{prefix}mount", where))
    whole.extend(child for child in added if child.tag in ("link", "joint", "material"))
    return ET.tostring(whole, encoding="unicode")


def move_meshes(text: str, folder: str) -> str:
    """The URDF with its relative mesh paths seen from another folder.

    Args:
        text: URDF text.
        folder: Path from that folder to the URDF's own, with forward slashes.
    """
    robot = ET.fromstring(text)
    for mesh in robot.iter("mesh"):
        name = mesh.get("filename", "")
        if name and "://" not in name and not posixpath.isabs(name):
            mesh.set("filename", posixpath.normpath(posixpath.join(folder, name)))
    return ET.tostring(robot, encoding="unicode")


def _root(robot: ET.Element, where: str) -> str:
    children = {child.get("link") for child in robot.iterfind("joint/child")}
    roots = [n for link in robot.findall("link") if (n := link.get("name", "")) not in children]
    if len(roots) != 1:
        raise VehicleError(where, "arm.urdf", f"has the root links {roots}", "it needs one")
    return roots[0]


def _mount_joint(
    mount: Mapping[str, Any], carrier: str, root: str, name: str, where: str
) -> ET.Element:
    position = read.vector(mount.get("position", [0, 0, 0]), where, "arm.mount.position")
    rpy = np.deg2rad(read.vector(mount.get("rpy_deg", [0, 0, 0]), where, "arm.mount.rpy_deg"))
    joint = ET.Element("joint", name=name, type="fixed")
    ET.SubElement(joint, "parent", link=carrier)
    ET.SubElement(joint, "child", link=root)
    xyz, angles = (" ".join(repr(float(x)) for x in vector) for vector in (position, rpy))
    ET.SubElement(joint, "origin", xyz=xyz, rpy=angles)
    return joint


def _prefix_names(robot: ET.Element, prefix: str) -> None:
    """Put a prefix before the names of links and joints, where they stand and are referred to."""
    for element in [*robot.findall("link"), *robot.findall("joint")]:
        element.set("name", prefix + element.get("name", ""))
    for joint in robot.findall("joint"):
        for tag in ("parent", "child"):
            for end in joint.findall(tag):
                end.set("link", prefix + end.get("link", ""))
        for mimic in joint.findall("mimic"):
            mimic.set("joint", prefix + mimic.get("joint", ""))


def _rename_materials(robot: ET.Element, taken: set[str | None]) -> None:
    """Give the arm's colours names that the platform's do not have."""
    for material in robot.iter("material"):
        name = material.get("name")
        while name in taken:
            name = f"arm_{name}"
        if name is not None:
            material.set("name", name)
