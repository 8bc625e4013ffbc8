"""What makes sense for each parameter of a design; see `fullam.model.design.VehicleDesign`."""

from __future__ import annotations

from typing import Any

from fullam.checks import Checker, Range, positive, shown, within
from fullam.model.definition import MOST_ROTORS

POSITIVE = (
    *("platform_mass", "ring_radius", "propeller_radius", "tool_length", "link_radius"),
    *("joint_range_deg", "joint_effort", "joint_speed_rpm"),
)
"""Parameters of a design that are above 0."""

MOST_ROWS = 100
"""More rows of a Craig table than any arm has."""

ROWS = {
    "craig": (3, (2, MOST_ROWS), "[alpha, a, d]"),
    "rotor_rows": (5, (0, MOST_ROTORS), "[azimuth_deg, radius, height, cant_deg, lean_deg]"),
}
"""Tables of a design: numbers in a row, least and most rows, what the numbers are."""

VECTORS: dict[str, tuple[int | None, Range]] = {
    "platform_inertia": (3, within(1e3, "kg m^2")),
    "mount_position": (3, within(1e3, "m")),
    "link_masses": (None, within(1e3, "kg")),
}
"""Vectors of a design: how many numbers (None: any), and which."""


def checked_parameter(check: Checker, key: str, value: Any) -> Any:
    """A parameter in its form, each number in the range of what it is.

    Args:
        check: Whose error is raised.
        key: Name of the parameter.
        value: What was given for it.
    """
    field = f"design.{key}"
    if key in VECTORS:
        return check.vector(field, value, *VECTORS[key])
    if key in ROWS:
        width, (least, most), meaning = ROWS[key]
        if not isinstance(value, list | tuple) or not least <= len(value) <= most:
            raise check.refuse(field, f"is {shown(value)}", f"give rows {meaning}")
        rows = enumerate(value)
        return tuple(check.vector(f"{field}[{i}]", row, width, within(1e3)) for i, row in rows)
    if key == "rotor_count":
        whole = int(value) if isinstance(value, float) and value.is_integer() else value
        return check.whole(field, whole, 4, MOST_ROTORS)
    return check.number(field, value, positive(1e4) if key in POSITIVE else within(1e4))
