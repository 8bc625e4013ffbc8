"""One call flies one scenario: `simulate`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fullam.control.controllers import make_settings
from fullam.exceptions import Diverged, UnknownName
from fullam.model.loading import load_vehicle
from fullam.model.vehicle import Vehicle
from fullam.simulation.flight import Flight
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.progress import Progress
from fullam.simulation.run import Run
from fullam.simulation.scenario import Scenario, load_scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.weather import CALM, Weather
from fullam.simulation.weather import weather as named_weather

ENGINES = ("reference", "compiled")
"""The engines that can fly a plan: Pinocchio and numpy; or machine code, with fullam[fast]."""


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
    engine: str = "reference",
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
        engine: Which engine flies it, one of `ENGINES`: "reference" flies everything, "compiled"
            the same flights to rounding, ten times faster or more, where it covers them.
        progress: Told (ticks flown, ticks in all) about a hundred times.
        throw: Raise when the flight diverges (at the prompt); False returns the partial run with
            outcome "diverged" (in a campaign).

    Raises:
        Diverged: The flight left the bounds of sense; the error carries the partial run.
        UnknownName: No such scenario, controller, vehicle, weather or engine.
        ScenarioError: A scenario that cannot be flown.
        VehicleError: A vehicle file that describes no flyable vehicle, or, with engine="compiled",
            an arm that is not one chain of revolute joints.
        NotFullyActuated: The rotors cannot produce the axes that the scenario controls.
        NonFiniteWrench: The controller returned NaN or infinity.
        MissingDependency: engine="compiled" without numba.
        SettingsError: A setting that the controller does not accept; or engine="compiled" for what
            it does not cover. The message names it.
    """
    if engine not in ENGINES:
        raise UnknownName("engine", engine, ENGINES)
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
    run = _fly_compiled(plan, progress) if engine == "compiled" else _fly(plan, progress)
    if run.diverged and throw:
        raise Diverged(run, run.metadata["reason"])
    return run


def fly_under_seeds(plan: FlightPlan, engine: str = "reference") -> Callable[[int], Run]:
    """A function from a seed to the run of the plan under it.

    What the flights share is prepared once; each run equals that of `simulate` with throw=False.
    The function raises ScenarioError for a seed that is no whole number from 0 on, and
    NonFiniteWrench where the controller returns NaN or infinity.

    Args:
        plan: The plan of any seed; see `prepare`.
        engine: As in `simulate`.

    Raises:
        UnknownName: No such engine.
        MissingDependency, SettingsError, VehicleError: As in `simulate` for engine="compiled".
    """
    if engine not in ENGINES:
        raise UnknownName("engine", engine, ENGINES)
    if engine == "reference":
        return lambda seed: _fly(plan.with_seed(seed), None)
    from fullam.simulation.compiled.batch import Batch  # imports numba, which is optional

    batch = Batch(plan)
    return lambda seed: batch.fly(seed).run()


def _fly(plan: FlightPlan, progress: Progress | None) -> Run:
    flight = Flight(plan)
    total = plan.t.size
    stride = max(1, total // 100)
    for k in flight.ticks():
        if progress is not None and (k % stride == 0 or k == total - 1):
            progress(k + 1, total)
    return flight.run()


def _fly_compiled(plan: FlightPlan, progress: Progress | None) -> Run:
    from fullam.simulation.compiled import engine  # imports numba, which is optional

    return engine.fly(plan, progress)
