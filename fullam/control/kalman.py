"""Error-state Kalman filter on SE(3): pose, gyroscope and accelerometer to pose and velocity.

The estimate is p, R = R_WA and the velocity v of the origin of {A} in world axes. Its error is the
nine numbers

    x = [p_true - p; log(R^T R_true); v_true - v]    (world, {A}, world),

small, with covariance P. Between two control periods T the inertial readings carry the estimate,

    R+ = R exp(T w),  v+ = v + T a,  p+ = p + T (v + v+) / 2,
    w the mean of two gyroscope readings, a that of R f + g over two accelerometer readings f,

and its error: x+ = F x + noise, with A = d a / d(log R) = -R s(f) and

    F = [1, T^2/2 A, T 1;  0, exp(-T s(w)), 0;  0, T A, 1],    P+ = F P F^T + Q.

F is never written down: it is applied to the columns of P and then to the rows of what results. A
pose reading (p_m, R_m) has the innovation y = [p_m - p; log(R^T R_m)] = [1 0] x + noise. Its six
noises are independent, so its entries are taken in one by one, which is exact and inverts nothing:
with c = P_:j the weight is c / (c_j + N_j), and P loses c c^T / (c_j + N_j).

There are no biases among the states. Behind sensors that have some, as those in the shops do, fly
`kalman_bias`; where there are none, states that are always zero would only slow the rest down.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fullam.control.estimator import Datasheet, EstimatorSettings, Inertial, KernelEstimator
from fullam.control.signals import Estimate
from fullam.dynamics.so3 import boxminus, boxplus, rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial
from fullam.exceptions import SettingsError
from fullam.numbers.kernel import Number, kernel, select, some
from fullam.numbers.records import Rows
from fullam.numbers.vectors import (
    ZERO,
    Matrix,
    Vector,
    add,
    axpy,
    cross,
    rotate,
    scale,
    subtract,
)


@dataclass(frozen=True)
class KalmanSettings(EstimatorSettings):
    """Settings of the filter, beside what the `Datasheet` states.

    Attributes:
        least_pose_noise: Noise that a pose is credited with at least [m, rad]: exact poses would
            make the filter deaf to everything else.
        sampling_noise: What the trapezoid over two readings misses of the mean between them
            [rad/s, m/s^2]. The readings are taken once a control period, and the rotors' answer is
            quicker than that. Added in squares to the sensors' own noise, it also keeps the filter
            awake when they have none. It does not cover a gust of one period, whose impulse the
            trapezoid spreads over two: in the period after it the velocity is off by half the
            impulse, and then right again.
        initial_speed: Standard deviation of the velocity at the start, which is from rest [m/s].
    """

    estimator: ClassVar[str] = "kalman"
    least_pose_noise: tuple[float, float] = (1e-4, 1e-4)
    sampling_noise: tuple[float, float] = (0.0005, 0.01)
    initial_speed: float = 0.01

    def __post_init__(self) -> None:
        """Check the numbers; lists become tuples."""
        for field, count in (("least_pose_noise", 2), ("sampling_noise", 2), ("initial_speed", 1)):
            self._become(field, count)

    def _become(self, field: str, count: int, least: float = 0.0) -> None:
        """Make a field so many numbers above the least, or say what is wrong."""
        values = np.asarray(getattr(self, field), dtype=float)
        if values.size != count or not np.all((values > least) & (values < np.inf)):
            raise SettingsError(
                f"estimator '{self.estimator}'",
                field,
                f"is {getattr(self, field)!r}",
                f"give {'two numbers' if count == 2 else 'a number'} above {least:g}",
            )
        object.__setattr__(self, field, tuple(values.tolist()) if count == 2 else float(values))


class KalmanNumbers(NamedTuple):
    """Rates, gravity and variances.

    Control periods between two poses; control period T; gravity along -z of {W}. Variances that a
    period adds: of position, of position with velocity, of velocity, of attitude. Variances of a
    pose reading, position and attitude; of the velocity at the start.
    """

    every: Number
    period: Number
    gravity: Number
    position: Number
    mixed: Number
    velocity: Number
    attitude: Number
    read_position: Number
    read_attitude: Number
    start: Number


def kalman_numbers(sheet: Datasheet, settings: KalmanSettings, period: float) -> KalmanNumbers:
    """The filter as numbers, by what the sensors' sheet states and the control period [s]."""
    s, T = settings, period
    q_w = sheet.gyroscope_noise**2 + s.sampling_noise[0] ** 2
    q_a = sheet.accelerometer_noise**2 + s.sampling_noise[1] ** 2
    return KalmanNumbers(
        every=float(sheet.pose_every),
        period=T,
        gravity=sheet.gravity,
        position=0.25 * T**4 * q_a,
        mixed=0.5 * T**3 * q_a,
        velocity=T**2 * q_a,
        attitude=T**2 * q_w,
        read_position=max(sheet.position_noise, s.least_pose_noise[0]) ** 2,
        read_attitude=max(sheet.attitude_noise, s.least_pose_noise[1]) ** 2,
        start=s.initial_speed**2,
    )


