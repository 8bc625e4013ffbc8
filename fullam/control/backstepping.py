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
from typing import Any, NamedTuple

import numpy as np

from fullam.control.law import KernelLaw, LawKernels
from fullam.control.pid import integrated, pose_error, released
from fullam.control.signals import Command
from fullam.control.tracking import TrackingSettings
from fullam.control.tunable import tunable
from fullam.dynamics.recursion import (
    bias_wrench,
    composite_body,
    gravity_in,
    inertial_wrench,
    solve_body,
)
from fullam.dynamics.so3 import SMALL, rotation_matrix
from fullam.dynamics.spatial import (
    Spatial,
    add_spatial,
    multiply_spatial,
    rotate_spatial,
    rotate_spatial_back,
    subtract_spatial,
)
from fullam.numbers.elementary import sincos
from fullam.numbers.kernel import Number, kernel, select, some, sqrt
from fullam.numbers.records import record
from fullam.numbers.vectors import ZERO, axpy, cross, dot, rotate_back, subtract


@dataclass(frozen=True)
class BacksteppingSettings(TrackingSettings):
    """Gains and limits; see the module's text.

    Attributes:
        position_gains: C1 [1/s], C2 [1/s], L [1/s^2] of the three positions.
        attitude_gains: C1 [1/s], C2 [1/s], L [1/s^2] of the axis-angle error.
        integral_limits: Largest L s, linear [m/s] and angular [rad/s].
    """

    position_gains: tuple[float, float, float] = tunable(
        (2.0, 4.0, 0.75), low=(0.5, 0.5, 0.005), high=(16.0, 16.0, 40.0)
    )
    attitude_gains: tuple[float, float, float] = tunable(
        (4.0, 6.0, 2.5), low=(0.5, 1.0, 0.01), high=(40.0, 30.0, 100.0)
    )
    integral_limits: tuple[float, float] = (1.0, 3.5)

    def __post_init__(self) -> None:
        """Check that C1 and C2 are positive, and what every law has."""
        super().__post_init__()
        for field in ("position_gains", "attitude_gains"):
            if min(getattr(self, field)[:2]) <= 0.0:
                raise self._wrong(field, "C1 and C2 must be above 0")


class BacksteppingGains(NamedTuple):
    """The law of the module's text as numbers, world axes, linear half first.

    a = ref + `error` e + `derivative` de + `rate` ((v_d - v) + L s), with 1 + L + C1 C2, C1 and C2;
    L times the control period, and the largest L s.
    """

    error: Spatial
    derivative: Spatial
    rate: Spatial
    integral: Spatial
    limit: Spatial


class BacksteppingNumbers(NamedTuple):
    """Gains, gravity, and what undelivered acceleration drains of L s in a control period."""

    gains: BacksteppingGains
    gravity: Number
    drain: Spatial


class BacksteppingMemory(NamedTuple):
    """L s, and the wrench commanded last; world axes."""

    integral: Spatial
    wrench: Spatial


@kernel
def attitude_derivative(e, w, w_d):
    """de/dt of e = log(R_d R^T) for the world angular velocities w and w_d, |e| < 2 pi.

    de = J_l^-1(e) (w_d - R_e w) with R_e w = w + sin|e|/|e| e x w + (1 - cos|e|)/|e|^2 e x (e x w).
    """
    s = dot(e, e)
    first = 1.0 - s * (1 / 6 - s * (1 / 120 - s * (1 / 5040 - s * (1 / 362880))))
    second = 1 / 2 - s * (1 / 24 - s * (1 / 720 - s * (1 / 40320)))
    k = 1 / 12 + s * (1 / 720 + s * (1 / 30240 + s * (1 / 1209600)))
    large = s >= SMALL
    if some(large):
        square = select(large, s, 1.0)
        half = 0.5 * sqrt(square)
        sine, cosine = sincos(half)
        first = select(large, sine * cosine / half, first)
        second = select(large, 2.0 * sine * sine / square, second)
        # (1 + cos) / sin of the angle is the cotangent of its half, which is finite up to 2 pi.
        k = select(large, 1.0 / square - cosine / (4.0 * half * sine), k)
    e_w = cross(e, w)
    relative = axpy(-second, cross(e, e_w), axpy(-first, e_w, subtract(w_d, w)))
    e_x = cross(e, relative)
    return axpy(k, cross(e, e_x), axpy(-0.5, e_x, relative))


