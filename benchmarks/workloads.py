"""What is timed: states along flights, so that nothing timed is frozen."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fullam.control.allocation import Allocator
from fullam.control.controller import Measurement, ReferencePoint, make_controller
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


def plan(
    vehicle: Vehicle | str,
    duration: float,
    controller: str = "dc-pid",
    weather: Weather = CALM,
    simulation: SimulationSettings = KILOHERTZ,
) -> FlightPlan:
    """Once round a level circle of 1 m in 8 s while the arm's last joint but one swings.

    A vehicle whose rotors cannot do that hovers in height and attitude.
    """
    if isinstance(vehicle, str):
        vehicle = load_vehicle(vehicle)
    mask = controllable_axes(vehicle.rotors)
    start = (1.0, 0.0, 2.0)
    scenario = Scenario(
        name=f"benchmark of {vehicle.name}",
        initial_position=start,
        reference=Circle((0.0, 0.0, 2.0), 1.0, 8.0) if all(mask) else Step(start),
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
    def calls(self) -> int:
        """Ticks of a burst."""
        return LAPS * len(self.measurements)

    def tick(self, controller: str, method: str = "ladder") -> ControlTick:
        """A controller at 1 kHz with its allocator, before its first tick."""
        law = make_controller(controller, self.vehicle, 0.001, self.axes)
        law.reset(self.measurements[0], self.references[0])
        return ControlTick(law, Allocator(self.vehicle.rotors, axes=self.axes, method=method))


def record(vehicle: Vehicle | str, ticks: int = BANK) -> Bank:
    """A bank from a calm flight around the circle."""
    return bank_of(plan(vehicle, 0.001 * (SETTLED + ticks)))


def record_demanding(vehicle: str, ticks: int = BANK) -> Bank:
    """A bank from a flight in noise and gusts whose reference jumps four times a second.

    The jumps are metres and tens of degrees and are not blended, so most of its wrenches are out of
    reach; the active set changes as it does in flight.
    """
    flown = plan(vehicle, 0.001 * (SETTLED + ticks), weather=WEATHERS[vehicle])
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
    return bank_of(prepare(scenario, vehicle=flown.nominal, settings=unblended, simulation=wide))


def bank_of(flown: FlightPlan) -> Bank:
    """Fly a plan and keep what the controller is told, after the start."""
    flight, measurements, references = Flight(flown), [], []
    for k in flight.ticks():
        if k < SETTLED:
            continue
        m, point = Measurement(flown.nominal), ReferencePoint()
        m.q[:], m.v[:] = flight.measurement.q, flight.measurement.v
        m.arm_acceleration[:] = flight.measurement.arm_acceleration
        point.pose, point.velocity = flown.reference.pose[k], flown.reference.velocity[k]
        point.acceleration = flown.reference.acceleration[k]
        measurements.append(m)
        references.append(point)
    return Bank(flown.nominal, flown.scenario.axes_mask, measurements, references)