class InertialPose(NamedTuple):
    """Pose, velocity of the origin of {A} in world axes, and the inertial readings there."""

    pose: Pose
    velocity: Vector
    inertial: Inertial


class Error(NamedTuple):
    """An error of position (world), attitude ({A}) and velocity (world)."""

    position: Vector
    attitude: Vector
    velocity: Vector


class Step(NamedTuple):
    """What F is made of: T, T w, and d v+ / d(log R) = T A."""

    period: Number
    turn: Vector
    push: Matrix


class KalmanMemory(NamedTuple):
    """Rows.

    The estimate at the time of the poses, one `InertialPose`; P, nine rows of nine numbers; the
    `Inertial` readings since, one more than the age of a pose; and room to take a pose in: its
    innovation (6), the correction (9) and a column of P (9).
    """

    late: Any
    covariance: Any
    waiting: Any
    innovation: Any
    correction: Any
    column: Any


@kernel
def kalman(numbers, memory, readings, k):
    """Carry the estimate to this period and take in a new pose.

    A delayed pose is met at its own time: the filter runs as far behind as the poses are old, and
    the inertial readings since then carry its estimate to the present, where it has no lag. The
    first poses that arrive late all show the start, where the filter then waits.
    """
    late, waiting = memory.late, memory.waiting
    span = len(waiting)
    waiting[k % span] = Inertial(readings.gyroscope, readings.accelerometer)
    if k == 0:
        late[0] = InertialPose(readings.pose, ZERO, waiting[0])
        begin(numbers, memory.covariance)
    elif k >= span:
        before = late[0]
        after = carry(numbers, before, waiting[(k + 1) % span])
        late[0] = after
        predict(numbers, memory.covariance, step_between(numbers, before, after))
    if k > 0 and k % int(numbers.every) == 0 and some(readings.is_new > 0.0):
        late[0] = take(numbers, memory, late[0], readings)
    now = late[0]
    for i in range(max(1, k - span + 2), k + 1):
        now = carry(numbers, now, waiting[i % span])
    w = rotate(rotation_matrix(now.pose.attitude), readings.gyroscope)
    return Estimate(now.pose, Spatial(now.velocity, w))


# The estimate.


@kernel
def carry(numbers, now, inertial):
    """One control period on, to the readings at its end."""
    T, pose = numbers.period, now.pose
    attitude = boxplus(pose.attitude, mean_turn(T, now.inertial, inertial))
    a = acceleration(numbers, pose.attitude, now.inertial)
    b = acceleration(numbers, attitude, inertial)
    change = scale(0.5 * T, add(a, b))
    position = axpy(T, axpy(0.5, change, now.velocity), pose.position)
    return InertialPose(Pose(position, attitude), add(now.velocity, change), inertial)


@kernel
def mean_turn(period, a, b):
    """T w: what the platform turns between two readings, {A} axes."""
    return scale(0.5 * period, add(a.gyroscope, b.gyroscope))


@kernel
def acceleration(numbers, attitude, inertial):
    """R f + g, world axes."""
    a = rotate(rotation_matrix(attitude), inertial.accelerometer)
    return (a[0], a[1], a[2] - numbers.gravity)


@kernel
def corrected(now, x):
    """The estimate moved by an error."""
    pose = Pose(add(now.pose.position, x.position), boxplus(now.pose.attitude, x.attitude))
    return InertialPose(pose, add(now.velocity, x.velocity), now.inertial)


# Its error.


@kernel
def step_between(numbers, before, after):
    """F of a control period, from the estimates at its ends."""
    T, R = numbers.period, rotation_matrix(after.pose.attitude)
    push = pushed(R, scale(-T, after.inertial.accelerometer))
    return Step(T, mean_turn(T, before.inertial, after.inertial), push)


@kernel
def pushed(R, f):
    """R s(f), whose row is r s(f) = r x f for a row r of R."""
    a, b, c = cross(R[0:3], f), cross(R[3:6], f), cross(R[6:9], f)
    return (a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2])


