"""From what the sensors read to what the law is told.

An estimator turns `Readings` into an `Estimate` of the platform's pose and velocity. The arm's
angles, rates and accelerations are known inputs (the servos are position controlled) and pass by
it. Those that come with fullam are kernels, flown by Python, by machine code and eight flights at a
time; anybody's own is a subclass of `Estimator`, in numpy if one likes. `estimators` has the names.

One of one's own (`fullam new estimator my_estimator.py` writes one that flies):

    @fullam.register_estimator("my-estimator")
    class MyEstimator(fullam.Estimator):
        Settings = MyEstimatorSettings                   # as of a law; may be left out
        needs_inertial = True                            # if it reads gyroscope, accelerometer

        def reset(self, readings): ...                   # before the first period
        def update(self, readings, measurement):         # every period, the first one included
            measurement.q[:7] = ...                      # [p, quaternion xyzw]
            measurement.v[:6] = ...                      # [v_A, w_A], {A} axes

It is given `self.datasheet` (noise, rates, delay of the sensors), `self.settings` and `self.period`
[s]. One that trails the motion may say by how much in `as_seen`; the lag is then taken off.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.control.controller import Measurement
from fullam.control.signals import Estimate
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial, rotate_spatial_back
from fullam.exceptions import SettingsError
from fullam.numbers.kernel import Number, kernel
from fullam.numbers.program import Lists, Stage, program
from fullam.numbers.records import Rows, flat
from fullam.numbers.vectors import Vector

Array = NDArray[np.float64]
Function = Callable[..., Any]


class Readings(NamedTuple):
    """What the sensors deliver in one control period.

    Noisy pose, the last one between two of them; true velocity [v_A, w_A] in {A} axes, for the
    estimator that cheats; noisy w_A [rad/s] and R^T (ddp_A - g) [m/s^2]; and 1 where the pose is a
    new one, 0 where it is still the last.

    In Python its parts are tuples of floats: `np.concatenate(readings.pose)` is the array
    [p, quaternion xyzw].
    """

    pose: Pose
    velocity: Spatial
    gyroscope: Vector
    accelerometer: Vector
    is_new: Number


class Inertial(NamedTuple):
    """What gyroscope and accelerometer read, or the noise in it [rad/s, m/s^2]; {A} axes."""

    gyroscope: Vector
    accelerometer: Vector


@dataclass(frozen=True)
class Datasheet:
    """What the sensors' makers state: rates and statistics, not the draw of a flight.

    Attributes:
        position_noise: Standard deviation of a measured position, each axis [m].
        attitude_noise: Standard deviation of a measured attitude, each body axis [rad].
        gyroscope_noise: Standard deviation of a gyroscope sample [rad/s].
        accelerometer_noise: Standard deviation of an accelerometer sample [m/s^2].
        delay_periods: Age of a pose when it arrives, in control periods.
        pose_every: Control periods between two poses.
        gravity: [m/s^2], along -z of {W}.
        gyroscope_bias: Standard deviation of the gyroscope's bias, each axis [rad/s].
        accelerometer_bias: Standard deviation of the accelerometer's bias, each axis [m/s^2].
        gyroscope_drift: Density of the random walk of that bias [rad/s/sqrt(s)].
        accelerometer_drift: The same [m/s^2/sqrt(s)].
        gyroscope_scale: Standard deviation of the gyroscope's scale factor, as a share of 1.
        accelerometer_scale: The same.
    """

    position_noise: float = 0.0
    attitude_noise: float = 0.0
    gyroscope_noise: float = 0.0
    accelerometer_noise: float = 0.0
    delay_periods: int = 0
    pose_every: int = 1
    gravity: float = 9.81
    gyroscope_bias: float = 0.0
    accelerometer_bias: float = 0.0
    gyroscope_drift: float = 0.0
    accelerometer_drift: float = 0.0
    gyroscope_scale: float = 0.0
    accelerometer_scale: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        for field in fields(self):
            value, least = getattr(self, field.name), 1 if field.name == "pose_every" else 0
            whole = field.name in ("delay_periods", "pose_every")
            if not least <= value < np.inf or (whole and value != int(value)):
                kind = "a whole number" if whole else "a number"
                raise SettingsError(
                    "datasheet", field.name, f"is {value!r}", f"give {kind} of at least {least}"
                )


@dataclass(frozen=True)
class EstimatorSettings:
    """Settings of an estimator, all of them JSON values; this one has none."""

    def to_dict(self) -> dict[str, Any]:
        """The settings as JSON values."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


