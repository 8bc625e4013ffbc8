"""What a vehicle can do in one arm pose: tilt, force, push, moment, acceleration, payload."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.analysis.atlas.hover import least_effort, least_total_thrust
from fullam.analysis.atlas.loads import Load, load_of
from fullam.analysis.atlas.rays import OUTSIDE, ROUNDING, Margin, margin, multiples, reach
from fullam.analysis.atlas.tilt import (
    AttitudeBounds,
    attitude_bounds,
    best_tilt,
    tilt_intervals,
    tilt_rose,
    worst_tilt,
)
from fullam.control.trim import HoverMargins
from fullam.model.attainable.facets import Facets, facets_of
from fullam.model.rotors import Rotors
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Envelope:
    """All that some rotors can do for one load; every figure is exact, none is sampled.

    Directions and wrenches are in the platform's frame {A}. Where a figure is NaN or None the
    vehicle cannot hover level in the first place.

    Attributes:
        rotors: The rotors.
        facets: Of what they attain.
        load: What they have to hold.
        length: What turns moments into forces in `margin` [m]: the mean distance of the hubs from
            the origin of {A}.
    """

    rotors: Rotors
    facets: Facets
    load: Load
    length: float

    @classmethod
    def of(
        cls,
        vehicle: Vehicle,
        theta: ArrayLike | None = None,
        payload: float = 0.0,
        tool_wrench: ArrayLike | None = None,
    ) -> Envelope:
        """Of a vehicle with its arm at `theta` (see `load_of` for the arguments and errors)."""
        load = load_of(vehicle, theta, payload, tool_wrench)
        return cls.from_rotors(vehicle.rotors, load)

    @classmethod
    def from_rotors(cls, rotors: Rotors, load: Load, facets: Facets | None = None) -> Envelope:
        """Of rotors and a load; `facets` if they are known already."""
        length = float(np.linalg.norm(rotors.positions, axis=1).mean()) or 1.0
        return cls(rotors, facets or facets_of(rotors), load, length)

    @cached_property
    def bounds(self) -> AttitudeBounds:
        """The facets as bounds of the up vector."""
        return attitude_bounds(self.facets, self.load)

    @property
    def can_hover(self) -> bool:
        """Whether the vehicle can hold itself level."""
        return self.bounds.level

    @cached_property
    def hover_wrench(self) -> Array:
        """Rotor wrench that holds it level, in {A}, shape (6,) [N, N m]."""
        return self.load.wrench()

    # Tilt.

    @cached_property
    def worst_tilt(self) -> tuple[float, float] | None:
        """Tilt that can be held towards every azimuth, and the azimuth that allows no more [rad].

        The first exit from level, the least over all azimuths; None if it cannot hover level.
        """
        found = worst_tilt(self.bounds)
        return None if found is None else found[:2]

    @cached_property
    def best_tilt(self) -> tuple[float, float] | None:
        """The largest first exit and its azimuth [rad]; None if it cannot hover level."""
        return best_tilt(self.bounds)

    def rose(self, azimuths: ArrayLike) -> Array:
        """First exit from level towards azimuths [rad], same shape [rad]; NaN without hover."""
        return tilt_rose(self.bounds, azimuths)[0]

    def intervals(self, azimuth: float) -> list[tuple[float, float]]:
        """All tilts towards an azimuth that can be held, as intervals [rad]."""
        return tilt_intervals(self.bounds, azimuth)

    # Forces and moments beside the weight, while level.

    def force(self, directions: ArrayLike) -> Array:
        """Largest force through the centre of mass without turning, beside holding the weight [N].

        Args:
            directions: Unit vectors, shape (..., 3).
        """
        return self._at(directions, self.load.center)

    def level_force(self, azimuths: ArrayLike) -> Array:
        """Largest horizontal force while level, towards azimuths [rad], same shape [N]."""
        a = np.asarray(azimuths, dtype=float)
        return self.force(np.stack([np.cos(a), np.sin(a), np.zeros_like(a)], axis=-1))

    @property
    def least_level_force(self) -> float:
        """Largest horizontal force that is there in every direction while level, exactly [N]."""
        return self._least(lambda rows: _per_force(rows, self.load.center)[:, :2])

    def push(self, directions: ArrayLike) -> Array:
        """Largest force that the tool can exert on the world, at the tool's origin [N].

        Args:
            directions: Unit vectors of the force on the world, shape (..., 3).
        """
        return self._at(directions, self.load.tool)

    @property
    def least_push(self) -> float:
        """Largest force at the tool that is there in every direction, exactly [N]."""
        return self._least(lambda rows: _per_force(rows, self.load.tool))

    def moment(self, directions: ArrayLike) -> Array:
        """Largest moment beside holding the weight [N m]; unit vectors, shape (..., 3)."""
        d = np.asarray(directions, dtype=float)
        return reach(
            self.facets, self.hover_wrench, np.concatenate([np.zeros_like(d), d], axis=-1)
        )[0]

    @property
    def least_moment(self) -> float:
        """Largest moment that is there about every axis, exactly [N m]."""
        return self._least(lambda rows: rows[:, 3:])

    def _at(self, directions: ArrayLike, point: Array) -> Array:
        d = np.asarray(directions, dtype=float)
        wrenches = np.concatenate([d, np.cross(point, d)], axis=-1)
        return reach(self.facets, self.hover_wrench, wrenches)[0]

    def _least(self, costs: Callable[[Array], Array]) -> float:
        """Least of slack over |cost|; `costs` tells what a unit of the figure takes of normals."""
        facets = self.facets
        if not self.can_hover:
            return float("nan")
        unit = np.linalg.norm(costs(np.diag(1.0 / facets.scale)), 2)
        if np.abs(costs(facets.equalities)).max(initial=0.0) > OUTSIDE * unit:
            return 0.0
        size = np.linalg.norm(costs(facets.normals), axis=1)
        slack = np.maximum(facets.slacks(self.hover_wrench), 0.0)
        steps = np.divide(slack, size, out=np.full(len(size), np.inf), where=size > ROUNDING * unit)
        return float(steps.min())

    # Motion.

    def acceleration(self) -> Array:
        """Largest acceleration along -x, +x, -y, ... of {A} while level, shape (3, 2) [m/s^2]."""
        sides = np.stack([-np.eye(3), np.eye(3)], axis=1)
        return self.force(sides) / self.load.mass

    def angular_acceleration(self) -> Array:
        """Largest angular acceleration about -x, +x, ... from hover, arm locked, (3, 2) [rad/s^2].

        The moment I alpha about the centre of mass, with no change of the force.
        """
        sides = np.stack([-np.eye(3), np.eye(3)], axis=1) @ self.load.inertia
        return self.moment(sides)

    @cached_property
    def margin(self) -> Margin:
        """Largest ball of wrenches about level hover (see `rays.margin`)."""
        return margin(self.facets, self.hover_wrench, self.length)

    @cached_property
    def trim_margin(self) -> float | None:
        """The largest margin of any attitude, see `fullam.control.trim` [N]; None without six axes.

        A wrench on the tool (`Load.extra`) is left out.
        """
        if self.facets.rank < 6:
            return None
        load = self.load
        return HoverMargins.of(self.facets, load.weight, load.center, self.length).best()[1]

    @cached_property
    def thrust_to_weight(self) -> float:
        """Largest multiple of the hover wrench within reach; 0 if none is."""
        found = multiples(self.facets, self.hover_wrench)
        return 0.0 if found is None else found[1]

    @cached_property
    def payload(self) -> float:
        """Point mass at the tool at which level hover ends [kg]; NaN if it cannot hover."""
        pull = self.load.gravity * np.concatenate([UP, np.cross(self.load.tool, UP)])
        return float(reach(self.facets, self.hover_wrench, pull)[0])

    @cached_property
    def hover_shares(self) -> Array | None:
        """Squared speeds over the largest that hold it level with the least |u|, shape (n,)."""
        return least_effort(self.facets, self.hover_wrench) if self.can_hover else None

    @cached_property
    def hover_efficiency(self) -> float:
        """Weight over the least sum of thrusts that holds it level; NaN if it cannot hover.

        An upper bound: speeds of least effort (`hover_shares`) may take more thrust in all.
        """
        least = least_total_thrust(self.facets, self.rotors.max_thrusts, self.hover_wrench)
        return float("nan") if least is None else self.load.weight / least


def _per_force(rows: Array, point: Array) -> Array:
    """n_f + n_tau x p: what a unit of force at a point takes of each normal's slack, (m, 3)."""
    found: Array = rows[:, :3] + np.cross(rows[:, 3:], point)
    return found