@kernel
def carry_error(step, x):
    """F x."""
    v = add(x.velocity, rotate(step.push, x.attitude))
    p = axpy(0.5 * step.period, add(x.velocity, v), x.position)
    return Error(p, subtract(x.attitude, cross(step.turn, x.attitude)), v)


@kernel
def begin(numbers, P):
    """P at the start: as uncertain as one pose reading is, and nearly at rest."""
    for i in range(9):
        for j in range(9):
            P[i][j] = 0.0
    uncertain(numbers, P)


@kernel
def uncertain(numbers, P):
    """Variances of position, attitude and velocity at the start."""
    for i in range(3):
        P[i][i] = numbers.read_position
        P[3 + i][3 + i] = numbers.read_attitude
        P[6 + i][6 + i] = numbers.start


@kernel
def predict(numbers, P, step):
    """P becomes F P F^T + Q, symmetric to the last bit: the upper triangle mirrors the lower."""
    for j in range(9):
        x = Error(
            (P[0][j], P[1][j], P[2][j]), (P[3][j], P[4][j], P[5][j]), (P[6][j], P[7][j], P[8][j])
        )
        x = carry_error(step, x)
        P[0][j], P[1][j], P[2][j] = x.position
        P[3][j], P[4][j], P[5][j] = x.attitude
        P[6][j], P[7][j], P[8][j] = x.velocity
    for i in range(9):
        row = P[i]
        x = Error((row[0], row[1], row[2]), (row[3], row[4], row[5]), (row[6], row[7], row[8]))
        x = carry_error(step, x)
        row[0], row[1], row[2] = x.position
        row[3], row[4], row[5] = x.attitude
        row[6], row[7], row[8] = x.velocity
        for j in range(i):
            P[j][i] = row[j]
    add_noise(numbers, P)


@kernel
def add_noise(numbers, P):
    """Add Q, what a period adds to the uncertainty of position, attitude and velocity."""
    for i in range(3):
        P[i][i] = P[i][i] + numbers.position
        P[3 + i][3 + i] = P[3 + i][3 + i] + numbers.attitude
        P[6 + i][6 + i] = P[6 + i][6 + i] + numbers.velocity
        P[i][6 + i] = P[i][6 + i] + numbers.mixed
        P[6 + i][i] = P[6 + i][i] + numbers.mixed


@kernel
def innovate(y, reading, pose):
    """Write the innovation [p_m - p; log(R^T R_m)] of a pose reading to y."""
    y[0], y[1], y[2] = subtract(reading.position, pose.position)
    y[3], y[4], y[5] = boxminus(reading.attitude, pose.attitude)


@kernel
def take(numbers, memory, now, readings):
    """Correct estimate and covariance by a pose reading, in the flights that have a new one."""
    is_new = readings.is_new
    P, y, x, c = memory.covariance, memory.innovation, memory.correction, memory.column
    innovate(y, readings.pose, now.pose)
    for i in range(9):
        x[i] = 0.0
    for j in range(6):
        for i in range(9):
            c[i] = P[j][i] if i < j else P[i][j]
        weight = is_new / (c[j] + (numbers.read_position if j < 3 else numbers.read_attitude))
        surprise = weight * (y[j] - x[j])
        for i in range(9):
            x[i] = x[i] + c[i] * surprise
            share = weight * c[i]
            for m in range(i + 1):
                P[i][m] = P[i][m] - share * c[m]
    for i in range(9):
        for j in range(i):
            P[j][i] = P[i][j]
    after = corrected(now, Error((x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[6], x[7], x[8])))
    return select(is_new > 0.0, after, now)


class Kalman(KernelEstimator):
    """Error-state Kalman filter: gyroscope, accelerometer and pose, by their `Datasheet`."""

    name = "kalman"
    Settings = KalmanSettings
    settings: KalmanSettings
    needs_inertial = True
    kernel = staticmethod(kalman)

    def numbers(self) -> KalmanNumbers:
        """See `KalmanNumbers`."""
        return kalman_numbers(self.datasheet, self.settings, self.period)

    def memory(self, lanes: int = 0) -> KalmanMemory:
        """Room, to be filled in the first period."""
        return KalmanMemory(
            Rows.empty(InertialPose, 1, lanes=lanes),
            Rows.empty(float, 9, 9, lanes=lanes),
            Rows.empty(Inertial, self.datasheet.delay_periods + 1, lanes=lanes),
            Rows.empty(float, 6, lanes=lanes),
            Rows.empty(float, 9, lanes=lanes),
            Rows.empty(float, 9, lanes=lanes),
        )
