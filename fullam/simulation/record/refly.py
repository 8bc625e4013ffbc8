"""Flying a record again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker
from fullam.exceptions import RunFileError
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.hands.force import HandForce, Holds, felt, still_pushing
from fullam.simulation.hands.interactive import InteractiveFlight
from fullam.simulation.hands.interventions import read_script
from fullam.simulation.hands.state import force_after
from fullam.simulation.record.flown_plugins import require_plugins
from fullam.simulation.record.run import Run
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.simulate import prepare, simulate

Array = NDArray[np.float64]


def refly(run: Run) -> Run:
    """Fly the same flight again from its record alone; equal versions give equal bits.

    What hands did to it is done again. A true vehicle that somebody put in
    (`FlightPlan.with_true`) is in no record: the seed's flies.

    Raises:
        PluginError: A plugin that flew is not loaded here; the message names it.
        RunFileError: It is no record.

    Warns:
        FullamWarning: A plugin that flew has changed since.
    """
    Checker("refly", RunFileError).instance("run", run, Run)
    require_plugins(run.plugins, f"the record of {run.controller}")
    if run.script is not None:
        return _refly_script(run)
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


def plan_of(run: Run, scenario: Scenario | None = None) -> FlightPlan:
    """What a record is the flight of, or would be in another scenario.

    Raises:
        PluginError: A plugin that flew is not loaded here.
        UnknownName: Its law or its estimator is not registered here.
        SettingsError: The law takes other settings here.
    """
    require_plugins(run.plugins, f"the record of {run.controller}")
    return prepare(
        scenario or run.scenario,
        run.controller,
        vehicle=run.vehicle,
        seed=run.seed,
        weather=run.weather,
        settings=run.settings,
        simulation=run.simulation,
    )


def _refly_script(run: Run) -> Run:
    script = run.script or {}
    # The weather of a longer flight is another one: all of the plan is drawn again.
    plan = plan_of(run, replace(run.scenario, duration=script["horizon"]))
    flight = InteractiveFlight(plan, read_script(script["interventions"]))
    while flight.period < len(run) + run.diverged and flight.step():
        pass
    return flight.record


def hand_forces(run: Run) -> Array:
    """What hands pulled with: [point of the vehicle, force], world axes, shape (N, 6) [m, N]."""
    out = np.zeros((len(run), 6))
    script = read_script(run.script["interventions"]) if run.script else []
    acts = [done for done in script if done.kind in ("push", "pull", "release")]
    holds, force, step = Holds(run.vehicle), HandForce(), run.simulation.control_period
    for k in range(acts[0].period, len(run)) if acts else ():
        while acts and acts[0].period <= k:
            force = force_after(force, acts.pop(0), k, step)
        force = still_pushing(force, k)
        now = felt(force, holds, run.pose[k], run.arm[k])
        out[k] = [*now.foot, *now.pull]
    return out
