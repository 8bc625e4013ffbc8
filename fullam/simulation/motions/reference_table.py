"""What a reference is: any object that can tabulate itself on the control grid.

A reference is tabulated once before a flight, so the loop only reads rows, and a NaN or a
malformed table is found on the ground.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fullam.checks import shown
from fullam.exceptions import ScenarioError

Array = NDArray[np.float64]

WIDTHS = {"pose": 7, "velocity": 6, "acceleration": 6}
"""Columns of each part of a table."""

UNIT_LENGTH = 1e-6
"""How far a quaternion of a reference may be from unit length."""


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


class Reference(Protocol):
    """Where the platform should be: whoever has this method can be flown.

    A class of one's own needs nothing else. It is asked once, before take-off; its table goes into
    the record, which flies again without the class.
    """

    def tabulate(self, t: Array, initial_pose: Array) -> ReferenceTable:
        """The reference on the control grid.

        Args:
            t: Times [s], shape (N,), from 0 on in equal steps.
            initial_pose: Where the vehicle starts, [p, quaternion xyzw], shape (7,).

        Returns:
            The table. Velocity and acceleration are the derivatives of the pose; a pose that moves
            otherwise from one row to the next counts as a jump, which the scenario's shaping
            spreads.
        """
        ...


def name_of(motion: Any) -> str:
    """What messages call a motion: its kind, or the name of its class."""
    return str(getattr(motion, "kind", type(motion).__name__))


def tabulate(reference: Reference, t: Array, initial_pose: Array) -> ReferenceTable:
    """Tabulate and check a reference.

    Raises:
        ScenarioError: What it gives is no table on this grid, or some entry is NaN or infinite, or
            a quaternion is not of unit length; the message says which, and when.
    """
    where = f"reference '{name_of(reference)}'"
    table = reference.tabulate(t, initial_pose)
    for field, width in WIDTHS.items():
        rows = rows_in(where, table, field, (t.size, width))
        for row, column in np.argwhere(~np.isfinite(rows))[:1]:
            raise ScenarioError(
                where,
                f"{field}[{column}] at t = {t[row]:g} s",
                "is not finite",
                "a reference gives a finite pose, velocity and acceleration at every time",
            )
    lengths = np.linalg.norm(table.pose[:, 3:], axis=1)
    for row in np.flatnonzero(np.abs(lengths - 1.0) > UNIT_LENGTH)[:1]:
        raise ScenarioError(
            where,
            f"pose at t = {t[row]:g} s",
            f"has a quaternion of length {lengths[row]:.6g}",
            "give unit quaternions in the order x, y, z, w",
        )
    return ReferenceTable(t, *(np.asarray(getattr(table, field), float) for field in WIDTHS))


def rows_in(where: str, table: Any, field: str, shape: tuple[int, int]) -> Array:
    """A part of a table that somebody's class has made: numbers in an array of that shape.

    Raises:
        ScenarioError: It is something else.
    """
    rows = getattr(table, field, None)
    if not isinstance(rows, np.ndarray) or rows.shape != shape:
        raise ScenarioError(
            where,
            field,
            f"is {shown(getattr(rows, 'shape', rows))}",
            f"tabulate gives an array of shape {shape}",
        )
    if rows.dtype.kind not in "iuf":
        raise ScenarioError(where, field, f"is of type {rows.dtype}", "give real numbers")
    return rows
