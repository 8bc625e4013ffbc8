"""Smooth motions of the platform through poses at given times.

Positions go along a spline. Attitudes do too: s(t) is the spline through the unit quaternions, of
one sign from each to the next, and the attitude is q = s / |s|. So both are differentiable as
often as the spline, and the derivatives are exact: with s' s* and s'' s* products of quaternions,

    w = 2 vec(s' s*) / |s|^2,    dw = 2 vec(s'' s*) / |s|^2 - 2 (s . s') / |s|^2 w

in world axes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.checks import Checker
from fullam.dynamics import quaternions as quaternion
from fullam.dynamics.pose_space import IDENTITY
from fullam.exceptions import ScenarioError
from fullam.simulation.motions.curves import spline
from fullam.simulation.motions.given_rows import is_empty, listed, rows_of, tuples
from fullam.simulation.motions.motion_csv import PLATFORM, Columns, read_columns
from fullam.simulation.motions.reference_table import ReferenceTable
from fullam.simulation.motions.spline_motion import GivenRows, SplineMotion

Array = NDArray[np.float64]

CHECK = Checker("trajectory", ScenarioError)

FAR, TURNED = 1e6, 1e5
"""What makes sense for a coordinate [m] and for an angle [deg]."""

WIDEST_TURN = 175.0
"""Attitudes that follow each other are nearer than this [deg]: at 180 nobody knows which way."""

NARROWEST = 0.1
"""Least |s| of a curve through unit quaternions; nearer to 0 the attitude is a matter of chance."""

NOT_A_UNIT = 1e-3
"""How far a quaternion that is typed may be from unit length; it is normalised."""


@dataclass(frozen=True)
class Trajectory(SplineMotion):
    """A smooth motion through poses at given times; before and after it the platform stands.

    `from_csv`, `from_arrays`, `minimum_snap` and `b_spline` make one.

    Attributes:
        times: When it is where [s], ascending, at least two.
        positions: One position a time [m].
        quaternions: One attitude a time, unit quaternions xyzw; empty: level all the way.
        velocities: One velocity a time [m/s], which the positions then have, as piecewise quintics
            whatever `degree` and `ends`; empty: what the spline gives.
        degree: Of the spline, 3, 5 or 7; its derivatives are continuous but for the last.
        ends: "rest" if it begins and ends at rest, "free" if the data say how.
        at: Time of the flight at which it starts [s].
    """

    kind: ClassVar[str] = "trajectory"
    GIVEN = GivenRows(CHECK, "positions", "velocities", "waypoints", FAR, width=3)
    times: tuple[float, ...]
    positions: tuple[tuple[float, ...], ...]
    quaternions: tuple[tuple[float, ...], ...] = ()
    velocities: tuple[tuple[float, ...], ...] = ()
    degree: int = 3
    ends: str = "free"
    at: float = 0.0

    def __post_init__(self) -> None:
        """Check lengths, order and numbers; quaternions become unit ones of one sign."""
        self._take_times()
        self._take_rows(3)
        attitudes: Any = ()
        if not is_empty(self.quaternions):
            rows = rows_of("quaternions", self.quaternions, (len(self.times), 4), 2.0, CHECK)
            attitudes = tuples(_unit(rows))
        self._set("quaternions", attitudes)
        self._take_choices()

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        degree: int = 3,
        ends: str = "free",
        at: float = 0.0,
        with_arm: bool = False,
    ) -> Trajectory:
        """The motion that a CSV file tells.

        Columns t, x, y, z; for attitudes either qx, qy, qz, qw or the x-y-z Euler angles phi,
        psi, gamma; for velocities vx, vy, vz. The header states units, "x [mm]" or "x_mm"; times,
        lengths and speeds without one are in s, m and m/s, and angles state theirs. Columns that
        begin with "joint" are the arm's (`JointTrajectory.from_csv` reads them).

        Args:
            path: The file; see `motion_csv.read_columns` for its form.
            degree: As the attribute.
            ends: As the attribute.
            at: As the attribute.
            with_arm: Whether all further columns are joints of the arm, whatever their names; so it
                is by itself where a scenario's file reads both motions from one CSV file.

        Raises:
            ScenarioError: What is wrong, with the line of the file.
        """
        columns = read_columns(path)
        for name in columns.names:
            if not (with_arm or name in ("t", *PLATFORM) or name.startswith("joint")):
                known = ", ".join(("t", *PLATFORM))
                raise columns.check.refuse(
                    "header",
                    f"'{name}' is no column of the platform",
                    f"if it is a joint of the arm, say with_arm = true; else it has {known}",
                )
        given = {"times": columns.times()}
        if not columns.has(("x", "y", "z")):
            raise columns.check.refuse("header", "has no position", "give x, y and z")
        given["positions"] = columns.read(("x", "y", "z"), "length")
        if columns.has(("vx", "vy", "vz")):
            given["velocities"] = columns.read(("vx", "vy", "vz"), "speed")
        try:
            return cls(
                **{name: tuples(rows) for name, rows in given.items()},
                quaternions=_attitudes(columns),
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
        position: ArrayLike,
        quaternion: ArrayLike | None = None,
        euler_deg: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        **choices: Any,
    ) -> Trajectory:
        """The motion through rows of arrays.

        Args:
            t: Times, shape (N,) [s].
            position: Shape (N, 3) [m].
            quaternion: Attitudes xyzw, shape (N, 4); or
            euler_deg: x-y-z Euler angles at each, shape (N, 3), or all the way, shape (3,) [deg];
                neither: level.
            velocity: Shape (N, 3) [m/s], if they are known.
            **choices: `degree`, `ends` and `at`, as the attributes.

        Raises:
            ScenarioError: What is wrong, with the row.
        """
        if quaternion is not None and euler_deg is not None:
            raise CHECK.refuse("attitude", "is given twice", "give quaternion or euler_deg")
        times, positions = listed("times", t, CHECK), listed("position", position, CHECK)
        rest = {"quaternions": quaternion, "velocities": velocity}
        lists = {name: listed(name, rows, CHECK) for name, rows in rest.items() if rows is not None}
        return cls(times, positions, **lists, **choices)._turned(euler_deg)

    @classmethod
    def minimum_snap(
        cls,
        waypoints: ArrayLike,
        times: ArrayLike | None = None,
        speed: float | None = None,
        euler_deg: ArrayLike | None = None,
        at: float = 0.0,
    ) -> Trajectory:
        """The motion from rest to rest through waypoints with the least integral of snap squared.

        It is a spline of degree 7, so even snap's second derivative is continuous but at the ends.

        Args:
            waypoints: Positions, shape (N, 3) [m].
            times: When they are passed, shape (N,) [s]; or
            speed: Largest speed on the way [m/s]; times then follow from the ways between them.
            euler_deg: x-y-z Euler angles at each, shape (N, 3), or all the way, shape (3,) [deg].
            at: Time of the flight at which it starts [s].

        Raises:
            ScenarioError: What is wrong, with the row.
        """
        return cls._through(waypoints, times, speed, 7, at)._turned(euler_deg)

    @classmethod
    def b_spline(
        cls,
        waypoints: ArrayLike,
        times: ArrayLike | None = None,
        speed: float | None = None,
        euler_deg: ArrayLike | None = None,
        degree: int = 5,
        at: float = 0.0,
    ) -> Trajectory:
        """The B-spline from rest to rest through waypoints; of degree 5 it has the least jerk.

        Args:
            waypoints: Positions, shape (N, 3) [m].
            times: When they are passed, shape (N,) [s]; or
            speed: Largest speed on the way [m/s]; times then follow from the ways between them.
            euler_deg: x-y-z Euler angles at each, shape (N, 3), or all the way, shape (3,) [deg].
            degree: Of the spline; 3 does not begin with acceleration 0.
            at: Time of the flight at which it starts [s].

        Raises:
            ScenarioError: What is wrong, with the row.
        """
        return cls._through(waypoints, times, speed, degree, at)._turned(euler_deg)

    def _turned(self, euler_deg: ArrayLike | None) -> Trajectory:
        """With attitudes by x-y-z Euler angles, one a time or one for all [deg]; None: level."""
        if euler_deg is None:
            return self
        count, angles = len(self.times), listed("euler_deg", euler_deg, CHECK)
        if isinstance(angles, list | tuple) and not any(np.ndim(a) for a in angles):
            angles = [CHECK.vector("euler_deg", angles)] * count
        return replace(self, quaternions=tuples(_from_euler(angles, count)))

    @property
    def final_pose(self) -> Array:
        """Where it ends, shape (7,)."""
        attitude = self.quaternions[-1] if self.quaternions else IDENTITY[3:]
        return np.array([*self.positions[-1], *attitude])

    def tabulate(self, t: Array, initial_pose: Array) -> ReferenceTable:
        """The reference on the grid t, shape (N,).

        Raises:
            ScenarioError: The times are too uneven for the degree, or neighbouring attitudes too
                far apart for one curve through them.
        """
        t = t - self.at
        p, dp, ddp = self._curve().at(t)
        if not self.quaternions:
            q, still = np.tile(IDENTITY[3:], (t.size, 1)), np.zeros((t.size, 3))
            w = dw = still
        else:
            times, rows = np.array(self.times), np.array(self.quaternions)
            turn = spline(times, rows, self.degree, self.ends, CHECK)
            q, w, dw = _attitude(*turn.at(t))
        return ReferenceTable(
            t + self.at, np.hstack([p, q]), np.hstack([dp, w]), np.hstack([ddp, dw])
        )


def _attitude(s: Array, ds: Array, dds: Array) -> tuple[Array, Array, Array]:
    """q, w, dw of a curve in quaternion space; see the module's docstring."""
    length = np.linalg.norm(s, axis=1, keepdims=True)
    if length.min(initial=1.0) < NARROWEST:
        raise CHECK.refuse(
            "attitude",
            "turns about half a round from one time to the next",
            "give attitudes in between",
        )
    square, back = np.square(length), quaternion.inverse(s)
    w = 2.0 * quaternion.product(ds, back)[:, :3] / square
    growth = np.sum(s * ds, axis=1, keepdims=True) / square
    dw = 2.0 * quaternion.product(dds, back)[:, :3] / square - 2.0 * growth * w
    return s / length, w, dw


