"""my-law: PID on the pose, and the inverse dynamics of the whole vehicle, arm included."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

import fullam
from fullam.control.law import KernelLaw, LawKernels
from fullam.control.pid import Gains, integrated, pid, pose_error
from fullam.control.signals import Command
from fullam.dynamics.recursion import root_wrench
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Spatial
from fullam.numbers.kernel import Number, kernel
from fullam.numbers.records import record
from fullam.numbers.vectors import ZERO


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


class Numbers(NamedTuple):
    """What the law knows."""

    gains: Gains
    gravity: Number


class Memory(NamedTuple):
    """What it remembers from period to period: the integral, and that of the period before."""

    integral: Spatial
    before: Spatial


@kernel
def start(numbers, chain, estimate):
    """Before the first period: an empty integral."""
    return Memory(Spatial(ZERO, ZERO), Spatial(ZERO, ZERO))


@kernel
def command(numbers, chain, estimate, target, memory):
    """Every period: the wrench wanted from the rotors, world axes, and the memory one period on."""
    R, w = rotation_matrix(estimate.pose.attitude), estimate.velocity.angular
    e, de = pose_error(estimate, target)
    a = pid(numbers.gains, e, de, memory.integral, target.acceleration)
    wrench, compensation = root_wrench(chain, R, w, a, numbers.gravity)
    integral = integrated(numbers.gains, memory.integral, e)
    return Command(wrench, a, compensation), Memory(integral, memory.integral)


@kernel
def delivered(numbers, chain, estimate, memory, delivery):
    """After a period whose wrench the rotors could not deliver: integrate none of it."""
    return Memory(memory.before, memory.before)


@fullam.register("my-law")
class MyLaw(KernelLaw):
    """PID on the pose and inverse dynamics, as kernels: Python, machine code, eight at a time."""

    Settings, Memory = MyLawSettings, Memory
    estimator = "kalman"  # flown with it, unless another one is asked for
    kernels = LawKernels(start, command, delivered)

    def numbers(self):
        """Settings and nominal vehicle as numbers; axes that are not controlled get no gain."""
        s = self.settings
        gains = np.array([s.position_gains, s.attitude_gains]).repeat(3, axis=0).T
        k_p, k_i, k_d = gains * self.axes
        limit = np.repeat(s.integral_limits, 3)
        gains = record(Gains, np.r_[k_p, k_d, k_i * self.period, limit])
        return Numbers(gains, self.vehicle.gravity)
