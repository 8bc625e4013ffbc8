"""Computed wrench: inverse dynamics of the whole vehicle and PD on the pose, the ideal bound.

    u = M_bb a + M_bj ddtheta + h_b,    a = K_p e + K_d de/dt + reference acceleration,

the root wrench of RNEA at (q, v, [a, ddtheta]). With exact parameters, an exact state and rotors
without lag or limits every axis then obeys dde + K_d de + K_p e = 0, alone and whatever the arm
does: no law can cancel more of the model. Nothing cancels what the model has wrong.

dc-PID with "desired_acceleration" reaches the same wrench through joint 1; a test holds this law's
root wrench, which is Pinocchio's, to dc-PID's by the paper's matrix system.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.control.controller import ALL_AXES
from fullam.control.law import LawKernels
from fullam.control.pid import (
    Gains,
    Limits,
    PidBase,
    PidMemory,
    PidSettings,
    delivered,
    integrated,
    pid,
    pose_error,
    start,
    within_bounds,
)
from fullam.control.signals import Command, Estimate, Target
from fullam.control.tunable import tunable
from fullam.dynamics.recursion import Chain, JointMotion, root_wrench
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Spatial, rotate_spatial, rotate_spatial_back
from fullam.model.vehicle import Vehicle
from fullam.numbers.kernel import Number, kernel
from fullam.numbers.records import flat, record
from fullam.numbers.vectors import rotate_back

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ComputedWrenchSettings(PidSettings):
    """Settings of the PID, without integral action by default.

    The poles are those of dc-PID's proportional and derivative gains: position 9.6, 6 (natural
    frequency 3.1 rad/s, damping 0.97), attitude 30, 10 (5.5 rad/s, 0.91).
    """

    position_gains: tuple[float, float, float] = tunable(
        (9.6, 0.0, 6.0), low=(2.0, 0.01, 1.0), high=(80.0, 100.0, 20.0)
    )
    attitude_gains: tuple[float, float, float] = tunable(
        (30.0, 0.0, 10.0), low=(5.0, 0.05, 2.0), high=(300.0, 500.0, 60.0)
    )


class ComputedWrenchNumbers(NamedTuple):
    """Computed wrench as numbers: gains, limits and gravity."""

    gains: Gains
    limits: Limits
    gravity: Number


@kernel
def computed_wrench(inverse_dynamics, numbers, chain, estimate, target, memory):
    """The root wrench at the acceleration that eq. (19) wants; see the module's text.

    Args:
        inverse_dynamics: (chain, R, w, a, gravity) to the root wrenches at a and at 0, a function.
        numbers: `ComputedWrenchNumbers`.
        chain: The nominal vehicle with its arm in motion.
        estimate: What is told of the platform.
        target: Where it should be.
        memory: `PidMemory`.
    """
    R = rotation_matrix(estimate.pose.attitude)
    e, de = pose_error(estimate, target)
    u_pid = pid(numbers.gains, e, de, memory.integral, target.acceleration)
    w = estimate.velocity.angular
    u, u_dc = inverse_dynamics(chain, R, w, u_pid, numbers.gravity)
    integral = integrated(numbers.gains, memory.integral, e)
    u, integral = within_bounds(numbers.limits, R, u, integral)
    return Command(u, u_pid, u_dc), PidMemory(integral)


@kernel
def command(numbers, chain, estimate, target, memory):
    """`computed_wrench` on the recursion: what machine code flies."""
    return computed_wrench(root_wrench, numbers, chain, estimate, target, memory)


class RootForce:
    """The root wrench read from Pinocchio's RNEA: what Python flies."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Own a workspace."""
        self._model, self._data = vehicle.model, vehicle.create_data()
        self._q, self._v = vehicle.neutral(), np.zeros(vehicle.model.nv)
        self._a = np.zeros(vehicle.model.nv)

    def wrenches(
        self, chain: Chain, R: Any, w: Any, acceleration: Spatial, gravity: float
    ) -> tuple[Spatial, Spatial]:
        """Root wrench at an acceleration, and at none; world axes. `chain.joints` are motions."""
        q, v, a = self._q, self._v, self._a
        q[3:7] = pin.Quaternion(np.array(R).reshape(3, 3)).coeffs()
        # Seen from a frame that moves along with {A}, classical and spatial acceleration agree.
        v[3:6] = rotate_back(R, w)
        for i, motion in enumerate(chain.joints):
            q[7 + i], v[6 + i], a[6 + i] = motion
        wanted = flat(rotate_spatial_back(R, acceleration))
        return self._wrench(R, wanted), self._wrench(R, np.zeros(6))

    def _wrench(self, R: Any, acceleration: Any) -> Spatial:
        self._a[:6] = acceleration
        root = pin.rnea(self._model, self._data, self._q, self._v, self._a)[:6]
        return rotate_spatial(R, record(Spatial, root))


class ComputedWrench(PidBase):
    """Inverse dynamics of the whole vehicle and PD on the pose: the ideal bound."""

    name = "computed-wrench"
    Settings = ComputedWrenchSettings
    settings: ComputedWrenchSettings
    Memory = PidMemory
    kernels = LawKernels(start, command, delivered)

    def __init__(
        self,
        vehicle: Vehicle,
        settings: ComputedWrenchSettings | None = None,
        period: float = 0.01,
        axes: tuple[bool, ...] = ALL_AXES,
        anticipated: bool = True,
    ) -> None:
        """Bind the law; see `Controller`."""
        super().__init__(vehicle, settings, period, axes, anticipated)
        self._root = RootForce(vehicle)

    def numbers(self) -> Any:
        """See `ComputedWrenchNumbers`."""
        return ComputedWrenchNumbers(self.gains(), self.limits(), self.vehicle.gravity)

    def chain(self, motions: Sequence[JointMotion]) -> Any:
        """Links, and the motions as they are: Pinocchio places the joints itself."""
        return Chain(self.links, motions)

    def _command(self, chain: Any, estimate: Estimate, target: Target) -> tuple[Command, Any]:
        answer: tuple[Command, Any] = computed_wrench(
            self._root.wrenches, self._numbers, chain, estimate, target, self._memory
        )
        return answer
