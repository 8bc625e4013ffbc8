"""Error-state Kalman filter on SE(3): pose, gyroscope and accelerometer to pose and velocity.

The estimate is p, R = R_WA and the velocity v of the origin of {A} in world axes. Its error is the
nine numbers

    x = [p_true - p; log(R^T R_true); v_true - v]    (world, {A}, world),

small, with covariance P. Between two control periods T the inertial readings carry the estimate,

    R+ = R exp(T w),  v+ = v + T a,  p+ = p + T (v + v+) / 2,
    w the mean of two gyroscope readings, a that of R f + g over two accelerometer readings f,

and its error: x+ = F x + noise, with A = d a / d(log R) = -R s(f) and

    F = [1, T^2/2 A, T 1;  0, exp(-T s(w)), 0;  0, T A, 1],    P+ = F P F^T + Q.

A pose reading (p_m, R_m) has the innovation y = [p_m - p; log(R^T R_m)] = [1 0] x + noise, whose
correction is x = P_:h S^{-1} y with S = P_hh + N. With S = L L^T and W = L^{-1} P_h: the covariance
after it is P - W^T W, symmetric to the last bit.

There are no biases among the states: the simulated inertial sensors have none, and two states that
are always zero would only slow the rest down.
"""

from __future__ import annotations

from collections import deque

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dtrtrs

from fullam.control.controller import Measurement
from fullam.control.estimator import Datasheet, Estimator, Readings, register_estimator
from fullam.dynamics.pose_space import IDENTITY, AttitudeView, pose_model

Array = NDArray[np.float64]

LEAST_POSE_NOISE = (1e-4, 1e-4)
"""Noise that a pose is credited with at least [m, rad]: exact poses would make S singular."""

SAMPLING_NOISE = (0.0005, 0.01)
"""What the trapezoid over two readings misses of the mean between them [rad/s, m/s^2].

The readings are taken once a control period, and the rotors' answer is quicker than that. Added in
squares to the sensors' own noise, it also keeps the filter awake when they have none. It does not
cover a gust of one period, whose impulse the trapezoid spreads over two: in the period after it
the velocity is off by half the impulse, and then right again."""

INITIAL_SPEED = 0.01
"""Standard deviation of the velocity at the start, which is from rest [m/s]."""


class InertialPose:
    """Pose and velocity carried from one pair of inertial readings to the next.

    Attributes:
        pose: [p, quaternion xyzw], shape (7,).
        velocity: v of the origin of {A}, world axes, shape (3,) [m/s].
        rotation: R_WA, shape (3, 3), live.
    """

    def __init__(self, period: float, gravity: float) -> None:
        """Start at the origin, level, at rest."""
        self._T = period
        self._g = np.array([0.0, 0.0, -gravity])
        self._model = pose_model()
        self._attitude = AttitudeView()
        self.pose: Array = np.array(IDENTITY)
        self.velocity: Array = np.zeros(3)
        self.rotation: Array = self._attitude.R_WA
        self._w: Array = np.zeros(3)
        self._a: Array = np.zeros(3)
        self._step: Array = np.zeros(6)

    def start(self, pose: Array, velocity: Array, inertial: Array) -> None:
        """Stand at a pose with a velocity, the readings of that instant being [w, f]."""
        self.pose[:] = pose
        self.velocity[:] = velocity
        self._w[:] = inertial[:3]
        np.add(self._attitude.look(self.pose) @ inertial[3:], self._g, out=self._a)

    def copy_from(self, other: InertialPose) -> None:
        """Stand where `other` stands."""
        self.pose[:], self.velocity[:] = other.pose, other.velocity
        self._w[:], self._a[:] = other._w, other._a
        self._attitude.look(self.pose)

    def advance(self, inertial: Array) -> Array:
        """One period on, to the readings [w, f] at its end; returns T w, shape (3,), live."""
        T, step = self._T, self._step
        turn = step[3:]
        np.add(self._w, inertial[:3], out=turn)
        turn *= 0.5 * T
        self._w[:] = inertial[:3]
        # The attitude first: it is needed to turn the force at the end of the period.
        step[:3] = 0.0
        pose = pin.integrate(self._model, self.pose, step)
        a = self._attitude.look(pose) @ inertial[3:]
        a += self._g
        change = self._a + a
        change *= 0.5 * T
        self._a[:] = a
        pose[:3] += T * (self.velocity + 0.5 * change)
        self.velocity += change
        self.pose[:] = pose
        return turn

    def correct(self, x: Array) -> None:
        """Move by an error x = [p, attitude, v], shape (9,)."""
        self.pose[:] = pin.integrate(self._model, self.pose, x[:6])
        self.velocity += x[6:]
        before = self.rotation.copy()
        # The force read belongs to the corrected attitude.
        self._a -= self._g
        turned = self._attitude.look(self.pose) @ (self._a @ before)
        np.add(turned, self._g, out=self._a)


