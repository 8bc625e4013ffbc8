"""Error-state Kalman filter on SE(3) that finds out the bias of gyroscope and accelerometer.

The estimate is that of `kalman`, and beside it the biases b_w and b_f of what the two sensors read.
Its error is the fifteen numbers

    x = [p_true - p; log(R^T R_true); v_true - v; b_w,true - b_w; b_f,true - b_f]

of which the last six are in {A} axes. The estimate is carried by readings less their biases, as
there, and P as `bias_covariance` says.

**Rest.** At the start the vehicle is at rest, so the gyroscope reads its bias, and the
accelerometer -R^T g and its bias: one reading of each is taken in as a measurement.

**Scale.** A scale error s is a bias s x that moves with the true value x. It is no state; but where
x has moved lately, part of s x is a bias that nobody has seen yet. With the mean m of x over a time
constant tau, and the mean n of m, Q credits the bias with (sigma_s (m - n))^2 4 T / tau a period,
which for a step of x comes to (sigma_s step)^2 in all. What jitters has no mean and costs nothing.

**Outliers.** A pose is taken in only where its innovation is plausible; see `pose_gate`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from fullam.control.bias_covariance import absorb, bias_step, mirror, predict
from fullam.control.estimator import Inertial, KernelEstimator
from fullam.control.kalman import (
    InertialPose,
    Kalman,
    KalmanNumbers,
    KalmanSettings,
    carry,
    innovate,
    kalman_numbers,
    uncertain,
)
from fullam.control.pose_gate import distance, doubt
from fullam.control.signals import Estimate
from fullam.dynamics.so3 import boxplus, rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial
from fullam.numbers.kernel import Number, both, kernel, select, some
from fullam.numbers.records import Rows
from fullam.numbers.vectors import ZERO, add, axpy, rotate, scale, subtract

STATES, READ = 15, 6
"""Entries of the error, and of a pose."""


@dataclass(frozen=True)
class KalmanBiasSettings(KalmanSettings):
    """Settings of the filter, beside those of `Kalman` and what the `Datasheet` states.

    Attributes:
        initial_motion: Standard deviations of rate and acceleration at the start, which is at rest
            [rad/s, m/s^2].
        least_bias: Standard deviations of the biases that the sensors are credited with at least
            [rad/s, m/s^2]: a filter that is certain of them never learns otherwise.
        scale_time: Time constant tau with which a scale error becomes part of the bias [s].
        gate: Squared Mahalanobis distance beyond which a pose is an outlier: 27.9 is exceeded by
            one sound pose in 10 000.
        patience: How many poses in a row may be rejected before P grows.
        growth: By what each further rejection multiplies P.
    """

    estimator: ClassVar[str] = "kalman-bias"
    initial_motion: tuple[float, float] = (0.002, 0.02)
    least_bias: tuple[float, float] = (1e-4, 1e-3)
    scale_time: float = 0.2
    gate: float = 27.9
    patience: float = 4.0
    growth: float = 3.0

    def __post_init__(self) -> None:
        """Check the numbers; lists become tuples."""
        super().__post_init__()
        for field, count in (("initial_motion", 2), ("least_bias", 2), ("scale_time", 1)):
            self._become(field, count)
        self._become("gate", 1)
        self._become("patience", 1, least=-1.0)
        self._become("growth", 1, least=1.0)


class KalmanBiasNumbers(NamedTuple):
    """What `Kalman` knows, the variances of the biases, and the gate.

    Variances at the start, of both biases and of what the readings there are off; variances that a
    period adds to the biases; the same by the square of how far a mean has moved; share of a
    reading in that mean; and the gate's settings.
    """

    kalman: KalmanNumbers
    start_bias: tuple[Number, Number]
    start_noise: tuple[Number, Number]
    drift: tuple[Number, Number]
    scale: tuple[Number, Number]
    share: Number
    gate: Number
    patience: Number
    growth: Number


class Flying(NamedTuple):
    """Pose, velocity and the inertial readings there, less the biases; and the biases.

    Then the mean of the readings less biases, over the last `scale_time`, and the mean of that.
    """

    now: InertialPose
    bias: Inertial
    mean: Inertial
    slow: Inertial


class BiasMemory(NamedTuple):
    """Rows.

    The estimate at the time of the poses, one `Flying`; P, fifteen rows of as many numbers; the
    `Inertial` readings since, one more than the age of a pose; room to take a pose in: its
    innovation (6), the correction (15), a column of P (15), the factors of the innovation's
    covariance (6 x 6); and how many poses in a row were rejected.
    """

    late: Any
    covariance: Any
    waiting: Any
    innovation: Any
    correction: Any
    column: Any
    factor: Any
    rejected: Any


@kernel
def kalman_bias(numbers, memory, readings, k):
    """Carry the estimate to this period and take in a new pose; see `kalman` for late poses."""
    late, waiting = memory.late, memory.waiting
    span = len(waiting)
    waiting[k % span] = Inertial(readings.gyroscope, readings.accelerometer)
    if k == 0:
        late[0] = begin(numbers, memory, readings)
    elif k >= span:
        before = late[0]
        after = carry_on(numbers, before, waiting[(k + 1) % span])
        late[0] = after
        step = bias_step(numbers.kalman.period, before.now, after.now)
        predict(numbers, memory.covariance, step, unbiased(after.mean, after.slow))
    if k > 0 and k % int(numbers.kalman.every) == 0 and some(readings.is_new > 0.0):
        late[0] = take(numbers, memory, readings)
    flying = late[0]
    for i in range(max(1, k - span + 2), k + 1):
        flying = carry_on(numbers, flying, waiting[i % span])
    now = flying.now
    w = rotate(rotation_matrix(now.pose.attitude), now.inertial.gyroscope)
    return Estimate(now.pose, Spatial(now.velocity, w))


# The estimate.


@kernel
def unbiased(inertial, bias):
    """Readings less their biases."""
    return Inertial(
        subtract(inertial.gyroscope, bias.gyroscope),
        subtract(inertial.accelerometer, bias.accelerometer),
    )


@kernel
def carry_on(numbers, flying, reading):
    """One control period on, to the readings at its end."""
    inertial, share = unbiased(reading, flying.bias), numbers.share
    mean = nearer(share, flying.mean, inertial)
    slow = nearer(share, flying.slow, mean)
    return Flying(carry(numbers.kalman, flying.now, inertial), flying.bias, mean, slow)


@kernel
def nearer(share, a, b):
    """Moved from a by a share of the way to b."""
    return Inertial(
        axpy(share, subtract(b.gyroscope, a.gyroscope), a.gyroscope),
        axpy(share, subtract(b.accelerometer, a.accelerometer), a.accelerometer),
    )


@kernel
def corrected(flying, x):
    """The estimate moved by an error, fifteen numbers."""
    now, bias = flying.now, flying.bias
    w, f = (x[9], x[10], x[11]), (x[12], x[13], x[14])
    pose = Pose(
        add(now.pose.position, (x[0], x[1], x[2])),
        boxplus(now.pose.attitude, (x[3], x[4], x[5])),
    )
    inertial = Inertial(
        subtract(now.inertial.gyroscope, w), subtract(now.inertial.accelerometer, f)
    )
    moved = InertialPose(pose, add(now.velocity, (x[6], x[7], x[8])), inertial)
    bias = Inertial(add(bias.gyroscope, w), add(bias.accelerometer, f))
    return Flying(moved, bias, flying.mean, flying.slow)


# The start.


@kernel
def begin(numbers, memory, readings):
    """At rest at the first pose: what the inertial sensors read there tells of their biases."""
    P, x, c = memory.covariance, memory.correction, memory.column
    memory.rejected[0] = 0.0
    for i in range(15):
        x[i] = 0.0
        for j in range(15):
            P[i][j] = 0.0
    uncertain(numbers.kalman, P)
    for i in range(3):
        P[9 + i][9 + i] = numbers.start_bias[0]
        P[12 + i][12 + i] = numbers.start_bias[1]
    R, w = rotation_matrix(readings.pose.attitude), readings.gyroscope
    up = scale(numbers.kalman.gravity, R[6:9])  # -R^T g; turning R by e turns it by up x e
    y = subtract(readings.accelerometer, up)
    for i in range(3):
        for j in range(15):
            c[j] = P[j][9 + i]
        read = w[0] if i == 0 else (w[1] if i == 1 else w[2])
        absorb(P, x, c, 1.0 / (c[9 + i] + numbers.start_noise[0]), read - x[9 + i])
        mirror(P)
    felt(numbers, memory, 0, (0.0, -up[2], up[1]), y[0])
    felt(numbers, memory, 1, (up[2], 0.0, -up[0]), y[1])
    felt(numbers, memory, 2, (-up[1], up[0], 0.0), y[2])
    rest = Inertial(readings.gyroscope, readings.accelerometer)
    here = Flying(InertialPose(readings.pose, ZERO, rest), Inertial(ZERO, ZERO), rest, rest)
    begun = corrected(here, x)
    return Flying(begun.now, begun.bias, begun.now.inertial, begun.now.inertial)


@kernel
def felt(numbers, memory, i, turn, y):
    """Take in an entry of the accelerometer at rest, which turning by e changes by turn e.

    Args:
        numbers: `KalmanBiasNumbers`.
        memory: `BiasMemory`.
        i: The entry.
        turn: Row of s(up).
        y: What it reads, less what it would at the pose that was read.
    """
    P, x, c = memory.covariance, memory.correction, memory.column
    for j in range(15):
        row = P[j]
        c[j] = turn[0] * row[3] + turn[1] * row[4] + turn[2] * row[5] + row[12 + i]
    variance = turn[0] * c[3] + turn[1] * c[4] + turn[2] * c[5] + c[12 + i]
    expected = turn[0] * x[3] + turn[1] * x[4] + turn[2] * x[5] + x[12 + i]
    absorb(P, x, c, 1.0 / (variance + numbers.start_noise[1]), y - expected)
    mirror(P)


# A pose.


@kernel
def take(numbers, memory, readings):
    """Correct estimate and covariance by a new pose, where there is one and it is plausible."""
    P, y, x, c = memory.covariance, memory.innovation, memory.correction, memory.column
    flying, own = memory.late[0], numbers.kalman
    innovate(y, readings.pose, flying.now.pose)
    is_new = readings.is_new > 0.0
    plausible = distance(numbers, memory) <= numbers.gate
    taken = both(is_new, plausible)
    accept = select(taken, 1.0, 0.0)
    for i in range(15):
        x[i] = 0.0
    for j in range(6):
        for i in range(15):
            c[i] = P[j][i] if i < j else P[i][j]
        weight = accept / (c[j] + (own.read_position if j < 3 else own.read_attitude))
        absorb(P, x, c, weight, y[j] - x[j])
    doubt(numbers, memory, is_new, plausible)
    mirror(P)
    return select(taken, corrected(flying, x), flying)


class KalmanBias(KernelEstimator):
    """Error-state Kalman filter with bias states, by its `Datasheet`; rejects outliers."""

    name = "kalman-bias"
    Settings = KalmanBiasSettings
    settings: KalmanBiasSettings
    needs_inertial = True
    knows_bias = True
    rejects_outliers = True
    stands_for = Kalman.name
    kernel = staticmethod(kalman_bias)

    def numbers(self) -> KalmanBiasNumbers:
        """See `KalmanBiasNumbers`."""
        sheet, s, T = self.datasheet, self.settings, self.period
        # At rest the scale error of the accelerometer is a bias, too.
        weight = sheet.accelerometer_scale * sheet.gravity
        bias_w = sheet.gyroscope_bias**2 + s.least_bias[0] ** 2
        bias_f = sheet.accelerometer_bias**2 + s.least_bias[1] ** 2 + weight**2
        start_w = sheet.gyroscope_noise**2 + s.initial_motion[0] ** 2
        start_f = sheet.accelerometer_noise**2 + s.initial_motion[1] ** 2
        share = min(1.0, T / s.scale_time)
        return KalmanBiasNumbers(
            kalman_numbers(sheet, s, T),
            start_bias=(bias_w, bias_f),
            start_noise=(start_w, start_f),
            drift=(T * sheet.gyroscope_drift**2, T * sheet.accelerometer_drift**2),
            scale=(
                4.0 * share * sheet.gyroscope_scale**2,
                4.0 * share * sheet.accelerometer_scale**2,
            ),
            share=share,
            gate=s.gate,
            patience=s.patience,
            growth=s.growth,
        )

    def memory(self, lanes: int = 0) -> BiasMemory:
        """Room, to be filled in the first period."""
        return BiasMemory(
            Rows.empty(Flying, 1, lanes=lanes),
            Rows.empty(float, STATES, STATES, lanes=lanes),
            Rows.empty(Inertial, self.datasheet.delay_periods + 1, lanes=lanes),
            Rows.empty(float, READ, lanes=lanes),
            Rows.empty(float, STATES, lanes=lanes),
            Rows.empty(float, STATES, lanes=lanes),
            Rows.empty(float, READ, READ, lanes=lanes),
            Rows.empty(float, 1, lanes=lanes),
        )
