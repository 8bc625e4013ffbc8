"""A lead on the rotors: ask for more than is wanted, so that they get there sooner.

The rotors follow with a first-order lag, so the wrench w they give now is known from what they were
asked for. Asking for u_c = w + n (u - w) makes them reach u with a lag n times shorter: a lead
filter (lag s + 1) / (lag/n s + 1) that differentiates no measurement.
"""

from __future__ import annotations

from fullam.dynamics.spatial import (
    Spatial,
    add_spatial,
    multiply_spatial,
    rotate_spatial,
    rotate_spatial_back,
    subtract_spatial,
)
from fullam.numbers.kernel import kernel
from fullam.numbers.vectors import add, cross, scale


@kernel
def turned_on(wrench, turn):
    """A wrench turned on with the platform, by a small rotation vector; world axes.

    Where lags are anticipated a command is turned to {A} by the reference's attitude one lag
    ahead, so what is fixed to the rotors is turned on before, and back after.
    """
    force, moment = wrench.linear, wrench.angular
    return Spatial(add(force, cross(turn, force)), add(moment, cross(turn, moment)))


@kernel
def asked_from_rotors(R, wrench, turn):
    """What a wrench in world axes asks from the rotors, {A} axes at the attitude R."""
    return rotate_spatial_back(R, turned_on(wrench, scale(-1.0, turn)))


@kernel
def led(gain, R, u, actual, turn):
    """Wrench to ask for where u is wanted: u + (n - 1) (u - w), world axes.

    Args:
        gain: n - 1 of each axis.
        R: Attitude.
        u: Wrench wanted, world axes.
        actual: Wrench w that the rotors give now, {A} axes.
        turn: By how much the platform will have turned when they follow, a rotation vector.
    """
    w = turned_on(rotate_spatial(R, actual), turn)
    return add_spatial(u, multiply_spatial(gain, subtract_spatial(u, w)))
