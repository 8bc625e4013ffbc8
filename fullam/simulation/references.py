"""Where the platform should be: references as data, tabulated on the control grid.

A reference is tabulated once before a flight, so the loop only reads rows, and a NaN or a
malformed table is found on the ground. `blend_jumps` spreads the jumps of a reference over
minimum-jerk profiles of bounded acceleration.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fullam.dynamics.pose_space import pose_from_euler
from fullam.exceptions import ScenarioError, UnknownName

Array = NDArray[np.float64]

PEAK_ACCELERATION = 10.0 / np.sqrt(3.0)
"""Peak of |d^2 s/dx^2| for the minimum-jerk profile s = 10 x^3 - 15 x^4 + 6 x^5."""

ON_GRID = 1e-9
"""A time on the grid may be a rounding error below the number that was typed [s]."""


@dataclass(frozen=True, eq=False)
class ReferenceTable:
    """A reference on a time grid.

    Attributes:
        t: Times [s], shape (N,).
        pose: [p, quaternion xyzw], shape (N, 7).
        velocity: [dp, w] in world axes, shape (N, 6) [m/s, rad/s].
        acceleration: [ddp, dw] in world axes, shape (N, 6) [m/s^2, rad/s^2].
    """

    t: Array
    pose: Array
    velocity: Array
    acceleration: Array


def _vector(where: str, field: str, value: Any) -> tuple[float, float, float]:
    array = np.asarray(value, dtype=float)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise ScenarioError(where, field, f"is {value!r}", "give three finite numbers")
    return (float(array[0]), float(array[1]), float(array[2]))


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
        for field in ("position", "euler_deg"):
            object.__setattr__(self, field, _vector("step", field, getattr(self, field)))
        if not (np.isfinite(self.at) and self.at >= 0.0):
            raise ScenarioError("step", "at", f"is {self.at!r}", "give seconds, 0 or later")

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
        times = np.asarray(self.times, dtype=float)
        if times.ndim != 1 or times.size == 0 or not np.all(np.isfinite(times)):
            raise ScenarioError("waypoints", "times", "is empty or not finite", "give seconds")
        if times[0] < 0 or np.any(np.diff(times) <= 0):
            raise ScenarioError("waypoints", "times", "does not ascend from 0 on", "sort them")
        object.__setattr__(self, "times", tuple(float(x) for x in times))
        for field in ("positions", "euler_deg"):
            rows = getattr(self, field)
            if len(rows) != times.size:
                raise ScenarioError(
                    "waypoints", field, f"has {len(rows)} rows", f"give {times.size}, one a time"
                )
            rows = tuple(_vector("waypoints", f"{field}[{i}]", r) for i, r in enumerate(rows))
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
        for field in ("center", "euler_deg"):
            object.__setattr__(self, field, _vector("circle", field, getattr(self, field)))
        for field in ("radius", "period"):
            if not 0.0 < getattr(self, field) < np.inf:
                raise ScenarioError(
                    "circle", field, f"is {getattr(self, field)!r}", "give a number above 0"
                )

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


Reference = Step | Waypoints | Circle

KINDS: dict[str, type[Reference]] = {c.kind: c for c in (Step, Waypoints, Circle)}


def from_dict(cls_by_kind: dict[str, Any], what: str, data: dict[str, Any]) -> Any:
    """Build one of several dataclasses from {"kind": ..., fields}; the inverse of `to_dict`.

    Raises:
        UnknownName: No such kind; the message lists the known ones.
        ScenarioError: A field that the kind does not have, or one that is missing.
    """
    values = dict(data)
    kind = values.pop("kind", "")
    if kind not in cls_by_kind:
        raise UnknownName(f"kind of {what}", str(kind), cls_by_kind)
    cls = cls_by_kind[kind]
    known = [f.name for f in fields(cls)]
    for key in values:
        if key not in known:
            raise ScenarioError(
                f"{what} '{kind}'", key, "is no field of it", f"it has {', '.join(known)}"
            )
    try:
        return cls(**values)
    except TypeError as error:
        raise ScenarioError(f"{what} '{kind}'", "fields", str(error), "give all of them") from error


def to_dict(value: Any) -> dict[str, Any]:
    """{"kind": ..., fields} of one of the reference or arm-motion dataclasses."""
    return {"kind": value.kind, **{f.name: getattr(value, f.name) for f in fields(value)}}


def tabulate(reference: Reference, t: Array, initial_pose: Array) -> ReferenceTable:
    """Tabulate and check a reference.

    Raises:
        ScenarioError: Some entry is NaN or infinite; the message says which, and when.
    """
    table = reference.tabulate(t, initial_pose)
    for field in ("pose", "velocity", "acceleration"):
        bad = np.argwhere(~np.isfinite(getattr(table, field)))
        if bad.size:
            row, column = bad[0]
            raise ScenarioError(
                f"reference '{reference.kind}'",
                f"{field}[{column}] at t = {t[row]:g} s",
                "is not finite",
                "a reference gives a finite pose, velocity and acceleration at every time",
            )
    return table


def blend_jumps(
    table: ReferenceTable,
    start_pose: Array,
    max_acceleration: float | None,
    max_angular_acceleration: float | None,
) -> ReferenceTable:
    """Spread the jumps of a reference over minimum-jerk profiles of bounded acceleration.

    A jump by delta at t_j (from `start_pose` at the first row) is undone and led in again:
    p(t) = p_ref(t) - delta (1 - s(x)), R(t) = exp(-(1 - s(x)) phi) R_ref(t), with
    s = 10 x^3 - 15 x^4 + 6 x^5, x = (t - t_j) / T and T such that the peak acceleration
    10/sqrt(3) |delta| / T^2 meets the limit. Position and attitude share the longer T, so that all
    six axes arrive together. What is smooth in the reference passes unchanged.

    Args:
        table: The reference, rows evenly spaced.
        start_pose: Pose from which the first row is a jump, shape (7,).
        max_acceleration: Peak linear acceleration of a blend [m/s^2]; None for no limit.
        max_angular_acceleration: Peak angular acceleration [rad/s^2]; None for no limit.

    Returns:
        A table on the same grid; the table itself if both limits are None.
    """
    if max_acceleration is None and max_angular_acceleration is None:
        return table
    t, pose = table.t, table.pose.copy()
    velocity, acceleration = table.velocity.copy(), table.acceleration.copy()
    before = np.vstack([start_pose, table.pose[:-1]])
    # What a smooth reference moves within one row, to first order, is not a jump.
    dt = np.diff(t, prepend=t[0])[:, None]
    travel = np.vstack([table.velocity[:1], table.velocity[:-1]]) * dt
    delta = table.pose[:, :3] - before[:, :3] - travel[:, :3]
    turn = (
        Rotation.from_quat(table.pose[:, 3:]) * Rotation.from_quat(before[:, 3:]).inv()
    ).as_rotvec() - travel[:, 3:]
    slack = 1e-6 + np.linalg.norm(acceleration, axis=1) * dt[:, 0] ** 2
    jumps = np.linalg.norm(delta, axis=1) + np.linalg.norm(turn, axis=1) > slack
    # Last to first: an earlier blend that is still under way turns the later one with it.
    for j in np.flatnonzero(jumps)[::-1]:
        distance, angle = np.linalg.norm(delta[j]), np.linalg.norm(turn[j])
        T = max(
            np.sqrt(PEAK_ACCELERATION * distance / (max_acceleration or np.inf)),
            np.sqrt(PEAK_ACCELERATION * angle / (max_angular_acceleration or np.inf)),
        )
        if T <= 0.0:
            continue
        x = np.clip((t[j:] - t[j]) / T, 0.0, 1.0)[:, None]
        left = 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        rate = 30.0 * x**2 * (1.0 - x) ** 2 / T
        curve = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / T**2
        undo = Rotation.from_rotvec(-left * turn[j])
        spin, inner = rate * turn[j], undo.apply(velocity[j:, 3:])
        pose[j:, :3] -= left * delta[j]
        pose[j:, 3:] = (undo * Rotation.from_quat(pose[j:, 3:])).as_quat()
        velocity[j:, :3] += rate * delta[j]
        acceleration[j:, :3] += curve * delta[j]
        acceleration[j:, 3:] = (
            curve * turn[j] + undo.apply(acceleration[j:, 3:]) + np.cross(spin, inner)
        )
        velocity[j:, 3:] = spin + inner
    return ReferenceTable(t, pose, velocity, acceleration)
