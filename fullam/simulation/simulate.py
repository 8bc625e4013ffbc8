"""One call flies one scenario: `simulate`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fullam.control.controllers import make_settings
from fullam.exceptions import Diverged, UnknownName
from fullam.model.loading import load_vehicle
from fullam.model.vehicle import Vehicle
from fullam.simulation import fused
from fullam.simulation.flight import Flight
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.progress import Progress
from fullam.simulation.run import Run
from fullam.simulation.scenario import Scenario, load_scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.weather import CALM, Weather
from fullam.simulation.weather import weather as named_weather

DRIVERS = ("python", "fused")
"""Who flies a plan: Python, with any law and Pinocchio as dynamics; or machine code."""


def prepare(
    scenario: Scenario | str | Path,
    controller: str = "dc-pid",
    *,
    vehicle: Vehicle | str | None = None,
    seed: int = 0,
    weather: Weather | str | None = None,
    calm: bool = False,
    settings: Any = None,
    simulation: SimulationSettings | None = None,
) -> FlightPlan:
    """Fix everything about a flight; arguments as in `simulate`."""
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    if not isinstance(vehicle, Vehicle):
        vehicle = load_vehicle(vehicle or scenario.vehicle)
    if calm:
        weather = CALM
    elif isinstance(weather, str):
        weather = named_weather(weather)
    if settings is None or isinstance(settings, Mapping):
        settings = make_settings(controller, dict(settings or {}))
    return FlightPlan.prepare(
        scenario,
        vehicle,
        controller,
        settings,
        simulation or SimulationSettings(),
        weather or scenario.weather,
        seed,
    )


def simulate(
    scenario: Scenario | str | Path,
    controller: str = "dc-pid",
    *,
    vehicle: Vehicle | str | None = None,
    seed: int = 0,
    weather: Weather | str | None = None,
    calm: bool = False,
    settings: Any = None,
    simulation: SimulationSettings | None = None,
    driver: str = "python",
    progress: Progress | None = None,
    throw: bool = True,
) -> Run:
    """Fly a scenario and return the record.

    Args:
        scenario: A scenario, the name of a registered one, or the path of a TOML file.
        controller: Name of a registered controller.
        vehicle: The nominal vehicle; the scenario's own by default.
        seed: Seed of noise, gusts and parameter errors.
        weather: A weather or its name; the scenario's own by default.
        calm: No noise, no gusts, no parameter errors, whatever the weather.
        settings: The controller's settings: an instance, or a mapping of those that differ from
            the defaults.
        simulation: Rates, integrator, sensors.
        driver: Who flies it, one of `DRIVERS`: "python" flies everything, with Pinocchio as
            dynamics; "fused" flies what is written as kernels, a hundred times faster, by machine
            code. Their flights agree to rounding.
        progress: Told (ticks flown, ticks in all) about a hundred times.
        throw: Raise when the flight diverges (at the prompt); False returns the partial run with
            outcome "diverged" (in a campaign).

    Raises:
        Diverged: The flight left the bounds of sense; the error carries the partial run.
        UnknownName: No such scenario, controller, vehicle, weather or driver.
        ScenarioError: A scenario that cannot be flown.
        VehicleError: A vehicle file that describes no flyable vehicle, or an arm that is not one
            chain of joints.
        NotFullyActuated: The rotors cannot produce the axes that the scenario controls.
        NonFiniteWrench: The controller returned NaN or infinity.
        SettingsError: A setting that the controller does not accept; or driver="fused" for a law
            or an estimator that is not written as kernels. The message names it.
    """
    if driver not in DRIVERS:
        raise UnknownName("driver", driver, DRIVERS)
    plan = prepare(
        scenario,
        controller,
        vehicle=vehicle,
        seed=seed,
        weather=weather,
        calm=calm,
        settings=settings,
        simulation=simulation,
    )
    run = fused.fly(plan, progress) if driver == "fused" else fly_by_python(plan, progress)
    if run.diverged and throw:
        raise Diverged(run, run.metadata["reason"])
    return run


def fly_by_python(plan: FlightPlan, progress: Progress | None = None) -> Run:
    """Fly one plan by Python; see `simulate`."""
    flight, total = Flight(plan), plan.t.size
    stride = max(1, total // 100)
    for k in flight.ticks():
        if progress is not None and (k % stride == 0 or k == total - 1):
            progress(k + 1, total)
    return flight.run()
