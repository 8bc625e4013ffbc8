"""The paper's first-order pose filter, on R^3 x SO(3) instead of on Euler angles.

With x the pose read and y the filtered one, at every new pose

    y <- y (+) gain (x (-) y),    gain = min(1, cutoff * pose period).

The published runs filter position and Euler angles with y += 0.01 * 18 * (x - y). The same
recursion with the difference taken on R^3 x SO(3) has no singular attitude and equals theirs to
second order in the angle between x and y. The rate of y over the last pose period is the velocity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from fullam.control.estimator import EstimatorSettings, KernelEstimator
from fullam.control.signals import Estimate
from fullam.dynamics.so3 import boxminus, boxplus, rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial, scale_spatial
from fullam.exceptions import SettingsError
from fullam.numbers.kernel import Number, kernel
from fullam.numbers.records import Rows
from fullam.numbers.vectors import ZERO, axpy, rotate, scale, subtract


@dataclass(frozen=True)
class FirstOrderSettings(EstimatorSettings):
    """Settings of the first-order filter.

    Attributes:
        cutoff: Corner frequency [rad/s]; infinity passes the poses through.
    """

    cutoff: float = 18.0

    def __post_init__(self) -> None:
        """Check the number."""
        if not self.cutoff > 0.0:
            raise SettingsError(
                "estimator 'first-order'",
                "cutoff",
                f"is {self.cutoff!r}",
                "give rad/s, above 0",
            )


class FirstOrderNumbers(NamedTuple):
    """Control periods between two poses, gain, and gain over the time between two poses [1/s]."""

    every: Number
    gain: Number
    per_pose_period: Number


class Filtered(NamedTuple):
    """Filtered pose, and its rate over the last pose period: dp in world axes, w in {A} axes."""

    pose: Pose
    rate: Spatial


class FirstOrderMemory(NamedTuple):
    """One row of `Filtered`."""

    filtered: Any


@kernel
def filter_pose(numbers, pose, reading):
    """One step of the filter: y (+) gain (x (-) y), and its rate."""
    way = subtract(reading.position, pose.position)
    turn = boxminus(reading.attitude, pose.attitude)
    after = Pose(
        axpy(numbers.gain, way, pose.position),
        boxplus(pose.attitude, scale(numbers.gain, turn)),
    )
    return Filtered(after, scale_spatial(numbers.per_pose_period, Spatial(way, turn)))


@kernel
def first_order(numbers, memory, readings, k):
    """Filter a new pose; between poses hold the last estimate."""
    if k == 0:
        memory.filtered[0] = Filtered(readings.pose, Spatial(ZERO, ZERO))
    if k % int(numbers.every) == 0:
        memory.filtered[0] = filter_pose(numbers, memory.filtered[0].pose, readings.pose)
    pose, rate = memory.filtered[0]
    w = rotate(rotation_matrix(pose.attitude), rate.angular)
    return Estimate(pose, Spatial(rate.linear, w))


class FirstOrder(KernelEstimator):
    """The paper's: a first-order filter on the pose, and its rate as the velocity."""

    name = "first-order"
    Settings = FirstOrderSettings
    settings: FirstOrderSettings
    kernel = staticmethod(first_order)

    def numbers(self) -> FirstOrderNumbers:
        """See `FirstOrderNumbers`."""
        gain = min(1.0, self.settings.cutoff * self.pose_period)
        every = float(self.datasheet.pose_every)
        return FirstOrderNumbers(every, gain, gain / self.pose_period)

    def memory(self, lanes: int = 0) -> FirstOrderMemory:
        """One row, to be filled in the first period."""
        return FirstOrderMemory(Rows.empty(Filtered, 1, lanes=lanes))
