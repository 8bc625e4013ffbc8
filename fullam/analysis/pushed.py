"""What a hovering vehicle's law answers to a push: the closed loop, as it flies.

A small wrench is added to the command of one control period, between law and allocation, and what
the law asks for afterwards is set against the same flight without it. Estimator, law, allocation,
rotors, sensors and their delay are those of the flight, as stages and kernels; so anybody's are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.control.estimator import flies_as_kernel
from fullam.control.estimators import estimator_class
from fullam.control.law import flies_as_kernels
from fullam.control.signals import Command
from fullam.dynamics.rotations import euler_angles
from fullam.dynamics.spatial import Spatial, add_spatial
from fullam.model.perturbation import Uncertainty
from fullam.numbers.kernel import kernel
from fullam.numbers.machine_code import available
from fullam.numbers.program import Stage
from fullam.numbers.records import Rows, flat, record
from fullam.simulation.block import Block
from fullam.simulation.flight import Flight
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.fused import Fused
from fullam.simulation.motions.arm_motion import HoldArm
from fullam.simulation.motions.references import Step
from fullam.simulation.plants.settings import in_kernels
from fullam.simulation.tables import Tables

Array = NDArray[np.float64]

SETTLE, HORIZON = 1.0, 4.0
"""Before the push the estimator and the law find their ways; so long the answer is heard [s]."""

PUSH = (1e-4, 1e-5)
"""Force in weights, moment in weights times a metre: a thousandth of what noise does, and ten
million times what rounding does."""


class PushView(NamedTuple):
    """What `push` is shown: the command, and by period what to add and what the law asked for."""

    command: Any
    pushes: Any
    asked: Any


@kernel
def push(view, k):  # type: ignore[no-untyped-def]
    """Note what the law asks for, and add to it."""
    command = view.command[0]
    view.asked[k] = command.wrench
    wrench = add_spatial(command.wrench, view.pushes[k])
    view.command[0] = Command(wrench, command.u_pid, command.u_dc)


class PushedBlock(Block):
    """A block of flights that are pushed.

    Attributes:
        pushes: Added to the commands, a row a control period.
        asked: What the law asked for, a row a control period.
    """

    def stages(self) -> dict[str, Stage]:
        """Those of a flight, with the push behind the law."""
        periods, found = self.tables.periods, {}
        self.pushes = Rows.empty(Spatial, periods, lanes=self.lanes)
        self.asked = Rows.empty(Spatial, periods, lanes=self.lanes)
        self.pushes.array[:] = 0.0
        for name, stage in super().stages().items():
            found[name] = stage
            if name == "command":
                found["push"] = Stage(push, PushView(self.command, self.pushes, self.asked))
        return found


@dataclass(frozen=True, eq=False)
class Answers:
    """What a law answers to a unit push.

    Attributes:
        period: Control period [s].
        axes: The axes that were pushed, out of 0 to 5.
        commands: Change of the command on the axis that was pushed, from the period of the push
            on, shape (periods, axes).
    """

    period: float
    axes: tuple[int, ...]
    commands: Array


def hover_of(plan: FlightPlan) -> FlightPlan:
    """A flight's vehicle, law, estimator and sensors in level hover, its arm held, in still air.

    Nothing is within reach: what touches a wall in some periods is no linear loop.
    Without failed rotors it is level, with some in the attitude which the others hold best.
    The pose and the inertial sensors keep their noise, which some laws listen to, and their biases;
    no pose is missing or an outlier, and parameters are exact. Where MuJoCo flies, the plant with
    the same joints that machine code can fly stands in for it.
    """
    s, euler_deg = plan.scenario, (0.0, 0.0, 0.0)
    if plan.trim is not None:
        x, y, z = np.degrees(euler_angles(plan.trim.rotation)).tolist()
        euler_deg = (x, y, z)
    scenario = replace(
        s,
        reference=Step(s.initial_position, euler_deg),
        initial_euler_deg=euler_deg,
        arm_motion=HoldArm(),
        duration=SETTLE + HORIZON,
        world=(),
        world_file=None,
    )
    weather = replace(
        plan.weather,
        force_disturbance=0.0,
        moment_disturbance=0.0,
        uncertainty=Uncertainty(share=0.0),
        sensors=plan.weather.sensors.without_lost_poses(),
    )
    plant, chosen = in_kernels(plan.simulation.plant, plan.simulation.plant_settings)
    simulation = replace(plan.simulation, governor=None, plant=plant, plant_settings=chosen)
    parts = scenario, plan.nominal, plan.controller, plan.settings, simulation, weather
    return FlightPlan.prepare(*parts, plan.seed)


def answers(plan: FlightPlan) -> Answers:
    """The answers to a push along each controlled axis.

    One flight an axis, by machine code if law and estimator are kernels, else by Python.

    Args:
        plan: What hovers; see `hover_of`.

    Raises:
        NonFiniteWrench: The law returned NaN or infinity.
    """
    weight = plan.nominal.mass * plan.nominal.gravity
    axes = tuple(int(axis) for axis in np.flatnonzero(plan.scenario.axes_mask))
    period = plan.simulation.control_period
    at, size = round(SETTLE / period), weight * np.repeat(PUSH, 3)
    pushes = np.zeros((len(axes) + 1, 6))  # the last one flies without
    pushes[np.arange(len(axes)), axes] = size[list(axes)]
    fly = _by_machine_code if as_kernels(plan) else _by_python
    asked = fly(plan, at, pushes)
    own = asked[:, np.arange(len(axes)), axes] - asked[:, -1, axes]
    return Answers(period, axes, own[at:] / size[list(axes)])


def as_kernels(plan: FlightPlan) -> bool:
    """Whether machine code can fly a plan's law and estimator."""
    law, filtering = type(plan.make_controller()), estimator_class(str(plan.simulation.estimator))
    return available() and flies_as_kernels(law) and flies_as_kernel(filtering)


def _by_machine_code(plan: FlightPlan, at: int, pushes: Array) -> Array:
    """Commands, shape (periods, flights, 6).

    One flight after the other: that takes no longer than it takes to load code for lanes, and the
    code is the one that flies the flight itself.
    """
    fused, asked = Fused(Tables(plan), make_block=PushedBlock), []
    block = fused.block
    assert isinstance(block, PushedBlock)
    block.load(plan)
    for pushed in pushes:
        block.pushes.array[at] = pushed
        fused.fly()
        asked.append(block.asked.array.copy())
    return np.stack(asked, axis=1)


def _by_python(plan: FlightPlan, at: int, pushes: Array) -> Array:
    """Commands, shape (periods, flights, 6)."""
    return np.stack([_pushed_by_python(plan, at, pushed) for pushed in pushes], axis=1)


def _pushed_by_python(plan: FlightPlan, at: int, pushed: Array) -> Array:
    """Commands of one flight, shape (periods, 6)."""
    flight, asked = Flight(plan), np.zeros((len(plan.t), 6))
    command, view = flight.stages["command"]

    def both(view: Any, k: int) -> None:
        command(view, k)
        wanted = view.command[0]
        asked[k] = [*flat(wanted.wrench)]
        if k == at:
            wrench = add_spatial(wanted.wrench, record(Spatial, pushed))
            view.command[0] = Command(wrench, wanted.u_pid, wanted.u_dc)

    flight.stages["command"] = both, view
    for _ in flight.ticks():
        pass
    return asked
