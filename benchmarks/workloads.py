"""What is timed: states along flights, so that nothing timed is frozen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from fullam.control.allocation import Allocator
from fullam.control.controller import Measurement, ReferencePoint
from fullam.control.controllers import make_controller
from fullam.control.tick import ControlTick
from fullam.model.loading import load_vehicle
from fullam.model.vehicle import Vehicle
from fullam.model.wrench_axes import controllable_axes
from fullam.simulation.arm_motion import SineRate
from fullam.simulation.flight import Flight
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.references import Circle, Step, Waypoints
from fullam.simulation.scenario import AXES, Scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.simulate import prepare
from fullam.simulation.weather import CALM, PAPER, Weather

VEHICLES = ("fullam", "hextilt")
"""Eight rotors and four joints; six rotors and five joints."""

WEATHERS = {
    "fullam": PAPER,
    "hextilt": replace(PAPER, force_disturbance=2.0, moment_disturbance=0.1),
}
"""Noise, gusts and parameter errors that each vehicle can bear."""

KILOHERTZ = SimulationSettings(control_period=0.001, plant_period=0.001, delay=0.002)
"""Control and plant at 1 kHz, with a late pose."""

BANK = 100
"""Ticks of a bank: few enough to stay in the caches, as the one live measurement of a loop does."""

LAPS = 4
"""How often a burst goes through a bank."""

SETTLED = 1000
"""Ticks that a bank leaves out: the start of its flight."""

STRETCH_EVERY = 235
"""Ticks from stretch to stretch of the demanding bank, whose reference jumps every 250."""


def plan(
    vehicle: Vehicle | str,
    duration: float,
    controller: str = "dc-pid",
    weather: Weather = CALM,
    simulation: SimulationSettings = KILOHERTZ,
    hover: bool = False,
) -> FlightPlan:
    """Once round a level circle of 1 m in 8 s while the arm's last joint but one swings.

    A vehicle whose rotors cannot do that hovers in height and attitude; so do all with `hover`.
    """
    if isinstance(vehicle, str):
        vehicle = load_vehicle(vehicle)
    mask = controllable_axes(vehicle.rotors)
    start = (1.0, 0.0, 2.0)
    scenario = Scenario(
        name=f"benchmark of {vehicle.name}",
        initial_position=start,
        reference=Step(start) if hover or not all(mask) else Circle((0.0, 0.0, 2.0), 1.0, 8.0),
        arm_motion=SineRate(joint=max(1, vehicle.n_arm - 1), rate=0.5, frequency=1.0),
        duration=duration,
        axes=tuple(axis for axis, good in zip(AXES, mask, strict=True) if good),
        weather=weather,
    )
    return prepare(scenario, controller, vehicle=vehicle, simulation=simulation)


@dataclass(frozen=True, eq=False)
class Bank:
    """Measurements and references of successive ticks of a flight."""

    vehicle: Vehicle
    axes: tuple[bool, ...]
    measurements: list[Measurement]
    references: list[ReferencePoint]

    @property
    def pairs(self) -> list[tuple[Measurement, ReferencePoint]]:
        """What the controller is told, tick by tick."""
        return list(zip(self.measurements, self.references, strict=True))

    @property
    def calls(self) -> int:
        """Ticks of a burst."""
        return LAPS * len(self.measurements)

    def tick(self, controller: str, method: str = "ladder") -> ControlTick:
        """A controller at 1 kHz with its allocator, before its first tick."""
        law = make_controller(controller, self.vehicle, 0.001, self.axes)
        law.reset(self.measurements[0], self.references[0])
        return ControlTick(law, Allocator(self.vehicle.rotors, axes=self.axes, method=method))


def record(vehicle: Vehicle | str, hover: bool = False) -> Bank:
    """A bank from a calm flight around the circle, or hovering at a point."""
    return bank_of(plan(vehicle, 0.001 * (SETTLED + BANK), hover=hover), (SETTLED,), BANK)


def record_demanding(vehicle: str) -> Bank:
    """A bank from a flight in noise and gusts whose reference jumps four times a second.

    The jumps are metres and tens of degrees and are not blended, so most of its wrenches are out of
    reach. Ten stretches of ten ticks, at different times after ten jumps: within a stretch the
    active set changes as it does in flight, from stretch to stretch altogether.
    """
    starts = tuple(range(SETTLED, SETTLED + 10 * STRETCH_EVERY, STRETCH_EVERY))
    flown = plan(vehicle, 0.001 * (starts[-1] + BANK), weather=WEATHERS[vehicle])
    rng = np.random.default_rng(0)
    start = np.array([0.0, 0.0, 10.0])
    times = tuple(np.arange(0.0, flown.scenario.duration, 0.25).tolist())
    jumps = Waypoints(
        times,
        tuple((rng.uniform(-3.0, 3.0, 3) + np.array([0.0, 0.0, 10.0])).tolist() for _ in times),
        tuple(rng.uniform(-60.0, 60.0, 3).tolist() for _ in times),
    )
    scenario = replace(flown.scenario, initial_position=tuple(start), reference=jumps)
    unblended = {"max_acceleration": None, "max_angular_acceleration": None}
    wide = replace(KILOHERTZ, max_position_error=50.0, max_attitude_error_deg=179.9)
    jumping = prepare(scenario, vehicle=flown.nominal, settings=unblended, simulation=wide)
    return bank_of(jumping, starts, BANK // len(starts))


def bank_of(flown: FlightPlan, starts: tuple[int, ...], length: int) -> Bank:
    """Fly a plan and keep what the controller is told in stretches of its ticks."""
    flight, measurements, references = Flight(flown), [], []
    wanted = {k for start in starts for k in range(start, start + length)}
    for k in flight.ticks():
        if k not in wanted:
            continue
        m, point = Measurement(flown.nominal), ReferencePoint()
        m.q[:], m.v[:] = flight.measurement.q, flight.measurement.v
        m.arm_acceleration[:] = flight.measurement.arm_acceleration
        point.pose, point.velocity = flown.reference.pose[k], flown.reference.velocity[k]
        point.acceleration = flown.reference.acceleration[k]
        measurements.append(m)
        references.append(point)
    return Bank(flown.nominal, flown.scenario.axes_mask, measurements, references)


def replay(tick: ControlTick, states: Bank) -> Callable[[], None]:
    """A function that flies the bank through a tick, LAPS times."""
    pairs = states.pairs * LAPS

    def work() -> None:
        speeds = tick.speeds
        for m, point in pairs:
            speeds(0.0, m, point)

    return work


def compiled_replay(tick: Any, states: Bank) -> Callable[[], None]:
    """The same for a compiled tick."""
    pairs = states.pairs * LAPS

    def work() -> None:
        speeds = tick.speeds
        for m, point in pairs:
            speeds(m, point)

    return work


def compiled_tick(states: Bank, controller: str) -> Any:
    """A compiled tick; skips the test without numba."""
    pytest.importorskip("numba", reason="numba is not installed (fullam[fast])")
    from fullam.simulation.compiled.tick import CompiledTick

    tick = states.tick(controller)
    return CompiledTick(tick.controller, tick.allocator)
