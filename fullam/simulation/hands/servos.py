"""The arm in motion: as the plan tabulates it, or, once a hand has moved it, by its servos.

A servo follows its goal within its joint's limits of position and rate, and within a limit of
acceleration, by the rule of `reference_model`. Its acceleration is held over a control period, so
that positions, rates and accelerations are consistent on every half step of the plant.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.placing import PlaceView, place
from fullam.dynamics.recursion import JointMotion
from fullam.model.joints import ArmJoints
from fullam.simulation.hands.reference_model import Bounds, acceleration_towards

Array = NDArray[np.float64]

ACCELERATION = 20.0
"""Largest acceleration of a joint that a hand moves [rad/s^2, or m/s^2]."""

LARGEST_RATE = 100.0
"""Of a joint whose URDF states none [rad/s, or m/s]."""


class ArmState(NamedTuple):
    """The arm under its servos at the start of a control period: a motion and a goal a joint."""

    period: int
    motions: tuple[JointMotion, ...]
    goals: tuple[float, ...]


def started(motions: Any, goals: Array, joints: ArmJoints, period: int, step: float) -> ArmState:
    """The arm as the servos take it over, or as they take a new goal.

    Args:
        motions: Its motion at the start of the period.
        goals: Where the joints shall go; they stop at their limits.
        joints: The arm's joints.
        period: The control period.
        step: Length of a control period [s].
    """
    within = np.clip(goals, joints.lower, joints.upper).tolist()
    state = ArmState(period, tuple(motions), tuple(within))
    return state._replace(motions=accelerated(state, joints, step))


def accelerated(state: ArmState, joints: ArmJoints, step: float) -> tuple[JointMotion, ...]:
    """The motions with the accelerations that the servos choose for this period."""
    chosen = []
    for motion, goal, rate in zip(state.motions, state.goals, joints.max_rates, strict=True):
        bounds = Bounds(ACCELERATION, min(float(rate), LARGEST_RATE))
        gap = goal - motion.position
        a, _, _ = acceleration_towards((gap, 0.0, 0.0), (motion.rate, 0.0, 0.0), bounds)
        # Never past the largest rate within the period.
        a = min(max(a, (-bounds.speed - motion.rate) / step), (bounds.speed - motion.rate) / step)
        if abs(gap) < 1e-9 and abs(motion.rate) < 1e-9:
            a = -motion.rate / step
        chosen.append(motion._replace(acceleration=a))
    return tuple(chosen)


def moved(motion: JointMotion, time: float) -> JointMotion:
    """A motion after a time of constant acceleration."""
    position, rate, a = motion
    return JointMotion(position + time * (rate + 0.5 * time * a), rate + time * a, a)


def next_period(state: ArmState, joints: ArmJoints, step: float) -> ArmState:
    """The arm one control period on."""
    after = state._replace(
        period=state.period + 1, motions=tuple(moved(m, step) for m in state.motions)
    )
    return after._replace(motions=accelerated(after, joints, step))


class MovingArm:
    """Rows of the arm's motion on the plant's half-step grid, as the stages read them.

    Attributes:
        state: The arm under its servos; None while the plan's table holds.
    """

    state: ArmState | None = None

    def __init__(self, table: Any, stride: int, per_period: int, half_step: float) -> None:
        """Bind the plan's table.

        Args:
            table: Rows of `JointMotion`s; one row for a still arm.
            stride: 1, or 0 for a still arm.
            per_period: Half steps in a control period.
            half_step: [s].
        """
        self._table, self._stride = table, stride
        self._per_period, self._half_step = per_period, half_step

    def __getitem__(self, row: int) -> Any:
        """The joints' motion in a row; under servos, a row of the present control period."""
        state = self.state
        if state is None:
            return self._table[row * self._stride]
        time = (row - state.period * self._per_period) * self._half_step
        return [moved(motion, time) for motion in state.motions]

    def __iter__(self) -> Iterator[Any]:
        """Not to be iterated: it has no end."""
        raise TypeError("rows of a moving arm are read one by one")


class MovingCenters:
    """The nominal vehicle's centre of mass in a row of the arm's motion."""

    def __init__(self, links: Any, arm: MovingArm) -> None:
        """Bind the links and the arm."""
        self._links, self._arm = links, arm

    def __getitem__(self, row: int) -> Any:
        """The centre in {A} [m]."""
        motions = self._arm[row]
        joints, centers = [[None] * len(motions)], [None]
        place(PlaceView(self._links, [motions], joints, centers), 0)
        return centers[0]
