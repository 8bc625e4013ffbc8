"""Where the platform should be: references as data.

`reference_table` says what a reference is; `Trajectory` is the smooth one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from inspect import signature
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, Range, from_zero, positive, shown, within
from fullam.dynamics.pose_space import pose_from_euler
from fullam.exceptions import ScenarioError, UnknownName
from fullam.simulation.excitation import Excitation
from fullam.simulation.motions.motion_rows import ReferenceRows
from fullam.simulation.motions.reference_table import Reference, ReferenceTable, name_of, tabulate
from fullam.simulation.motions.trajectory import Trajectory
from fullam.simulation.tool.follows import FollowsTool

__all__ = [
    "KINDS",
    "Circle",
    "Reference",
    "ReferenceTable",
    "Step",
    "Trajectory",
    "Waypoints",
    "from_dict",
    "is_kind",
    "tabulate",
    "to_dict",
]

Array = NDArray[np.float64]

ON_GRID = 1e-9
"""A time on the grid may be a rounding error below the number that was typed [s]."""


FAR, TURNED = within(1e6, "m"), within(1e5, "deg")
LATE, MOST_POINTS = 1e6, 100_000
"""What makes sense for a coordinate, an angle, a time [s] and a number of waypoints."""


@dataclass(frozen=True)
class Step:
    """Jump to a pose at a time and stay: the paper's position and tilted-hover targets.

    Attributes:
        position: Target of {A} [m].
        euler_deg: Target x-y-z Euler angles [deg].
        at: Time of the jump [s]; before it the reference is the initial pose of the scenario.
    """

    kind: ClassVar[str] = "step"
    position: tuple[float, float, float]
    euler_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    at: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        check = Checker("step", ScenarioError)
        object.__setattr__(self, "position", check.vector("position", self.position, 3, FAR))
        object.__setattr__(self, "euler_deg", check.vector("euler_deg", self.euler_deg, 3, TURNED))
        object.__setattr__(self, "at", check.number("at", self.at, from_zero(LATE, "s")))

    @property
    def final_pose(self) -> Array:
        """Where the reference ends, shape (7,)."""
        return pose_from_euler(np.array(self.position), np.radians(self.euler_deg))

    def tabulate(self, t: Array, initial_pose: Array) -> ReferenceTable:
        """The reference on the grid t, shape (N,)."""
        pose = np.where((t >= self.at - ON_GRID)[:, None], self.final_pose, initial_pose)
        return ReferenceTable(t, pose, np.zeros((t.size, 6)), np.zeros((t.size, 6)))


@dataclass(frozen=True)
class Waypoints:
    """Jumps to a sequence of poses, each held until the next.

    Attributes:
        times: When each pose is asked for [s], ascending, from 0 on.
        positions: One position a time [m].
        euler_deg: One triple of x-y-z Euler angles a time [deg].
    """

    kind: ClassVar[str] = "waypoints"
    times: tuple[float, ...]
    positions: tuple[tuple[float, float, float], ...]
    euler_deg: tuple[tuple[float, float, float], ...]

    def __post_init__(self) -> None:
        """Check lengths, order and numbers."""
        check = Checker("waypoints", ScenarioError)
        times = check.vector("times", self.times, None, from_zero(LATE, "s"))
        if not 0 < len(times) <= MOST_POINTS:
            raise check.refuse("times", f"has {len(times)} entries", f"give 1 to {MOST_POINTS}")
        if any(later <= earlier for earlier, later in pairwise(times)):
            raise check.refuse("times", "does not ascend from 0 on", "sort them")
        object.__setattr__(self, "times", times)
        for field, numbers in (("positions", FAR), ("euler_deg", TURNED)):
            rows = getattr(self, field)
            is_list = isinstance(rows, list | tuple) or np.ndim(rows) == 2
            if not is_list or len(rows) != len(times):
                raise check.refuse(
                    field, f"is {shown(rows)}", f"give {len(times)} rows of three, one a time"
                )
            rows = tuple(
                check.vector(f"{field}[{i}]", row, 3, numbers) for i, row in enumerate(rows)
            )
            object.__setattr__(self, field, rows)

    @property
    def final_pose(self) -> Array:
        """Where the reference ends, shape (7,)."""
        return pose_from_euler(np.array(self.positions[-1]), np.radians(self.euler_deg[-1]))

    def tabulate(self, t: Array, initial_pose: Array) -> ReferenceTable:
        """The reference on the grid t, shape (N,)."""
        poses = pose_from_euler(np.array(self.positions), np.radians(np.array(self.euler_deg)))
        poses = np.vstack([initial_pose, poses])
        pose = poses[np.searchsorted(self.times, t + ON_GRID, side="right")]
        return ReferenceTable(t, pose, np.zeros((t.size, 6)), np.zeros((t.size, 6)))


@dataclass(frozen=True)
class Circle:
    """A level circle at constant speed, with its exact velocity and acceleration.

    Attributes:
        center: Centre [m].
        radius: Radius [m].
        period: Time of one round [s].
        euler_deg: Constant attitude, x-y-z Euler angles [deg].
    """

    kind: ClassVar[str] = "circle"
    center: tuple[float, float, float]
    radius: float = 1.0
    period: float = 6.0
    euler_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the numbers."""
        check = Checker("circle", ScenarioError)
        object.__setattr__(self, "center", check.vector("center", self.center, 3, FAR))
        object.__setattr__(self, "euler_deg", check.vector("euler_deg", self.euler_deg, 3, TURNED))
        object.__setattr__(self, "radius", check.number("radius", self.radius, positive(1e6, "m")))
        period = check.number("period", self.period, Range(1e-3, LATE, "s"))
        object.__setattr__(self, "period", period)

    @property
    def final_pose(self) -> None:
        """A circle ends nowhere."""
        return None

    def tabulate(self, t: Array, initial_pose: Array) -> ReferenceTable:
        """The reference on the grid t, shape (N,)."""
        rate = 2.0 * np.pi / self.period
        cos, sin, zero = np.cos(rate * t), np.sin(rate * t), np.zeros_like(t)
        radial = np.stack([cos, sin, zero], axis=1) * self.radius
        tangent = np.stack([-sin, cos, zero], axis=1) * self.radius
        euler = np.broadcast_to(np.radians(self.euler_deg), (t.size, 3))
        pose = pose_from_euler(np.array(self.center) + radial, euler)
        still = np.zeros((t.size, 3))
        return ReferenceTable(
            t,
            pose,
            np.hstack([rate * tangent, still]),
            np.hstack([-(rate**2) * radial, still]),
        )


