"""What motions of platform and arm through given rows share: their checks, and the curve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from fullam.checks import Checker, from_zero
from fullam.simulation.motions.curves import Curve, hermite, spline
from fullam.simulation.motions.given_rows import (
    FAST,
    LATE,
    check_spline,
    checked_times,
    is_empty,
    rows_of,
    times_of,
    tuples,
    waypoints_of,
)


@dataclass(frozen=True)
class GivenRows:
    """What rows a kind of motion goes through.

    Attributes:
        check: Says what is wrong.
        rows: Name of the field that has them.
        rates: Name of the field that has their rates, or nothing.
        waypoints: What they are called where a spline is laid through them.
        far: What makes sense for a number of theirs.
        width: How many numbers a waypoint has; None for as many as the first one.
        each: Whether a largest speed is that of any number, or that of a point of three.
    """

    check: Checker
    rows: str
    rates: str
    waypoints: str
    far: float
    width: int | None = None
    each: bool = False


class SplineMotion:
    """A motion through rows at given times; subclasses are frozen dataclasses.

    Attributes:
        GIVEN: What rows it goes through.
        times: When it is where [s].
        degree: Of the spline.
        ends: "rest" or "free".
        at: Time of the flight at which it starts [s].
    """

    GIVEN: ClassVar[GivenRows]
    times: tuple[float, ...]
    degree: int
    ends: str
    at: float

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def _take_times(self) -> None:
        """Check the times."""
        self._set("times", checked_times(self.times, self.GIVEN.check))

    def _take_rows(self, width: int) -> None:
        """Check the rows and their rates, of so many numbers each."""
        given, shape = self.GIVEN, (len(self.times), width)
        rows, rates = getattr(self, given.rows), getattr(self, given.rates)
        self._set(given.rows, tuples(rows_of(given.rows, rows, shape, given.far, given.check)))
        known = not is_empty(rates)
        rates = tuples(rows_of(given.rates, rates, shape, FAST, given.check)) if known else ()
        self._set(given.rates, rates)

    def _take_choices(self) -> None:
        """Check degree, ends and start."""
        check_spline(self.degree, self.ends, self.GIVEN.check)
        self._set("at", self.GIVEN.check.number("at", self.at, from_zero(LATE, "s")))

    @classmethod
    def _through(
        cls, waypoints: Any, times: Any, speed: Any, degree: Any, at: Any, **rest: Any
    ) -> Self:
        """The spline from rest to rest; times as `given_rows.times_of` has them."""
        g = cls.GIVEN
        rows = np.asarray(waypoints_of(g.waypoints, waypoints, g.width, g.far, g.check))
        check_spline(degree, "rest", g.check)
        times = times_of(rows, times, speed, degree, g.check, largest=g.each)
        motion = {"times": times, g.rows: tuples(rows), "degree": degree, "ends": "rest", "at": at}
        return cls(**motion, **rest)

    def _curve(self) -> Curve:
        """Rows by time; by their rates where those are given.

        Raises:
            ScenarioError: The times are too uneven for the degree.
        """
        times = np.array(self.times)
        rows, rates = (np.array(getattr(self, n)) for n in (self.GIVEN.rows, self.GIVEN.rates))
        if rates.size:
            return hermite(times, rows, rates)
        return spline(times, rows, self.degree, self.ends, self.GIVEN.check)
