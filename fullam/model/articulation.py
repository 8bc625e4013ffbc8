"""Which joints of a URDF move: those of the arm; all others are held where they are.

A real URDF has more joints than a flying arm: propellers on continuous joints, grippers, folding
legs. A joint that is not named in `arm` and does not lie between platform, arm and tool is held,
by making it a fixed joint in the URDF itself, so that everybody who reads it sees the same robot.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin

from fullam.exceptions import VehicleError
from fullam.model import definition as read

MOVING = ("revolute", "continuous", "prismatic")
"""Types of joint with one coordinate."""

SHOWN = 8
"""How many held joints a remark names."""


@dataclass(frozen=True)
class Articulation:
    """A URDF whose only moving joints are the arm's.

    Attributes:
        urdf: The text; the given one itself when nothing had to be held.
        held: The joints that were held, with their positions [rad or m].
    """

    urdf: str
    held: dict[str, float]

    @property
    def remark(self) -> str:
        """Which joints are held, in a sentence."""
        held = [f"'{name}' at {position:g}" for name, position in self.held.items()]
        if len(held) > SHOWN:
            held = [*held[:SHOWN], f"and {len(held) - SHOWN} more"]
        return f"joints that are not the arm's are held: {', '.join(held)}"


def articulate(
    text: str, arm: tuple[str, ...], tool: str, held: Mapping[str, Any], where: str
) -> Articulation:
    """Hold every joint that is not of the arm.

    Args:
        text: URDF text.
        arm: Names of the arm's joints, base to tip.
        tool: Link that carries the tool.
        held: Positions of joints to hold [rad or m]; others are held at 0, or at the limit
            nearest to it.
        where: What an error message names as its source.

    Raises:
        VehicleError: The arm branches, names what does not move or leaves out a joint that moves
            it or the tool; or a held joint is unknown or outside its limits.
    """
    robot = ET.fromstring(text)
    joints = {joint.get("name", ""): joint for joint in robot.findall("joint")}
    _check_names(arm, held, joints, where)
    _check_chain(arm, tool, held, joints, where)
    positions: dict[str, float] = {}
    for name, joint in joints.items():
        if name in arm or joint.get("type") == "fixed":
            continue
        positions[name] = _held_position(joint, held.get(name), where)
        _fix(joint, positions[name])
    return Articulation(ET.tostring(robot, encoding="unicode") if positions else text, positions)


def _check_names(
    arm: tuple[str, ...], held: Mapping[str, Any], joints: Mapping[str, ET.Element], where: str
) -> None:
    moving = [name for name, joint in joints.items() if joint.get("type") in MOVING]
    for name in arm:
        if name not in moving:
            kind = f"a {joints[name].get('type')} joint" if name in joints else "no joint"
            raise VehicleError(
                where, "arm", f"names '{name}', {kind} of the URDF", f"those that move: {moving}"
            )
    for name in held:
        if name not in joints or name in arm:
            problem = "is a joint of the arm" if name in arm else "is no joint of the URDF"
            others = [other for other in moving if other not in arm]
            raise VehicleError(where, f"held.{name}", problem, f"can be held: {others}")


def _check_chain(
    arm: tuple[str, ...],
    tool: str,
    held: Mapping[str, Any],
    joints: Mapping[str, ET.Element],
    where: str,
) -> None:
    above = {_link(joint, "child"): name for name, joint in joints.items()}

    def path(link: str) -> list[str]:
        """Moving joints from the root to a link."""
        found: list[str] = []
        while link in above:
            joint = joints[above[link]]
            if joint.get("type") != "fixed" and above[link] not in held:
                found.insert(0, above[link])
            link = _link(joint, "parent")
        return found

    for before, name in pairwise(arm):
        if before not in path(_link(joints[name], "parent")):
            raise VehicleError(
                where,
                "arm",
                f"branches: joint '{name}' does not follow '{before}'",
                "name one serial chain, base to tip; joints that are left out are held",
            )
    ends = {"the arm": _link(joints[arm[-1]], "child")} if arm else {}
    for moved, link in (ends | {f"the tool '{tool}'": tool}).items():
        for name in path(link):
            if name not in arm:
                chain = path(link)
                raise VehicleError(
                    where,
                    "arm",
                    f"is {list(arm)}, but joint '{name}' moves {moved}, too",
                    f"name all moving joints, base to tip ({chain}), or hold it: "
                    f'held = {{ "{name}" = 0.0 }} [rad or m]',
                )


def _link(joint: ET.Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def limits(joint: ET.Element) -> tuple[float, float]:
    """Least and largest position of a URDF joint [rad or m]; infinite where it states no range."""
    limit = joint.find("limit")
    if limit is None or joint.get("type") == "continuous":
        return -np.inf, np.inf
    lower, upper = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
    return (lower, upper) if lower < upper else (-np.inf, np.inf)


def _held_position(joint: ET.Element, asked: Any, where: str) -> float:
    lower, upper = limits(joint)
    if asked is None:
        return float(np.clip(0.0, lower, upper))
    field = f"held.{joint.get('name')}"
    position = read.number(asked, where, field)
    if not lower <= position <= upper:
        raise VehicleError(
            where, field, f"is {position:g}", f"the joint goes from {lower:g} to {upper:g}"
        )
    return position


def _fix(joint: ET.Element, position: float) -> None:
    """Make a joint a fixed one, at a position [rad or m]."""
    if position != 0.0:
        origin = joint.find("origin")
        if origin is None:
            origin = ET.SubElement(joint, "origin")
        placement = _placement(origin) * _displacement(joint, position)
        origin.set("xyz", " ".join(repr(float(x)) for x in placement.translation))
        angles = pin.rpy.matrixToRpy(placement.rotation)
        origin.set("rpy", " ".join(repr(float(x)) for x in angles))
    joint.set("type", "fixed")
    for tag in ("axis", "limit", "mimic", "dynamics", "safety_controller", "calibration"):
        for child in joint.findall(tag):
            joint.remove(child)


def _numbers(element: ET.Element | None, key: str, default: str) -> np.ndarray:
    text = default if element is None else element.get(key, default)
    return np.array([float(part) for part in text.split()])


def _placement(origin: ET.Element) -> pin.SE3:
    rotation = pin.rpy.rpyToMatrix(_numbers(origin, "rpy", "0 0 0"))
    return pin.SE3(rotation, _numbers(origin, "xyz", "0 0 0"))


def _displacement(joint: ET.Element, position: float) -> pin.SE3:
    axis = _numbers(joint.find("axis"), "xyz", "1 0 0")
    axis /= np.linalg.norm(axis)
    if joint.get("type") == "prismatic":
        return pin.SE3(np.eye(3), axis * position)
    return pin.SE3(pin.exp3(axis * position), np.zeros(3))


def build_model(text: str) -> pin.Model:
    """Pinocchio's model of a URDF: a free flyer, then its moving joints, one coordinate each.

    Pinocchio gives a continuous joint two coordinates, cosine and sine. Here it is a revolute
    joint without limits, so that q is [p, quaternion xyzw, theta] whatever the arm. A joint whose
    limits enclose nothing (0 and 0 is what a URDF that states none means) has none, either.

    Args:
        text: URDF text.

    Raises:
        ValueError: Pinocchio refuses the URDF.
    """
    robot = ET.fromstring(text)
    continuous = [joint for joint in robot.findall("joint") if joint.get("type") == "continuous"]
    for joint in continuous:
        joint.set("type", "revolute")
        limit = joint.find("limit")
        if limit is None:
            ET.SubElement(joint, "limit", effort="0", velocity="0", lower="0", upper="0")
    if continuous:
        text = ET.tostring(robot, encoding="unicode")
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    for index in range(7, model.nq):
        if model.lowerPositionLimit[index] >= model.upperPositionLimit[index]:
            model.lowerPositionLimit[index], model.upperPositionLimit[index] = -np.inf, np.inf
    for joint in continuous:
        index = model.idx_qs[model.getJointId(joint.get("name"))]
        model.lowerPositionLimit[index], model.upperPositionLimit[index] = -np.inf, np.inf
    return model
