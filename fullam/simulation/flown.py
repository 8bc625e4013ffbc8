"""The track of a flight: what its figures need of it, one row a control period.

A campaign that keeps no records writes these rows alone, into the same `Rows` block after block.
"""

from __future__ import annotations

from typing import NamedTuple

from fullam.dynamics.spatial import Pose
from fullam.numbers.kernel import Number


class Flown(NamedTuple):
    """One control period: true pose, 1 if the allocation met a bound else 0, and thrust.

    `thrust` is the sum of k_f Omega^2 over the rotors [N], true speeds and nominal coefficients.
    """

    pose: Pose
    saturated: Number
    thrust: Number
