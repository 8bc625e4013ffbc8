"""One call flies one scenario: `simulate`."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypedDict, Unpack

from fullam.checks import Checker, shown
from fullam.control.controllers import make_settings
from fullam.control.settings_file import SettingsFile
from fullam.exceptions import Diverged, FullamWarning, ScenarioError, UnknownName
from fullam.model.loading import load_vehicle
from fullam.model.vehicle import Vehicle
from fullam.numbers.blas import one_blas_thread
from fullam.simulation import fused
from fullam.simulation.flight import Flight
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.motions.shaping import Shaping
from fullam.simulation.progress import Progress
from fullam.simulation.record.run import Run
from fullam.simulation.scenarios.scenario import Scenario, load_scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.weather import CALM, Weather
from fullam.simulation.weather import weather as named_weather

DRIVERS = ("python", "fused")
"""Who flies a plan: Python, with any law and Pinocchio as dynamics; or machine code."""


class Choices(TypedDict, total=False):
    """What one may choose of a flight beside scenario and controller; all may be left out.

    Attributes:
        vehicle: The nominal vehicle; the scenario's own by default.
        seed: Seed of noise, gusts and parameter errors; 0 by default.
        weather: A weather or its name; the scenario's own by default.
        calm: No noise, no gusts, no parameter errors, whatever the weather.
        settings: The controller's settings: an instance, a mapping of those that differ from the
            defaults, or what `load_settings` read from a file; the law then flies with the file's
            estimator unless `simulation` names one.
        simulation: Rates, integrator, sensors, estimator, governor: an instance, or a mapping of
            what differs from the defaults.
        plant: Which physics flies, "prescribed", "servo" or "mujoco"; by default the one that
            the scenario needs, or the simulation's own.
        shaping: How the reference is blended and anticipated: an instance, or a mapping of what
            differs from the scenario's own.
        failed: Rotors that stand still, and are known to: a list of names, or of indices from 0.
    """

    vehicle: Vehicle | str | None
    seed: int
    weather: Weather | str | None
    calm: bool
    settings: Any
    simulation: SimulationSettings | Mapping[str, Any] | None
    plant: str | None
    shaping: Shaping | Mapping[str, Any] | None
    failed: Sequence[int | str]


def prepare(
    scenario: Scenario | str | Path, controller: str | None = None, **choices: Unpack[Choices]
) -> FlightPlan:
    """Fix everything about a flight; arguments as in `simulate`."""
    for name in choices:
        if name not in Choices.__annotations__:
            known = ", ".join(Choices.__annotations__)
            raise TypeError(f"a flight has nothing named '{name}' to choose; it has {known}")
    scenario = _scenario(scenario, choices.get("shaping"))
    controller = scenario.controller if controller is None else controller
    vehicle = choices.get("vehicle")
    if not isinstance(vehicle, Vehicle):
        vehicle = load_vehicle(scenario.vehicle if vehicle is None else vehicle)
    failed = choices.get("failed", ())
    if not isinstance(failed, list | tuple):
        problem = f"is {shown(failed)}"
        raise ScenarioError("flight", "failed", problem, "give a list of names, or of indices")
    if failed:
        vehicle = vehicle.with_failed(*failed)
    settings = given = choices.get("settings")
    if given is None or isinstance(given, Mapping):
        settings = make_settings(controller, given)
    simulation = _simulation(scenario, choices.get("simulation"), choices.get("plant"))
    if isinstance(given, SettingsFile):
        simulation = _made_for(given, vehicle, simulation)
    return FlightPlan.prepare(
        scenario,
        vehicle,
        controller,
        settings,
        simulation,
        _weather(choices.get("weather"), choices.get("calm", False)) or scenario.weather,
        choices.get("seed", 0),
    )


def _simulation(
    scenario: Scenario, simulation: SimulationSettings | Mapping[str, Any] | None, plant: str | None
) -> SimulationSettings:
    """The simulation's settings, with the plant that was chosen or that the scenario needs."""
    given = simulation.plant if isinstance(simulation, SimulationSettings) else None
    if isinstance(simulation, Mapping):
        given = simulation.get("plant")
    if plant is None and given in (None, "prescribed") and scenario.plant != "prescribed":
        plant = scenario.plant  # "prescribed" may be nobody's choice
    if not isinstance(simulation, SimulationSettings):
        own = {} if simulation is None else simulation
        if plant is not None and isinstance(own, Mapping):
            own = {**own, "plant": plant}
        return SimulationSettings.from_dict(own)
    if plant is not None and plant != simulation.plant:
        return replace(simulation, plant=plant, plant_settings={})
    return simulation


