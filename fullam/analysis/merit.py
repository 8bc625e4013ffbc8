"""What a rotor layout is worth: the figures that a design is judged by, fast enough to search."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.analysis.atlas.hover import least_total_thrust
from fullam.analysis.atlas.loads import Load, load_of
from fullam.analysis.atlas.rays import margin, multiples
from fullam.analysis.atlas.tilt import attitude_bounds, worst_tilt
from fullam.exceptions import UnknownName
from fullam.model.attainable.facets import Facets, facets_of_columns
from fullam.model.rotors import coupling_matrix
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

OBJECTIVES = ("worst-tilt", "level-force", "failure-tilt", "failure-margin", "efficiency")
"""What a search can raise: tilt towards anywhere [deg], force towards anywhere while level over the
weight, the same tilt with any one rotor stopped [deg], the margin then over the weight, and the
weight over the least sum of thrusts that hold it."""

FALLS = -100.0
"""A tilt or margin where the vehicle cannot hover counts as this, less how far it is from it."""


@dataclass(frozen=True)
class Merit:
    """The figures of one layout; NaN for what was not asked for.

    Attributes:
        worst_tilt: Towards anywhere [deg].
        level_force: Towards anywhere while level, over the weight.
        failure_tilt: The worst tilt with any one rotor stopped [deg].
        failure_margin: The least margin with any one rotor stopped, over the weight.
        efficiency: Weight over the least sum of thrusts that hold it level.
        reserve: Largest multiple of the hover wrench within reach: thrust to weight.
    """

    worst_tilt: float
    level_force: float
    failure_tilt: float
    failure_margin: float
    efficiency: float
    reserve: float

    def of(self, objective: str) -> float:
        """The figure of that name, one of `OBJECTIVES`.

        Raises:
            UnknownName: If it is none of them.
        """
        if objective not in OBJECTIVES:
            raise UnknownName("objective", objective, OBJECTIVES)
        return float(getattr(self, objective.replace("-", "_")))

    def to_dict(self) -> dict[str, Any]:
        """Under their names."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Judge:
    """Judges layouts of rotors of one kind under one load.

    Attributes:
        load: What they hold.
        spins: Shape (n,).
        k_f: Shape (n,) [N/(rad/s)^2].
        k_tau: Shape (n,) [N m/(rad/s)^2].
        squares: Largest squared speeds, shape (n,) [(rad/s)^2].
        least: Least squared speeds over them, shape (n,).
    """

    load: Load
    spins: Array
    k_f: Array
    k_tau: Array
    squares: Array
    least: Array

    @classmethod
    def of(cls, vehicle: Vehicle, arm: ArrayLike | None = None) -> Judge:
        """For the rotors and the weight of a vehicle.

        Args:
            vehicle: The vehicle.
            arm: Its arm pose [rad], whose centre of mass counts; None puts it at the origin of {A}.
        """
        load, rotors = load_of(vehicle, arm), vehicle.rotors
        if arm is None:
            load = Load(load.mass, load.gravity, np.zeros(3), load.inertia, load.tool, load.extra)
        squares = np.square(rotors.max_speeds)
        return cls(load, rotors.spins, rotors.k_f, rotors.k_tau, squares, rotors.least_shares)

    def merit(self, positions: Array, axes: Array, asked: tuple[str, ...] = OBJECTIVES) -> Merit:
        """Figures of a layout.

        Args:
            positions: Hubs in {A}, shape (n, 3) [m].
            axes: Thrust axes, shape (n, 3), unit.
            asked: The objectives that count; single failures take n times as long as the rest.
        """
        matrix = coupling_matrix(positions, axes, self.spins, self.k_f, self.k_tau) * self.squares
        lengths = [np.linalg.norm(matrix[rows], axis=0).sum() for rows in (slice(3), slice(3, 6))]
        scale = np.repeat(np.where(np.array(lengths) > 0.0, lengths, 1.0), 3)
        facets = facets_of_columns(matrix, self.least.copy(), scale)
        wrench = self.load.wrench()
        lift = multiples(facets, wrench)
        reserve = 0.0 if lift is None else lift[1]
        length = float(np.linalg.norm(positions, axis=1).mean())
        tilt, force, efficiency = (float("nan"),) * 3
        if "worst-tilt" in asked:
            tilt = self._tilt(facets, length)
        if "level-force" in asked:
            force = self._level_force(facets)
        if "efficiency" in asked:
            least = None
            if reserve >= 1.0:
                least = least_total_thrust(facets, self.squares * self.k_f, wrench)
            efficiency = 0.0 if least is None else self.load.weight / least
        failing = [name for name in ("failure-tilt", "failure-margin") if name in asked]
        after = self._failures(matrix, scale, length) if failing else (float("nan"),) * 2
        return Merit(tilt, force, *after, efficiency, reserve)

    def _tilt(self, facets: Facets, length: float) -> float:
        found = worst_tilt(attitude_bounds(facets, self.load))
        if found is not None:
            return float(np.rad2deg(found[0]))
        return FALLS + min(self._margin(facets, length), 0.0)

    def _level_force(self, facets: Facets) -> float:
        along = facets.normals[:, :2] + np.cross(facets.normals[:, 3:], self.load.center)[:, :2]
        size = np.linalg.norm(along, axis=1)
        slack = facets.slacks(self.load.wrench())
        if facets.rank < 6 or slack.min(initial=0.0) < 0.0:
            return min(self._margin(facets, 1.0), 0.0)
        steps = np.divide(slack, size, out=np.full(len(size), np.inf), where=size > 1e-12)
        return float(steps.min()) / self.load.weight

    def _margin(self, facets: Facets, length: float) -> float:
        return margin(facets, self.load.wrench(), length).value / self.load.weight

    def _failures(self, matrix: Array, scale: Array, length: float) -> tuple[float, float]:
        tilts, margins = [], []
        for k in range(matrix.shape[1]):
            left, least = matrix.copy(), self.least.copy()
            left[:, k], least[k] = 0.0, 0.0
            facets = facets_of_columns(left, least, scale)
            tilts.append(self._tilt(facets, length))
            margins.append(self._margin(facets, length))
        return min(tilts), min(margins)
