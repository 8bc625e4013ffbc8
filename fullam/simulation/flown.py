"""The track of a flight: what its figures need of it, one row a control period.

A campaign that keeps no records writes these rows alone, into the same `Rows` block after block.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.dynamics.spatial import Pose
from fullam.numbers.kernel import Number, kernel


class Flown(NamedTuple):
    """One control period: true pose, 1 if the allocation met a bound else 0, and thrust.

    `thrust` is the sum of k_f Omega^2 over the rotors [N], true speeds and nominal coefficients.
    """

    pose: Pose
    saturated: Number
    thrust: Number


class TrackView(NamedTuple):
    """What `write_track` is shown; `thrust_coefficients` are the nominal k_f."""

    state: Any
    delivery: Any
    speeds: Any
    thrust_coefficients: Any
    track: Any


@kernel
def total_thrust(coefficients, speeds):
    """Sum of k_f Omega^2 over the rotors [N]."""
    thrust = 0.0
    for i in range(len(speeds)):
        thrust = thrust + coefficients[i] * (speeds[i] * speeds[i])
    return thrust


@kernel
def write_track(view, k):
    """Write the row of period k, before the vehicle moves on."""
    thrust = total_thrust(view.thrust_coefficients, view.speeds)
    view.track[k] = Flown(view.state[0].pose, view.delivery[0].saturated, thrust)