@register_estimator("kalman")
class Kalman(Estimator):
    """Error-state Kalman filter: gyroscope, accelerometer and pose, by their `Datasheet`.

    A delayed pose is met at its own time: the filter runs as far behind as the poses are old, and
    the inertial readings since then carry its estimate to the present, where it has no lag.

    Attributes:
        covariance: P of the error [p, attitude, v] at the time of the poses, (9, 9), live.
        state: The estimate at the time of the poses.
    """

    needs_inertial = True

    def __init__(
        self,
        period: float,
        pose_period: float,
        cutoff: float,
        datasheet: Datasheet | None = None,
    ) -> None:
        """Lay out the noise; `cutoff` is not used."""
        super().__init__(period, pose_period, cutoff, datasheet)
        sheet, T = self.datasheet, period
        pose_noise = np.maximum((sheet.position_noise, sheet.attitude_noise), LEAST_POSE_NOISE)
        self._pose_variance = np.repeat(np.square(pose_noise), 3)
        q_w = sheet.gyroscope_noise**2 + SAMPLING_NOISE[0] ** 2
        q_a = sheet.accelerometer_noise**2 + SAMPLING_NOISE[1] ** 2
        Q = np.zeros((3, 3, 3, 3))
        eye = np.eye(3)
        Q[0, :, 0], Q[0, :, 2] = 0.25 * T**4 * q_a * eye, 0.5 * T**3 * q_a * eye
        Q[2, :, 0], Q[2, :, 2] = Q[0, :, 2], T**2 * q_a * eye
        Q[1, :, 1] = T**2 * q_w * eye
        self._Q = Q.reshape(9, 9)
        self._F = np.eye(9)
        self._F[0:3, 6:9] = T * eye
        self._eye = eye
        self._model = pose_model()
        self.state = InertialPose(period, sheet.gravity)
        self._now = self.state if sheet.delay_periods == 0 else InertialPose(period, sheet.gravity)
        self.covariance: Array = np.zeros((9, 9))
        self._waiting: deque[Array] = deque()
        self._fresh = False
        self._S: Array = np.zeros((6, 6))
        self._diagonal = np.arange(6)

    def reset(self, readings: Readings) -> None:
        """Start at the first pose, at rest, as uncertain as one pose reading is."""
        self.state.start(readings.pose, np.zeros(3), _inertial(readings))
        self.covariance[:] = np.diag(np.append(self._pose_variance, [INITIAL_SPEED**2] * 3))
        self._waiting.clear()
        self._fresh = True

    def update(self, readings: Readings, measurement: Measurement) -> None:
        """Carry the estimate to this period and take in a new pose, if there is one."""
        if self._fresh:  # the first readings are in the state already
            self._fresh = False
        else:
            self._waiting.append(_inertial(readings))
            # The first poses that arrive late all show the start, where the filter then waits.
            if len(self._waiting) > self.datasheet.delay_periods:
                self._predict(self._waiting.popleft())
            if readings.pose_is_new:
                self._take(readings.pose)
        now = self._now
        if now is not self.state:
            now.copy_from(self.state)
            for inertial in self._waiting:
                now.advance(inertial)
        measurement.q[:7] = now.pose
        v = measurement.v
        np.dot(now.velocity, now.rotation, out=v[:3])
        v[3:6] = readings.gyroscope

    def _predict(self, inertial: Array) -> None:
        """Estimate and covariance, one period on."""
        F, T, P = self._F, self.period, self.covariance
        f_A = inertial[3:]
        turn = self.state.advance(inertial)
        A = self.state.rotation @ pin.skew(f_A)
        A *= -T
        F[6:9, 3:6] = A
        A *= 0.5 * T
        F[0:3, 3:6] = A
        np.subtract(self._eye, pin.skew(turn), out=F[3:6, 3:6])
        product = F @ (P @ F.T)
        np.add(product, product.T, out=P)  # rounding must not pile up between the halves
        P *= 0.5
        P += self._Q

    def _take(self, pose: Array) -> None:
        """Correct by a pose reading."""
        P, S = self.covariance, self._S
        S[:] = P[:6, :6]
        S[self._diagonal, self._diagonal] += self._pose_variance
        L = dpotrf(S, lower=1, clean=0)[0]
        y = pin.difference(self._model, self.state.pose, pose)
        W = dtrtrs(L, P[:6], lower=1)[0]
        y = dtrtrs(L, y, lower=1)[0]
        self.state.correct(y @ W)
        P -= W.T @ W


def _inertial(readings: Readings) -> Array:
    """[w, f] of the readings, shape (6,), a copy."""
    return np.concatenate((readings.gyroscope, readings.accelerometer))
