"""What sensors as sold do wrong beside noise: bias, drift, scale, missing poses and outliers.

A reading of a gyroscope or an accelerometer of true value x is

    (1 + s) x + b + w_k + noise,    w_k = w_{k-1} + d sqrt(T) n_k,    n_k normal,

entry by entry, with a scale error s and a bias b drawn uniformly within their bounds, once a
flight, and a bias drift w that walks with the density d, in control periods T. The noise has the
weather's standard deviation and, added in squares, that of a noise density, density / sqrt(T).

Of poses there is a gap in every interval, at a time drawn uniformly within it; and each pose is an
outlier with a given probability: displaced by a fixed distance, and turned by a fixed angle, in
directions without preference. The pose of the first period, with which estimators begin, is sound.

Here is what numpy draws of that; `drawn_weather` draws the same bits as kernels.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, Range, from_zero
from fullam.exceptions import ScenarioError

Array = NDArray[np.float64]

MILLI_G = 9.80665e-3
"""1 mg in m/s^2, as datasheets count."""

DEG = np.pi / 180.0

VECTORS = {
    "gyroscope_bias_deg": from_zero(1e4, "deg/s"),
    "accelerometer_bias_mg": from_zero(1e5, "mg"),
}
NUMBERS = {
    "gyroscope_drift_deg": from_zero(1e4, "deg/s/sqrt(s)"),
    "accelerometer_drift_mg": from_zero(1e5, "mg/sqrt(s)"),
    "gyroscope_scale": from_zero(0.5),
    "accelerometer_scale": from_zero(0.5),
    "gyroscope_density_deg": from_zero(1e4, "deg/s/sqrt(Hz)"),
    "accelerometer_density_ug": from_zero(1e8, "ug/sqrt(Hz)"),
    # Every gap is a row: of the longest flight at most ten million.
    "gap_interval": Range(1e-3, 1e6, "s"),
    "gap_duration": from_zero(1e6, "s"),
    "outlier_share": from_zero(1.0),
    "outlier_distance": from_zero(1e4, "m"),
    "outlier_angle_deg": from_zero(180.0, "deg"),
}
"""What makes sense for each field."""


@dataclass(frozen=True)
class SensorErrors:
    """Bounds and statistics of the errors; all of them 0 by default.

    Attributes:
        gyroscope_bias_deg: Largest bias of each axis [deg/s].
        accelerometer_bias_mg: Largest bias of each axis [mg].
        gyroscope_drift_deg: Density of the random walk of the bias [deg/s/sqrt(s)].
        accelerometer_drift_mg: The same [mg/sqrt(s)].
        gyroscope_scale: Largest error of the scale factor, as a share of 1.
        accelerometer_scale: The same.
        gyroscope_density_deg: Noise density [deg/s/sqrt(Hz)].
        accelerometer_density_ug: Noise density [ug/sqrt(Hz)].
        gap_interval: In every interval of this length poses are missing once [s].
        gap_duration: For how long they are missing [s]; 0 for never.
        outlier_share: Probability of a pose to be an outlier.
        outlier_distance: By how much an outlier is displaced [m].
        outlier_angle_deg: By how much it is turned [deg].
    """

    gyroscope_bias_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    accelerometer_bias_mg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gyroscope_drift_deg: float = 0.0
    accelerometer_drift_mg: float = 0.0
    gyroscope_scale: float = 0.0
    accelerometer_scale: float = 0.0
    gyroscope_density_deg: float = 0.0
    accelerometer_density_ug: float = 0.0
    gap_interval: float = 10.0
    gap_duration: float = 0.0
    outlier_share: float = 0.0
    outlier_distance: float = 0.0
    outlier_angle_deg: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers; lists become tuples."""
        check = Checker("weather: sensors", ScenarioError)
        for name, numbers in VECTORS.items():
            object.__setattr__(self, name, check.vector(name, getattr(self, name), 3, numbers))
        for name, numbers in NUMBERS.items():
            object.__setattr__(self, name, check.number(name, getattr(self, name), numbers))
        if self.gap_duration > self.gap_interval:
            raise check.refuse(
                "gap_duration",
                f"{self.gap_duration!r} s is longer than gap_interval",
                "let a gap end before the next may begin",
            )

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Any) -> SensorErrors:
        """The inverse of `to_dict`; what is left out is 0."""
        check = Checker("weather: sensors", ScenarioError)
        values = check.table("sensors", data)
        check.known(values, (*VECTORS, *NUMBERS))
        return cls(**values)

    # In SI units.

    @property
    def bounds(self) -> Array:
        """Largest biases and scale errors, shape (12,).

        Bias of the gyroscope [rad/s] and of the accelerometer [m/s^2], scale of both; in the order
        of the draws.
        """
        scales = np.repeat([self.gyroscope_scale, self.accelerometer_scale], 3)
        gyroscope = np.array(self.gyroscope_bias_deg) * DEG
        accelerometer = np.array(self.accelerometer_bias_mg) * MILLI_G
        return np.concatenate([gyroscope, accelerometer, scales])

    @property
    def drift(self) -> Array:
        """Densities of the drifts, shape (2,) [rad/s/sqrt(s), m/s^2/sqrt(s)]."""
        return np.array([self.gyroscope_drift_deg * DEG, self.accelerometer_drift_mg * MILLI_G])

    @property
    def density(self) -> Array:
        """Noise densities, shape (2,) [rad/s/sqrt(Hz), m/s^2/sqrt(Hz)]."""
        ug = 1e-3 * MILLI_G
        return np.array([self.gyroscope_density_deg * DEG, self.accelerometer_density_ug * ug])

    @property
    def outlier(self) -> Array:
        """Displacement and angle of an outlier, shape (2,) [m, rad]."""
        return np.array([self.outlier_distance, self.outlier_angle_deg * DEG])

    @property
    def are_biased(self) -> bool:
        """Whether the inertial sensors are wrong by more than noise."""
        return bool(self.bounds.any() or self.drift.any())

    @property
    def have_outliers(self) -> bool:
        """Whether some poses are."""
        return bool(self.outlier_share > 0.0 and self.outlier.any())

    @property
    def have_gaps(self) -> bool:
        """Whether poses are missing."""
        return self.gap_duration > 0.0

    def without_lost_poses(self) -> SensorErrors:
        """The same inertial sensors beside a pose sensor without gaps and outliers."""
        names = ("gap_duration", "outlier_share")
        return SensorErrors(**(asdict(self) | dict.fromkeys(names, 0.0)))


