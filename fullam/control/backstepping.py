"""Backstepping on one composite rigid body whose mass, centre and inertia follow the arm.

**Model.** As in the literature on variable inertia parameters, platform and arm are at each
instant ONE rigid body, frozen in the shape the arm has then: mass m, centre of mass c(theta) and
inertia J(theta) about the origin of {A}, in {A} axes. With a the acceleration of that origin and
w the angular velocity, in {A} axes,

    u_f   = m (a - g) + dw x m c + w x (w x m c),
    u_tau = J dw + w x J w + m c x (a - g).                                                     (B1)

Rates and accelerations of the arm do not occur: neither dc/dt nor dJ/dt, nor the wrench at joint 1.

**First step.** Position error e = p_d - p and its integral s = int e dt. Take

    alpha = dp_d + C1 e + L s,    z = alpha - dp,    V1 = e^T e / 2 + s^T L s / 2,

with C1, L positive diagonal (multiples of 1 for the attitude). Then de = dp_d - dp = z - C1 e - L s
and dV1 = e^T z - e^T C1 e.

**Second step.** V = V1 + z^T z / 2. Choosing the acceleration

    a = dalpha + e + C2 z    gives    dz = -e - C2 z    and

    dV = -e^T C1 e - z^T C2 z <= 0.

V is radially unbounded in (e, s, z), and dV = 0 for ever leaves e = z = 0, hence L s = 0: the
origin is globally asymptotically stable (LaSalle). (B1) turns a into the wrench.

**Attitude.** e = log(R_d R^T) in world axes, R_e = R_d R^T. From dR_e = s(w_d - R_e w) R_e and
R_e e = e follows d(e^T e / 2)/dt = e^T (w_d - w) exactly, so the same two steps hold with dp
replaced by the world angular velocity w, for rotations below pi. Here dalpha needs

    de = J_l^-1(e) (w_d - R_e w),    J_l^-1(e) x = x - e x x / 2 + k e x (e x x),
    k = 1/|e|^2 - (1 + cos|e|) / (2 |e| sin|e|),

which is exact as well: no small angles are assumed, and nothing is differentiated numerically.

**Gains.** Written out, a = reference acceleration + (C1 + C2) de + (1 + L + C1 C2) e + C2 L s, a
PID near the target. The defaults (C1, C2, L) = (2, 4, 0.75) and (4, 6, 2.5) make it (9.75, 3, 6)
in position, dc-PID's gains but for rounding, and (27.5, 15, 10) in attitude, where dc-PID has
(40, 20, 11): with that much damping this form cannot be as stiff. L = 0 is the form without
integral action.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin, sqrt

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.control.controller import ALL_AXES, Controller, Measurement, ReferencePoint
from fullam.control.tracking import TrackingSettings
from fullam.dynamics.pose_space import AttitudeView, pose_model
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

SMALL_ANGLE = 1e-3
"""Below this [rad] k of the module's text is 1/12 + |e|^2/720, exact to 1e-16 there; the closed
form loses digits to cancellation."""


@dataclass(frozen=True)
class BacksteppingSettings(TrackingSettings):
    """Gains and limits; see the module's text.

    Attributes:
        position_gains: C1 [1/s], C2 [1/s], L [1/s^2] of the three positions.
        attitude_gains: The same for the axis-angle error.
        integral_limits: Largest L s, linear [m/s] and angular [rad/s].
    """

    position_gains: tuple[float, float, float] = (2.0, 4.0, 0.75)
    attitude_gains: tuple[float, float, float] = (4.0, 6.0, 2.5)
    integral_limits: tuple[float, float] = (1.0, 3.5)

    def __post_init__(self) -> None:
        """Check that C1 and C2 are positive, and what every law has."""
        super().__post_init__()
        for field in ("position_gains", "attitude_gains"):
            if min(getattr(self, field)[:2]) <= 0.0:
                raise self._wrong(field, "C1 and C2 must be above 0")


class CompositeBody:
    """The frozen vehicle as one rigid body: (B1) of the module's text.

    Attributes:
        q: Configuration of which the arm's angles count, shape (nq,).
        inertia: [[m 1, -m s(c)], [m s(c), J]] about the origin of {A}, {A} axes, (6, 6), live.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        """Own a workspace."""
        self._model, self._data = vehicle.model, vehicle.create_data()
        self.q: Array = vehicle.neutral()
        self.inertia: Array = self._data.M[:6, :6]
        self._gravity: Array = np.array(self._model.gravity.linear)
        self._still: Array = np.zeros(6)

    def bias(self, R_WA: Array, w: Array, out: Array) -> Array:
        """Centrifugal and gyroscopic terms less the weight, {A} axes, shape (6,), into `out`.

        Refreshes `inertia` for the arm's angles in `q`. Args: attitude (3, 3), w in {A} axes.
        """
        # The free flyer's own block comes out of the composite inertia alone: no arm rates.
        pin.crba(self._model, self._data, self.q)
        M, still = self.inertia, self._still
        np.dot(self._gravity, R_WA, out=still[:3])
        spin = pin.skew(w)
        np.dot(M[:, 3:], w, out=out)  # [w x m c; J w]
        out[:3] = spin @ out[:3]
        out[3:] = spin @ out[3:]
        out -= M[:, :3] @ still[:3]
        return out


