"""One control period without sensors: law, turn to {A}, allocation, rotor speeds."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pinocchio import centerOfMass

from fullam.control.allocation import Allocator
from fullam.control.controller import Controller, Measurement, ReferencePoint
from fullam.dynamics.pose_space import AttitudeView

Array = NDArray[np.float64]


class ControlTick:
    """A controller and its allocator: from measurement and reference to rotor speeds.

    This is what runs on a flight computer, and what a simulated flight calls once a period. A
    wrench out of reach is allocated about the vehicle's centre of mass, and the controller is told
    what it got. Copies and pickles begin afresh, as those of a controller do.

    Attributes:
        controller: The law; call its `reset` before the first tick.
        allocator: Wrench to squared speeds.
        command: The law's wrench, world axes, shape (6,), live [N, N m].
        wrench_A: The same in the axes of {A} that the thrust will have, shape (6,), live.
        residual: Achieved minus asked in {A}, shape (6,), live; means something if saturated.
        saturated: Whether bounds kept the last wrench from being delivered.
    """

    def __init__(self, controller: Controller, allocator: Allocator) -> None:
        """Bind the two; both are used by nobody else."""
        self.controller, self.allocator = controller, allocator
        self.command: Array = np.zeros(6)
        self.wrench_A: Array = np.zeros(6)
        self.residual: Array = np.zeros(6)
        self.saturated = False
        vehicle = controller.vehicle
        self._command_rows = self.command.reshape(2, 3)
        self._wrench_A_rows = self.wrench_A.reshape(2, 3)
        # A law that has worked out the attitude of the measurement may share it.
        self._shared: Array | None = controller.attitude
        self._attitude = AttitudeView()
        self._model, self._data = vehicle.model, vehicle.create_data()
        self._at_origin = vehicle.neutral()
        self._arm_angles = self._at_origin[7:]
        self._coupling = vehicle.rotors.normalized_coupling
        self._max_speeds = vehicle.rotors.max_speeds
        self._speeds = np.zeros(vehicle.rotors.count)
        # What was achieved and what was missing in one array: one product turns both.
        both, both_W = np.zeros(12), np.zeros(12)
        self._achieved, self._missing, self._both_rows = both[:6], both[6:], both.reshape(4, 3)
        self._achieved_W, self._missing_W = both_W[:6], both_W[6:]
        self._both_W_rows = both_W.reshape(4, 3)

    def __reduce__(self) -> tuple[Any, ...]:
        """Made anew around the two: arrays that are views of each other would be copied apart."""
        return type(self), (self.controller, self.allocator)

    def speeds(
        self, t: float, m: Measurement, reference: ReferencePoint, R_thrust: Array | None = None
    ) -> Array:
        """Rotor speeds, shape (n_r,), live [rad/s].

        Args:
            t: Time [s].
            m: The measurement.
            reference: The reference.
            R_thrust: Attitude when the rotors will have followed, shape (3, 3); that of the
                measurement if None.

        Raises:
            NonFiniteWrench: The law returned NaN or infinity, or (`NonFiniteCenter`) an angle of
                the arm is not finite.
        """
        command = self.controller.wrench(t, m, reference)
        if command is not self.command:
            self.command, self._command_rows = command, command.reshape(2, 3)
        if R_thrust is None:
            shared = self._shared
            R_thrust = self._attitude.look(m.q[:7]) if shared is None else shared
        self._command_rows.dot(R_thrust, self._wrench_A_rows)
        self.saturated = False
        u = self.allocator.exact(self.wrench_A)
        if u is None:
            u = self._about_center_of_mass(m, R_thrust)
        np.sqrt(u, self._speeds)
        return np.multiply(self._speeds, self._max_speeds, self._speeds)

    def _about_center_of_mass(self, m: Measurement, R: Array) -> Array:
        """Allocate what is out of the exact map's reach; tell the law what it did not get."""
        allocator = self.allocator
        self._arm_angles[:] = m.q[7:]
        center = centerOfMass(self._model, self._data, self._at_origin)
        u = allocator.allocate_about(self.wrench_A, center)
        self.saturated = allocator.saturated
        if self.saturated:
            achieved = self._coupling.dot(u, self._achieved)
            np.subtract(achieved, self.wrench_A, self.residual)
            np.subtract(achieved, allocator.asked, self._missing)
            self._both_rows.dot(R.T, self._both_W_rows)
            self.controller.delivered(self._achieved_W, self._missing_W)
        return u
