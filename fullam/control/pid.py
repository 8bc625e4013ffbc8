"""PID on the platform's pose, eq. (19), and the plain PID controller with gravity.

The pose error is e = [p_d - p; R log(R^T R_d)] in world axes: the second half is the world-side
axis-angle theta_e v_e of eqs. (17)-(18), because R log(R^T R_d) = log(R_d R^T). The integrator is
stored as the acceleration that it commands.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.control.law import KernelLaw, LawKernels
from fullam.control.signals import Command
from fullam.control.tracking import TrackingSettings
from fullam.control.tunable import tunable
from fullam.dynamics.so3 import boxminus, rotation_matrix
from fullam.dynamics.spatial import (
    Spatial,
    add_spatial,
    multiply_spatial,
    subtract_spatial,
)
from fullam.model.vehicle import Vehicle
from fullam.numbers.kernel import Number, absolute, kernel, minimum, select, some
from fullam.numbers.records import record
from fullam.numbers.vectors import (
    ZERO,
    Symmetric,
    apply_symmetric,
    clip_vector,
    dot,
    rotate,
    rotate_back,
    scale,
    subtract,
)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PidSettings(TrackingSettings):
    """Gains and limits of a PID on the pose.

    The gains are accelerations per error, so that one set serves vehicles of any mass. The
    published runs of this control law use (9.6, 1e-3, 6) for position and (19.2, 1e-3, 9) for
    attitude; the defaults add integral action that cancels a model error within a second or two.

    Attributes:
        position_gains: Kp [1/s^2], Ki [1/s^3], Kd [1/s] of the three positions.
        attitude_gains: Kp [1/s^2], Ki [1/s^3], Kd [1/s] of the axis-angle error.
        integral_limits: Largest integrator output, linear [m/s^2] and angular [rad/s^2].
        wrench_bounds: Symmetric bounds on the commanded wrench, except that the vertical force is
            kept in [0, bound]; six numbers [N, N m], world axes, or None for no bound.
    """

    position_gains: tuple[float, float, float] = tunable(
        (9.6, 3.0, 6.0), low=(2.0, 0.01, 1.0), high=(80.0, 100.0, 20.0)
    )
    attitude_gains: tuple[float, float, float] = tunable(
        (40.0, 20.0, 11.0), low=(5.0, 0.05, 2.0), high=(300.0, 500.0, 60.0)
    )
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


class Gains(NamedTuple):
    """The PID as numbers, world axes, linear half first.

    K_p, K_d, and K_i times the control period; largest integrator output.
    """

    proportional: Spatial
    derivative: Spatial
    integral: Spatial
    limit: Spatial


class Limits(NamedTuple):
    """Bounds of the commanded wrench, and what anti-windup goes by.

    Least and largest wrench; rate of the anti-windup times the control period; the vehicle's mass,
    and the inverse of its inertia about {A} at the neutral arm, {A} axes.
    """

    lower: Spatial
    upper: Spatial
    drain: Number
    mass: Number
    inertia_inverse: Symmetric


class PidNumbers(NamedTuple):
    """The plain PID: gains, limits, gravity, and the inertia about {A} at the neutral arm."""

    gains: Gains
    limits: Limits
    gravity: Number
    inertia: Symmetric


class PidMemory(NamedTuple):
    """The integrator's output, an acceleration in world axes."""

    integral: Spatial


@kernel
def pose_error(estimate, target):
    """Error e = [p_d - p; R log(R^T R_d)] and its rate [dp_d - dp; w_d - w], world axes."""
    pose, wanted = estimate.pose, target.pose
    R = rotation_matrix(pose.attitude)
    e_f = subtract(wanted.position, pose.position)
    e_tau = rotate(R, boxminus(wanted.attitude, pose.attitude))
    return Spatial(e_f, e_tau), subtract_spatial(target.velocity, estimate.velocity)


@kernel
def pid(gains, e, de, integral, acceleration):
    """Eq. (19): u_pid = K_p e + K_i int e dt + K_d de/dt, plus the reference's acceleration."""
    proportional = multiply_spatial(gains.proportional, e)
    derivative = multiply_spatial(gains.derivative, de)
    return add_spatial(add_spatial(add_spatial(proportional, integral), derivative), acceleration)


@kernel
def integrated(gains, integral, e):
    """The integrator one period on, within its limits."""
    after = add_spatial(integral, multiply_spatial(gains.integral, e))
    limit = gains.limit
    return Spatial(
        clip_vector(after.linear, scale(-1.0, limit.linear), limit.linear),
        clip_vector(after.angular, scale(-1.0, limit.angular), limit.angular),
    )


@kernel
def bounded(limits, wrench):
    """The wrench within its bounds."""
    return Spatial(
        clip_vector(wrench.linear, limits.lower.linear, limits.upper.linear),
        clip_vector(wrench.angular, limits.lower.angular, limits.upper.angular),
    )


