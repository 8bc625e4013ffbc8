"""my-estimator: carried along by the inertial sensors, drawn to each pose that is read."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import fullam


@dataclass(frozen=True)
class MyEstimatorSettings:
    """How fast it is drawn to the poses that are read: position and attitude [rad/s]."""

    position_rate: float = 3.0
    attitude_rate: float = 3.0


@fullam.register_estimator("my-estimator")
class MyEstimator(fullam.Estimator):
    """A complementary filter of pose, gyroscope and accelerometer, as a class in numpy."""

    Settings = MyEstimatorSettings
    needs_inertial = True

    def reset(self, readings):
        """Before the first period: begin at the first pose, at rest."""
        self.pose, self.v = pin.XYZQUATToSE3(np.concatenate(readings.pose)), np.zeros(3)
        self.gravity, self.k = np.array([0.0, 0.0, self.datasheet.gravity]), 0

    def update(self, readings, measurement):
        """Every period: write pose, q[:7], and velocity in {A} axes, v[:6], from the readings."""
        R, p, s, dt = self.pose.rotation, self.pose.translation, self.settings, self.period
        w, f = np.array(readings.gyroscope), np.array(readings.accelerometer)
        if self.k > 0:
            R, p = R @ pin.exp3(dt * w), p + dt * self.v
            self.v = self.v + dt * (R @ f - self.gravity)
        if self.k % self.datasheet.pose_every == 0:  # a new pose has come
            read, T = pin.XYZQUATToSE3(np.concatenate(readings.pose)), self.pose_period
            way, turn = read.translation - p, pin.log3(R.T @ read.rotation)
            p, R = p + 2.0 * s.position_rate * T * way, R @ pin.exp3(s.attitude_rate * T * turn)
            self.v = self.v + s.position_rate**2 * T * way
        self.pose, self.k = pin.SE3(R, p), self.k + 1
        measurement.q[:7] = pin.SE3ToXYZQUAT(self.pose)
        measurement.v[:3], measurement.v[3:6] = R.T @ self.v, w
