"""Arguments that several verbs share, and what they mean to the library."""

from __future__ import annotations

import argparse
import contextlib
import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fullam.cli.verbs import argument
from fullam.exceptions import ScenarioError, SettingsError

if TYPE_CHECKING:
    from fullam.analysis.contender import Contender
    from fullam.simulation.settings import SimulationSettings

MOST_SEEDS = 10_000
"""More seeds than this in one range are a typing error."""

FIGURE_FORMATS = (".pdf", ".png", ".svg")

DEFAULT = "dc-pid"
"""Who flies if nobody is named, and the scenario names nobody."""


def run_path(text: str) -> Path:
    """A path for a run file, checked before the flight rather than after it."""
    if Path(text).suffix != ".npz":
        raise argparse.ArgumentTypeError(f"'{text}' does not end in .npz")
    return Path(text)


def figure_path(text: str) -> Path:
    """A path for a figure, checked before the flight rather than after it."""
    if Path(text).suffix.lower() not in FIGURE_FORMATS:
        raise argparse.ArgumentTypeError(f"'{text}' ends in none of {', '.join(FIGURE_FORMATS)}")
    return Path(text)


def between(low: float, high: float, what: str) -> Callable[[str], float]:
    """A reader of numbers from low to high; `what` names them in a complaint."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{_typed(text)} is no {what} {low:g} to {high:g}")
        return value

    return read


def whole(low: int, high: int, what: str) -> Callable[[str], int]:
    """A reader of whole numbers from low to high."""

    def read(text: str) -> int:
        digits = text.removeprefix("-")
        # A number of thousands of digits is not converted to see that it is too large.
        if not (digits.isascii() and digits.isdecimal() and len(digits) < 20) or not (
            low <= int(text) <= high
        ):
            raise argparse.ArgumentTypeError(f"{_typed(text)} is no {what} {low} to {high}")
        return int(text)

    return read


def _typed(text: str) -> str:
    return f"'{text}'" if len(text) < 40 else f"'{text[:40]}...'"


rate = between(0.01, 1e6, "rate in Hz, from")
delay = between(0.0, 100.0, "delay in seconds, from")
seed = whole(0, 2**63 - 1, "whole number, from")
jobs = whole(1, 256, "number of threads, from")
runs = whole(1, 10_000_000, "number of seeds, from")
port = whole(0, 65535, "port, from")


def names(text: str) -> list[str]:
    """Names separated by commas."""
    found = [name.strip() for name in text.split(",") if name.strip()]
    if not found:
        raise argparse.ArgumentTypeError("no names given; separate them by commas")
    return found


FAILED_HELP = "rotors that stand still and are known to: names, or numbers from 1"


def setting(text: str) -> tuple[str, Any]:
    """KEY=VALUE with the value in JSON or TOML; a bare word is a string."""
    key, equals, value = text.partition("=")
    if not (equals and key.strip()):
        raise argparse.ArgumentTypeError(f"'{text}' is not KEY=VALUE")
    return key.strip(), _value(value.strip())


def _value(text: str) -> Any:
    # Neither reads integers of thousands of digits or endless nesting, and both say so in ways of
    # their own; as a text the setting is then refused by whoever it is for.
    with contextlib.suppress(ValueError, RecursionError):
        return json.loads(text)
    with contextlib.suppress(ValueError, RecursionError, KeyError):
        return tomllib.loads(f"value = {text}")["value"]
    return text


def settings_path(text: str) -> Path:
    """A path for settings of a controller."""
    if Path(text).suffix != ".toml":
        raise argparse.ArgumentTypeError(f"{_typed(text)} does not end in .toml")
    return Path(text)


def seeds(text: str) -> tuple[int, ...]:
    """Seeds separated by commas; A-B are all from A to B."""
    found: list[int] = []
    for part in names(text):
        first, dash, last = part.partition("-")
        low = seed(first)
        high = seed(last) if dash else low
        if not low <= high < low + MOST_SEEDS:
            raise argparse.ArgumentTypeError(f"{_typed(part)} is no range of up to {MOST_SEEDS}")
        found += range(low, high + 1)
    return tuple(found)


JSON = argument("--json", action="store_true", help="print JSON, and nothing else, on stdout")

SCENARIO = argument("scenario", metavar="SCENARIO", help="name (see `fullam list`) or TOML file")

FIGURE = argument("--figure", type=figure_path, metavar="FILE", help="draw it (.png, .pdf or .svg)")

PLANT = (
    argument(
        "--plant",
        metavar="NAME",
        help="the physics: prescribed, joints follow their motion exactly (default); servo, "
        "joints are free and moved by their servos; or mujoco, the same by MuJoCo (extra contact)",
    ),
    argument(
        "--plant-set",
        type=setting,
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="a setting of the plant; of servo: feedback=twin|encoder|command|truth, "
        "feed_forward=gravity|motion|off, payload=unknown|learned; of mujoco also "
        "integrator=rk4|implicitfast|euler; may be repeated",
    ),
)
"""Which physics flies."""

FLIGHT = (
    argument("--seed", type=seed, default=0, metavar="N", help="seed of the weather (default: 0)"),
    argument("--calm", action="store_true", help="no noise, no gusts, exact parameters"),
    argument("--weather", metavar="NAME", help="another weather than the scenario's"),
    argument("--vehicle", metavar="V", help="another vehicle than the scenario's: name or TOML"),
    argument("--failed", type=names, default=[], metavar="R,...", help=FAILED_HELP),
    argument("--control-rate", type=rate, metavar="HZ", help="controller's rate (default: 100)"),
    argument("--plant-rate", type=rate, metavar="HZ", help="plant's rate (default: 1000)"),
    argument("--estimator", metavar="NAME", help="state estimator (default: the controller's own)"),
    *PLANT,
    argument(
        "--governor", metavar="on|off", help="take the target's tilt back while force is short"
    ),
    argument(
        "--shape",
        type=setting,
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="how the reference is shaped: max_acceleration, max_angular_acceleration (null for no "
        "limit), anticipate; may be repeated",
    ),
)
"""How to fly a scenario, whatever the controller."""


DRIVER = argument(
    "--driver",
    default="python",
    metavar="NAME",
    help="python, or fused: machine code, for laws and estimators that are kernels",
)


LAW = (
    argument(
        "--controller",
        metavar="NAME",
        help="(default: the one that --settings or the scenario is for, in free flight dc-pid)",
    ),
    argument(
        "--settings",
        type=settings_path,
        metavar="FILE",
        help="settings of the controller, as `fullam tune` writes them (.toml)",
    ),
    argument(
        "--set",
        type=setting,
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="a setting of the controller, in JSON or TOML; may be repeated",
    ),
)
"""Which law flies, and with which settings."""

SETTINGS_FILES = argument(
    "--settings",
    type=settings_path,
    action="append",
    default=[],
    metavar="FILE",
    help="settings of one of the controllers, from `fullam tune` (.toml); may be repeated",
)
"""For verbs that fly several laws: each file is for the controller that it names."""


def flight_arguments(arguments: argparse.Namespace) -> dict[str, Any]:
    """Keywords of `simulate` from the arguments of `FLIGHT`.

    Raises:
        ScenarioError: Calm and another weather at once, or rates that do not divide each other.
    """
    if arguments.calm and arguments.weather:
        raise ScenarioError("--calm", "weather", "is given as well", "give one of the two")
    return {
        "seed": arguments.seed,
        "calm": arguments.calm,
        "weather": arguments.weather,
        "vehicle": arguments.vehicle,
        "failed": arguments.failed,
        "simulation": simulation_settings(arguments),
        "shaping": dict(arguments.shape),
    }


def law(arguments: argparse.Namespace, default: str = DEFAULT) -> tuple[str, Any]:
    """Controller and settings from the arguments of `LAW`: those of the file, then --set.

    Args:
        arguments: Those of `LAW`.
        default: Who flies if neither they nor the file name somebody.

    Raises:
        SettingsError: A setting that it does not have, or a value of the wrong kind; or a file of
            another controller.
    """
    from fullam.control.controllers import load_settings, make_settings

    changes, file = dict(arguments.set), None
    if arguments.settings is not None:
        file = load_settings(arguments.settings)
    controller = arguments.controller or (file and file.controller) or default
    if file is not None:
        make_settings(controller, file)
        return controller, file.changed(changes)
    try:
        return controller, make_settings(controller, changes)
    except (TypeError, ValueError) as error:
        typed = ", ".join(f"{key}={value!r}" for key, value in changes.items())
        raise SettingsError(
            f"controller '{controller}'", "--set", f"{typed}: {error}", "give numbers as numbers"
        ) from error


def contenders(arguments: argparse.Namespace, tuned: bool = False) -> tuple[Contender, ...]:
    """Who was named with --controllers, with the files of --settings.

    Raises:
        FullamError: An unknown name, or a file that is for none of them.
    """
    from fullam.analysis.contender import Contender, with_files
    from fullam.control.controllers import load_settings

    named = [Contender.parse(name, tuned) for name in arguments.controllers]
    files = [load_settings(path) for path in arguments.settings]
    return with_files(named, files, arguments.estimator)


def plant_choices(arguments: argparse.Namespace) -> dict[str, Any]:
    """What the arguments of `PLANT` change of the simulation's settings.

    Settings without a plant are for the one that the scenario needs, if there is one scenario.
    """
    from fullam.simulation.scenarios.scenario import Scenario, load_scenario

    plant, changes = arguments.plant, {}
    scenario = getattr(arguments, "scenario", None)
    if arguments.plant_set:
        changes["plant_settings"] = dict(arguments.plant_set)
        if plant is None and scenario is not None:
            known = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
            plant = known.plant
    return changes if plant is None else changes | {"plant": plant}


def simulation_settings(arguments: argparse.Namespace) -> SimulationSettings:
    """The simulation's settings with the given rates, estimator, plant and governor."""
    from fullam.simulation.settings import SimulationSettings

    changes: dict[str, Any] = plant_choices(arguments)
    if arguments.control_rate:
        changes["control_period"] = 1.0 / arguments.control_rate
    if arguments.plant_rate:
        changes["plant_period"] = 1.0 / arguments.plant_rate
    if arguments.estimator:
        changes["estimator"] = arguments.estimator
    if arguments.governor:
        changes["governor"] = arguments.governor
    return SimulationSettings(**changes)