def _made_for(
    file: SettingsFile, vehicle: Vehicle, simulation: SimulationSettings
) -> SimulationSettings:
    """With the estimator that a file's settings are made for, unless another one is named.

    Warns:
        FullamWarning: They were tuned on another vehicle, or with another estimator.
    """
    for difference in file.differences(vehicle, simulation.estimator):
        warnings.warn(difference, FullamWarning, stacklevel=4)
    return simulation if file.estimator is None else simulation.with_estimator(file.estimator)


def _weather(weather: Weather | str | None, calm: bool) -> Weather | None:
    """The weather that was chosen, if one was."""
    check = Checker("flight", ScenarioError)
    if check.flag("calm", calm):
        return CALM
    if weather is None:
        return None
    if isinstance(weather, str):
        return named_weather(weather)
    chosen: Weather = check.instance("weather", weather, Weather)
    return chosen


def _scenario(
    scenario: Scenario | str | Path, shaping: Shaping | Mapping[str, Any] | None
) -> Scenario:
    """The scenario, under another shaping if one is given."""
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    if shaping is None:
        return scenario
    if not isinstance(shaping, Shaping):
        shaping = scenario.shaping.changed(shaping)
    return replace(scenario, shaping=shaping)


def simulate(
    scenario: Scenario | str | Path,
    controller: str | None = None,
    *,
    driver: str = "python",
    progress: Progress | None = None,
    throw: bool = True,
    **choices: Unpack[Choices],
) -> Run:
    """Fly a scenario and return the record.

    Args:
        scenario: A scenario, the name of a registered one, or the path of a TOML file.
        controller: Name of a registered controller; by default the one that the scenario is for.
        driver: Who flies it, one of `DRIVERS`: "python" flies everything, with Pinocchio as
            dynamics; "fused" flies what is written as kernels, a hundred times faster, by machine
            code. Their flights agree to rounding.
        progress: Told (ticks flown, ticks in all) about a hundred times.
        throw: Raise when the flight diverges (at the prompt); False returns the partial run with
            outcome "diverged" (in a campaign).
        **choices: `vehicle` (nominal; an instance, a name or a path), `seed` (of the weather, 0),
            `failed` (rotors that stand still and are known to), `weather` (an instance or a name),
            `calm` (no weather at all), `settings` (the controller's: an instance, a mapping of what
            differs, or what `load_settings` read), `shaping` (of the reference; an instance or a
            mapping of what differs), `simulation` (rates, integrator, sensors, estimator), `plant`
            (the physics). Each has the scenario's own or the default where it is left out; see
            `Choices`.

    Raises:
        Diverged: The flight left the bounds of sense; the error carries the partial run.
        UnknownName: No such scenario, controller, vehicle, weather, plant or driver.
        ScenarioError: A scenario that cannot be flown.
        VehicleError: A vehicle file that describes no flyable vehicle, or an arm that is not one
            chain of joints.
        NotFullyActuated: The rotors cannot produce the axes that the scenario controls.
        NonFiniteWrench: The controller returned NaN or infinity.
        SettingsError: A setting that the controller does not accept; or driver="fused" for a law
            or an estimator that is not written as kernels. The message names it.
    """
    fly = pilot(driver)
    run = fly(prepare(scenario, controller, **choices), progress)
    if run.diverged and throw:
        raise Diverged(run, run.metadata["reason"])
    return run


def pilot(driver: str) -> Callable[[FlightPlan, Progress | None], Run]:
    """Who flies a prepared plan.

    Raises:
        UnknownName: No such driver.
    """
    if not isinstance(driver, str) or driver not in DRIVERS:
        raise UnknownName("driver", driver, DRIVERS)
    return fused.fly if driver == "fused" else fly_by_python


@one_blas_thread()
def fly_by_python(plan: FlightPlan, progress: Progress | None = None) -> Run:
    """Fly one plan by Python; see `simulate`."""
    flight, total = Flight(plan), plan.t.size
    stride = max(1, total // 100)
    for k in flight.ticks():
        if progress is not None and (k % stride == 0 or k == total - 1):
            progress(k + 1, total)
    return flight.run()
