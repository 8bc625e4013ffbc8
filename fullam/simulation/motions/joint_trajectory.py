"""Smooth motions of the arm through joint positions at given times."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.checks import Checker, shown
from fullam.exceptions import ScenarioError
from fullam.model.joints import SLACK, ArmJoints
from fullam.simulation.motions.arm_table import ArmTable
from fullam.simulation.motions.given_rows import listed, tuples
from fullam.simulation.motions.motion_csv import PLATFORM, Columns, read_columns
from fullam.simulation.motions.spline_motion import GivenRows, SplineMotion

Array = NDArray[np.float64]

CHECK = Checker("arm motion", ScenarioError)

FAR = 1e5
"""What makes sense for a joint position [deg or m]."""


@dataclass(frozen=True)
class JointTrajectory(SplineMotion):
    """A smooth motion of joints; before and after it the arm stands.

    Positions are typed as those of a scenario's start: degrees of a revolute joint, METRES of a
    prismatic one. A joint that is not named stays where it starts. `from_csv`, `from_arrays`,
    `minimum_snap` and `b_spline` make one.

    Attributes:
        times: When the arm is where [s], ascending, at least two.
        positions_deg: One row a time, a number a joint [deg, or m of a prismatic joint].
        joints: Names of the joints, as the URDF has them or "joint_N" for the N-th; empty: all of
            the arm, base to tip.
        velocities_deg: One row a time [deg/s or m/s], which they then have, as piecewise quintics
            whatever `degree` and `ends`; empty: what the spline gives.
        units: "deg" or "m" for each joint, to be compared with the arm that flies; empty: what it
            has.
        degree: Of the spline, 3, 5 or 7; its derivatives are continuous but for the last.
        ends: "rest" if it begins and ends at rest, "free" if the data say how.
        at: Time of the flight at which it starts [s].
    """

    kind: ClassVar[str] = "joint-trajectory"
    GIVEN = GivenRows(CHECK, "positions_deg", "velocities_deg", "waypoints_deg", FAR, each=True)
    times: tuple[float, ...]
    positions_deg: tuple[tuple[float, ...], ...]
    joints: tuple[str, ...] = ()
    velocities_deg: tuple[tuple[float, ...], ...] = ()
    units: tuple[str, ...] = ()
    degree: int = 3
    ends: str = "free"
    at: float = 0.0

    def __post_init__(self) -> None:
        """Check lengths, order and numbers."""
        self._take_times()
        rows = listed("positions_deg", self.positions_deg, CHECK)
        is_nested = isinstance(rows, list | tuple) and rows and isinstance(rows[0], list | tuple)
        width = len(rows[0]) if is_nested else 1
        if not width:
            raise CHECK.refuse("positions_deg", "has no joint", "give a column for each that moves")
        self._take_rows(width)
        for name, choices in (("joints", ()), ("units", ("deg", "m"))):
            self._set(name, self._texts(name, width, choices))
        self._take_choices()

    def _texts(self, name: str, width: int, choices: tuple[str, ...]) -> tuple[str, ...]:
        texts = getattr(self, name)
        if not isinstance(texts, list | tuple) or len(texts) not in (0, width):
            raise CHECK.refuse(name, f"is {shown(texts)}", f"give {width} of them, or none")
        for text in texts:
            CHECK.text(name, text)
            if choices and text not in choices:
                raise CHECK.refuse(name, f"has {shown(text)}", f"choose from {', '.join(choices)}")
        if not choices and len(set(texts)) < len(texts):
            raise CHECK.refuse(name, f"are {shown(texts)}", "give each joint once")
        return tuple(texts)

    @classmethod
    def from_csv(
        cls, path: str | Path, degree: int = 3, ends: str = "free", at: float = 0.0
    ) -> JointTrajectory:
        """The motion that a CSV file tells.

        A column t, and one a joint, by its name in the URDF or "joint_N", with its unit: "joint_1
        [deg]", "joint_4_m", "elbow_rad"; without one, degrees of a revolute joint and metres of a
        prismatic one. Columns of the platform (x, y, z, qx, ...) are left to
        `Trajectory.from_csv`.

        Args:
            path: The file; see `motion_csv.read_columns` for its form.
            degree: As the attribute.
            ends: As the attribute.
            at: As the attribute.

        Raises:
            ScenarioError: What is wrong, with the line of the file.
        """
        columns = read_columns(path)
        times = columns.times()
        joints = tuple(name for name in columns.names if name not in ("t", *PLATFORM))
        if not joints:
            raise columns.check.refuse("header", "names no joint", "name one 'joint_1 [deg]'")
        parts = [_column(columns, name) for name in joints]
        units = tuple(unit for unit, _ in parts)
        stated = all(units)
        if not stated and any(units):
            without = joints[units.index("")]
            problem = f"joint '{without}' has no unit, and others have"
            raise columns.check.refuse("header", problem, f"name it '{without} [deg]', or [m]")
        try:
            return cls(
                tuple(times.tolist()),
                tuples(np.stack([values for _, values in parts], axis=1)),
                joints,
                units=units if stated else (),
                degree=degree,
                ends=ends,
                at=at,
            )
        except ScenarioError as error:
            raise columns.placed(error) from error

    @classmethod
    def from_arrays(
        cls,
        t: ArrayLike,
        positions_deg: ArrayLike,
        joints: tuple[str, ...] = (),
        velocities_deg: ArrayLike = (),
        **choices: Any,
    ) -> JointTrajectory:
        """The motion through rows of arrays.

        Args:
            t: Times, shape (N,) [s].
            positions_deg: Shape (N, joints) [deg, or m of a prismatic joint].
            joints: As the attribute.
            velocities_deg: Shape (N, joints) [deg/s or m/s], if they are known.
            **choices: `units`, `degree`, `ends` and `at`, as the attributes.

        Raises:
            ScenarioError: What is wrong, with the row.
        """
        given = {"times": t, "positions_deg": positions_deg, "velocities_deg": velocities_deg}
        lists: dict[str, Any] = {name: listed(name, rows, CHECK) for name, rows in given.items()}
        return cls(joints=joints, **lists, **choices)

    @classmethod
    def minimum_snap(
        cls,
        waypoints_deg: ArrayLike,
        times: ArrayLike | None = None,
        speed_deg: float | None = None,
        joints: tuple[str, ...] = (),
        at: float = 0.0,
    ) -> JointTrajectory:
        """The motion from rest to rest through joint positions with the least snap squared.

        Args:
            waypoints_deg: Shape (N, joints) [deg, or m of a prismatic joint].
            times: When they are passed, shape (N,) [s]; or
            speed_deg: Largest speed of any joint [deg/s, or m/s]; the times follow.
            joints: As the attribute.
            at: Time of the flight at which it starts [s].

        Raises:
            ScenarioError: What is wrong, with the row.
        """
        return cls._through(waypoints_deg, times, speed_deg, 7, at, joints=joints)

    @classmethod
    def b_spline(
        cls,
        waypoints_deg: ArrayLike,
        times: ArrayLike | None = None,
        speed_deg: float | None = None,
        joints: tuple[str, ...] = (),
        degree: int = 5,
        at: float = 0.0,
    ) -> JointTrajectory:
        """The B-spline from rest to rest through joint positions.

        Args:
            waypoints_deg: Shape (N, joints) [deg, or m of a prismatic joint].
            times: When they are passed, shape (N,) [s]; or
            speed_deg: Largest speed of any joint [deg/s, or m/s]; the times follow.
            joints: As the attribute.
            degree: Of the spline; 3 does not begin with acceleration 0.
            at: Time of the flight at which it starts [s].

        Raises:
            ScenarioError: What is wrong, with the row.
        """
        return cls._through(waypoints_deg, times, speed_deg, degree, at, joints=joints)

    def start(self, joints: ArmJoints) -> Array:
        """Where the arm has to stand before it, shape (n,) [rad or m]; at rest where not named."""
        start = joints.rest.copy()
        columns = self._columns(joints)
        typed = joints.to_typed(start)
        typed[columns] = self.positions_deg[0]
        return joints.from_typed(typed)

    def tabulate(self, t: Array, initial: Array, joints: ArmJoints) -> ArmTable:
        """The motion on the grid t [s], from the initial positions [rad or m].

        Args:
            t: Times, shape (N,) [s].
            initial: Positions at the start, shape (n,) [rad or m].
            joints: The arm's joints.

        Raises:
            ScenarioError: It does not fit the arm, or begins elsewhere than the arm does.
        """
        columns = self._columns(joints)
        typed = joints.to_typed(initial)
        for j, first in zip(columns, self.positions_deg[0], strict=True):
            if abs(joints.from_typed(_only(typed, j, first))[j] - initial[j]) > SLACK:
                unit = joints.units[j]
                raise CHECK.refuse(
                    f"joint '{joints.names[j]}' at t = {self.times[0] + self.at:g} s",
                    f"is to be at {first:g} {unit}, and the arm starts at {typed[j]:.6g} {unit}",
                    "start there (initial_arm_deg), or leave initial_arm_deg out",
                )
        parts = []
        for order, values in enumerate(self._curve().at(t - self.at)):
            full = np.zeros((t.size, initial.size)) + (typed if order == 0 else 0.0)
            full[:, columns] = values
            parts.append(joints.from_typed(full))
        return ArmTable(*parts)

    def _columns(self, joints: ArmJoints) -> list[int]:
        """Which joints of an arm are moved."""
        names, width = joints.names, len(self.positions_deg[0])
        if not self.joints and width != len(names):
            problem = f"has {width} columns"
            raise CHECK.refuse("positions_deg", problem, f"the arm has {len(names)} joints")
        columns = []
        for joint in self.joints or names:
            numbered = {f"joint_{k + 1}": k for k in range(len(names))}
            found = numbered | {name: k for k, name in enumerate(names)}
            if joint not in found:
                known = ", ".join(names)
                raise CHECK.refuse("joints", f"the arm has no '{joint}'", f"it has {known}")
            columns.append(found[joint])
        for k, unit in zip(columns, self.units, strict=False):
            if unit != joints.units[k]:
                problem = f"is given in {unit}, and is measured in {joints.units[k]}"
                raise CHECK.refuse(f"joint '{names[k]}'", problem, "give it in that")
        return columns


def _only(typed: Array, j: int, value: float) -> Array:
    """Positions with another one of joint j."""
    changed = np.array(typed)
    changed[j] = value
    return changed


def _column(columns: Columns, name: str) -> tuple[str, Array]:
    """Unit ("deg", "m", or "" if none is stated) and values of a joint."""
    unit = columns.units[columns.names.index(name)]
    if not unit:
        return "", columns.values[:, columns.names.index(name)]
    measures = "length" if unit in ("m", "cm", "mm") else "angle"
    return "m" if measures == "length" else "deg", columns.read((name,), measures)[:, 0]
