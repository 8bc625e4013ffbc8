"""How fast a law may be, by how rough the estimate is that it acts on.

A law is slowed down while the measured velocity is rough, separately for force and moment. The
roughness is the running mean of |v_k - 2 v_{k-1} + v_{k-2}| / T over control periods T: a smooth
motion has next to none, white noise of standard deviation s on the velocity has about 4 s / T
(three axes). The factor is limit / roughness, at most 1. What differentiates the velocity takes it
as it is: its noise then stays flat as the roughness grows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fullam.dynamics.spatial import Spatial, subtract_spatial
from fullam.numbers.kernel import Number, kernel, select, sqrt
from fullam.numbers.vectors import ZERO, dot, scale

MEMORY = 0.3
"""Time constant of the running mean of the roughness [s]."""


class Halves(NamedTuple):
    """A number for force and position, and one for moment and attitude."""

    linear: Number
    angular: Number


class CautionNumbers(NamedTuple):
    """Control period T [s], share of a period in the running mean, and the limits.

    Up to those [m/s^2, rad/s^2] nothing slows down.
    """

    period: Number
    share: Number
    limits: Halves


class CautionMemory(NamedTuple):
    """Velocity [v_A; w_A] of the last period, its change then, and the roughness."""

    velocity: Spatial
    change: Spatial
    roughness: Halves


@kernel
def trusted(velocity):
    """What is remembered of an estimate that nothing is known against."""
    return CautionMemory(velocity, Spatial(ZERO, ZERO), Halves(0.0, 0.0))


@kernel
def felt(numbers, memory, velocity):
    """The roughness one period on, with the velocity [v_A; w_A] of this period, {A} axes."""
    change = subtract_spatial(velocity, memory.velocity)
    bend = subtract_spatial(change, memory.change)
    before = memory.roughness
    linear = sqrt(dot(bend.linear, bend.linear)) / numbers.period - before.linear
    angular = sqrt(dot(bend.angular, bend.angular)) / numbers.period - before.angular
    roughness = Halves(
        before.linear + numbers.share * linear, before.angular + numbers.share * angular
    )
    return CautionMemory(velocity, change, roughness)


@kernel
def caution_factors(numbers, roughness):
    """Limit / roughness, at most 1, of either half."""
    return Halves(
        slower(numbers.limits.linear, roughness.linear),
        slower(numbers.limits.angular, roughness.angular),
    )


@kernel
def slower(limit, roughness):
    """The factor of one half."""
    rough = roughness > limit
    return select(rough, limit / select(rough, roughness, 1.0), 1.0)


@kernel
def slowed(factors, x):
    """Both halves of gains, each times its factor."""
    return Spatial(scale(factors.linear, x.linear), scale(factors.angular, x.angular))


def caution_numbers(period: float, limits: tuple[float, float]) -> CautionNumbers:
    """Caution with these limits of the roughness, linear [m/s^2] and angular [rad/s^2]."""
    share = 1.0 - float(np.exp(-period / MEMORY))
    return CautionNumbers(period, share, Halves(*map(float, limits)))