def _unit(rows: Array) -> Array:
    """Unit quaternions, each of the sign that is nearer to the one before it."""
    lengths = np.linalg.norm(rows, axis=1, keepdims=True)
    for i in np.flatnonzero(np.abs(lengths - 1.0) > NOT_A_UNIT)[:1]:
        problem = f"has length {lengths[i, 0]:.4g}"
        raise CHECK.refuse(f"quaternions[{i}]", problem, "give unit quaternions (x, y, z, w)")
    rows = rows / lengths
    together = np.sum(rows[1:] * rows[:-1], axis=1)
    nearest = np.cos(np.radians(0.5 * WIDEST_TURN))
    for i in np.flatnonzero(np.abs(together) < nearest)[:1]:
        turned = np.degrees(2.0 * np.arccos(min(1.0, abs(together[i]))))
        problem = f"is turned by {turned:.0f} deg from the one before"
        raise CHECK.refuse(f"attitude [{i + 1}]", problem, "give one in between")
    signs = np.cumprod(np.concatenate([[1.0], np.where(together < 0.0, -1.0, 1.0)]))
    return np.asarray(rows * signs[:, None])


def _attitudes(columns: Columns) -> tuple[tuple[float, ...], ...]:
    """The attitudes of a file, if it has any."""
    wanted = {"number": ("qx", "qy", "qz", "qw"), "angle": ("phi", "psi", "gamma")}
    there = [measures for measures, names in wanted.items() if columns.has(names)]
    if len(there) > 1:
        problem = "has quaternions and Euler angles"
        raise columns.check.refuse("header", problem, "give one of them")
    if not there:
        return ()
    rows = columns.read(wanted[there[0]], there[0])
    if there[0] == "angle":
        return tuples(quaternion.from_euler(np.radians(rows)))
    return tuples(rows)


def _from_euler(angles: Any, count: int) -> Array:
    """Quaternions of x-y-z Euler angles [deg], one a time."""
    rows = rows_of("euler_deg", angles, (count, 3), TURNED, CHECK)
    return quaternion.from_euler(np.radians(rows))
