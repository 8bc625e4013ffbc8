"""A controller and its allocator as one compiled call: for hardware in the loop, and timing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fullam.control.allocation import Allocator
from fullam.control.controller import Controller, Measurement, ReferencePoint
from fullam.exceptions import NonFiniteWrench
from fullam.simulation.compiled.arrays import (
    LAWS,
    allotment_of,
    check_rotors,
    law_memory,
    law_of,
    links_of,
    refuse,
    start_afresh,
)
from fullam.simulation.compiled.box_qp import U
from fullam.simulation.compiled.dynamics import ARM_WIDTH
from fullam.simulation.compiled.entries import NOT_FINITE, OUT_OF_REACH
from fullam.simulation.compiled.entries import allot as allot_compiled
from fullam.simulation.compiled.entries import tick as tick_compiled
from fullam.simulation.compiled.integrate import ASKED, COMMANDS, TOLD
from fullam.simulation.compiled.jit import announced

Array = NDArray[np.float64]


class CompiledTick:
    """From a measurement and a reference to rotor speeds.

    Attributes:
        allotment: The allocation, with its counters.
        memory: What the law remembers, shape (7, 6); see `law`.
        wrench_A: Wrench asked for last in {A} axes, shape (6,), live [N, N m].
        saturated: Whether bounds kept it from being delivered.
    """

    def __init__(self, controller: Controller, allocator: Allocator) -> None:
        """Turn a controller and an allocator into arrays, and compile; neither is used afterwards.

        Raises:
            SettingsError: The controller is not compiled; the message says which are.
        """
        if type(controller) not in LAWS:
            raise refuse("controller", controller.name, [c.name for c in LAWS])
        vehicle = controller.vehicle
        check_rotors(vehicle)
        self.saturated = False
        self.memory = law_memory()
        self.allotment = allotment_of(allocator)
        self._state, self._speeds = np.zeros((8, 7)), np.zeros((2, vehicle.rotors.count))
        self._state[TOLD, 6] = 1.0
        self._commands: Array = self._speeds[COMMANDS]
        self.wrench_A: Array = self._state[ASKED, :6]
        reference, joints = np.zeros((3, 7)), np.zeros((3, vehicle.n_arm))
        self._inputs = np.concatenate(
            [
                vehicle.neutral(),
                np.zeros(6 + 2 * vehicle.n_arm),
                vehicle.neutral()[:7],
                np.zeros(12),
            ]
        )
        self._arguments = (
            *law_of(controller, links_of(vehicle)),
            self.memory,
            *self.allotment,
            self._state,
            self._speeds,
            reference,
            joints,
            np.zeros((1, vehicle.n_arm, ARM_WIDTH)),
            self._inputs,
        )
        with announced("the controller", tick_compiled):
            tick_compiled(*self._arguments)
        # The arrays are ours and always of these types: no need to look at them every time.
        self._tick = tick_compiled.get_overload(tick_compiled.signatures[0])
        self.reset()

    def reset(self) -> None:
        """Forget the past: integrators to zero, and where the last allocation was found."""
        self.memory[:] = 0.0
        start_afresh(self.allotment)

    def speeds(self, m: Measurement, reference: ReferencePoint) -> Array:
        """Rotor speeds for one control period, shape (n_r,), live [rad/s].

        Raises:
            NonFiniteWrench: The law returned NaN or infinity.
        """
        np.concatenate(
            (
                m.q,
                m.v,
                m.arm_acceleration,
                reference.pose,
                reference.velocity,
                reference.acceleration,
            ),
            out=self._inputs,
        )
        said = self._tick(*self._arguments)
        if said == NOT_FINITE:
            raise NonFiniteWrench(self.wrench_A.copy())
        self.saturated = said == OUT_OF_REACH
        return self._commands

    def allocate(self, wrench_A: Array) -> tuple[Array, bool]:
        """Squared speeds as shares of the largest, shape (n_r,), and whether out of reach."""
        saturated = allot_compiled(self.allotment, np.array(wrench_A, dtype=float).reshape(1, 6))
        return self.allotment.unknowns[U].copy(), bool(saturated)
