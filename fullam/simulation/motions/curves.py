"""Smooth curves through rows of numbers, with the derivatives of the curve itself.

The splines are scipy's. A spline of degree 2 m - 1 whose first m - 1 derivatives vanish at both
ends is, among all curves through its rows that begin and end at rest, the one with the least
integral of the squared m-th derivative: degree 5 is minimum jerk, degree 7 minimum snap.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker

Array = NDArray[np.float64]

DEGREES = (3, 5, 7)
ENDS = ("rest", "free")

MOST_SWING = 10.0
"""By how much a spline may leave the rows it goes through, as a multiple of how far they lie apart:
more says that the times are too uneven for its degree."""

LOOKS = (0.25, 0.5, 0.75)
"""Where between two rows that is looked for."""

SAMPLES = 200
"""Looks at a curve between two rows, for its largest speed."""

LONGEST = 1e6
"""Nobody means a motion that takes longer [s]."""


@dataclass(frozen=True, eq=False)
class Curve:
    """x(t) and its derivatives; it stands before its first and behind its last time.

    Attributes:
        times: First and last time [s].
        piecewise: One of scipy's piecewise polynomials with values of shape (n,).
    """

    times: tuple[float, float]
    piecewise: Any

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """x, dx, ddx at times of shape (N,), each of shape (N, n)."""
        start, end = self.times
        inside = ((t >= start) & (t <= end))[:, None]
        clipped = np.clip(t, start, end)
        x, dx, ddx = (np.asarray(self.piecewise(clipped, nu=order)) for order in range(3))
        return x, np.where(inside, dx, 0.0), np.where(inside, ddx, 0.0)


def spline(times: Array, rows: Array, degree: int, ends: str, check: Checker) -> Curve:
    """The spline through rows.

    Args:
        times: Ascending, shape (N,), N > 1 [s].
        rows: What it goes through, shape (N, n).
        degree: 3, 5 or 7; all its derivatives but the last are continuous. Where free ends and
            few rows do not determine so much, it is N - 1.
        ends: "rest": velocity, and from degree 5 on acceleration, from degree 7 on jerk, are 0 at
            both ends. "free": the first and the last pieces are one polynomial each (not-a-knot).
        check: Raises what is wrong.

    Raises:
        InvalidInput: The times are too uneven for this degree.
    """
    from scipy.interpolate import make_interp_spline

    if ends == "rest":
        still = [(order, np.zeros(rows.shape[1])) for order in range(1, (degree + 1) // 2)]
        found = make_interp_spline(times, rows, k=degree, bc_type=(still, still))
    else:
        found = make_interp_spline(times, rows, k=min(degree, len(times) - 1))
    between = times[:-1] + np.outer(LOOKS, np.diff(times))
    span = max(np.ptp(rows, axis=0).max(), 1e-9)  # who stands still is rounded too
    away = np.abs(found(between.ravel()) - rows[0]).max()
    if away > (1.0 + MOST_SWING) * span:
        problem = (
            f"are so uneven that a spline of degree {degree} swings out {away / span:.3g} times"
        )
        raise check.refuse(
            "times", f"{problem} as far as they go", "space them evenly, or take a lower degree"
        )
    return _curve(times, found)


def hermite(times: Array, rows: Array, velocities: Array) -> Curve:
    """The piecewise quintic with these rows and velocities at the times; twice differentiable.

    Accelerations at the times are those of the cubic spline through the velocities.

    Args:
        times: Ascending, shape (N,), N > 1 [s].
        rows: Shape (N, n).
        velocities: Shape (N, n).
    """
    from scipy.interpolate import BPoly, make_interp_spline

    speed = make_interp_spline(times, velocities, k=min(3, len(times) - 1))
    at_times = np.stack([rows, velocities, speed.derivative()(times)], axis=1)
    return _curve(times, BPoly.from_derivatives(times, at_times))


def timed(
    waypoints: Array, speed: float, degree: int, check: Checker, largest: bool = False
) -> Array:
    """Times of waypoints, shape (N,) [s], at which their spline from rest to rest peaks at a speed.

    They are spaced as the ways between the waypoints are long.

    Args:
        waypoints: Shape (N, n).
        speed: Largest speed on the way, per second.
        degree: Of the spline.
        check: Raises what is wrong.
        largest: Take the largest of the n parts for a length, and not their Euclidean norm.

    Raises:
        InvalidInput: Two neighbouring waypoints are at one place, or it would take for ever.
    """
    order = np.inf if largest else 2
    ways = np.linalg.norm(np.diff(waypoints, axis=0), ord=order, axis=1)
    for i in np.flatnonzero(ways <= 0.0)[:1]:
        problem = f"[{i}] and [{i + 1}] are at one place"
        raise check.refuse("waypoints", problem, "leave one out, or give times and no speed")
    times = np.concatenate([[0.0], np.cumsum(ways)])
    looks = np.concatenate([np.linspace(a, b, SAMPLES) for a, b in pairwise(times)])
    _, velocity, _ = spline(times, waypoints, degree, "rest", check).at(looks)
    peak = np.linalg.norm(velocity, ord=order, axis=1).max()
    with np.errstate(over="ignore"):
        slower = peak / speed
        last = times[-1] * slower
    if not last <= LONGEST:
        problem = f"is {speed:g} per second, at which the way takes {last:g} s"
        raise check.refuse("speed", problem, f"arrive within {LONGEST:g} s")
    return np.asarray(times * slower)


def _curve(times: Array, found: Any) -> Curve:
    return Curve((float(times[0]), float(times[-1])), found)