EXACT = SensorErrors()
"""None."""

MPU6050 = SensorErrors(
    gyroscope_bias_deg=(20.0, 20.0, 20.0),
    accelerometer_bias_mg=(50.0, 50.0, 80.0),
    gyroscope_drift_deg=0.01,
    accelerometer_drift_mg=0.2,
    gyroscope_scale=0.03,
    accelerometer_scale=0.03,
    gyroscope_density_deg=0.005,
    accelerometer_density_ug=400.0,
    gap_interval=5.0,
    gap_duration=0.5,
    outlier_share=0.02,
    outlier_distance=0.5,
    outlier_angle_deg=20.0,
)
"""The inertial sensor of the paper, as sold and not calibrated: zero-rate output, zero-g output,
tolerances of the scale factors and noise densities of InvenSense's PS-MPU-6000A-00, revision 3.4,
sections 6.1 and 6.2. Of drift it states the variation over temperature, some 0.3 deg/s and 1 mg a
kelvin; what stands here, 0.08 deg/s and 1.5 mg in a minute, is a kelvin or less of warming up.
Poses are those of a camera that loses sight for half a second now and then, and takes one thing for
another in 2 of 100 pictures."""


# The draws.


def inertial_draws(
    errors: SensorErrors,
    periods: int,
    period: float,
    biases: np.random.SeedSequence,
    drifts: np.random.SeedSequence,
) -> tuple[Array, Array]:
    """Offsets, shape (N, 6), and gains 1 + s, shape (6,), of gyroscope and accelerometer.

    Args:
        errors: What is drawn.
        periods: Control periods N.
        period: T [s].
        biases: Seed of biases and scale errors.
        drifts: Seed of the drifts.
    """
    if not errors.are_biased:
        return np.zeros((periods, 6)), np.ones(6)
    drawn = errors.bounds * (-1.0 + 2.0 * np.random.default_rng(biases).random(12))
    rng, steps = np.random.default_rng(drifts), errors.drift * np.sqrt(period)
    walks = [np.cumsum(step * rng.standard_normal((periods, 3)), axis=0) for step in steps]
    return drawn[:6] + np.hstack(walks), 1.0 + drawn[6:]


def outlier_draws(errors: SensorErrors, periods: int, seed: np.random.SeedSequence) -> Array:
    """What outliers add to the noise of the poses, shape (N, 6) [m, rad]; zeros elsewhere."""
    added, rng = np.zeros((periods, 6)), np.random.default_rng(seed)
    hit = np.flatnonzero(rng.random(periods) < errors.outlier_share)
    for k, draws in zip(hit, rng.standard_normal((len(hit), 6)), strict=True):
        for part, size in zip((slice(0, 3), slice(3, 6)), errors.outlier, strict=True):
            x, y, z = draws[part]
            added[k, part] = (size / np.sqrt(x * x + y * y + z * z)) * draws[part]
    added[:1] = 0.0
    return added


def gap_draws(
    errors: SensorErrors, periods: int, period: float, seed: np.random.SeedSequence
) -> Array:
    """1 for each control period that no pose arrives in, else 0; shape (N,)."""
    missing = np.zeros(periods)
    if not errors.have_gaps:
        return missing
    count, rows = gap_counts(errors, periods, period)
    for i, u in enumerate(np.random.default_rng(seed).random(count)):
        start = i * errors.gap_interval + u * (errors.gap_interval - errors.gap_duration)
        first = int(start / period) + 1
        missing[first : first + rows] = 1.0
    return missing


def gap_counts(errors: SensorErrors, periods: int, period: float) -> tuple[int, int]:
    """How many gaps begin in a flight at most, and how many control periods each has."""
    count = int(periods * period / errors.gap_interval) + 1
    return count, max(1, round(errors.gap_duration / period))
