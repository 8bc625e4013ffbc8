"""The keys of a vehicle's TOML: what each of its tables may hold, and what that means.

The readers accept these keys and no others, and the documentation shows these tables.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

REQUIRED = object()
"""Stands for the default of a key that has to be stated."""


GRAVITY = 9.81
"""Gravity when a definition states none [m/s^2]."""


@dataclass(frozen=True)
class Key:
    """One key of a table.

    Attributes:
        name: As typed.
        kind: What its value is, in words.
        meaning: What it says.
        unit: What a number counts; empty for the others.
        default: What it is unless stated: a value, or in words what is done then.
    """

    name: str
    kind: str
    meaning: str
    unit: str = ""
    default: Any = REQUIRED


Table = tuple[Key, ...]


def names_of(table: Table) -> tuple[str, ...]:
    """The keys by name, in the order in which they are listed."""
    return tuple(key.name for key in table)


VEHICLE: Table = (
    Key("name", "text", "Short name."),
    Key("description", "text", "One sentence.", default=""),
    Key(
        "urdf",
        "path or table",
        "The URDF, relative to the TOML; or a table that says where to find it.",
    ),
    Key("platform", "text", "Link that carries the rotors: the URDF's root. Its frame is {A}."),
    Key(
        "arm",
        "names or table",
        "The arm's joints, base to tip; or a table with them and a URDF of the arm's own.",
        default=[],
    ),
    Key("tool", "text", "Link at the tip of the arm."),
    Key(
        "held",
        "table of numbers",
        "Positions at which joints are held that are not the arm's, by the joints' names.",
        "rad or m",
        "at 0, or the limit nearest to it",
    ),
    Key("mass", "number", "Mass of the whole, which the URDF has to add up to.", "kg", "not held"),
    Key("gravity", "number", "Gravity, along -z of {W}.", "m/s^2", GRAVITY),
    Key(
        "physics",
        "check or trust",
        "Whether masses and inertias that no body has are refused.",
        default="check",
    ),
    Key("rotor_defaults", "table", "What the rotors have in common.", default={}),
    Key("rotor", "list of tables", "The rotors, one [[rotor]] each.", default=[]),
    Key("servo", "table", "The servos at the arm's joints.", default={}),
    Key(
        "body",
        "list of tables",
        "Bodies whose mass properties were measured, one [[body]] each.",
        default=[],
    ),
    Key(
        "design",
        "table",
        "Parameters that the URDF was written from, for `fullam.design_vehicle`.",
        default="no variants",
    ),
)

URDF: Table = (
    Key("path", "path", "File, relative to the TOML, or inside the package's robots."),
    Key(
        "package",
        "text",
        "Data package of the environment that installs its robots under share/PACKAGE/robots.",
        default="none",
    ),
    Key("args", "table", "Arguments of a xacro file.", default={}),
)

ARM: Table = (
    Key("joints", "names", "The arm's joints, base to tip.", default=[]),
    Key("urdf", "path or table", "The arm's own URDF, as the vehicle's.", default="none"),
    Key("mount", "table", "Where the arm's root is fixed. Goes with `urdf`.", default={}),
    Key("prefix", "text", "Goes before every name of the arm. Goes with `urdf`.", default=""),
)

ARM_IN_THE_URDF: Table = ARM[:1]
"""An arm that has no URDF of its own."""

MOUNT: Table = (
    Key("link", "text", "Link of the platform that carries the arm.", default="the platform's"),
    Key("position", "three numbers", "Of the arm's root on it.", "m", [0, 0, 0]),
    Key("rpy_deg", "three numbers", "URDF's roll, pitch, yaw about fixed axes.", "deg", [0, 0, 0]),
)

ROTOR_DEFAULTS: Table = (
    Key("k_f", "number", "Thrust by the squared speed, eq. (27).", "N/(rad/s)^2"),
    Key("k_tau", "number", "Drag torque by the squared speed, eq. (30).", "N m/(rad/s)^2"),
    Key("max_speed", "number", "Largest speed.", "rad/s"),
    Key("lag", "number", "Time constant with which a speed follows its command.", "s"),
    Key("min_speed", "number", "Smallest speed.", "rad/s", 0.0),
)
"""May stand in [rotor_defaults] or in a [[rotor]]; the rotor's own wins."""

ROTOR: Table = (
    Key("name", "text", "Its name.", default="its frame's, or rotor_N"),
    Key(
        "frame",
        "text",
        "Link of the URDF, fixed to the platform, whose z is the thrust axis.",
        default="see position",
    ),
    Key("position", "three numbers", "Of the hub in {A}, with `axis`.", "m", "see frame"),
    Key("axis", "three numbers", "Unit vector of the thrust in {A}.", default="see frame"),
    Key("spin", "+1 or -1", "Sign of the drag torque along the thrust axis, d of eq. (30)."),
    *ROTOR_DEFAULTS,
)

SERVO: Table = (
    Key("stall_torque", "number", "Largest torque, at rest.", "N m", 1.5),
    Key("no_load_speed_rpm", "number", "Speed at which no torque is left.", "rpm", 59.0),
    Key("resolution_deg", "number", "Step of encoder and goal.", "deg", 300.0 / 1023.0),
    Key(
        "slope_deg",
        "number",
        "Angle off the goal at which the motor gives all it has.",
        "deg",
        32.0 * 300.0 / 1023.0,
    ),
    Key("armature", "number", "Inertia of the motor's rotor at the joint.", "kg m^2", 0.0024),
    Key("pinion_radius", "number", "Of a joint that slides, on a rack.", "m", 0.02),
    Key("joints", "table of tables", "What is different at a joint, by its name.", default={}),
)
"""A ROBOTIS Dynamixel AX-12A by default; of all joints, or in [servo.joints.NAME] of one."""

BODY: Table = (
    Key("link", "text", "Any link of the body: what moves with a joint is one."),
    Key("mass", "number", "Its mass, in place of what the URDF adds up to.", "kg"),
    Key("center", "three numbers", "Centre of mass in the joint's frame.", "m"),
    Key("inertia", "six numbers", "xx, xy, xz, yy, yz, zz about the centre of mass.", "kg m^2"),
)
