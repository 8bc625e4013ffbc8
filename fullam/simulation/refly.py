"""Flying a record again."""

from __future__ import annotations

from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.run import Run
from fullam.simulation.simulate import prepare, simulate


def refly(run: Run) -> Run:
    """Fly the same flight again from its record alone; equal versions give equal bits.

    A true vehicle that somebody put in (`FlightPlan.with_true`) is in no record: the seed's flies.
    """
    return simulate(
        run.scenario,
        run.controller,
        driver=run.driver,
        throw=False,
        vehicle=run.vehicle,
        seed=run.seed,
        weather=run.weather,
        settings=run.settings,
        simulation=run.simulation,
    )


def plan_of(run: Run) -> FlightPlan:
    """What a record is the flight of.

    Raises:
        UnknownName: Its law or its estimator is not registered here.
        SettingsError: The law takes other settings here.
    """
    return prepare(
        run.scenario,
        run.controller,
        vehicle=run.vehicle,
        seed=run.seed,
        weather=run.weather,
        settings=run.settings,
        simulation=run.simulation,
    )
