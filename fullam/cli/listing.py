"""`fullam list`."""

from __future__ import annotations

import argparse

from fullam.cli.options import DEFAULT, JSON
from fullam.cli.output import say, say_json, table
from fullam.cli.verbs import OK, verb


def registered() -> dict[str, dict[str, str]]:
    """Everything with a name: kind to name to one line about it."""
    import fullam.simulation.simulate  # noqa: F401 - registers scenarios and controllers
    from fullam.control.controllers import controller_class, controller_names
    from fullam.control.estimators import estimator_class, estimator_names
    from fullam.model.loading import load_vehicle, vehicle_names
    from fullam.ownership import owner_of
    from fullam.simulation.scenarios.scenario import Scenario, load_scenario, scenario_names
    from fullam.simulation.sensor_errors import SensorErrors
    from fullam.simulation.weather import WEATHERS

    def summary(kind: str, name: str, thing: object) -> str:
        plugin = owner_of(kind, name)
        return _summary(thing) + (f" [{plugin.name}]" if plugin else "")

    def experiment(scenario: Scenario) -> str:
        own = scenario.controller
        return scenario.description + (f" ({own})" if own != DEFAULT else "")

    return {
        "scenarios": {name: experiment(load_scenario(name)) for name in scenario_names()},
        "vehicles": {name: load_vehicle(name).description for name in vehicle_names()},
        "controllers": {
            name: summary("controller", name, controller_class(name)) for name in controller_names()
        },
        "estimators": {
            name: summary("estimator", name, estimator_class(name)) for name in estimator_names()
        },
        "weathers": {
            name: (
                f"noise {1e3 * w.position_noise:g} mm, {w.attitude_noise_deg:g} deg; "
                f"gusts {w.force_disturbance:g} N, {w.moment_disturbance:g} N m; "
                f"parameters +-{100 * w.uncertainty.share:g} %"
                + ("" if w.sensors == SensorErrors() else "; biases, lost and wrong poses")
            )
            for name, w in WEATHERS.items()
        },
    }


def _summary(thing: object) -> str:
    return (thing.__doc__ or "").strip().split("\n")[0].rstrip(".")


@verb("list", JSON)
def list_names(arguments: argparse.Namespace) -> int:
    """List scenarios, vehicles, controllers, estimators and weathers."""
    found = registered()
    if arguments.json:
        say_json(found)
        return OK
    width = max(len(name) for entries in found.values() for name in entries)
    for kind, entries in found.items():
        rows = [(f"  {name.ljust(width)}", text) for name, text in entries.items()]
        say(f"{kind}\n{table(rows, left=2)}\n")
    return OK
