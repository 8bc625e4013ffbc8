"""Paths of the tool: where it should be at which time, as an offset from where the path begins.

Lines, circles and squares are walked from rest to rest on minimum-jerk profiles; a `Trajectory`
(spline, minimum snap, CSV) is a path too, by its positions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, Range, positive, within
from fullam.exceptions import ScenarioError
from fullam.simulation.motions.trajectory import Trajectory

Array = NDArray[np.float64]

LONG, SLOW = within(1e3, "m"), Range(0.01, 1e4, "s")
"""What makes sense for an offset, and for the time that a path takes."""


class ToolPath(Protocol):
    """Where the tool should be: whoever has these."""

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        ...

    def offsets(self, t: Array) -> Array:
        """Places at times since its begin, (N,) [s] to (N, 3) [m]; before and after it stands."""
        ...


def minimum_jerk(t: Array, duration: float) -> Array:
    """From 0 to 1 in a time, from rest to rest: s = 10 x^3 - 15 x^4 + 6 x^5, x = t / duration."""
    x = np.clip(t / duration, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x**2))


def plane(normal: tuple[float, ...]) -> tuple[Array, Array]:
    """Two unit vectors that span the plane across a normal, right-handed with it.

    Across z they are x and y, across x they are y and z, across y they are z and x.
    """
    n = np.array(normal) / np.linalg.norm(normal)
    first = np.roll(np.eye(3)[np.argmax(np.abs(n))], 1)
    first = first - (first @ n) * n
    first /= np.linalg.norm(first)
    return first, np.cross(n, first)


def _own(path: Any, **values: Any) -> None:
    for name, value in values.items():
        object.__setattr__(path, name, value)


def _normal(check: Checker, normal: Any) -> tuple[float, ...]:
    vector = check.vector("normal", normal, 3, within(1e6))
    if not np.linalg.norm(vector) > 0.0:
        raise check.refuse("normal", "is zero", "give the direction across the path")
    return vector


@dataclass(frozen=True)
class LinePath:
    """A straight line.

    Attributes:
        to: Where it ends, from where it begins [m].
        duration: Time it takes [s].
    """

    kind: ClassVar[str] = "line"
    to: tuple[float, float, float]
    duration: float = 4.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        check = Checker("tool path 'line'", ScenarioError)
        _own(self, to=check.vector("to", self.to, 3, LONG))
        _own(self, duration=check.number("duration", self.duration, SLOW))

    def offsets(self, t: Array) -> Array:
        """Places at times since its begin, shape (N, 3) [m]."""
        return np.outer(minimum_jerk(t, self.duration), self.to)


@dataclass(frozen=True)
class CirclePath:
    """A circle that begins and ends on its rim.

    Attributes:
        radius: Radius [m].
        normal: Direction across it, about which it turns; its centre lies at -radius times the
            first vector of `plane`.
        duration: Time of all rounds [s].
        rounds: How many; negative ones turn the other way.
    """

    kind: ClassVar[str] = "circle"
    radius: float = 0.15
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    duration: float = 8.0
    rounds: float = 1.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        check = Checker("tool path 'circle'", ScenarioError)
        _own(self, radius=check.number("radius", self.radius, positive(1e3, "m")))
        _own(self, normal=_normal(check, self.normal))
        _own(self, duration=check.number("duration", self.duration, SLOW))
        _own(self, rounds=check.number("rounds", self.rounds, within(1e4)))

    def offsets(self, t: Array) -> Array:
        """Places at times since its begin, shape (N, 3) [m]."""
        angle = 2.0 * np.pi * self.rounds * minimum_jerk(t, self.duration)
        first, second = plane(self.normal)
        return self.radius * (
            np.outer(np.cos(angle) - 1.0, first) + np.outer(np.sin(angle), second)
        )


@dataclass(frozen=True)
class SquarePath:
    """A square, begun in a corner; it rests in each.

    Attributes:
        side: Length of a side [m].
        normal: Direction across it, about which it turns.
        duration: Time of all four sides [s].
    """

    kind: ClassVar[str] = "square"
    side: float = 0.2
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    duration: float = 12.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        check = Checker("tool path 'square'", ScenarioError)
        _own(self, side=check.number("side", self.side, positive(1e3, "m")))
        _own(self, normal=_normal(check, self.normal))
        _own(self, duration=check.number("duration", self.duration, SLOW))

    def offsets(self, t: Array) -> Array:
        """Places at times since its begin, shape (N, 3) [m]."""
        first, second = plane(self.normal)
        part, out = 0.25 * self.duration, np.zeros((t.size, 3))
        for k, way in enumerate((first, second, -first, -second)):
            out += self.side * np.outer(minimum_jerk(t - k * part, part), way)
        return out


@dataclass(frozen=True)
class SplinePath:
    """The positions of a trajectory, from its first one on.

    Attributes:
        trajectory: The trajectory.
    """

    kind: ClassVar[str] = "spline"
    trajectory: Trajectory

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        return self.trajectory.at + self.trajectory.times[-1]

    def offsets(self, t: Array) -> Array:
        """Places at times since its begin, shape (N, 3) [m]."""
        still = np.array([*self.trajectory.positions[0], 0.0, 0.0, 0.0, 1.0])
        return self.trajectory.tabulate(t, still).pose[:, :3] - still[:3]
