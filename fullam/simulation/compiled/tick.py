"""A controller and its allocator as one compiled call: for hardware in the loop, and timing."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.control.allocation import Allocator
from fullam.control.controller import Controller, Measurement, ReferencePoint
from fullam.exceptions import NonFiniteCenter, NonFiniteWrench
from fullam.simulation.compiled.allocation import Allotment
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
from fullam.simulation.compiled.box_qp import RESIDUAL, U
from fullam.simulation.compiled.dynamics import ARM_WIDTH
from fullam.simulation.compiled.entries import NO_CENTER, NOT_FINITE, OUT_OF_REACH
from fullam.simulation.compiled.entries import allot as allot_compiled
from fullam.simulation.compiled.entries import tick as tick_compiled
from fullam.simulation.compiled.integrate import ASKED, COMMANDS, TOLD
from fullam.simulation.compiled.jit import announced

Array = NDArray[np.float64]


class CompiledTick:
    """From a measurement and a reference to rotor speeds.

    Copies and pickles carry the memory of law and allocation along.

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
        state = np.zeros((8, 7))
        state[TOLD, 6] = 1.0
        pose = vehicle.neutral()
        inputs = np.concatenate([pose, np.zeros(6 + 2 * vehicle.n_arm), pose[:7], np.zeros(12)])
        self._bind(
            (
                *law_of(controller, links_of(vehicle)),
                law_memory(),
                *allotment_of(allocator),
                state,
                np.zeros((2, vehicle.rotors.count)),
                np.zeros((3, 7)),
                np.zeros((3, vehicle.n_arm)),
                np.zeros((1, vehicle.n_arm, ARM_WIDTH)),
                inputs,
            )
        )

    def _bind(self, arguments: tuple[Any, ...]) -> None:
        """Keep the arguments of the compiled function, look into them, and compile it."""
        self._arguments = arguments
        _, _, self.memory, *allotment, state, speeds, _, _, _, self._inputs = arguments
        self.allotment = Allotment(*allotment)
        self._commands: Array = speeds[COMMANDS]
        self.wrench_A: Array = state[ASKED, :6]
        self.saturated = False
        if not tick_compiled.signatures:
            with announced("the controller", tick_compiled):
                # Copies, since a call changes its arguments.
                tick_compiled(*(array.copy() for array in arguments))
        # The arrays are ours and always of these types: no need to look at them every time.
        self._tick = tick_compiled.get_overload(tick_compiled.signatures[0])

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy the arrays alone: the rest are views of them, and machine code."""
        return _bound, (self._arguments, self.saturated)

    def reset(self) -> None:
        """Forget the past: integrators to zero, and where the last allocation was found."""
        self.memory[:] = 0.0
        start_afresh(self.allotment)

    def speeds(self, m: Measurement, reference: ReferencePoint) -> Array:
        """Rotor speeds for one control period, shape (n_r,), live [rad/s].

        Raises:
            NonFiniteWrench: The law returned NaN or infinity, or (`NonFiniteCenter`) an angle of
                the arm is not finite.
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
        if said == NO_CENTER:
            raise NonFiniteCenter(self.wrench_A.copy(), self.allotment.sixes[RESIDUAL, :3].copy())
        self.saturated = said == OUT_OF_REACH
        return self._commands

    def allocate(self, wrench_A: Array) -> tuple[Array, bool]:
        """Squared speeds as shares of the largest, shape (n_r,), and whether out of reach.

        Raises:
            NonFiniteWrench: NaN or infinity.
        """
        wrench = np.array(wrench_A, dtype=float).reshape(1, 6)
        if not isfinite(sum(wrench[0].tolist())):
            raise NonFiniteWrench(wrench[0])
        saturated = allot_compiled(self.allotment, wrench)
        return self.allotment.unknowns[U].copy(), bool(saturated)


def _bound(arguments: tuple[Any, ...], saturated: bool) -> CompiledTick:
    """What a copy or a pickle is made from."""
    tick = CompiledTick.__new__(CompiledTick)
    tick._bind(arguments)
    tick.saturated = saturated
    return tick
