"""Can this body exist? Physical checks of the masses and inertias that a URDF states.

Pinocchio and yourdfpy both accept impossible inertias, so the checks are made here. What flies are
bodies: links with all that is fixed to them. A body that cannot exist is refused by the name of the
link that spoils it; a link that cannot exist by itself but vanishes in a possible body (a camera of
the size of a coin with the inertia of a plate) is remarked upon.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.checks import Checker, shown, within
from fullam.exceptions import VehicleError

Array = NDArray[np.float64]

INERTIA_TOLERANCE = 1e-3
"""Slack of both inequalities, relative to the largest principal moment.

Published tensors carry four or five digits, a thin plate sits exactly on the triangle inequality
and a thin rod has a moment of zero, so rounding alone may break either by some 1e-4. Hextilt and
borinot keep it with 1.6 % and 4 % to spare; among the other robots of example-robot-data the
mildest offender but one (0.18 %) breaks it by 9 %."""

POINT = 1e-6
"""Radius of gyration below which a body is a point mass, whatever its tensor says [m]: its moments
are zeros, some of them written as -2e-35."""

MASS_TOLERANCE = 1e-3
"""How far a declared mass may be from the sum over the links, relative: data sheets give grams."""


LEAST_MASS, MOST_MASS = 1e-9, 1e6
"""Masses of a link that are no typing errors [kg]."""

MOST_INERTIA = 1e9
"""The largest mass [kg] or entry of an inertia [kg m^2] that is looked at."""

MOST_DISTANCE, MOST_ANGLE = 1e3, 1e3
"""The largest coordinate of an origin [m] and its largest angle [rad]."""

AXIS_LENGTH = 1e3
"""A joint's axis is normalised on loading if its length is from 1 over this to this."""

MOST_LINKS, MOST_NESTED = 1000, 100
"""More links, or elements inside each other, than any vehicle's URDF has."""

COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)


@dataclass(frozen=True, eq=False)
class LinkInertia:
    """Mass properties of one URDF link.

    Attributes:
        link: Name of the link.
        mass: Mass [kg]; 0 for a link that only carries a frame.
        inertia: Rotational inertia about the centre of mass, in the axes of the URDF's inertial
            frame, shape (3, 3) [kg m^2].
    """

    link: str
    mass: float
    inertia: Array


def parse_urdf(text: str, where: str) -> ElementTree.Element:
    """The root element of a URDF.

    Args:
        text: The URDF's XML.
        where: What an error message names as its source.

    Raises:
        VehicleError: If the text is not XML, or its root is not <robot>.
    """
    if not isinstance(text, str):
        raise VehicleError(where, "URDF", f"is {shown(text)}", "give the URDF's text")
    if "<!" in COMMENT.sub("", text):
        # A document type can define entities that grow without end; no URDF has one.
        raise VehicleError(where, "XML", "has a document type or CDATA", "give a plain URDF")
    try:
        _check_nesting(text, where)
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise VehicleError(where, "XML", str(error), "give a well-formed URDF") from error
    if root.tag != "robot":
        raise VehicleError(where, f"<{root.tag}>", "is the root element", "a URDF starts <robot>")
    return root


def _check_nesting(text: str, where: str) -> None:
    """Refuse a document that is nested deeper than any URDF, before a parser recurses into it."""
    parser: ElementTree.XMLPullParser = ElementTree.XMLPullParser(["start", "end"])
    depth, size = 0, 1 << 16
    for start in range(0, len(text), size):
        parser.feed(text[start : start + size])
        for event, *_ in parser.read_events():
            depth += 1 if event == "start" else -1
            if depth > MOST_NESTED:
                raise VehicleError(
                    where,
                    "XML",
                    f"is nested {depth} elements deep",
                    "links and joints are children of <robot>",
                )


