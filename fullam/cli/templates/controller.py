"""my-law: PID on the pose, and the inverse dynamics of the whole vehicle, arm included."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import fullam


@dataclass(frozen=True)
class MyLawSettings:
    """Gains K_p [1/s^2], K_i [1/s^3], K_d [1/s]; largest integral action [m/s^2, rad/s^2].

    `fullam tune` searches between low and high.
    """

    position_gains: tuple[float, float, float] = fullam.tunable(
        (16.0, 16.0, 7.0), low=(4.0, 1.0, 3.0), high=(60.0, 80.0, 20.0)
    )
    attitude_gains: tuple[float, float, float] = fullam.tunable(
        (80.0, 250.0, 16.0), low=(20.0, 20.0, 6.0), high=(200.0, 600.0, 30.0)
    )
    integral_limits: tuple[float, float] = (4.0, 20.0)


@fullam.register("my-law")
class MyLaw(fullam.Controller):
    """PID on the pose and inverse dynamics, as a class in numpy."""

    Settings = MyLawSettings
    estimator = "kalman"  # flown with it, unless another one is asked for

    def reset(self, measurement, reference):
        """Before the first period: forget the past."""
        s, self.data = self.settings, self.vehicle.create_data()
        gains = np.array([s.position_gains, s.attitude_gains]).repeat(3, axis=0).T
        self.k_p, self.k_i, self.k_d = gains * self.axes  # axes that are not controlled get none
        self.limit, self.integral = np.repeat(s.integral_limits, 3), np.zeros(6)

    def wrench(self, t, measurement, reference):
        """Every period: wrench wanted from the rotors, [force, moment] in world axes [N, N m]."""
        here, there = pin.XYZQUATToSE3(measurement.q[:7]), pin.XYZQUATToSE3(reference.pose)
        R, v = here.rotation, measurement.v.copy()  # R_WA; v in {A} axes
        error = np.r_[there.translation - here.translation, R @ pin.log3(R.T @ there.rotation)]
        rate = reference.velocity - np.r_[R @ v[:3], R @ v[3:6]]
        a = self.k_p * error + self.integral + self.k_d * rate + reference.acceleration
        self.before, step = self.integral, self.period * self.k_i * error
        self.integral = np.clip(self.integral + step, -self.limit, self.limit)
        v[:3], q = 0.0, measurement.q  # in axes that move along, ddp is Pinocchio's acceleration
        ddq = np.r_[R.T @ a[:3], R.T @ a[3:], measurement.arm_acceleration]
        wrench_A = pin.rnea(self.vehicle.model, self.data, q, v, ddq)[:6]
        self.u_pid = a  # for the record, if you like
        return np.r_[R @ wrench_A[:3], R @ wrench_A[3:]]

    def delivered(self, wrench_W, missing_W):
        """After a period whose wrench the rotors could not deliver: integrate none of it."""
        self.integral = self.before
