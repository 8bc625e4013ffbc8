"""Rows of numbers that a person or a program gives for a motion, checked and made into tuples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, from_zero, positive, shown, within
from fullam.simulation.motions.curves import DEGREES, ENDS, timed
from fullam.simulation.motions.motion_csv import MOST_ROWS

Array = NDArray[np.float64]

LATE, FAST = 1e6, 1e6
"""What makes sense for a time [s] and a speed, per second."""


def checked_times(times: Any, check: Checker) -> tuple[float, ...]:
    """Ascending times from 0 on, at least two [s].

    Raises:
        InvalidInput: They are not.
    """
    times = check.vector("times", times, None, from_zero(LATE, "s"))
    if not 2 <= len(times) <= MOST_ROWS:
        raise check.refuse("times", f"has {len(times)} entries", f"give 2 to {MOST_ROWS}")
    for i in np.flatnonzero(np.diff(times) <= 0.0)[:1]:
        problem = f"is {times[i + 1]:g} s after {times[i]:g} s"
        raise check.refuse(f"times[{i + 1}]", problem, "times ascend")
    return times


def check_spline(degree: Any, ends: Any, check: Checker) -> None:
    """Refuse a degree or a kind of ends that no spline has."""
    if not isinstance(degree, int) or degree not in DEGREES:
        raise check.refuse("degree", f"is {shown(degree)}", f"choose from {DEGREES}")
    if not isinstance(ends, str) or ends not in ENDS:
        raise check.refuse("ends", f"is {shown(ends)}", f"choose from {ENDS}")


def times_of(
    waypoints: Array, times: Any, speed: Any, degree: int, check: Checker, largest: bool = False
) -> Any:
    """Times of waypoints: those given, or those that a largest speed calls for."""
    if (times is None) == (speed is None):
        given = "neither" if times is None else "both"
        raise check.refuse("times, speed", f"{given} of them given", "give one of the two")
    if times is not None:
        return listed("times", times, check)
    speed = check.number("speed", speed, positive(FAST, "per second"))
    return tuple(timed(waypoints, speed, degree, check, largest).tolist())


def waypoints_of(
    field: str, rows: Any, width: int | None, size: float, check: Checker
) -> list[Any]:
    """Two rows or more of equally many numbers."""
    rows = listed(field, rows, check)
    if not isinstance(rows, list | tuple) or not 2 <= len(rows) <= MOST_ROWS:
        raise check.refuse(field, f"is {shown(rows)}", f"give 2 to {MOST_ROWS} rows")
    if width is None:
        width = len(rows[0]) if isinstance(rows[0], list | tuple) else 1
    return [check.vector(f"{field}[{i}]", row, width, within(size)) for i, row in enumerate(rows)]


def is_empty(rows: Any) -> bool:
    """Whether there is nothing in a list or an array."""
    if isinstance(rows, np.ndarray):
        return not rows.size
    return isinstance(rows, list | tuple) and not rows


def rows_of(field: str, rows: Any, shape: tuple[int, int], size: float, check: Checker) -> Array:
    """Numbers of a shape, none beyond a size."""
    array = check.array(field, rows, shape)
    for i, j in np.argwhere(np.abs(array) > size)[:1]:
        raise check.refuse(f"{field}[{i}][{j}]", f"is {array[i, j]:g}", f"at most {size:g}")
    return array


def listed(field: str, rows: Any, check: Checker) -> Any:
    """Lists of what an array holds; whatever is no array stays, for the checks to see."""
    if isinstance(rows, np.ndarray) and rows.dtype.kind not in "iuf":
        raise check.refuse(field, f"is of type {rows.dtype}", "give numbers")
    return rows.tolist() if hasattr(rows, "tolist") else rows


def tuples(rows: Array) -> Any:
    """Rows as tuples, which compare and go into JSON."""
    return tuple(map(tuple, rows.tolist())) if rows.ndim == 2 else tuple(rows.tolist())