@kernel
def start(numbers, chain, estimate):
    """No integral, and nothing commanded."""
    none = Spatial(ZERO, ZERO)
    return BacksteppingMemory(none, none)


@kernel
def command(numbers, chain, estimate, target, memory):
    """Wrench of (B1) for the acceleration a of the module's text."""
    gains, w = numbers.gains, estimate.velocity.angular
    R = rotation_matrix(estimate.pose.attitude)
    e, rate = pose_error(estimate, target)
    turning = attitude_derivative(e.angular, w, target.velocity.angular)
    de = Spatial(rate.linear, turning)
    feedback = multiply_spatial(gains.rate, add_spatial(rate, memory.integral))
    feedback = add_spatial(feedback, multiply_spatial(gains.derivative, de))
    feedback = add_spatial(feedback, multiply_spatial(gains.error, e))
    a = add_spatial(feedback, target.acceleration)

    body = composite_body(chain)
    bias = bias_wrench(body, rotate_back(R, w), gravity_in(R, numbers.gravity))
    bias = rotate_spatial(R, bias)
    inertial = rotate_spatial(R, inertial_wrench(body, rotate_spatial_back(R, a)))
    u = add_spatial(inertial, bias)  # (B1)
    return Command(u, a, bias), BacksteppingMemory(integrated(gains, memory.integral, e), u)


@kernel
def delivered(numbers, chain, estimate, memory, delivery):
    """L s drained by what was not delivered, where it pushes into the limit.

    (B1) knows where the centre of mass is: what the composite body lacks in acceleration follows
    from the shortfall at the origin of {A}.
    """
    R = rotation_matrix(estimate.pose.attitude)
    shortfall = rotate_spatial_back(R, subtract_spatial(delivery.wrench, memory.wrench))
    missing = rotate_spatial(R, solve_body(composite_body(chain), shortfall))
    i, a, rate = memory.integral.linear, missing.linear, numbers.drain.linear
    j, b, turn = memory.integral.angular, missing.angular, numbers.drain.angular
    integral = Spatial(
        (
            released(i[0], a[0], rate[0]),
            released(i[1], a[1], rate[1]),
            released(i[2], a[2], rate[2]),
        ),
        (
            released(j[0], b[0], turn[0]),
            released(j[1], b[1], turn[1]),
            released(j[2], b[2], turn[2]),
        ),
    )
    return BacksteppingMemory(integral, memory.wrench)


class Backstepping(KernelLaw):
    """Backstepping on platform and arm as one rigid body, whose shape follows the arm.

    `u_pid` is a, and `u_dc` what (B1) has besides inertia times a.
    """

    name = "backstepping"
    Settings = BacksteppingSettings
    settings: BacksteppingSettings
    Memory = BacksteppingMemory
    kernels = LawKernels(start, command, delivered)

    def numbers(self) -> Any:
        """See `BacksteppingNumbers`."""
        s = self.settings
        mask = np.asarray(self.axes, dtype=float)
        c1, c2, of_integral = (
            np.repeat([s.position_gains[k], s.attitude_gains[k]], 3) * mask for k in range(3)
        )
        of_error = mask * (1.0 + of_integral) + c2 * c1
        limit = np.repeat(s.integral_limits, 3)
        gains = np.concatenate([of_error, c1, c2, of_integral * self.period, limit])
        # The integral enters a as C2 L s: let go of it in its own unit.
        drain = s.anti_windup * self.period / np.maximum(c2, 1.0)
        return BacksteppingNumbers(
            record(BacksteppingGains, gains), self.vehicle.gravity, record(Spatial, drain)
        )
