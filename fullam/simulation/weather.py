"""Noise, disturbances and parameter errors: drawn before the flight, the same for everyone.

One seed spawns separate streams for the pose noise, the disturbance, the inertial sensors and the
parameters, so two controllers with one seed meet exactly the same weather, however they fly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, Range, from_zero, positive
from fullam.exceptions import ScenarioError
from fullam.model.perturbation import Uncertainty
from fullam.registry import Registry
from fullam.simulation.sensor_errors import (
    EXACT,
    MPU6050,
    SensorErrors,
    gap_draws,
    inertial_draws,
    outlier_draws,
)

Array = NDArray[np.float64]


RANGES = {
    "position_noise": from_zero(1e3, "m"),
    "attitude_noise_deg": from_zero(360.0, "deg"),
    # Noise is redrawn until it is within the bound: at 0.1 it takes 13 draws, at 1e-6 a million.
    "noise_bound": Range(0.1, 1e6, "standard deviations"),
    "force_disturbance": from_zero(1e6, "N"),
    "moment_disturbance": from_zero(1e6, "N m"),
    # Every gust is a row: of the longest flight at most ten million.
    "gust_interval": Range(1e-3, 1e6, "s"),
    "gust_duration": positive(1e6, "s"),
    "gyroscope_noise": from_zero(1e4, "rad/s"),
    "accelerometer_noise": from_zero(1e6, "m/s^2"),
}
"""What makes sense for each number."""


@dataclass(frozen=True)
class Weather:
    """What spoils a flight.

    Attributes:
        position_noise: Standard deviation of the measured position, each axis [m].
        attitude_noise_deg: Standard deviation of the measured attitude, each body axis [deg].
        noise_bound: Noise is redrawn until within this many standard deviations.
        force_disturbance: Standard deviation of the force gusts, each axis [N].
        moment_disturbance: Standard deviation of the moment gusts, each axis [N m].
        gust_interval: Time between gusts [s]; the first one comes after one interval.
        gust_duration: Time for which a gust lasts [s].
        gyroscope_noise: Standard deviation of a gyroscope sample [rad/s].
        accelerometer_noise: Standard deviation of an accelerometer sample [m/s^2].
        uncertainty: Which true parameters differ from the nominal ones, and by how much.
        sensors: What the sensors do wrong beside noise.
    """

    position_noise: float = 0.0
    attitude_noise_deg: float = 0.0
    noise_bound: float = np.inf
    force_disturbance: float = 0.0
    moment_disturbance: float = 0.0
    gust_interval: float = 1.0
    gust_duration: float = 0.01
    gyroscope_noise: float = 0.0
    accelerometer_noise: float = 0.0
    uncertainty: Uncertainty = field(default_factory=lambda: Uncertainty(share=0.0))
    sensors: SensorErrors = EXACT

    def __post_init__(self) -> None:
        """Check the numbers."""
        check = Checker("weather", ScenarioError)
        for name, numbers in RANGES.items():
            value = getattr(self, name)
            if name == "noise_bound" and isinstance(value, float) and value == np.inf:
                continue
            object.__setattr__(self, name, check.number(name, value, numbers))
        check.instance("uncertainty", self.uncertainty, Uncertainty)
        check.instance("sensors", self.sensors, SensorErrors)
        if self.gust_duration > self.gust_interval:
            raise ScenarioError(
                "weather",
                "gust_duration",
                f"{self.gust_duration!r} s is longer than gust_interval",
                "let a gust end before the next begins",
            )

    @property
    def noise_scale(self) -> Array:
        """Standard deviations of the pose noise, shape (6,) [m, rad]."""
        return np.repeat([self.position_noise, np.radians(self.attitude_noise_deg)], 3)

    @property
    def gust_scale(self) -> Array:
        """Standard deviations of a gust, shape (6,) [N, N m]."""
        return np.repeat([self.force_disturbance, self.moment_disturbance], 3)

    def inertial_scale(self, period: float) -> tuple[float, float]:
        """Standard deviations of a sample of gyroscope and accelerometer [rad/s, m/s^2].

        Args:
            period: Time between two samples [s], over which a noise density is averaged.
        """
        w, f = self.sensors.density / math.sqrt(period)
        return math.hypot(self.gyroscope_noise, w), math.hypot(self.accelerometer_noise, f)

    def to_dict(self) -> dict[str, Any]:
        """JSON values; an infinite bound becomes None."""
        data = {f.name: getattr(self, f.name) for f in fields(self)}
        data["uncertainty"] = self.uncertainty.to_dict()
        data["sensors"] = self.sensors.to_dict()
        data["noise_bound"] = None if np.isinf(self.noise_bound) else self.noise_bound
        return data

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Weather:
        """The inverse of `to_dict`."""
        check = Checker("weather", ScenarioError)
        values = check.table("weather", data)
        check.known(values, tuple(f.name for f in fields(cls)))
        if "uncertainty" in values:
            values["uncertainty"] = Uncertainty.from_dict(values["uncertainty"])
        if "sensors" in values:
            values["sensors"] = SensorErrors.from_dict(values["sensors"])
        if values.get("noise_bound", 0.0) is None:
            values["noise_bound"] = np.inf
        return cls(**values)


CALM = Weather()
"""No noise, no gusts, the true vehicle is the nominal one."""

RECORDED = Weather(
    position_noise=0.010,
    attitude_noise_deg=1.0,
    force_disturbance=10.0,
    moment_disturbance=1.745,
    gyroscope_noise=0.005,
    accelerometer_noise=0.05,
)
"""The noise and gusts of the runs that the paper's group published: sigma 10 mm and 1 deg; once a
second, for one sample of 10 ms, a gust of sigma 10 N and 1.745 N m. The parameters are exact. The
inertial sensors' noise (which their controller did not read) is a small MEMS unit's."""

PAPER = replace(RECORDED, noise_bound=2.5, uncertainty=Uncertainty(share=0.10))
"""As recorded, with the paper's bound of +-25 mm on the noise (2.5 sigma; its +-3 deg would be 3
sigma) and its +-10 % on the parameters."""

SOLD = replace(PAPER, sensors=MPU6050)
"""The paper's, with sensors as they are sold: biased, drifting, their scales off, poses missing at
times and wrong at others."""

STREAMS = (
    *("noise", "gusts", "inertial", "parameters"),
    *("biases", "drifts", "gaps", "outliers"),
)
"""What is random, in the order of the streams that a seed spawns; more of them go to the end."""

WEATHERS: Registry[Weather] = Registry(
    "weather", {"calm": CALM, "recorded": RECORDED, "paper": PAPER, "sold": SOLD}
)


def weather(name: str) -> Weather:
    """The weather of that name: "calm", "recorded", "paper" or "sold".

    Raises:
        UnknownName: There is no such weather.
    """
    return WEATHERS[name]


@dataclass(frozen=True, eq=False)
class Forecast:
    """One draw of the weather, on the control grid of a flight.

    Attributes:
        weather: The statistics.
        period: Control period [s].
        pose_noise: [position (world), attitude (tangent at {A})], shape (N, 6) [m, rad]; outliers
            are part of it.
        disturbance: Wrench on the platform at its origin, world axes, shape (N, 6) [N, N m], held
            over each control period.
        missing: 1 for each control period that no pose arrives in, else 0; shape (N,).
        offsets: Bias and drift of gyroscope and accelerometer, shape (N, 6) [rad/s, m/s^2].
        gains: What gyroscope and accelerometer make of 1, shape (6,).
        inertial: Seed of the noise of the inertial sensors, which is drawn when it is first read.
        parameters: Generator for the draw of the true vehicle.
    """

    weather: Weather
    period: float
    pose_noise: Array
    disturbance: Array
    missing: Array
    offsets: Array
    gains: Array
    inertial: np.random.SeedSequence
    parameters: np.random.Generator

    @property
    def gyroscope_noise(self) -> Array:
        """Noise of the gyroscope, shape (N, 3) [rad/s]."""
        return self._inertial_noise[0]

    @property
    def accelerometer_noise(self) -> Array:
        """Noise of the accelerometer, shape (N, 3) [m/s^2]."""
        return self._inertial_noise[1]

    @property
    def inertial_noise(self) -> Array:
        """What is added to the readings of both: noise, bias and drift, shape (N, 6)."""
        return np.hstack(self._inertial_noise) + self.offsets

    @cached_property
    def _inertial_noise(self) -> tuple[Array, Array]:
        # Few estimators read these sensors, and their noise is half of what there is to draw.
        # A generator of its own each time: a copy, or a second thread, draws the same.
        rng, shape = np.random.default_rng(self.inertial), (len(self.pose_noise), 3)
        gyroscope, accelerometer = self.weather.inertial_scale(self.period)
        return rng.standard_normal(shape) * gyroscope, rng.standard_normal(shape) * accelerometer


def forecast(weather: Weather, seed: int, t: Array) -> Forecast:
    """Draw the weather of a flight.

    Args:
        weather: Its statistics.
        seed: One number; each kind of randomness gets a stream of its own from it.
        t: Control grid [s], shape (N,).
    """
    spawned = np.random.SeedSequence(seed).spawn(len(STREAMS))
    streams = dict(zip(STREAMS, spawned, strict=True))
    period, errors = control_period(t, weather), weather.sensors
    noise = np.random.default_rng(streams["noise"])
    pose_noise = noise.standard_normal((t.size, 6))
    while (outside := np.abs(pose_noise) > weather.noise_bound).any():
        pose_noise[outside] = noise.standard_normal(int(outside.sum()))
    pose_noise *= weather.noise_scale
    if errors.have_outliers:
        pose_noise += outlier_draws(errors, t.size, streams["outliers"])
    gusts = np.random.default_rng(streams["gusts"])
    parameters = np.random.default_rng(streams["parameters"])
    disturbance = GustTable.of(weather, t).disturbance(weather, gusts)
    missing = gap_draws(errors, t.size, period, streams["gaps"])
    offsets, gains = inertial_draws(errors, t.size, period, streams["biases"], streams["drifts"])
    parts = period, pose_noise, disturbance, missing, offsets, gains
    return Forecast(weather, *parts, streams["inertial"], parameters)


def control_period(t: Array, weather: Weather) -> float:
    """Step of a control grid [s]; of a grid of one row it can be any."""
    return float(t[1] - t[0]) if t.size > 1 else weather.gust_duration


@dataclass(frozen=True, eq=False)
class GustTable:
    """Which gusts each control period holds, as read-only columns; gust k begins after k intervals.

    A control period holds the mean over the period of every gust that it touches, so that the
    impulse is the same at every control rate.

    Attributes:
        periods: Number of control periods N.
        gusts: Number of gusts to draw; the first, 0, never blows.
        period: Control period of each entry, shape (E,), int; from the last gust of a period back.
        gust: Number of its gust, shape (E,), int.
        share: Share of the period in which that gust blows, shape (E,).
    """

    periods: int
    gusts: int
    period: NDArray[np.intp]
    gust: NDArray[np.intp]
    share: Array

    @classmethod
    def of(cls, weather: Weather, t: Array) -> GustTable:
        """The gusts of a weather on a control grid t [s], shape (N,)."""
        period = control_period(t, weather)
        interval, duration = weather.gust_interval, weather.gust_duration
        end = t + period
        last = np.floor((end - 1e-9) / interval).astype(int)  # gust to begin within the period
        entries = []
        # Of gusts shorter than the calm between them a short period touches the last one only.
        for back in range(math.ceil((period + duration) / interval)):
            number = last - back if back else last
            start = number * interval
            overlap = np.minimum(end, start + duration) - np.maximum(t, start)
            blowing = ((overlap > 0.0) & (number >= 1)).nonzero()[0]
            share = np.minimum(overlap[blowing] / period, 1.0).round(9)
            entries.append((blowing, number[blowing], share))
        columns = [np.concatenate(column) for column in zip(*entries, strict=True)]
        for column in columns:
            column.setflags(write=False)
        return cls(t.size, int(last.max(initial=0)) + 1, *columns)

    def disturbance(self, weather: Weather, rng: np.random.Generator) -> Array:
        """Draw the disturbance wrenches, shape (N, 6) [N, N m]."""
        draws = rng.standard_normal((self.gusts, 6)) * weather.gust_scale
        disturbance = np.zeros((self.periods, 6))
        # One after the other: a period may hold several gusts.
        np.add.at(disturbance, self.period, draws[self.gust] * self.share[:, None])
        return disturbance
