"""A governor of the target attitude: what the rotors cannot hold is not insisted on.

A vehicle whose rotors meet their bounds keeps its moment and gives up force. Tilted, with thrust
coefficients that are not the nominal ones, it may do so for seconds: the position runs off, the law
asks for ever more force in its direction, all rotors go to a bound, and what each of them gives too
much or too little turns the vehicle further. Level, it has the most force to spare. So the tilt of
the target is taken back while force is short. With

    s = |missing force| / weight    (0 where bounds cost nothing),
    m, the running mean of s over `memory`,
    dg/dt = (m - tolerated) / patience, not faster back than 1 / recovery,    0 <= g <= 1,

the target's tilt theta (between its z and the world's) becomes (1 - g) theta, about the same
horizontal axis. What is missing is measured against the exact bounds of the coupling matrix, by the
allocation itself, so nothing has to be assumed about the vehicle. A flight whose force is never
short for long is not touched, to the last bit. The governor stands before the law and knows none.

With a failed rotor another attitude than level has the most force to spare (see `trim`), and theta
is the angle from that one. Where it is depends on the true vehicle, and off by some degrees nothing
is left. So the target, in addition, leans towards the force f that is missing, by the rotation l:

    dl/dt = lean e_z x f / weight - l / lean_recovery,    |l_x|, |l_y| <= most_lean.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fullam.checks import Checker, Range
from fullam.control.signals import Target
from fullam.dynamics.so3 import compose, exponential, rotation_matrix
from fullam.dynamics.spatial import Pose
from fullam.exceptions import SettingsError
from fullam.numbers.elementary import arctan2
from fullam.numbers.kernel import (
    Number,
    absolute,
    clip,
    either,
    kernel,
    maximum,
    minimum,
    select,
    some,
    sqrt,
)
from fullam.numbers.records import Rows
from fullam.numbers.vectors import Vector, axpy, clip_vector, dot, rotate

UP = (0.0, 0.0, 1.0)
"""Level has the most force to spare, if all rotors turn."""

ONSET = 0.5
"""A tilt that is given up in any case is gone after this time [s]."""

LEVEL = 1e-18
"""Squared sine of the tilt below which an attitude is level."""


@dataclass(frozen=True)
class Governor:
    """Settings of the governor; see the module's first lines.

    Attributes:
        memory: Time constant of the mean shortage [s].
        tolerated: Mean shortage that nothing is done about, as a share of the weight.
        patience: At a mean shortage of one weight above it, the tilt is gone after this time [s].
        recovery: Without a shortage, it is back after this time [s].
        lean: With a failed rotor, rate at which the target leans towards a force that is missing,
            if that is a weight or more [rad/s].
        lean_recovery: Time constant with which it rights itself [s].
        most_lean: Largest lean about either axis [rad].
    """

    memory: float = 0.1
    tolerated: float = 0.05
    patience: float = 0.03
    recovery: float = 2.0
    lean: float = 2.0
    lean_recovery: float = 1.0
    most_lean: float = 0.26

    def __post_init__(self) -> None:
        """Check the numbers."""
        check = Checker("governor", SettingsError)
        for field in fields(self):
            value = check.number(field.name, getattr(self, field.name), Range(1e-6, 1e6))
            object.__setattr__(self, field.name, value)

    def numbers(
        self, weight: float, period: float, up: ArrayLike | None = None, least: float = 0.0
    ) -> Rows:
        """One row of numbers.

        Args:
            weight: Of the vehicle [N].
            period: Control period [s].
            up: Up vector, seen from {A}, of the attitude with most force to spare without failed
                rotors, shape (3,); None if none has failed.
            least: Share of the tilt that is given up in any case, from 0 to 1.
        """
        renewal = 1.0 - float(np.exp(-period / self.memory))
        row = [weight, renewal, self.tolerated, period / self.patience, period / self.recovery]
        row += [*(UP if up is None else np.asarray(up, dtype=float)), least, period / ONSET]
        lean = 0.0 if up is None else period * self.lean
        row += [lean, float(np.exp(-period / self.lean_recovery)), self.most_lean]
        return Rows(GovernorNumbers, [row])


class GovernorNumbers(NamedTuple):
    """Weight [N]; share of the mean renewed in a period; tolerated mean; rates times the period.

    What shall point up where the tilt is given up, seen from {A}; the share of it that is given up
    in any case, and how much of that a period takes. Lean in a period, share of it that is kept,
    and the largest.
    """

    weight: Number
    renewal: Number
    tolerated: Number
    urgency: Number
    relief: Number
    up: Vector
    least: Number
    onset: Number
    lean: Number
    kept: Number
    most_lean: Number


class GovernorMemory(NamedTuple):
    """Mean shortage of force, in weights; share of the tilt that is given up; lean [rad]."""

    shortage: Number
    given_up: Number
    lean: Vector


class GovernView(NamedTuple):
    """What `govern` and `hand_on` are shown: rows; `delivery` is that of the period before."""

    numbers: Any
    targets: Any
    delivery: Any
    memory: Any
    target: Any


@kernel
def levelled(attitude, share, up):
    """An attitude with a share of its tilt taken back, about the same horizontal axis.

    The tilt is that of the body's vector `up` from the vertical; of its z axis if nothing is wrong.
    """
    R = rotation_matrix(attitude)
    x, y, z = rotate(R, up)
    square = x * x + y * y
    tilted = square > LEVEL
    sine = sqrt(select(tilted, square, 1.0))
    turn = select(tilted, share * arctan2(sine, z) / sine, 0.0)
    return compose(exponential((turn * y, -turn * x, 0.0)), attitude)


@kernel
def leaning(n, lean, delivery):
    """The lean one period on: e_z x f for the force f = -missing."""
    missing = delivery.missing.linear
    rate = select(delivery.saturated > 0.0, n.lean / n.weight, 0.0)
    x = clip(rate * missing[1], -n.lean, n.lean)
    y = clip(-rate * missing[0], -n.lean, n.lean)
    after = axpy(n.kept, lean, (x, y, 0.0))
    return clip_vector(after, (-n.most_lean, -n.most_lean, 0.0), (n.most_lean, n.most_lean, 0.0))


@kernel
def govern(view, k):
    """Hand the target on, its tilt taken back while force is short."""
    n, memory, delivery = view.numbers[0], view.memory[0], view.delivery[0]
    missing = delivery.missing.linear
    size = sqrt(dot(missing, missing)) / n.weight
    now = select(delivery.saturated > 0.0, size, 0.0)
    shortage = memory.shortage + n.renewal * (now - memory.shortage)
    change = maximum(n.urgency * (shortage - n.tolerated), -n.relief)
    given_up = clip(memory.given_up + change, 0.0, 1.0)
    given_up = maximum(given_up, minimum(n.least, memory.given_up + n.onset))
    lean = leaning(n, memory.lean, delivery)
    view.memory[0] = GovernorMemory(shortage, given_up, lean)
    target = view.targets[k]
    view.target[0] = target
    leans = absolute(lean[0]) + absolute(lean[1]) > 0.0
    governed = either(given_up > 0.0, leans)
    if some(governed):
        attitude = target.pose.attitude
        attitude = select(given_up > 0.0, levelled(attitude, given_up, n.up), attitude)
        attitude = select(leans, compose(exponential(lean), attitude), attitude)
        pose = Pose(target.pose.position, attitude)
        view.target[0] = Target(pose, target.velocity, target.acceleration)


@kernel
def hand_on(view, k):
    """Hand the target on as it is: no governor."""
    view.target[0] = view.targets[k]