KINDS: dict[str, Any] = {
    c.kind: c for c in (Step, Waypoints, Circle, Trajectory, Excitation, ReferenceRows, FollowsTool)
} | {"minimum-snap": Trajectory.minimum_snap, "b-spline": Trajectory.b_spline}
"""What a scenario's table may name, and what makes a reference of its other entries."""


def from_dict(cls_by_kind: Mapping[str, Any], what: str, data: dict[str, Any]) -> Any:
    """Build one of several motions from {"kind": ..., arguments}; the inverse of `to_dict`.

    Raises:
        UnknownName: No such kind; the message lists the known ones.
        ScenarioError: An argument that the kind does not have, or one that is missing.
    """
    values = Checker(what, ScenarioError).table("table", data)
    kind = values.pop("kind", "")
    if not isinstance(kind, str) or kind not in cls_by_kind:
        raise UnknownName(
            f"kind of {what}", kind if isinstance(kind, str) else shown(kind), cls_by_kind
        )
    make = cls_by_kind[kind]
    check = Checker(f"{what} '{kind}'", ScenarioError)
    wanted = signature(make).parameters
    check.known(values, tuple(wanted))
    for name, parameter in wanted.items():
        if name not in values and parameter.default is parameter.empty:
            raise check.refuse(name, "is missing", "give it")
    return make(**values)


def to_dict(value: Any) -> dict[str, Any]:
    """{"kind": ..., fields} of one of fullam's reference or arm-motion dataclasses."""
    return {"kind": value.kind, **{f.name: getattr(value, f.name) for f in fields(value)}}


def is_kind(motion: Any, kinds: Mapping[str, Any]) -> bool:
    """Whether a motion is of one of these kinds, which plain data rebuild."""
    return kinds.get(name_of(motion)) is type(motion)