class Estimator(ABC):
    """Keeps the best guess of the platform's pose and velocity.

    Attributes:
        name: The name it is registered under.
        Settings: Frozen dataclass of its settings.
        needs_inertial: Whether it reads the gyroscope and the accelerometer.
        knows_bias: Whether it finds out their bias.
        rejects_outliers: Whether it tells an outlier from a pose.
        stands_for: Name of an estimator in whose place it flies any law as well; "" for none.
    """

    name: ClassVar[str] = "estimator"
    Settings: ClassVar[type] = EstimatorSettings
    needs_inertial: ClassVar[bool] = False
    knows_bias: ClassVar[bool] = False
    rejects_outliers: ClassVar[bool] = False
    stands_for: ClassVar[str] = ""

    def __init__(
        self, datasheet: Datasheet | None = None, settings: Any = None, period: float = 0.01
    ) -> None:
        """Bind the estimator to its sensors.

        Args:
            datasheet: Rates and statistics of the sensors; exact ones without delay if None.
            settings: An instance of `Settings`; its defaults if None.
            period: Control period [s].

        Raises:
            SettingsError: The settings belong to another estimator, or the period is not above 0.
        """
        settings = self.Settings() if settings is None else settings
        where = f"estimator '{self.name}'"
        if not isinstance(settings, self.Settings):
            given, wanted = type(settings).__name__, self.Settings.__name__
            raise SettingsError(where, "settings", f"is a {given}", f"give a {wanted}")
        if not 0.0 < period < np.inf:
            raise SettingsError(where, "period", f"is {period!r}", "give seconds, above 0")
        self.datasheet = Datasheet() if datasheet is None else datasheet
        self.settings = settings
        self.period = period

    @property
    def pose_period(self) -> float:
        """Time between two poses [s]."""
        return self.datasheet.pose_every * self.period

    @abstractmethod
    def reset(self, readings: Readings) -> None:
        """Begin anew, at rest at the first readings; `update` is then given the same ones."""

    @abstractmethod
    def update(self, readings: Readings, measurement: Measurement) -> None:
        """Take in one period's readings; write q[:7] and v[:6] of the measurement.

        After a reset the pose is a new one in the first period and then every
        `datasheet.pose_every` periods, unless one is missing: `Readings.is_new` tells.
        """

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


class KernelEstimator(Estimator):
    """An estimator as a kernel, with the face of an `Estimator`.

    Subclasses give `kernel`, `numbers` and `memory`; that is all it takes to fly everywhere.

    Attributes:
        kernel: f(numbers, memory, readings, k) -> Estimate. In period 0 it begins anew; where k is
            a multiple of the datasheet's pose_every and `readings.is_new` is 1, the pose is a new
            one.
        state: What it remembers, as lists of records, while it is used from Python; else None.
    """

    kernel: ClassVar[Function]
    state: Any

    def __init__(
        self, datasheet: Datasheet | None = None, settings: Any = None, period: float = 0.01
    ) -> None:
        """Bind the estimator; see `Estimator`."""
        super().__init__(datasheet, settings, period)
        self._numbers = self.numbers()
        self.forget()

    @abstractmethod
    def numbers(self) -> Any:
        """Settings and sensors as a record of numbers.

        `every` of it is the datasheet's pose_every where no inertial sensors are read.
        """

    @abstractmethod
    def memory(self, lanes: int = 0) -> Any:
        """A view with room for what the estimator remembers."""

    def forget(self) -> None:
        """Begin anew at the next readings."""
        self.state = None
        self._k = 0

    def estimate(self, readings: Readings) -> Estimate:
        """One period."""
        if self.state is None:
            self.state = Lists().of(self.memory())
        told: Estimate = self.kernel(self._numbers, self.state, readings, self._k)
        self._k += 1
        return told

    # The face of an estimator.

    def reset(self, readings: Readings) -> None:
        """Begin anew; see `Estimator.reset`."""
        self.forget()

    def update(self, readings: Readings, measurement: Measurement) -> None:
        """One period, its velocity turned to {A} axes; see `Estimator.update`."""
        pose, velocity = self.estimate(readings)
        measurement.q[:7] = flat(pose)
        turned = rotate_spatial_back(rotation_matrix(pose.attitude), velocity)
        measurement.v[:6] = flat(turned)

    def as_seen(self, poses: Array, velocities: Array) -> tuple[Array, Array]:
        """The motion behind the kernel; see `Estimator.as_seen`.

        Inertial sensors see a motion as it happens: an estimator that reads them has no lag.
        """
        if self.needs_inertial:
            return poses, velocities
        numbers = self._numbers
        view = MotionView(
            Rows.of(type(numbers), [numbers]),
            self.memory(),
            Rows(float, [[self.datasheet.delay_periods]]),
            Rows(Estimate, np.hstack([poses, velocities])),
            seen := Rows.empty(Estimate, len(poses)),
        )
        program([Stage(motion_stage(self.kernel), view)]).run(0, len(poses))
        return seen["pose"], seen["velocity"]


FACE = ("reset", "update", "estimate")
"""What Python calls. A subclass that overrides one of these is no longer its kernel."""


def flies_as_kernel(estimator: type[Estimator]) -> bool:
    """Whether the kernel of an estimator says all that its class does."""
    return issubclass(estimator, KernelEstimator) and all(
        getattr(estimator, name) is getattr(KernelEstimator, name) for name in FACE
    )


# The stages of a flight, and of its tables, that belong to the estimator.


class EstimateView(NamedTuple):
    """What the stage of the estimator is shown: rows."""

    numbers: Any
    memory: Any
    readings: Any
    estimate: Any


class MotionView(NamedTuple):
    """The same for a known motion: the poses' age, and the motion by period; rows."""

    numbers: Any
    memory: Any
    delay: Any
    motion: Any
    seen: Any


@cache
def estimate_stage(update: Function) -> Function:
    """The stage that asks an estimator, given its kernel."""

    @kernel
    def estimate(view, k):
        view.estimate[0] = update(view.numbers[0], view.memory, view.readings[0], k)

    return estimate


@cache
def motion_stage(update: Function) -> Function:
    """The stage that shows a known motion to an estimator, given its kernel."""

    @kernel
    def see(view, k):
        numbers, now = view.numbers[0], view.motion[k]
        taken = k - k % int(numbers.every) - int(view.delay[0])
        pose = view.motion[max(0, taken)].pose
        velocity = rotate_spatial_back(rotation_matrix(now.pose.attitude), now.velocity)
        is_new = 0.0 if k % int(numbers.every) else 1.0
        readings = Readings(pose, velocity, velocity.angular, (0.0, 0.0, 0.0), is_new)
        view.seen[k] = update(numbers, view.memory, readings, k)

    return see