class Backstepping(Controller):
    """Backstepping on platform and arm as one rigid body, whose shape follows the arm.

    `u_pid` is a, and `u_dc` what (B1) has besides inertia times a.
    """

    name = "backstepping"
    Settings = BacksteppingSettings
    settings: BacksteppingSettings

    def __init__(
        self,
        vehicle: Vehicle,
        settings: BacksteppingSettings | None = None,
        period: float = 0.01,
        axes: tuple[bool, ...] = ALL_AXES,
    ) -> None:
        """Bind the law; see `Controller`."""
        super().__init__(vehicle, settings, period, axes)
        s = self.settings
        mask = np.asarray(self.axes, dtype=float)
        c1, c2, integral = (
            np.repeat([s.position_gains[k], s.attitude_gains[k]], 3) * mask for k in range(3)
        )
        # a = ref + C1 de + L e + e + C2 (v_d - v + C1 e + L s); L s is stored as one vector.
        self._of_error = mask * (1.0 + integral) + c2 * c1
        self._of_derivative, self._of_rate, self._of_integral = c1, c2, c2
        self._step = integral * period
        self._limit = np.repeat(s.integral_limits, 3)
        self._body = CompositeBody(vehicle)
        self._model = pose_model()
        self._attitude = AttitudeView()
        self._rotation: Array = self._attitude.R_WA
        self._integral: Array = np.zeros(6)
        self._error: Array = np.zeros(6)
        self._derivative: Array = np.zeros(6)
        self._a_A: Array = np.zeros(6)
        self._bias_A: Array = np.zeros(6)
        self._wrench: Array = np.zeros(6)

    def reset(self, measurement: Measurement, reference: ReferencePoint) -> None:
        """Empty the integral."""
        self._integral[:] = 0.0
        self._wrench[:] = 0.0

    def wrench(self, t: float, measurement: Measurement, reference: ReferencePoint) -> Array:
        """Wrench of (B1) for the acceleration a, world axes; see `Controller.wrench`."""
        q, v, a_W = measurement.q, measurement.v, self.u_pid
        R = self._attitude.look(q[:7])
        e = self._error
        local = pin.difference(self._model, q[:7], reference.pose)
        e[:3] = local[:3]
        np.dot(R, local[3:], out=e[3:])
        velocity = np.dot(v[:6].reshape(2, 3), R.T).ravel()
        rate = reference.velocity - velocity
        de = self._derivative
        de[:3] = rate[:3]
        self._attitude_derivative(e[3:], velocity[3:], reference.velocity[3:], de[3:])

        np.multiply(self._of_error, e, out=a_W)
        a_W += self._of_derivative * de
        a_W += self._of_rate * rate
        a_W += self._of_integral * self._integral
        a_W += reference.acceleration

        body, a_A, bias = self._body, self._a_A, self._bias_A
        body.q[7:] = q[7:]
        body.bias(R, v[3:6], bias)
        np.dot(a_W.reshape(2, 3), R, out=a_A.reshape(2, 3))
        np.dot(bias.reshape(2, 3), R.T, out=self.u_dc.reshape(2, 3))
        u_A = body.inertia @ a_A
        np.dot(u_A.reshape(2, 3), R.T, out=self._wrench.reshape(2, 3))
        self._wrench += self.u_dc

        i = self._integral
        i += self._step * e
        np.minimum(i, self._limit, out=i)
        np.maximum(i, -self._limit, out=i)
        return self._wrench

    @staticmethod
    def _attitude_derivative(e: Array, w: Array, w_d: Array, out: Array) -> None:
        """de/dt of e = log(R_d R^T) for the world angular velocities w and w_d, into `out`.

        R_e w = w + sin|e|/|e| e x w + (1 - cos|e|)/|e|^2 e x (e x w).
        """
        square = float(e @ e)
        angle = sqrt(square)
        if angle < SMALL_ANGLE:
            first, second, k = 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 12.0 + square / 720.0
        else:
            s, c = sin(angle), cos(angle)
            first, second = s / angle, (1.0 - c) / square
            # (1 + cos) / sin = sin / (1 - cos), which stays finite up to pi.
            k = 1.0 / square - s / (2.0 * angle * (1.0 - c))
        cross = pin.skew(e)
        e_w = cross @ w
        relative = w_d - w
        relative -= first * e_w
        relative -= second * (cross @ e_w)
        e_x = cross @ relative
        np.subtract(relative, 0.5 * e_x, out=out)
        out += k * (cross @ e_x)

    def delivered(self, wrench_W: Array, missing_W: Array) -> None:
        """Drain the integral by what was not delivered, where it pushes into the limit.

        (B1) knows where the centre of mass is: what the composite body lacks in acceleration
        follows from the shortfall at the origin.
        """
        R = self._rotation
        missing_A = ((wrench_W - self._wrench).reshape(2, 3) @ R).ravel()
        a_A = np.linalg.solve(self._body.inertia, missing_A)
        missing = (a_A.reshape(2, 3) @ R.T).ravel()
        i = self._integral
        # The integral enters a as C2 L s: let go of it in its own unit.
        step = np.abs(missing) * (self.settings.anti_windup * self.period)
        step /= np.maximum(self._of_integral, 1.0)
        np.minimum(step, np.abs(i), out=step)
        i -= np.where(i * missing < 0.0, np.sign(i) * step, 0.0)