def check_joints(robot: ElementTree.Element, where: str) -> None:
    """Places, axes and limits of joints and inertias are finite, and what moves has an axis.

    Raises:
        VehicleError: Naming the file, the joint or link and the remedy.
    """
    for kind in ("link", "joint"):
        if len(robot.findall(kind)) > MOST_LINKS:
            raise VehicleError(
                where, f"<{kind}>", f"is there more than {MOST_LINKS} times", "give a vehicle"
            )
    for link in robot.findall("link"):
        for origin in link.findall("inertial/origin"):
            _check_origin(origin, f"inertial of link '{link.get('name')}'", where)
    for joint in robot.findall("joint"):
        name = f"joint '{joint.get('name')}'"
        for origin in joint.findall("origin"):
            _check_origin(origin, name, where)
        if joint.get("type") != "fixed":
            axis = _numbers(joint.find("axis"), "xyz", f"axis of {name}", where)
            length = 1.0 if axis is None else math.hypot(*axis)  # which does not overflow
            if not 1.0 / AXIS_LENGTH <= length <= AXIS_LENGTH:
                raise VehicleError(
                    where, f"axis of {name}", f"has length {length:g}", "give a unit vector"
                )
        limit = joint.find("limit")
        for key in () if limit is None else ("lower", "upper", "effort", "velocity"):
            _numbers(limit, key, f"limit {key} of {name}", where, count=1)


def _check_origin(origin: ElementTree.Element, name: str, where: str) -> None:
    for key, most, unit in (("xyz", MOST_DISTANCE, "m"), ("rpy", MOST_ANGLE, "rad")):
        numbers = _numbers(origin, key, f"origin {key} of {name}", where)
        if numbers is not None and np.abs(numbers).max() > most:
            raise VehicleError(
                where,
                f"origin {key} of {name}",
                f"is {' '.join(f'{number:g}' for number in numbers)}",
                f"give numbers of at most {most:g} {unit}",
            )


def _numbers(
    element: ElementTree.Element | None, key: str, field: str, where: str, count: int = 3
) -> Array | None:
    """The finite numbers of an attribute; None where it is left out."""
    text = None if element is None else element.get(key)
    if text is None:
        return None
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError as error:
        raise VehicleError(where, field, f"is {shown(text)}", "give numbers") from error
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        plural = "s" if count > 1 else ""
        raise VehicleError(where, field, f"is {shown(text)}", f"give {count} finite number{plural}")
    return numbers


def link_inertias(robot: ElementTree.Element, where: str) -> list[LinkInertia]:
    """Mass properties of every link that states them, in the URDF's order.

    Raises:
        VehicleError: If a number is missing or is not one.
    """
    found = []
    for link in robot.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        name = link.get("name", "")
        mass = _attribute(inertial, "mass", "value", name, where)
        xx, xy, xz, yy, yz, zz = (
            _attribute(inertial, "inertia", key, name, where)
            for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        found.append(LinkInertia(name, mass, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])))
    return found


def _attribute(inertial: ElementTree.Element, tag: str, key: str, link: str, where: str) -> float:
    element = inertial.find(tag)
    text = None if element is None else element.get(key)
    field = f"{tag}/{key} of link '{link}'"
    if text is None:
        raise VehicleError(where, field, "is missing", "state it, or drop the <inertial>")
    try:
        value = float(text)
    except ValueError as error:
        raise VehicleError(where, field, f"is {shown(text)}", "give a number") from error
    # A mass of a megatonne and an inertia to it are typing errors, and would overflow further on.
    return Checker(where, VehicleError).number(field, value, within(MOST_INERTIA))


def body_inertia(mass: float, center: Array, inertia: Array) -> pin.Inertia:
    """A body as Pinocchio has it, whatever rounding left below zero in its inertia.

    Pinocchio refuses such an inertia where a body is made of it, and takes it where it is set. What
    is impossible is told by `inertia_problem`.

    Args:
        mass: [kg].
        center: Centre of mass, shape (3,) [m].
        inertia: About that, shape (3, 3) [kg m^2].
    """
    body = pin.Inertia(mass, np.asarray(center, dtype=float), np.eye(3))
    body.inertia = inertia
    return body


def inertia_problem(inertia: Array, mass: float = 0.0) -> str | None:
    """What is impossible about a rotational inertia about the centre of mass, or None.

    No principal moment of a rigid body is negative, and none exceeds the sum of the other two
    (I_x + I_y - I_z = 2 sum m z^2 >= 0), within `INERTIA_TOLERANCE` of the largest. Moments of
    zero are a rod's or a point mass's.

    Args:
        inertia: Shape (3, 3), symmetric [kg m^2].
        mass: Mass of the body [kg]; by it a tensor is known to be zero but for rounding.
    """
    if not np.isfinite(inertia).all():
        return "is not finite"
    moments = np.linalg.eigvalsh(inertia)
    if np.max(np.abs(moments)) <= mass * POINT**2:
        return None
    if moments[0] < -INERTIA_TOLERANCE * abs(moments[2]):
        return f"has principal moments {_listed(moments)}, one of them negative"
    excess = moments[2] - moments[0] - moments[1]
    if excess > INERTIA_TOLERANCE * moments[2]:
        return (
            f"has principal moments {_listed(moments)}, the largest above the sum of the other two"
        )
    return None


