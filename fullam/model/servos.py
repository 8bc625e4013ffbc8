"""The arm's position servos: what a datasheet says of them, joint by joint.

A servo's electronics ask its motor for a share of full torque in proportion to the angle it is off
its goal, all of it from `slope` on; its motor gives that share of the stall torque, less what its
own turning takes from it, so torque falls on the line from stall to the no-load speed:

    tau = clip(k (goal - q), -stall, stall) - d dq,   k = stall / slope,   d = stall / no_load_speed

The defaults are a ROBOTIS Dynamixel AX-12A's at 12 V (its e-manual): 300 deg in 1023 steps, stall
torque 1.5 N m, 59 rpm without load, gear 254 : 1, and the compliance slope that it is shipped with,
32 steps. k = 9.2 N m/rad then: the default vehicle's arm sags by 5.6 and 3.3 deg in its first two
joints when it is stretched out level. Its rotor is in no datasheet. A motor of that size comes to
speed with a time constant of some 10 ms, which is armature / d: 0.0024 kg m^2 at the joint.

A joint that slides has the same servo on a rack and pinion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, Range, from_zero, positive, shown
from fullam.exceptions import VehicleError
from fullam.model.definition_keys import SERVO, names_of
from fullam.model.joints import ArmJoints

Array = NDArray[np.float64]

RANGES: dict[str, Range] = {
    "stall_torque": positive(1e5, "N m"),
    "no_load_speed_rpm": positive(1e5, "rpm"),
    "resolution_deg": from_zero(90.0, "deg"),
    "slope_deg": positive(1e3, "deg"),
    "armature": positive(1e4, "kg m^2"),
    "pinion_radius": positive(10.0, "m"),
}
"""What makes sense for each number of a `[servo]` table."""

DEFAULTS: dict[str, float] = {key.name: key.default for key in SERVO if key.kind == "number"}
"""The AX-12A's values."""

STOP = 20.0
"""Stiffness of a joint's stops, in those of its servo: it gives by a twentieth of `slope` at
stall, and the motor's own damping takes the bounce."""


@dataclass(frozen=True, eq=False)
class Servos:
    """The servos at the joints, read-only arrays of shape (n,); [N m, rad], or [N, m] that slide.

    Attributes:
        stiffness: k, torque per angle off the goal.
        damping: d, torque per rate.
        stall: Largest torque at rest.
        armature: Inertia of the motor's rotor, seen at the joint.
        resolution: Step of the encoder and of the goal; 0 for none.
        lower: Least position; -inf for none.
        upper: Largest position; inf for none.
        stop: Stiffness of the stops there.
    """

    stiffness: Array
    damping: Array
    stall: Array
    armature: Array
    resolution: Array
    lower: Array
    upper: Array
    stop: Array

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for field in fields(self):
            getattr(self, field.name).setflags(write=False)

    @property
    def rows(self) -> Array:
        """One row a joint, in the order of the attributes, shape (n, 8)."""
        return np.stack([getattr(self, field.name) for field in fields(self)], axis=1)

    @classmethod
    def of(cls, table: Any, joints: ArmJoints, where: str) -> Servos:
        """The servos that a definition's `[servo]` table states.

        Args:
            table: The table; its own table `joints` may state other numbers for joints by name.
            joints: The arm's joints.
            where: What an error message names as the source.

        Raises:
            VehicleError: An unknown key or joint, or a number out of range.
        """
        common = _numbers(table, "servo", DEFAULTS, where)
        own = table.get("joints", {})
        if not isinstance(own, Mapping):
            raise VehicleError(where, "servo.joints", f"is {shown(own)}", "give a table of tables")
        for name in own:
            if name not in joints.names:
                raise VehicleError(
                    where,
                    f"servo.joints.{name}",
                    "is no joint of the arm",
                    f"its joints are {', '.join(joints.names) or 'none'}",
                )
        each = [_numbers(own.get(n, {}), f"servo.joints.{n}", common, where) for n in joints.names]
        columns = {k: np.array([numbers[k] for numbers in each]) for k in DEFAULTS}
        # What a pinion makes of a torque and of an angle.
        lever = np.where(joints.prismatic, columns["pinion_radius"], 1.0)
        stall = columns["stall_torque"] / lever
        stiffness = stall / (np.radians(columns["slope_deg"]) * lever)
        return cls(
            stiffness=stiffness,
            damping=stall / (columns["no_load_speed_rpm"] * (np.pi / 30.0) * lever),
            stall=stall,
            armature=columns["armature"] / lever**2,
            resolution=np.radians(columns["resolution_deg"]) * lever,
            lower=joints.lower.copy(),
            upper=joints.upper.copy(),
            stop=STOP * stiffness,
        )


def _numbers(table: Any, field: str, default: Mapping[str, float], where: str) -> dict[str, float]:
    """The numbers of a table, the default's where it states none."""
    check = Checker(where, VehicleError)
    if not isinstance(table, Mapping):
        raise VehicleError(where, field, f"is {shown(table)}", "give a table, { name = value }")
    known = names_of(SERVO) if field == "servo" else tuple(DEFAULTS)
    for key in table:
        if key not in known:
            raise VehicleError(
                where, f"{field}.{key}", "is not a known key", f"known here: {', '.join(known)}"
            )
    return {
        key: check.number(f"{field}.{key}", table.get(key, default[key]), range)
        for key, range in RANGES.items()
    }
