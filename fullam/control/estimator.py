"""From what the sensors read to what the controller is told.

An estimator turns `Readings` into the platform's pose and velocity in a `Measurement`. The arm's
angles, rates and accelerations are known inputs (the servos are position controlled) and pass by
it. Estimators register themselves by name, as controllers do.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from fullam.control.controller import Measurement
from fullam.control.filters import FirstOrderPoseFilter
from fullam.dynamics.pose_space import IDENTITY, AttitudeView
from fullam.exceptions import SettingsError
from fullam.registry import Registry

Array = NDArray[np.float64]


class Readings:
    """What the sensors deliver in one control period, rewritten in place.

    Attributes:
        pose: Noisy pose [p, quaternion xyzw], shape (7,).
        pose_is_new: Whether the pose was taken in this period (its sensor may be slower).
        gyroscope: Noisy w_A [rad/s], shape (3,).
        accelerometer: Noisy R^T (ddp_A - g) [m/s^2], shape (3,).
        velocity: True [v_A, w_A] in {A} axes, for the estimator that cheats, shape (6,).
    """

    __slots__ = ("accelerometer", "gyroscope", "pose", "pose_is_new", "velocity")

    def __init__(self) -> None:
        """Start at the origin, at rest."""
        self.pose: Array = np.array(IDENTITY)
        self.pose_is_new = True
        self.gyroscope: Array = np.zeros(3)
        self.accelerometer: Array = np.zeros(3)
        self.velocity: Array = np.zeros(6)


@dataclass(frozen=True)
class Datasheet:
    """What the sensors' makers state: their statistics, not the draw of a flight.

    Attributes:
        position_noise: Standard deviation of a measured position, each axis [m].
        attitude_noise: Standard deviation of a measured attitude, each body axis [rad].
        gyroscope_noise: Standard deviation of a gyroscope sample [rad/s].
        accelerometer_noise: Standard deviation of an accelerometer sample [m/s^2].
        delay_periods: Age of a pose when it arrives, in control periods.
        gravity: [m/s^2], along -z of {W}.
    """

    position_noise: float = 0.0
    attitude_noise: float = 0.0
    gyroscope_noise: float = 0.0
    accelerometer_noise: float = 0.0
    delay_periods: int = 0
    gravity: float = 9.81


class Estimator(ABC):
    """Keeps the best guess of the platform's pose and velocity.

    Attributes:
        needs_inertial: Whether it reads the gyroscope and the accelerometer.
    """

    name: ClassVar[str]
    needs_inertial: ClassVar[bool] = False

    def __init__(
        self,
        period: float,
        pose_period: float,
        cutoff: float,
        datasheet: Datasheet | None = None,
    ) -> None:
        """Bind the rates.

        Args:
            period: Control period [s].
            pose_period: Time between new poses [s].
            cutoff: Corner frequency of the pose filter [rad/s], for estimators that have one.
            datasheet: Statistics of the sensors, for estimators that weigh them; exact sensors
                without delay if None.
        """
        if not cutoff > 0.0:
            raise SettingsError(
                f"estimator '{self.name}'", "cutoff", f"is {cutoff!r}", "give rad/s, above 0"
            )
        self.period, self.pose_period, self.cutoff = period, pose_period, cutoff
        self.datasheet = Datasheet() if datasheet is None else datasheet

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is a fresh estimator: views into workspaces cannot be copied."""
        return type(self), (self.period, self.pose_period, self.cutoff, self.datasheet)

    @abstractmethod
    def reset(self, readings: Readings) -> None:
        """Start from the first readings, at rest."""

    @abstractmethod
    def update(self, readings: Readings, measurement: Measurement) -> None:
        """Take in one period's readings; write q[:7] and v[:6] of the measurement."""

    def as_seen(self, poses: Array, velocities: Array) -> tuple[Array, Array]:
        """A motion as this estimator would report it: with its lag, without noise.

        By how much the reference as seen trails the reference, the estimate of a vehicle that
        follows it trails the vehicle; so the lag of a known motion can be taken off. An estimator
        without lag returns the motion itself.

        Args:
            poses: [p, quaternion xyzw] once a control period, shape (N, 7).
            velocities: [dp, w] in world axes, shape (N, 6).
        """
        return poses, velocities

    def _arrivals(self, rows: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """In each control period, the row whose pose is at hand, and whether it is a new one."""
        every = round(self.pose_period / self.period)
        k = np.arange(rows)
        return np.maximum(0, k - k % every - self.datasheet.delay_periods), k % every == 0


EstimatorType = TypeVar("EstimatorType", bound=type[Estimator])

_REGISTRY: Registry[type[Estimator]] = Registry("estimator")


def register_estimator(name: str) -> Callable[[EstimatorType], EstimatorType]:
    """Class decorator: make an estimator known under `name`."""

    def add(cls: EstimatorType) -> EstimatorType:
        cls.name = name
        _REGISTRY[name] = cls
        return cls

    return add


def estimator_names() -> tuple[str, ...]:
    """Names of the registered estimators, sorted."""
    return tuple(sorted(_REGISTRY))


def estimator_class(name: str) -> type[Estimator]:
    """The class registered under `name`.

    Raises:
        UnknownName: No such estimator; the message lists the known ones.
    """
    return _REGISTRY[name]


@register_estimator("truth")
class Truth(Estimator):
    """Pose as read and the true velocity: no estimator can do better, none is this good."""

    def reset(self, readings: Readings) -> None:
        """Nothing to forget."""

    def update(self, readings: Readings, measurement: Measurement) -> None:
        """Copy pose and velocity."""
        measurement.q[:7] = readings.pose
        measurement.v[:6] = readings.velocity

    def as_seen(self, poses: Array, velocities: Array) -> tuple[Array, Array]:
        """The poses as they arrive; the velocity is the true one."""
        return poses[self._arrivals(len(poses))[0]], velocities


@register_estimator("first-order")
class FirstOrder(Estimator):
    """The paper's: a first-order filter on the pose, and its rate as the velocity."""

    def __init__(
        self,
        period: float,
        pose_period: float,
        cutoff: float,
        datasheet: Datasheet | None = None,
    ) -> None:
        """Set up the filter at the rate of new poses."""
        super().__init__(period, pose_period, cutoff, datasheet)
        self._filter = FirstOrderPoseFilter(cutoff, pose_period)
        self._linear_rate, self._angular_rate = self._filter.rate[:3], self._filter.rate[3:]
        self._attitude = AttitudeView()

    def reset(self, readings: Readings) -> None:
        """Start the filter at the first pose."""
        self._filter.reset(readings.pose)

    def update(self, readings: Readings, measurement: Measurement) -> None:
        """Filter a new pose; between poses hold the last estimate."""
        if readings.pose_is_new:
            self._filter.update(readings.pose)
        pose, v = self._filter.pose, measurement.v
        measurement.q[:7] = pose
        self._linear_rate.dot(self._attitude.look(pose), v[:3])
        v[3:6] = self._angular_rate

    def as_seen(self, poses: Array, velocities: Array) -> tuple[Array, Array]:
        """The motion behind the filter, from rest at its first pose."""
        seen, rates = np.empty_like(poses), np.empty_like(velocities)
        lag = FirstOrderPoseFilter(self.cutoff, self.pose_period)
        lag.reset(poses[0])
        arrived, is_new = self._arrivals(len(poses))
        for k in range(len(poses)):
            if is_new[k]:
                lag.update(poses[arrived[k]])
            seen[k], rates[k] = lag.pose, lag.rate
            np.dot(self._attitude.look(lag.pose), lag.rate[3:], out=rates[k, 3:])
        return seen, rates
