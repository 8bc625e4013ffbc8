"""PID on the platform's pose, eq. (19), and the plain PID controller with gravity.

The pose error is e = [p_d - p; R log(R^T R_d)] in world axes: the second half is the world-side
axis-angle theta_e v_e of eqs. (17)-(18), because R log(R^T R_d) = log(R_d R^T).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from pinocchio import difference

from fullam.control.controller import (
    ALL_AXES,
    Controller,
    Measurement,
    ReferencePoint,
    register,
)
from fullam.control.tracking import TrackingSettings
from fullam.dynamics.pose_space import AttitudeView, pose_model
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PidSettings(TrackingSettings):
    """Gains and limits of a PID on the pose.

    The gains are accelerations per error, so that one set serves vehicles of any mass. The
    published runs of this control law use (9.6, 1e-3, 6) for position and (19.2, 1e-3, 9) for
    attitude; the defaults add integral action that cancels a model error within a second or two.

    Attributes:
        position_gains: Kp [1/s^2], Ki [1/s^3], Kd [1/s] of the three positions.
        attitude_gains: The same for the axis-angle error.
        integral_limits: Largest integrator output, linear [m/s^2] and angular [rad/s^2].
        wrench_bounds: Symmetric bounds on the commanded wrench, except that the vertical force is
            kept in [0, bound]; six numbers [N, N m], world axes, or None for no bound.
    """

    position_gains: tuple[float, float, float] = (9.6, 3.0, 6.0)
    attitude_gains: tuple[float, float, float] = (40.0, 20.0, 11.0)
    integral_limits: tuple[float, float] = (4.0, 20.0)
    wrench_bounds: tuple[float, float, float, float, float, float] | None = None

    def __post_init__(self) -> None:
        """Check the bounds, then what every law has."""
        super().__post_init__()
        if self.wrench_bounds is not None:
            bounds = np.asarray(self.wrench_bounds, dtype=float)
            if bounds.shape != (6,) or not np.all(bounds > 0.0):
                raise self._wrong("wrench_bounds", "give six numbers > 0")
            object.__setattr__(self, "wrench_bounds", tuple(bounds.tolist()))


class PidLaw:
    """u_pid = K_p e + K_i int e dt + K_d de/dt + reference acceleration, eq. (19).

    All vectors are in world axes, position first. The error's derivative is the velocity error.
    The three terms are one product G s with s = [e; i; de], where the integrator i is stored as
    the acceleration it commands. What allocates or looks up is bound once: at this size a product
    `A.dot(x, out)` costs 0.25 us (`np.dot` 0.4, `@` 0.9) and making a view 0.1 us.

    Attributes:
        gains: G, shape (6, 18), live: whoever changes it changes the law.
        error: e, shape (6,), live [m, rad].
        integral: i, shape (6,), live [m/s^2, rad/s^2].
        error_rate: de/dt, shape (6,), live [m/s, rad/s].
        rotation: R_WA of the last measurement, shape (3, 3), live.
    """

    def __init__(self, settings: PidSettings, period: float, axes: tuple[bool, ...]) -> None:
        """Lay out the gains; uncontrolled axes get none."""
        mask = np.asarray(axes, dtype=float)
        kp, ki, kd = (
            np.repeat([settings.position_gains[k], settings.attitude_gains[k]], 3) * mask
            for k in range(3)
        )
        self.period = period
        self.proportional_gain, self.integral_gain, self.derivative_gain = kp, ki, kd
        self.integral_limit = np.repeat(settings.integral_limits, 3)
        self.anti_windup = settings.anti_windup
        # [u; next i] = map @ [e; i; de]: the law, and the integrator's step.
        self._map = np.zeros((12, 18))
        self.gains: Array = self._map[:6]
        self.gains[:] = np.hstack([np.diag(kp), np.eye(6), np.diag(kd)])
        self._map[6:, :6], self._map[6:, 6:12] = np.diag(ki * period), np.eye(6)
        self._answer = np.zeros(12)
        self._u, self._next_integral = self._answer[:6], self._answer[6:]
        self._lowest = -self.integral_limit
        self._s = np.zeros(18)
        self.error: Array = self._s[0:6]
        self.integral: Array = self._s[6:12]
        self.error_rate: Array = self._s[12:18]
        self._position_error, self._attitude_error = self._s[0:3], self._s[3:6]
        self._velocity = np.zeros(6)
        self._velocity_rows = self._velocity.reshape(2, 3)
        self._attitude = AttitudeView()
        self.rotation: Array = self._attitude.R_WA
        self._rotation_back = self.rotation.T
        self._model = pose_model()

    def reset(self) -> None:
        """Empty the integrator."""
        self._s[:] = 0.0

    def acceleration(self, m: Measurement, ref: ReferencePoint, out: Array) -> Array:
        """Write u_pid [m/s^2, rad/s^2] to `out`, world axes; `rotation` becomes R_WA."""
        pose = m.q[:7]
        R = self._attitude.look(pose)
        e = difference(self._model, pose, ref.pose)
        self._position_error[:] = e[:3]
        R.dot(e[3:], self._attitude_error)
        # Rows of v as two 3-vectors in {A}: one product turns both to world axes.
        m.v[:6].reshape(2, 3).dot(self._rotation_back, self._velocity_rows)
        np.subtract(ref.velocity, self._velocity, self.error_rate)
        self._map.dot(self._s, self._answer)
        np.add(self._u, ref.acceleration, out)
        np.minimum(self._next_integral, self.integral_limit, out=self.integral)
        np.maximum(self.integral, self._lowest, out=self.integral)
        return out

    def drain(self, missing_acceleration: Array) -> None:
        """Anti-windup: let go of integral action that pushes into a limit, and of no more.

        Where the integrator points along what could not be delivered, it is drained at the rate
        `anti_windup` times the missing acceleration, down to zero. It is never pushed past zero:
        a manoeuvre that asks too much for a moment must not leave an offset behind.

        Args:
            missing_acceleration: delivered minus commanded, shape (6,) [m/s^2, rad/s^2].
        """
        i, rate = self.integral, self.anti_windup * self.period
        pairs = zip(i.tolist(), missing_acceleration.tolist(), strict=True)
        for k, (value, missing) in enumerate(pairs):
            if value * missing < 0.0:
                step = min(abs(missing) * rate, abs(value))
                i[k] = value - step if value > 0.0 else value + step


class PidBase(Controller):
    """What the controllers built on eq. (19) share: the law, the bounds, the anti-windup.

    Attributes:
        law: Eq. (19).
        attitude: That of the law, `PidLaw.rotation`; see `Controller`.
        rigid_inertia: Inertia of the whole vehicle about the origin of {A} with the arm neutral,
            {A} axes, shape (3, 3) [kg m^2].
    """

    Settings = PidSettings
    settings: PidSettings

    def __init__(
        self,
        vehicle: Vehicle,
        settings: PidSettings | None = None,
        period: float = 0.01,
        axes: tuple[bool, ...] = ALL_AXES,
    ) -> None:
        """Bind the law; see `Controller`."""
        super().__init__(vehicle, settings, period, axes)
        self.law = PidLaw(self.settings, period, self.axes)
        self.attitude: Array = self.law.rotation
        self._wrench: Array = np.zeros(6)
        self._bounded = self.settings.wrench_bounds is not None
        if self.settings.wrench_bounds is not None:
            self._upper = np.array(self.settings.wrench_bounds)
            self._lower = -self._upper
            self._lower[2] = 0.0
        # Total mass, and inertia about {A} at the neutral arm: a missing wrench as acceleration.
        self._mass = vehicle.mass
        data = vehicle.create_data()
        upper = np.triu(pin.crba(vehicle.model, data, vehicle.neutral())[3:6, 3:6])
        self.rigid_inertia: Array = upper + np.triu(upper, 1).T
        self._inertia_inverse = np.linalg.inv(self.rigid_inertia)

    def reset(self, measurement: Measurement, reference: ReferencePoint) -> None:
        """Empty the integrator."""
        self.law.reset()
        self._wrench[:] = 0.0

    def _bound(self) -> None:
        """Clip the command to `wrench_bounds`; what is cut off drains the integrator."""
        commanded = self._wrench.copy()
        np.minimum(self._wrench, self._upper, out=self._wrench)
        np.maximum(self._wrench, self._lower, out=self._wrench)
        if not np.array_equal(commanded, self._wrench):
            self._drain(self._wrench - commanded)

    def _drain(self, missing_W: Array) -> None:
        R = self.law.rotation
        missing = missing_W / self._mass
        missing_A = missing_W[3:].dot(R)
        R.dot(self._inertia_inverse.dot(missing_A), missing[3:])
        self.law.drain(missing)

    def delivered(self, wrench_W: Array, missing_W: Array) -> None:
        """Drain the integrator by what the allocation could not deliver."""
        self._drain(missing_W)


@register("pid")
class Pid(PidBase):
    """Eq. (19) on the vehicle taken as one rigid body at rest, with its weight fed forward.

    u = [m (u_f - g); R I R^T u_tau] with the total mass m, the inertia I about {A} at the neutral
    arm, and gravity g: what dc-PID is measured against, since it knows nothing of the arm's pose.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        settings: PidSettings | None = None,
        period: float = 0.01,
        axes: tuple[bool, ...] = ALL_AXES,
    ) -> None:
        """Bind the law; see `Controller`."""
        super().__init__(vehicle, settings, period, axes)
        self._weight = np.zeros(6)
        self._weight[2] = self._mass * vehicle.gravity

    def wrench(self, t: float, measurement: Measurement, reference: ReferencePoint) -> Array:
        """U = blkdiag(m 1, R I R^T) u_pid - [m g; 0], world axes; see `Controller.wrench`."""
        a = self.law.acceleration(measurement, reference, self.u_pid)
        R, u = self.law.rotation, self._wrench
        np.multiply(a[:3], self._mass, out=u[:3])
        u[3:] = R @ (self.rigid_inertia @ (R.T @ a[3:]))
        u += self._weight
        self.u_dc[:] = self._weight
        if self._bounded:
            self._bound()
        return u
