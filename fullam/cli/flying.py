"""`fullam run` and `fullam compare`."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from fullam.analysis.metrics_table import as_text, cell, figures_of
from fullam.cli import options
from fullam.cli.output import complain, progress, say, say_json, table
from fullam.cli.verbs import FAILED, OK, argument, verb

if TYPE_CHECKING:
    from fullam.analysis.diagnosis import Finding
    from fullam.analysis.metrics import Metrics
    from fullam.simulation.flight_plan import FlightPlan
    from fullam.simulation.record.run import Run

MOST_JOINTS = 12
"""Of a scene's joints, told of at the prompt."""


@verb(
    "run",
    options.SCENARIO,
    *options.LAW,
    *options.FLIGHT,
    options.DRIVER,
    argument("--out", type=options.run_path, metavar="FILE", help="save the record (.npz)"),
    options.FIGURE,
    options.JSON,
)
def run_scenario(arguments: argparse.Namespace) -> int:
    """Fly a scenario and measure it.

    Prints what the flight was worth, and saves the record and a figure if asked. Two controllers
    with one seed meet exactly the same weather. Exit code 1 says that the flight diverged or
    swings about its target.
    """
    from fullam.simulation.scenarios.scenario import load_scenario

    arguments.scenario = load_scenario(arguments.scenario)
    flight = prepared(arguments, *options.law(arguments, arguments.scenario.controller))
    tell_of_failure(flight)
    warn_of_reach(flight)
    warn_of_loop(flight)
    run, metrics = flown(flight, arguments.driver)
    files = {}
    if arguments.out:
        files["run"] = str(run.save(arguments.out))
    if arguments.figure and has_rows(run):
        from fullam.viz.figures import overview, save_figure

        files["figure"] = str(save_figure(overview(run), arguments.figure))
    if arguments.json:
        found = {"files": files, "findings": [f.to_dict() for f in findings_of(run, metrics)]}
        found |= contact_data(run)
        say_json(identity(run) | metrics.to_dict() | found)
    else:
        say(f"{heading(run)}, {run.controller}\n\n{as_text(metrics)}")
        for kind, path in files.items():
            say(f"{kind} saved to {path}")
        explain(run, metrics)
    return OK if run.well else FAILED


@verb(
    "compare",
    options.SCENARIO,
    argument(
        "--controllers",
        type=options.names,
        default=["dc-pid", "pid"],
        metavar="A,B,...",
        help="separated by commas; NAME@ESTIMATOR flies with another estimator, FILE.toml with the "
        "settings in that file (default: dc-pid,pid)",
    ),
    options.SETTINGS_FILES,
    *options.FLIGHT,
    options.DRIVER,
    options.FIGURE,
    options.JSON,
)
def compare_controllers(arguments: argparse.Namespace) -> int:
    """Fly a scenario under several controllers, in the same weather, side by side.

    One seed is one weather: noise, gusts and true parameters are the same for all of them. Exit
    code 1 says that a flight diverged or swings about its target.
    """
    contenders = options.contenders(arguments)
    plans = [
        prepared(arguments, c.controller, c.settings if c.file is None else c.file, c.estimator)
        for c in contenders
    ]
    labels = [c.label for c in contenders]
    tell_of_failure(plans[0])
    warn_of_reach(plans[0])
    for plan in plans:
        warn_of_loop(plan)
    flights = [flown(plan, arguments.driver) for plan in plans]
    runs = [run for run, _ in flights]
    files = {}
    if arguments.figure and all(has_rows(run) for run in runs):
        from fullam.viz.figures import compare, save_figure

        files["figure"] = str(save_figure(compare(runs, labels), arguments.figure))
    if arguments.json:
        records = [
            {"contender": label} | identity(run) | metrics.to_dict()
            for label, (run, metrics) in zip(labels, flights, strict=True)
        ]
        say_json({"runs": records, "files": files})
    else:
        header = ["", "unit", *labels]
        rows = [
            [text, unit, *(cell(metrics, field, digits) for _, metrics in flights)]
            for text, field, unit, digits in figures_of([metrics for _, metrics in flights])
        ]
        say(f"{heading(runs[0])}\n\n{table(rows, header, left=2)}")
        for kind, path in files.items():
            say(f"\n{kind} saved to {path}")
        for run, metrics in flights:
            explain(run, metrics)
    return OK if all(run.well for run in runs) else FAILED


def findings_of(run: Run, metrics: Metrics) -> list[Finding]:
    """What was in the way of a flight that diverged, swings or has not settled."""
    from fullam.analysis.diagnosis import diagnose

    return diagnose(run) if len(run) and not (run.well and settled(run, metrics)) else []


