"""The stage that learns what hangs at the tool; see `fullam.control.payload_observer`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from fullam.control.payload_observer import Gripper, LearnMemory, LearnNumbers, LearnView, learn
from fullam.control.wrench_observer import observer_numbers
from fullam.dynamics.spatial import Spatial
from fullam.model.vehicle import Vehicle
from fullam.numbers.kernel import kernel, maximum, select
from fullam.numbers.program import Stage
from fullam.numbers.records import Rows
from fullam.numbers.vectors import axpy, scale, subtract
from fullam.simulation.payloads.payload import Load, is_held
from fullam.simulation.tool.held import held_tool

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

FLOOR = 0.01, 0.004
"""Least standard deviations of a reading of mass [kg] and first moment [kg m]."""

ACCELERATION, TURNING = 0.3, 0.15
"""Of the platform [m/s^2], and of it or a joint [rad/s], above which the estimate is frozen."""

ENOUGH = 0.3
"""Of what is told before anybody else is [s]."""

HAND_OVER = 0.5
"""Time constant with which the rest of the controller is told [s]."""

NOTHING = 1e-9
"""A mass that has a centre and weighs nothing [kg]."""


class LoadLearnView(NamedTuple):
    """What `learn_load` is shown.

    What `learn` is shown; all loads that the controller is told of; and which of them is the first
    that is learned, and not known.
    """

    learner: LearnView
    loads: Any
    first: Any


@kernel
def closed_around(loads, first, k):
    """1 if one of the loads from the first on is there in period k, else 0."""
    closed = 0.0
    for i in range(first, len(loads)):
        closed = maximum(closed, is_held(loads[i], k))
    return closed


@kernel
def learn_load(view, k):
    """Learn from period k, and write the load that is told of from the next one on."""
    loads, first, learner = view.loads, int(view.first[0]), view.learner
    now, then = closed_around(loads, first, k), closed_around(loads, first, k + 1)
    learner.gripper[0] = Gripper(now, then)
    learn(learner, k)
    held, tool = learner.memory[0].held, learner.numbers[0].tool
    offset = subtract(held.moment, scale(held.mass, tool))
    center = axpy(1.0 / maximum(held.mass, NOTHING), offset, tool)
    for i in range(first, len(loads)):
        body = loads[i]
        told = Load(body.begin, body.end, held.mass, center, body.inertia)
        loads[i] = select(is_held(body, k) > 0.0, told, body)


class Learner:
    """The rows of what is learned.

    Attributes:
        memory: `LearnMemory`, one row.
        state: (m, s), four rows.
        covariance: Of these, four rows.
        weight: Of what the controller is told anew of it, one row.
    """

    def __init__(self, vehicle: Vehicle, period: float, loads: Rows, first: int) -> None:
        """Make the rows.

        Args:
            vehicle: The nominal vehicle.
            period: Control period [s].
            loads: All that the controller is told of, `Load` rows.
            first: From which of them on they are learned; when they are gripped counts, no more.
        """
        lanes = loads.lanes
        self._loads, self._first = loads, first
        self._numbers = Rows.of(LearnNumbers, [learn_numbers(vehicle, period)])
        self.memory = Rows.empty(LearnMemory, 1, lanes=lanes)
        self.state = Rows.empty(float, 4, lanes=lanes)
        self.covariance = Rows.empty(float, 4, 4, lanes=lanes)
        self.weight = Rows.empty(Spatial, 1, lanes=lanes)
        self._gripper = Rows.empty(Gripper, 1, lanes=lanes)

    def begin(self) -> None:
        """Know nothing."""
        self._loads.array[self._first :, 2:] = 0.0

    def remembered(self) -> Sequence[Rows]:
        """Rows that it takes to go back to a moment."""
        return self._loads, self.memory, self.state, self.covariance

    def stage(self, **rows: Rows) -> Stage:
        """Its stage.

        Args:
            **rows: Those of `LearnView` that are others'.
        """
        own = {name: getattr(self, name) for name in ("memory", "state", "covariance", "weight")}
        view = LearnView(numbers=self._numbers, gripper=self._gripper, **own, **rows)
        return Stage(learn_load, LoadLearnView(view, self._loads, Rows(float, [[self._first]])))


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