def _listed(moments: NDArray[np.floating]) -> str:
    return ", ".join(f"{moment:.4g}" for moment in moments)


REMEDY = (
    "state it about the centre of mass [kg m^2], without negative principal moments and each at "
    'most the sum of the other two, or write physics = "trust"'
)


def link_problems(robot: ElementTree.Element, where: str) -> dict[str, VehicleError]:
    """What is impossible about links taken by themselves, as errors that nobody raised yet.

    A link of mass zero carries a frame; its inertia must be zero too.

    Raises:
        VehicleError: A mass is negative, or a number is missing or is none.
    """
    found = {}
    for body in link_inertias(robot, where):
        field = f"inertia of link '{body.link}'"
        if body.mass < 0.0:
            raise VehicleError(
                where,
                f"mass of link '{body.link}'",
                f"is {body.mass:g} kg",
                "a mass is positive, or 0 on a link that only carries a frame",
            )
        if 0.0 < body.mass < LEAST_MASS or body.mass > MOST_MASS:
            raise VehicleError(
                where,
                f"mass of link '{body.link}'",
                f"is {body.mass:g} kg",
                f"give {LEAST_MASS:g} to {MOST_MASS:g} kg, or 0 to a link that carries a frame",
            )
        problem = inertia_problem(body.inertia, body.mass)
        if body.mass == 0.0 and np.any(body.inertia):
            found[body.link] = VehicleError(
                where,
                field,
                "is not zero although the mass is",
                "give the link a mass, or no inertia",
            )
        elif problem is not None:
            found[body.link] = VehicleError(where, field, problem, REMEDY)
    return found


def check_bodies(model: pin.Model, robot: ElementTree.Element, where: str) -> list[str]:
    """Every body of the model can exist: a moving link with all that is fixed to it.

    Args:
        model: Model of the URDF, a free flyer first.
        robot: The URDF.
        where: What an error message names as its source.

    Returns:
        Remarks on links that are impossible by themselves and harmless in their body, and on
        joints that move no mass.

    Raises:
        VehicleError: Naming the file, the link and the remedy.
    """
    problems = link_problems(robot, where)
    platform, *moved = list(model.inertias)[1:]
    if platform.mass <= 0.0:
        root = next(f.name for f in model.frames if f.type == pin.FrameType.BODY)
        raise VehicleError(where, f"link '{root}'", "has no mass", "give it an <inertial>")
    body_of = {f.name: f.parentJoint for f in model.frames if f.type == pin.FrameType.BODY}
    for index, body in enumerate([platform, *moved], start=1):
        problem = inertia_problem(body.inertia, body.mass)
        if problem is None and (body.mass > 0.0 or not np.any(body.inertia)):
            continue
        for link, error in problems.items():
            if body_of[link] == index:
                raise error
        what = f"inertia of the links behind joint '{model.names[index]}'"
        raise VehicleError(where, what, problem or "is not zero although the mass is", REMEDY)
    remarks = [
        f"{error.field} {error.problem}; harmless in the body that it is fixed to"
        for error in problems.values()
    ]
    for name, body in zip(list(model.names)[2:], moved, strict=True):
        if body.mass == 0.0:
            remarks.append(f"joint '{name}' moves a body without mass")
    return remarks


def check_total_mass(declared: float, total: float, where: str) -> None:
    """The declared mass is the sum over the links, within `MASS_TOLERANCE`.

    Args:
        declared: Mass that the TOML states [kg].
        total: Sum over the URDF's links [kg].
        where: The TOML, for the message.

    Raises:
        VehicleError: If they differ by more.
    """
    if not abs(declared - total) <= MASS_TOLERANCE * total:
        raise VehicleError(
            where,
            "mass",
            f"is {declared:g} kg, but the links of the URDF weigh {total:.6g} kg together",
            "correct the one that is wrong, or leave `mass` out",
        )
