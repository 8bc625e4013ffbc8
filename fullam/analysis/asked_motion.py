"""What a scenario asks of a flight: coordinates, increments, and the last jump among them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.deviation import asked_rows, coordinates, deviations
from fullam.numbers.records import Rows
from fullam.simulation.motions.jumps import last_jump

Array = NDArray[np.float64]

STEP_MINIMUM = (10.0, 1.0)
"""A jump below this is no step: 2 % of it would be 0.2 mm or 0.02 deg [mm, deg]."""


@dataclass(frozen=True, eq=False)
class AskedMotion:
    """What a scenario asks of a flight, and the last jump in it.

    Attributes:
        t: Control grid [s], shape (N,).
        pose: Poses asked for, shape (N, 7).
        coordinates: [position [mm], Euler angles [deg]] of them, shape (N, 6).
        change: Their increments, row k from row k-1 to k, shape (N, 6) [mm, deg].
    """

    t: Array
    pose: Array
    coordinates: Array
    change: Array

    @classmethod
    def of(cls, t: Array, pose: Array, initial_pose: Array) -> AskedMotion:
        """From the poses asked for.

        Args:
            t: Control grid [s], shape (N,), N > 0.
            pose: [p, quaternion xyzw], shape (N, 7).
            initial_pose: Where the vehicle starts; there the reference stood before the first row.
        """
        earlier = np.vstack([initial_pose, pose])
        where = coordinates(earlier)
        change = deviations(pose, asked_rows(where[:-1], earlier[:-1]))[:, :6]
        return cls(t, pose, where[1:], change)

    def until(self, rows: int) -> AskedMotion:
        """The part that a flight of that many rows has seen."""
        return AskedMotion(*(a[:rows] for a in (self.t, self.pose, self.coordinates, self.change)))

    @cached_property
    def start(self) -> int:
        """Row of the last jump; 0 if there is none."""
        return last_jump(self.change)

    @property
    def since(self) -> Array:
        """Times from the jump on [s], shape (N - start,)."""
        return self.t[self.start :] - self.t[self.start]

    @cached_property
    def step(self) -> Array:
        """The jump, shape (6,) [mm, deg]; 0 where it is no step."""
        jump = self.change[self.start]
        return np.where(np.abs(jump) > np.repeat(STEP_MINIMUM, 3), jump, 0.0)

    @property
    def setpoint(self) -> Array:
        """Coordinates at the end, shape (6,) [mm, deg]."""
        return self.coordinates[-1]

    @property
    def period(self) -> float:
        """Control period [s]; 0 if there is one row only."""
        return float(self.t[1] - self.t[0]) if len(self.t) > 1 else 0.0

    def rows(self) -> Rows:
        """What was asked from the jump on, for kernels."""
        return asked_rows(self.coordinates[self.start :], self.pose[self.start :])
