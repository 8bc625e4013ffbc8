"""A controller and its allocator as one compiled call: for hardware in the loop, and timing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fullam.control.allocation import Allocator
from fullam.control.controller import Controller, Measurement, ReferencePoint
from fullam.simulation.compiled.allocation import U
from fullam.simulation.compiled.arrays import (
    LAWS,
    allotment_of,
    check_rotors,
    law_memory,
    law_of,
    links_of,
    refuse,
)
from fullam.simulation.compiled.dynamics import ACCELERATION, COS, RATE, SIN
from fullam.simulation.compiled.entries import allot as allot_compiled
from fullam.simulation.compiled.entries import tick as tick_compiled
from fullam.simulation.compiled.integrate import ASKED, COMMANDS, TOLD, TOLD_VELOCITY
from fullam.simulation.compiled.jit import announced

Array = NDArray[np.float64]


class CompiledTick:
    """From a measurement and a reference to rotor speeds.

    Attributes:
        allotment: The allocation, with its counters.
        memory: What the law remembers, shape (7, 6); see `law`.
        wrench_A: Wrench asked for last in {A} axes, shape (6,), live [N, N m].
    """

    def __init__(self, controller: Controller, allocator: Allocator) -> None:
        """Turn a controller and an allocator into arrays; neither is used afterwards.

        Raises:
            SettingsError: The controller is not compiled; the message says which are.
        """
        if type(controller) not in LAWS:
            raise refuse("controller", controller.name, [c.name for c in LAWS])
        vehicle = controller.vehicle
        check_rotors(vehicle)
        self._law = law_of(controller, links_of(vehicle))
        self.memory = law_memory()
        self.allotment = allotment_of(allocator)
        self._state = np.zeros((8, 7))
        self._pose, self._velocity = self._state[TOLD], self._state[TOLD_VELOCITY, :6]
        self._speeds = np.zeros((2, vehicle.rotors.count))
        self._commands: Array = self._speeds[COMMANDS]
        self._reference = np.zeros((3, 7))
        self._arm = np.zeros((1, 4, vehicle.n_arm))
        self._cos, self._sin = self._arm[0, COS], self._arm[0, SIN]
        self._rate, self._acceleration = self._arm[0, RATE], self._arm[0, ACCELERATION]
        self.wrench_A: Array = self._state[ASKED, :6]

    def speeds(self, measurement: Measurement, reference: ReferencePoint) -> Array:
        """Rotor speeds for one control period, shape (n_r,), live [rad/s]."""
        q, v, point = measurement.q, measurement.v, self._reference
        self._pose[:], self._velocity[:] = q[:7], v[:6]
        np.cos(q[7:], out=self._cos)
        np.sin(q[7:], out=self._sin)
        self._rate[:], self._acceleration[:] = v[6:], measurement.arm_acceleration
        point[0], point[1, :6], point[2, :6] = (
            reference.pose,
            reference.velocity,
            reference.acceleration,
        )
        with announced("the controller", tick_compiled):
            tick_compiled(
                *self._law,
                self.memory,
                self.allotment,
                self._state,
                self._speeds,
                point,
                self._arm,
            )
        return self._commands

    def allocate(self, wrench_A: Array) -> tuple[Array, bool]:
        """Squared speeds as shares of the largest, shape (n_r,), and whether out of reach."""
        saturated = allot_compiled(self.allotment, np.array(wrench_A, dtype=float).reshape(1, 6))
        return self.allotment.unknowns[U].copy(), bool(saturated)