@kernel
def within_bounds(limits, R, wrench, integral):
    """The wrench within its bounds, and the integrator drained by what they cut off."""
    within = bounded(limits, wrench)
    missing = subtract_spatial(within, wrench)
    cut = dot(missing.linear, missing.linear) + dot(missing.angular, missing.angular) > 0.0
    if some(cut):
        integral = select(cut, drained(limits, integral, R, missing), integral)
    return within, integral


@kernel
def drained(limits, integral, R, missing):
    """Anti-windup: let go of integral action that pushes into a limit, and of no more.

    Where the integrator points along what could not be delivered, it is drained at the rate
    `anti_windup` times the missing acceleration, down to zero. It is never pushed past zero: a
    manoeuvre that asks too much for a moment must not leave an offset behind.

    Args:
        limits: Rate, mass and inertia.
        integral: The integrator.
        R: Attitude.
        missing: Wrench delivered minus commanded, world axes, its moment about the centre of mass.
    """
    a = scale(1.0 / limits.mass, missing.linear)
    b = rotate(R, apply_symmetric(limits.inertia_inverse, rotate_back(R, missing.angular)))
    i, j, rate = integral.linear, integral.angular, limits.drain
    return Spatial(
        (released(i[0], a[0], rate), released(i[1], a[1], rate), released(i[2], a[2], rate)),
        (released(j[0], b[0], rate), released(j[1], b[1], rate), released(j[2], b[2], rate)),
    )


@kernel
def released(value, missing, rate):
    """One integrator after what is missing of its acceleration."""
    step = minimum(absolute(missing) * rate, absolute(value))
    return select(value * missing < 0.0, select(value > 0.0, value - step, value + step), value)


@kernel
def start(numbers, chain, estimate):
    """An empty integrator."""
    return PidMemory(Spatial(ZERO, ZERO))


@kernel
def command(numbers, chain, estimate, target, memory):
    """Wrench u = [m (u_f + g); R I R^T u_tau]: the weight is the only compensation."""
    R = rotation_matrix(estimate.pose.attitude)
    e, de = pose_error(estimate, target)
    u_pid = pid(numbers.gains, e, de, memory.integral, target.acceleration)
    limits = numbers.limits
    torque = rotate(R, apply_symmetric(numbers.inertia, rotate_back(R, u_pid.angular)))
    weight = Spatial((0.0, 0.0, limits.mass * numbers.gravity), ZERO)
    u = add_spatial(Spatial(scale(limits.mass, u_pid.linear), torque), weight)
    integral = integrated(numbers.gains, memory.integral, e)
    u, integral = within_bounds(limits, R, u, integral)
    return Command(u, u_pid, weight), PidMemory(integral)


@kernel
def delivered(numbers, chain, estimate, memory, delivery):
    """The integrator after a command that could not be delivered."""
    R = rotation_matrix(estimate.pose.attitude)
    return PidMemory(drained(numbers.limits, memory.integral, R, delivery.missing))


class PidBase(KernelLaw):
    """What the laws built on eq. (19) share: gains, bounds and anti-windup as numbers."""

    Settings = PidSettings
    settings: PidSettings

    def gains(self) -> Gains:
        """Gains of the controlled axes; the others get none."""
        s = self.settings
        k_p, k_i, k_d = (
            np.repeat([s.position_gains[k], s.attitude_gains[k]], 3) * self.axes for k in range(3)
        )
        limit = np.repeat(s.integral_limits, 3)
        return record(Gains, np.concatenate([k_p, k_d, k_i * self.period, limit]))

    def limits(self) -> Limits:
        """Bounds of the wrench, infinite where there are none, and what anti-windup goes by."""
        upper = np.array(self.settings.wrench_bounds or np.full(6, np.inf))
        lower = -upper
        if self.settings.wrench_bounds is not None:
            lower[2] = 0.0
        inverse = np.linalg.inv(rigid_inertia(self.vehicle))[np.triu_indices(3)]
        scalars = [self.settings.anti_windup * self.period, self.vehicle.mass]
        return record(Limits, np.concatenate([lower, upper, scalars, inverse]))


def rigid_inertia(vehicle: Vehicle) -> Array:
    """Inertia of the whole vehicle about the origin of {A}, arm neutral, {A} axes, (3, 3)."""
    data = vehicle.create_data()
    upper = np.triu(pin.crba(vehicle.model, data, vehicle.neutral())[3:6, 3:6])
    whole: Array = upper + np.triu(upper, 1).T
    return whole


class Pid(PidBase):
    """Eq. (19) on the vehicle taken as one rigid body at rest, with its weight fed forward.

    u = [m (u_f - g); R I R^T u_tau] with the total mass m, the inertia I about {A} at the neutral
    arm, and gravity g: what dc-PID is measured against, since it knows nothing of the arm's pose.
    """

    name = "pid"
    Memory = PidMemory
    kernels = LawKernels(start, command, delivered)

    def numbers(self) -> Any:
        """See `PidNumbers`."""
        inertia = rigid_inertia(self.vehicle)[np.triu_indices(3)]
        return PidNumbers(
            self.gains(), self.limits(), self.vehicle.gravity, tuple(inertia.tolist())
        )