def settled(run: Run, metrics: Metrics) -> bool:
    """Whether every axis settled that the law was to hold, and not to push along."""
    from fullam.analysis.touching import unsettled_axes

    return metrics.settled or not unsettled_axes(run, metrics)


def contact_data(run: Run) -> dict[str, Any]:
    """What the tool touched and what moved around it, for machines; nothing if nothing did."""
    from fullam.analysis.scene_motion import scene_motions
    from fullam.analysis.touching import contact_of

    contact, moved = contact_of(run), [motion.to_dict() for motion in scene_motions(run)]
    found: dict[str, Any] = {} if contact is None else {"contact": contact.to_dict()}
    return found | ({"scene": moved} if moved else {})


def explain(run: Run, metrics: Metrics) -> None:
    """Say what was touched and moved; how a flight that was not well went, what was in its way."""
    from fullam.analysis.scene_motion import scene_motions
    from fullam.analysis.touching import contact_of, contact_warning

    contact, warning = contact_of(run), contact_warning(run)
    if warning is not None:
        complain(warning)
    elif contact is not None:
        say(f"\ncontact: {contact}")
    for motion in scene_motions(run)[:MOST_JOINTS]:
        say(f"scene: {motion}")
    if not run.well:
        say(f"\n{run.outcome.upper()}, {run.controller}: {run.metadata['reason']}")
    elif not settled(run, metrics):
        say(f"\nNOT SETTLED, {run.controller}")
    for finding in findings_of(run, metrics):
        say(f"- {finding}")


def prepared(
    arguments: argparse.Namespace, controller: str, settings: Any, estimator: str | None = None
) -> FlightPlan:
    """The flight that was asked for; what is wrong with it is found here.

    Args:
        arguments: Those of `options.FLIGHT`, and the scenario.
        controller: Who flies.
        settings: With what, as in `simulate`.
        estimator: Another one than `arguments` name.
    """
    from fullam.simulation.simulate import pilot, prepare

    pilot(getattr(arguments, "driver", "python"))
    keywords = options.flight_arguments(arguments)
    if estimator is not None:
        keywords["simulation"] = replace(keywords["simulation"], estimator=estimator)
    return prepare(arguments.scenario, controller, settings=settings, **keywords)


def flown(plan: FlightPlan, driver: str = "python") -> tuple[Run, Metrics]:
    """Fly and measure one flight, with progress."""
    from fullam.analysis.metrics import measure
    from fullam.simulation.simulate import pilot

    with progress(f"{plan.scenario.name}, {plan.controller}") as show:
        run = pilot(driver)(plan, show)
    return run, measure(run)


def tell_of_failure(plan: FlightPlan) -> None:
    """Say before take-off what a vehicle with failed rotors holds."""
    if plan.trim is not None:
        complain(str(plan.trim))


def warn_of_reach(plan: FlightPlan) -> None:
    """Say before take-off if a target is out of the vehicle's reach."""
    from fullam.analysis.foresight import reach_warning
    from fullam.exceptions import VehicleError

    if plan.trim is not None:
        return  # `tell_of_failure` says what is held instead
    try:
        found = reach_warning(plan.scenario, plan.nominal)
    except VehicleError:
        return  # more rotors than the atlas takes
    if found is not None:
        complain(f"out of reach: {found}")


def warn_of_loop(plan: FlightPlan) -> None:
    """Say before take-off if a law's loop has no margin, and what a strange estimator costs it.

    And what the law's estimator believes of its sensors that is not so.
    """
    from fullam.analysis.margins import estimator_cost, margin_warning
    from fullam.analysis.sensing import sensor_warning

    believed = sensor_warning(plan.weather, str(plan.simulation.estimator))
    for line in (believed, estimator_cost(plan), margin_warning(plan)):
        if line is not None:
            complain(line)


def has_rows(run: Run) -> bool:
    """Whether there is something to draw; says so if not."""
    if not len(run):
        complain(f"no figure: {run.controller} ended before its first tick")
    return len(run) > 0


def identity(run: Run) -> dict[str, Any]:
    """What was flown, for machines."""
    metadata = run.metadata
    plugins = {"plugins": run.plugins} if run.plugins else {}
    return plugins | {
        "scenario": metadata["scenario"]["name"],
        "vehicle": metadata["vehicle"]["definition"]["name"],
        **{name: metadata[name] for name in ("controller", "settings", "seed", "driver")},
        **{name: metadata[name] for name in ("weather", "simulation", "outcome", "reason")},
        **({} if run.trim is None else {"trim": run.trim}),
    }


def heading(run: Run) -> str:
    """What was flown, but for the controller, in one line."""
    from fullam.analysis.captions import weather_caption

    vehicle, scenario = run.metadata["vehicle"]["definition"]["name"], run.scenario
    return f"{scenario.name}: {scenario.duration:g} s, {vehicle}, {weather_caption(run)}"
