"""The estimator that cheats: a yardstick for all others."""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.control.estimator import KernelEstimator
from fullam.control.signals import Estimate
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import rotate_spatial
from fullam.numbers.kernel import Number, kernel


class TruthNumbers(NamedTuple):
    """Control periods between two poses."""

    every: Number


class TruthMemory(NamedTuple):
    """Nothing."""


@kernel
def tell_truth(numbers, memory, readings, k):
    """Pose as read, and the true body velocity, turned by the attitude that was read."""
    R = rotation_matrix(readings.pose.attitude)
    return Estimate(readings.pose, rotate_spatial(R, readings.velocity))


class Truth(KernelEstimator):
    """Pose as read and the true velocity: no estimator can do better, none is this good."""

    name = "truth"
    kernel = staticmethod(tell_truth)

    def numbers(self) -> TruthNumbers:
        """See `TruthNumbers`."""
        return TruthNumbers(float(self.datasheet.pose_every))

    def memory(self, lanes: int = 0) -> Any:
        """Nothing."""
        return TruthMemory()
