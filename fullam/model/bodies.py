"""Bodies whose mass properties a definition states itself, in place of the URDF's.

A body is what moves with a joint: a link and all that is fixed to it. A table

    [[body]]
    link = "link_1"                     # any link of the body
    mass = 0.25                         # [kg]
    center = [0.0, 0.0, 0.05]           # centre of mass in the joint's frame [m]
    inertia = [1e-3, 0, 0, 1e-3, 0, 5e-4]  # xx, xy, xz, yy, yz, zz about it [kg m^2]

replaces what the URDF adds up to. So a calibrated vehicle is written: the URDF stays as it is, and
what was measured stands beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from fullam.checks import FINITE, Checker, positive, within
from fullam.exceptions import VehicleError
from fullam.model import definition as read
from fullam.model.definition_keys import BODY, names_of
from fullam.model.physics import body_inertia, inertia_problem

TRIANGLE = ([0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2])
"""Rows and columns of the six numbers of an inertia."""


def replace_bodies(definition: Mapping[str, Any], model: pin.Model, where: str) -> None:
    """Give the bodies of a model the mass properties that a definition states.

    Raises:
        VehicleError: A table is incomplete, names no link, one body is stated twice, or no body has
            such mass properties.
    """
    tables = definition.get("body", [])
    if not isinstance(tables, list) or not all(isinstance(table, Mapping) for table in tables):
        raise VehicleError(where, "body", "is not a list of tables", "write [[body]] per body")
    stated: dict[int, str] = {}
    for index, table in enumerate(tables):
        field = f"body[{index + 1}]"
        check = Checker(where, VehicleError)
        read.check_keys(table, names_of(BODY), where, field)
        for key in names_of(BODY):
            if key not in table:
                raise VehicleError(where, f"{field}.{key}", "is missing", "state it")
        link = read.text(table, "link", where)
        joint = model.frames[read.frame_id(model, link, where, f"{field}.link")].parentJoint
        if joint in stated:
            raise VehicleError(
                where,
                f"{field}.link",
                f"'{link}' is one body with '{stated[joint]}'",
                "state it once",
            )
        stated[joint] = link
        mass = check.number(f"{field}.mass", table["mass"], positive(1e6, "kg"))
        center = check.vector(f"{field}.center", table["center"], 3, within(1e3, "m"))
        numbers = check.vector(f"{field}.inertia", table["inertia"], 6, FINITE)
        inertia = np.zeros((3, 3))
        inertia[TRIANGLE] = inertia.T[TRIANGLE] = numbers
        problem = inertia_problem(inertia, mass)
        if problem is not None and definition.get("physics") != "trust":
            raise VehicleError(
                where, f"{field}.inertia", f"belongs to no body: {problem}", "measure it again"
            )
        model.inertias[joint] = body_inertia(mass, np.array(center), inertia)


def body_tables(model: pin.Model) -> list[dict[str, Any]]:
    """The mass properties of every body of a model as such tables."""
    links: dict[int, str] = {}
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            links.setdefault(frame.parentJoint, frame.name)
    return [
        {
            "link": links[joint],
            "mass": float(body.mass),
            "center": np.array(body.lever).tolist(),
            "inertia": np.array(body.inertia)[TRIANGLE].tolist(),
        }
        for joint, body in enumerate(model.inertias)
        if joint > 0
    ]
