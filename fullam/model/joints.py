"""The arm's joints: what their positions are measured in, and how far they go.

Inside the code a revolute joint's position is in rad and a prismatic one's in m. Where a person
types or reads, a revolute joint's is in degrees; a prismatic one's stays in metres.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from fullam.exceptions import VehicleError

Array = NDArray[np.float64]

FIRST = 2
"""Index of the arm's first joint in a Pinocchio model, behind the universe and the free flyer."""

SLACK = 1e-9
"""How far a position may be beyond its limit [rad or m]: degrees that are typed, and limits that a
URDF prints, are rounded."""


@dataclass(frozen=True, eq=False)
class ArmJoints:
    """Kind and limits of the arm's joints, base to tip, as read-only arrays of shape (n,).

    Attributes:
        names: Names of the joints.
        prismatic: Which joints move along their axis; the others turn about it.
        lower: Least positions [rad or m]; -inf of a continuous joint.
        upper: Largest positions [rad or m]; inf of a continuous joint.
        max_rates: Largest speeds [rad/s or m/s]; inf where the URDF states none or 0.
    """

    names: tuple[str, ...]
    prismatic: NDArray[np.bool_]
    lower: Array
    upper: Array
    max_rates: Array

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for field in fields(self)[1:]:
            getattr(self, field.name).setflags(write=False)

    @classmethod
    def from_model(cls, model: pin.Model) -> ArmJoints:
        """Read the joints behind the free flyer; each has one coordinate."""
        prismatic = ["JointModelP" in kind.shortname() for kind in list(model.joints)[FIRST:]]
        rates = np.array(model.velocityLimit[6:])
        return cls(
            names=tuple(model.names)[FIRST:],
            prismatic=np.array(prismatic, dtype=bool),
            lower=np.array(model.lowerPositionLimit[7:]),
            upper=np.array(model.upperPositionLimit[7:]),
            max_rates=np.where(rates > 0.0, rates, np.inf),
        )

    @property
    def units(self) -> tuple[str, ...]:
        """What a person types and reads of each joint, "deg" or "m"."""
        return tuple("m" if slides else "deg" for slides in self.prismatic)

    @property
    def unit_list(self) -> str:
        """The units in one line, "m, deg, deg"."""
        return ", ".join(self.units)

    @property
    def rest(self) -> Array:
        """Where the arm is unless one says otherwise: 0, or the limit nearest to it [rad or m]."""
        return np.clip(np.zeros(len(self.names)), self.lower, self.upper)

    def from_typed(self, values: ArrayLike) -> Array:
        """Positions in rad and m from those that a person types, in deg and m; shape (..., n).

        Raises:
            VehicleError: They are not one for each joint.
        """
        if np.shape(values)[-1:] != (len(self.names),):
            raise VehicleError(
                "the arm",
                "joint positions",
                f"have shape {np.shape(values)}",
                f"give {len(self.names)} [{self.unit_list}]",
            )
        return np.asarray(values, dtype=np.float64) * self._scale

    def to_typed(self, positions: ArrayLike) -> Array:
        """The inverse of `from_typed`."""
        return np.asarray(positions, dtype=np.float64) / self._scale

    def position_problem(self, positions: Array, times: Array | None = None) -> str | None:
        """Which joint leaves its limits and where to, or None.

        Args:
            positions: One or many, shape (..., n) [rad or m].
            times: Of each [s], to tell when it first leaves them.
        """
        rows = np.reshape(positions, (-1, max(1, len(self.names))))
        for k, name in enumerate(self.names):
            low, high = rows[:, k].min(), rows[:, k].max()
            if low >= self.lower[k] - SLACK and high <= self.upper[k] + SLACK:
                continue
            extreme = high if high > self.upper[k] + SLACK else low
            reached = f"{self._typed(extreme, k)} {self.units[k]}"
            beyond = (rows[:, k] < self.lower[k] - SLACK) | (rows[:, k] > self.upper[k] + SLACK)
            text = f"takes joint '{name}' to {reached}; it goes {self.range_of(k)}"
            return text + _first(beyond, times)
        return None

    def rows(self) -> list[tuple[str, str, str]]:
        """Kind and limits of each joint, as (label, value, unit) of a report."""
        rows = []
        for k, name in enumerate(self.names):
            kind = "prismatic" if self.prismatic[k] else "revolute"
            if np.isinf(self.lower[k]) and np.isinf(self.upper[k]):
                value = f"{kind}, without limits"
            else:
                value = f"{kind}, {self.range_of(k)}"
            rows.append((f"joint {k + 1}, {name}", value, ""))
        return rows

    def range_of(self, k: int) -> str:
        """Limits of joint k as text, "from -90 to 90 deg"."""
        lower, upper = self._typed(self.lower[k], k), self._typed(self.upper[k], k)
        return f"from {lower} to {upper} {self.units[k]}"

    def rate_problem(self, rates: Array, times: Array | None = None) -> str | None:
        """Which joint moves faster than it can, or None.

        Args:
            rates: One or many, shape (..., n) [rad/s or m/s].
            times: Of each [s], to tell when it first does.
        """
        rows = np.abs(np.reshape(rates, (-1, max(1, len(self.names)))))
        for k, name in enumerate(self.names):
            if rows[:, k].max() > self.max_rates[k] + SLACK:
                fastest, most = self._typed(rows[:, k].max(), k), self._typed(self.max_rates[k], k)
                unit = f"{self.units[k]}/s"
                text = f"moves joint '{name}' at {fastest} {unit}; it can {most} {unit}"
                return text + _first(rows[:, k] > self.max_rates[k] + SLACK, times)
        return None

    @property
    def _scale(self) -> Array:
        return np.where(self.prismatic, 1.0, np.pi / 180.0)

    def _typed(self, value: float, k: int) -> str:
        return f"{value / self._scale[k]:.4g}"


def _first(beyond: NDArray[np.bool_], times: Array | None) -> str:
    """When rows first are beyond something, as the end of a sentence."""
    return "" if times is None else f" (first at t = {times[np.argmax(beyond)]:g} s)"
