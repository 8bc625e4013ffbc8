"""The joints of a scene in MJCF: their names, and the coordinates that a record holds of them.

    hinge (1)   angle [rad]
    slide (1)   way [m]
    ball (4)    quaternion xyzw, by which its body has turned from how it is drawn
    free (7)    p [m], quaternion xyzw of its body in world axes

They are MuJoCo's `qpos`: an angle or a way is the joint's `ref` in the scene as it is drawn. A
record's column `scene` has them side by side, in the scene's order; its metadata name them,
`{"name": "valve", "kind": "hinge"}`. MuJoCo's order of a quaternion, wxyz, ends in `mujoco.scene`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from fullam.checks import CONTROL, Checker, shown

COLUMN = "scene"
"""Name of the record's column, and of the entry of its metadata that names its joints."""

QUATERNION = (("qx", ""), ("qy", ""), ("qz", ""), ("qw", ""))
COORDINATES: dict[str, tuple[tuple[str, str], ...]] = {
    "hinge": (("", "rad"),),
    "slide": (("", "m"),),
    "ball": QUATERNION,
    "free": (("x", "m"), ("y", "m"), ("z", "m"), *QUATERNION),
}
"""Name and unit of each coordinate of a joint, by its kind."""

UNITS = {"ball": "quaternion xyzw", "free": "m, quaternion xyzw"}
"""Of those whose coordinates have several."""


@dataclass(frozen=True)
class SceneJoint:
    """A joint of a scene.

    Attributes:
        name: Its own, or that of the body that it moves; no two have the same.
        kind: One of `COORDINATES`.
    """

    name: str
    kind: str

    @property
    def width(self) -> int:
        """How many coordinates it has."""
        return len(COORDINATES[self.kind])

    @property
    def components(self) -> tuple[str, ...]:
        """Names of its coordinates: "valve", or "box_x", "box_y", ..."""
        parts = (part for part, _ in COORDINATES[self.kind])
        return tuple(f"{self.name}_{part}" if part else self.name for part in parts)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each of them; "" has none."""
        return tuple(unit for _, unit in COORDINATES[self.kind])

    @property
    def unit(self) -> str:
        """All of them in words."""
        return UNITS.get(self.kind, self.units[0])

    def to_dict(self) -> dict[str, str]:
        """JSON values; `read_joints` is the inverse."""
        return {"name": self.name, "kind": self.kind}


def named(found: Iterable[tuple[str, str]]) -> tuple[SceneJoint, ...]:
    """Joints from what a scene calls them, (name, kind), which may be nothing, or no text.

    A coordinate whose name is taken gets another one: "box" and then "box 2".
    """
    joints: list[SceneJoint] = []
    taken: set[str] = set()
    for text, kind in found:
        name = "".join(c for c in CONTROL.sub("", text) if c.isprintable()).strip() or "joint"
        joint, number = SceneJoint(name, kind), 2
        while not taken.isdisjoint(joint.components):
            joint, number = SceneJoint(f"{name} {number}", kind), number + 1
        taken.update(joint.components)
        joints.append(joint)
    return tuple(joints)


def read_joints(metadata: Mapping[str, Any], check: Checker) -> tuple[SceneJoint, ...]:
    """The joints that a record's metadata name; none where they name no scene.

    Raises:
        InvalidInput: Of the checker's class: they are not as `named` makes them, or the record is
            of a plant or of a scenario without a scene.
    """
    if COLUMN not in metadata:
        return ()
    simulation, scenario = metadata.get("simulation"), metadata.get("scenario")
    plant = simulation.get("plant") if isinstance(simulation, Mapping) else None
    file = scenario.get("world_file") if isinstance(scenario, Mapping) else None
    if plant != "mujoco" or not isinstance(file, Mapping):
        raise check.refuse(COLUMN, "is there", "a flight without a scene in MJCF has none")
    joints = []
    for entry in check.items(COLUMN, metadata[COLUMN]):
        table = check.table(COLUMN, entry)
        check.known(table, ("name", "kind"))
        kind = table.get("kind")
        if not isinstance(kind, str) or kind not in COORDINATES:
            remedy = f"a joint is one of {', '.join(COORDINATES)}"
            raise check.refuse(f"{COLUMN}, kind", f"is {shown(kind)}", remedy)
        joints.append(SceneJoint(check.text(f"{COLUMN}, name", table.get("name")), kind))
    names = [name for joint in joints for name in joint.components]
    if not names or len(set(names)) < len(names):
        problem = "names two coordinates alike" if names else "names no joint"
        raise check.refuse(COLUMN, problem, "save the run again")
    return tuple(joints)


def width_of(joints: Iterable[SceneJoint]) -> int:
    """How many coordinates joints have together."""
    return sum(joint.width for joint in joints)


def part_of(joints: Iterable[SceneJoint], name: str) -> slice | None:
    """Columns of a joint among those of all; None if there is no such joint."""
    at = 0
    for joint in joints:
        if joint.name == name:
            return slice(at, at + joint.width)
        at += joint.width
    return None


def quaternions_of(joints: Iterable[SceneJoint]) -> list[slice]:
    """Columns of the quaternions among the coordinates of all."""
    found, at = [], 0
    for joint in joints:
        at += joint.width
        if joint.width >= len(QUATERNION):
            found.append(slice(at - len(QUATERNION), at))
    return found
