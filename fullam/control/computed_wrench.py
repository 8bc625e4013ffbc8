"""Computed wrench: inverse dynamics of the whole vehicle and PD on the pose, the ideal bound.

    u = M_bb a + M_bj ddtheta + h_b,    a = K_p e + K_d de/dt + reference acceleration,

the root wrench of RNEA at (q, v, [a, ddtheta]). With exact parameters, an exact state and rotors
without lag or limits every axis then obeys dde + K_d de + K_p e = 0, alone and whatever the arm
does: no law can cancel more of the model. Nothing cancels what the model has wrong.

dc-PID with "desired_acceleration" reaches the same wrench through joint 1; a test holds the one to
the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.control.controller import ALL_AXES, Measurement, ReferencePoint
from fullam.control.pid import PidBase, PidSettings
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ComputedWrenchSettings(PidSettings):
    """Settings of the PID, without integral action by default.

    The poles are those of dc-PID's proportional and derivative gains: position 9.6, 6 (natural
    frequency 3.1 rad/s, damping 0.97), attitude 30, 10 (5.5 rad/s, 0.91).
    """

    position_gains: tuple[float, float, float] = (9.6, 0.0, 6.0)
    attitude_gains: tuple[float, float, float] = (30.0, 0.0, 10.0)


class ComputedWrench(PidBase):
    """Inverse dynamics of the whole vehicle and PD on the pose: the ideal bound."""

    name = "computed-wrench"
    Settings = ComputedWrenchSettings
    settings: ComputedWrenchSettings

    def __init__(
        self,
        vehicle: Vehicle,
        settings: ComputedWrenchSettings | None = None,
        period: float = 0.01,
        axes: tuple[bool, ...] = ALL_AXES,
    ) -> None:
        """Bind the law; see `Controller`."""
        super().__init__(vehicle, settings, period, axes)
        model = vehicle.model
        self._model, self._data = model, vehicle.create_data()
        self._q, self._v, self._a = vehicle.neutral(), np.zeros(model.nv), np.zeros(model.nv)

    def wrench(self, t: float, measurement: Measurement, reference: ReferencePoint) -> Array:
        """Root wrench for the wanted acceleration, world axes; see `Controller.wrench`."""
        u_pid = self.law.acceleration(measurement, reference, self.u_pid)
        q, v, a, R = self._q, self._v, self._a, self.law.rotation
        q[:] = measurement.q
        # Seen from a frame that moves along with {A}, classical and spatial acceleration agree.
        v[3:] = measurement.v[3:]
        np.dot(u_pid.reshape(2, 3), R, out=a[:6].reshape(2, 3))
        a[6:] = measurement.arm_acceleration
        root = pin.rnea(self._model, self._data, q, v, a)[:6]
        np.dot(root.reshape(2, 3), R.T, out=self._wrench.reshape(2, 3))
        a[:6] = 0.0
        bias = pin.rnea(self._model, self._data, q, v, a)[:6]
        np.dot(bias.reshape(2, 3), R.T, out=self.u_dc.reshape(2, 3))
        if self._bounded:
            self._bound()
        return self._wrench
