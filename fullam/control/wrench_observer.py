"""Momentum-based observer of the wrench that the nominal model does not explain.

The momentum of platform and arm, linear h_f and angular h_tau about the common centre of mass (at
c from the origin of {A}), changes in world axes by external wrenches alone:

    dh_f = U_f + m g + d_f,    dh_tau = U_tau - c x U_f + d_tau,

whatever the arm does; no Coriolis term, no derivative of the velocity. Everything but d is known:
h from the measured velocities and the nominal inertias, U from what the allocation delivered,
followed by the rotors with a first-order lag in {A} axes. The classical observer of rate K,
d = K (h - int (U + m g + d) dt), is for a wrench held over the period T

    d+ = d + (1 - exp(-K T)) ((h+ - h) / T - U_mean - m g - d),

a first-order low-pass filter on the unexplained wrench. It is taken at the origin of {A} before
the filter, since gusts and rotors act on the platform and not on the moving centre of mass. d
contains gusts, contact, and what the nominal masses, inertias and thrust coefficients have wrong.
An impulse J leaves d = K J behind, which decays with K: cancelling d then takes back just the
momentum that the impulse brought.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fullam.control.caution import Halves
from fullam.dynamics.momentum import momentum
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import (
    Spatial,
    add_spatial,
    axpy_spatial,
    rotate_spatial,
    rotate_spatial_back,
    scale_spatial,
    subtract_spatial,
)
from fullam.model.vehicle import Vehicle
from fullam.numbers.elementary import decay
from fullam.numbers.kernel import Number, kernel
from fullam.numbers.vectors import ZERO, Matrix, Vector, add, axpy, cross, rotate, scale, subtract


class ObserverNumbers(NamedTuple):
    """The observer as numbers.

    The period T [s]; K T of force and of moment; m g [N]; of the gap between what the rotors give
    and what they are asked for: the share that is left after T, and its mean over T.
    """

    period: Number
    rates: Halves
    weight: Number
    left: Number
    mean: Number


class ObserverMemory(NamedTuple):
    """What the observer saw last.

    d at the origin of {A}, world axes; momentum about the centre of mass, where that was, and the
    attitude, world axes; the wrench asked from the rotors and the wrench that they gave, {A} axes.
    """

    wrench: Spatial
    momentum: Spatial
    center: Vector
    attitude: Matrix
    command: Spatial
    actual: Spatial


@kernel
def momentum_about_center(chain, R, velocity):
    """Momentum about the centre of mass, and c, both in world axes."""
    v = rotate_spatial_back(R, velocity)
    h, c = momentum(chain, v.linear, v.angular)
    return rotate_spatial(R, h), rotate(R, c)


@kernel
def nothing_observed(numbers, chain, estimate):
    """Nothing unexplained yet; the rotors carry the weight."""
    R = rotation_matrix(estimate.pose.attitude)
    h, c = momentum_about_center(chain, R, estimate.velocity)
    lift = (0.0, 0.0, numbers.weight)
    hover = rotate_spatial_back(R, Spatial(lift, cross(c, lift)))
    return ObserverMemory(Spatial(ZERO, ZERO), h, c, R, hover, hover)


@kernel
def observed(numbers, factors, chain, estimate, memory):
    """The observer one period on.

    Args:
        numbers: `ObserverNumbers`.
        factors: By how much K is slowed down, `Halves`.
        chain: The nominal vehicle with its arm in motion.
        estimate: What is told of the platform.
        memory: `ObserverMemory`, with the wrench that was asked for since.
    """
    R = rotation_matrix(estimate.pose.attitude)
    h, c = momentum_about_center(chain, R, estimate.velocity)
    gap = subtract_spatial(memory.actual, memory.command)
    mean = axpy_spatial(numbers.mean, gap, memory.command)
    actual = axpy_spatial(numbers.left, gap, memory.command)
    mean = add_spatial(rotate_spatial(memory.attitude, mean), rotate_spatial(R, mean))
    U = scale_spatial(0.5, mean)
    # The moving arm carries the centre of mass along: what acted had the lever in between.
    lever = scale(0.5, add(memory.center, c))
    dh = scale_spatial(1.0 / numbers.period, subtract_spatial(h, memory.momentum))
    force = add(subtract(dh.linear, U.linear), (0.0, 0.0, numbers.weight))
    moment = subtract(dh.angular, subtract(U.angular, cross(lever, U.linear)))
    moment = add(moment, cross(lever, force))  # now at the origin of {A}
    d = memory.wrench
    d = Spatial(
        axpy(decay(numbers.rates.linear * factors.linear), subtract(force, d.linear), d.linear),
        axpy(
            decay(numbers.rates.angular * factors.angular), subtract(moment, d.angular), d.angular
        ),
    )
    return ObserverMemory(d, h, c, R, memory.command, actual)


@kernel
def asked(memory, wrench_A):
    """The observer told of the wrench asked from the rotors until the next period, {A} axes."""
    m = memory
    return ObserverMemory(m.wrench, m.momentum, m.center, m.attitude, wrench_A, m.actual)


@kernel
def less(numbers, memory, wrench):
    """The observer told that a part of what it observes acts in this period for the last time.

    The momentum is put on by what that part brings in this period, which then is not observed.

    Args:
        numbers: `ObserverNumbers`.
        memory: `ObserverMemory`.
        wrench: The part, world axes at the origin of {A}.
    """
    m, f = memory, wrench.linear
    about_center = Spatial(f, subtract(wrench.angular, cross(m.center, f)))
    h = axpy_spatial(numbers.period, about_center, m.momentum)
    d = subtract_spatial(m.wrench, wrench)
    return ObserverMemory(d, h, m.center, m.attitude, m.command, m.actual)


def observer_numbers(
    vehicle: Vehicle, period: float, rates: tuple[float, float], lag: float
) -> ObserverNumbers:
    """The observer of a nominal vehicle.

    Args:
        vehicle: The nominal vehicle.
        period: Time between updates T [s].
        rates: K of force and of moment [rad/s]; 0 switches a half off.
        lag: Time constant with which the wrench follows its command [s].
    """
    left = float(np.exp(-period / lag)) if lag > 0.0 else 0.0
    return ObserverNumbers(
        period,
        Halves(rates[0] * period, rates[1] * period),
        vehicle.mass * vehicle.gravity,
        left,
        lag / period * (1.0 - left),
    )
