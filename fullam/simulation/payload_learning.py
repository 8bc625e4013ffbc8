"""The stage that learns what hangs at the tool, and tells the links; see `payload_observer`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from fullam.control.payload_observer import (
    Held,
    LearnMemory,
    LearnNumbers,
    LearnView,
    carried_on,
    learn,
)
from fullam.control.wrench_observer import observer_numbers
from fullam.dynamics.spatial import Spatial
from fullam.model.vehicle import Vehicle
from fullam.numbers.kernel import both, kernel, maximum, select
from fullam.numbers.records import Rows
from fullam.numbers.vectors import axpy, scale, subtract
from fullam.simulation.held_tool import held_tool
from fullam.simulation.payload import Load, LoadView, load

RATE = 20.0
"""Of the observer, and of the filters of what moves [rad/s]."""

MEMORY = 4.0
"""Time constants after which a filter has forgotten what was."""

HEAVIEST, REACH = 2.0, 0.1
"""Standard deviations of a mass [kg], and of its centre from the tool [m], before it is known."""

HORIZON = 4.0
"""Over how long the tare is a mean, and the filter one of what it is told [s]."""

CORRELATION = 0.3
"""How long a gust lasts [s]."""

FLOOR = 0.005, 0.0005
"""Least standard deviations of a reading of mass [kg] and first moment [kg m]."""

ACCELERATION, TURNING = 0.3, 0.15
"""Of the platform [m/s^2], and of it or a joint [rad/s], above which the estimate is frozen."""

ENOUGH = 0.3
"""Of what is told before anything is handed over [s]."""

HAND_OVER = 0.5
"""Time constant of the hand-over [s]."""

NOTHING = 1e-9
"""A mass that has a centre and weighs nothing [kg]."""


class LoadLearnView(NamedTuple):
    """What `learn_load` is shown; `first` is the number of the first body that is not known."""

    learner: LearnView
    told: LoadView
    first: Any


@kernel
def learn_load(view, k):
    """Learn from period k; write the load and the law's links that it leads to."""
    loads, first = view.told.loads, int(view.first[0])
    closed = 0.0
    for i in range(first, len(loads)):
        closed = select(both(loads[i].begin <= k, k < loads[i].end), 1.0, closed)
    view.learner.closed[0] = closed
    learn(view.learner, k)
    held, tool = view.learner.held[0], view.learner.numbers[0].tool
    for i in range(first, len(loads)):
        body = loads[i]
        offset = subtract(held.moment, scale(held.mass, tool))
        center = axpy(1.0 / maximum(held.mass, NOTHING), offset, tool)
        now = Load(body.begin, body.end, held.mass, center, body.inertia)
        loads[i] = select(both(body.begin <= k, k < body.end), now, body)
    load(view.told, k)
    carried_on(view.learner, k)


class Learner:
    """The rows of what is learned.

    Attributes:
        loads: What the law is told of, `Load` rows: the known ones, then those that are learned.
        memory: `LearnMemory`, one row.
        state: (m, s), four rows.
        covariance: Of these, four rows.
        held: What is handed over, one row.
        weight: What is new in its weight, one row.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        period: float,
        lanes: int,
        known: Rows | None,
        unknown: Rows,
    ) -> None:
        """Make the rows.

        Args:
            vehicle: The nominal vehicle.
            period: Control period [s].
            lanes: Flights at a time; 0 for one, as scalars.
            known: Loads that the law is told of.
            unknown: Those that are learned; when they are gripped counts, and no more.
        """
        first = 0 if known is None else len(known.array)
        count = first + len(unknown.array)
        self.loads = Rows.empty(Load, count, lanes=lanes)
        for part, rows in ((slice(0, first), known), (slice(first, count), unknown)):
            if rows is not None:
                self.loads.array[part] = rows.array[..., None] if lanes else rows.array
        self._first = first
        self._numbers = Rows.of(LearnNumbers, [learn_numbers(vehicle, period)])
        self.memory = Rows.empty(LearnMemory, 1, lanes=lanes)
        self.state = Rows.empty(float, 4, lanes=lanes)
        self.covariance = Rows.empty(float, 4, 4, lanes=lanes)
        self.held = Rows.empty(Held, 1, lanes=lanes)
        self.weight = Rows.empty(Spatial, 1, lanes=lanes)
        self._closed = Rows.empty(float, 1, lanes=lanes)

    def begin(self) -> None:
        """Know nothing."""
        self.loads.array[self._first :, 2:] = 0.0

    def remembered(self) -> Sequence[Rows]:
        """Rows that it takes to go back to a moment."""
        return self.loads, self.memory, self.state, self.covariance, self.held

    def view(self, told: LoadView, **rows: Any) -> LoadLearnView:
        """What the stage is shown.

        Args:
            told: What the law is told of, `loads` among it.
            **rows: Those of `LearnView` that are others'.
        """
        own = {name: getattr(self, name) for name in ("memory", "state", "covariance", "held")}
        learner = LearnView(
            numbers=self._numbers, closed=self._closed, weight=self.weight, **own, **rows
        )
        return LoadLearnView(learner, told, Rows(float, [[self._first]]))


def learn_numbers(vehicle: Vehicle, period: float) -> LearnNumbers:
    """How a load is learned at a vehicle's tool, as numbers."""
    point, frame = held_tool(vehicle, "learn what hangs at it")
    lag = float(vehicle.rotors.lags.mean())
    floor = FLOOR[0] ** 2, FLOOR[1] ** 2, FLOOR[1] ** 2
    return LearnNumbers(
        observer_numbers(vehicle, period, (RATE, RATE), lag),
        tuple((frame.T @ point).tolist()),
        vehicle.gravity,
        HEAVIEST,
        REACH,
        (period / HORIZON) ** 2,
        max(1.0, CORRELATION / period),
        floor,
        1.0 - math.exp(-RATE * period),
        ACCELERATION,
        TURNING,
        math.ceil(MEMORY / RATE / period),
        max(1.0, HORIZON / period),
        math.ceil(ENOUGH / period),
        1.0 - math.exp(-period / HAND_OVER),
    )
