"""`fullam sweep` and `fullam reproduce`."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fullam.cli import options
from fullam.cli.output import number, say, say_json, table
from fullam.cli.searching import ANY_DRIVER, JOBS, bar, continued
from fullam.cli.verbs import OK, argument, verb
from fullam.exceptions import CampaignError, ScenarioError

if TYPE_CHECKING:
    from fullam.analysis.campaign_table import CampaignTable
    from fullam.analysis.cluster import Scheduler

SCHEDULER = (
    argument(
        "--scheduler",
        metavar="ADDRESS",
        help="a running dask scheduler instead, tls://HOST:PORT; who reaches it runs code as you",
    ),
    argument("--tls-ca", metavar="FILE", help="certificate of the scheduler's authority (.pem)"),
    argument("--tls-cert", metavar="FILE", help="this client's certificate (.pem)"),
    argument("--tls-key", metavar="FILE", help="the key of that (.pem)"),
)
SUMMARY = (
    ("lost", "lost", 0),
    ("oscillating", "oscillating", 0),
    ("settling [s]", "settling_time_s", 2),
    ("overshoot [%]", "overshoot_percent", 2),
    ("RMS [mm]", "rms_position_mm", 2),
    ("RMS [deg]", "rms_attitude_deg", 3),
    ("excursion [mm]", "max_excursion_mm", 1),
    ("jitter [deg]", "jitter_attitude_deg", 3),
)
"""Columns of the summary: text, a count of `_counts` or a column of the rows, digits."""


def result_path(text: str) -> Path:
    """A path for rows, checked before the flights rather than after them."""
    if Path(text).suffix != ".parquet":
        raise argparse.ArgumentTypeError(f"'{text}' does not end in .parquet")
    return Path(text)


def scheduler(arguments: argparse.Namespace) -> Scheduler | None:
    """The scheduler that was named, with its certificates; None if none was.

    Raises:
        CampaignError: Certificates without a scheduler, not all three of them, or no such file.
    """
    from fullam.analysis.cluster import Scheduler

    files = (arguments.tls_ca, arguments.tls_cert, arguments.tls_key)
    if arguments.scheduler is None:
        if any(files):
            raise CampaignError(
                "--tls-...", "--scheduler", "is not given", "give tls://HOST:PORT there"
            )
        return None
    return Scheduler(arguments.scheduler, *files)


@verb(
    "sweep",
    argument(
        "scenarios",
        type=options.names,
        nargs="+",
        metavar="SCENARIO",
        help="names or TOML files, with commas or blanks between them",
    ),
    argument(
        "--controllers",
        type=options.names,
        default=["dc-pid"],
        metavar="A,B",
        help="names; NAME@ESTIMATOR flies with another estimator, FILE.toml with the settings in "
        "that file (default: dc-pid)",
    ),
    options.SETTINGS_FILES,
    argument(
        "--runs", type=options.runs, default=100, metavar="N", help="seeds 0 to N-1 (default: 100)"
    ),
    argument("--tuned", action="store_true", help="the committed tuned gains, not the defaults"),
    argument("--estimator", metavar="NAME", help="state estimator (default: each law's own)"),
    *options.PLANT,
    argument("--vehicle", metavar="V", help="another vehicle than the scenarios': name or TOML"),
    argument("--weather", metavar="NAME", help="another weather than the scenario's"),
    argument("--no-gusts", action="store_true", help="the weather without its gusts"),
    argument("--traces", action="store_true", help="keep every motion, at 25 Hz"),
    argument("--out", type=result_path, required=True, metavar="FILE", help="rows (.parquet)"),
    argument("--overwrite", action="store_true", help="forget what FILE holds"),
    JOBS,
    *SCHEDULER,
    ANY_DRIVER,
    options.JSON,
)
def sweep(arguments: argparse.Namespace) -> int:
    """Fly scenarios under many seeds and keep one row a flight.

    All controllers meet the same weather under the same seed. Rows are kept as flights finish: the
    same command continues a sweep that was interrupted or killed, and ends with the same file,
    whatever the number of jobs. A flight that diverges or swings is a row and says so.
    """
    from fullam.analysis.campaign import Campaign
    from fullam.analysis.campaign import sweep as fly
    from fullam.simulation.scenarios.scenario import load_scenario
    from fullam.simulation.settings import SimulationSettings

    named = [name for names in arguments.scenarios for name in names]
    scenarios = [load_scenario(name) for name in named]
    if arguments.vehicle:
        scenarios = [replace(scenario, vehicle=arguments.vehicle) for scenario in scenarios]
    chosen = options.plant_choices(arguments)
    if arguments.estimator:
        chosen["estimator"] = arguments.estimator
    campaign = Campaign(
        tuple(scenarios),
        options.contenders(arguments, arguments.tuned),
        tuple(range(arguments.runs)),
        _weather(arguments, scenarios),
        SimulationSettings(**chosen),
        arguments.driver,
        arguments.traces,
    )
    where = f"{arguments.out}.parts holds the rows"
    where += ", so leave out --overwrite" if arguments.overwrite else ""
    with continued(where), bar("flights") as progress:
        rows = fly(
            campaign,
            arguments.out,
            jobs=arguments.jobs,
            scheduler=scheduler(arguments),
            overwrite=arguments.overwrite,
            progress=lambda done, total: progress("flights", done, total),
        )
    _summarize(rows, campaign, arguments)
    return OK


def _weather(arguments: argparse.Namespace, scenarios: list[Any]) -> Any:
    """The weather asked for; None leaves each scenario its own.

    Raises:
        UnknownName: No such weather.
        ScenarioError: Without gusts, but of which weather: the scenarios' differ.
    """
    from fullam.simulation.weather import weather

    chosen = weather(arguments.weather) if arguments.weather else None
    if not arguments.no_gusts:
        return chosen
    own = {s.name: s.weather for s in scenarios}
    if chosen is None and len(set(map(str, own.values()))) > 1:
        raise ScenarioError(
            "--no-gusts", "weather", "differs between the scenarios", "name one with --weather"
        )
    chosen = chosen or scenarios[0].weather
    return replace(chosen, force_disturbance=0.0, moment_disturbance=0.0)


def _summarize(rows: CampaignTable, campaign: Any, arguments: argparse.Namespace) -> None:
    import numpy as np

    from fullam.analysis.statistics import middle

    lines, data = [], []
    for scenario in campaign.scenarios:
        for contender in campaign.contenders:
            where = (scenario.name, contender.label)
            figures = _counts(rows.column("outcome", *where).tolist())
            for _, name, _digits in SUMMARY[len(figures) :]:
                values = rows.column(name, *where)
                finite = np.where(np.isnan(values), np.inf, values.astype(float))
                figures[name] = float(middle(finite))
            data.append({"scenario": where[0], "contender": where[1], "median": figures})
            cells = [
                number(figures[n] if np.isfinite(figures[n]) else None, d) for _, n, d in SUMMARY
            ]
            lines.append([*where, *cells])
    if arguments.json:
        counts = {"flights": len(rows), "drivers": campaign.drivers}
        say_json({"out": str(arguments.out)} | counts | {"summary": data})
        return
    say(table(lines, ["scenario", "controller", *(text for text, *_ in SUMMARY)], left=2))
    say(f"\nmedians over {arguments.runs} seeds; {len(rows)} rows in {arguments.out}")
    drivers = ", ".join(f"{label}: {driver}" for label, driver in campaign.drivers.items())
    say(f"driver of {drivers}")


def _counts(outcomes: list[str]) -> dict[str, float]:
    """How many flights were lost, and how many swing about their target."""
    from fullam.analysis.judged import LOST

    lost = sum(outcome in LOST for outcome in outcomes)
    return {"lost": float(lost), "oscillating": float(outcomes.count("oscillating"))}


@verb(
    "reproduce",
    argument(
        "--runs",
        type=options.runs,
        default=100,
        metavar="N",
        help="seeds a scenario (default: 100)",
    ),
    argument("--out", type=Path, default=Path("report"), metavar="FOLDER", help="default: report"),
    argument("--quick", action="store_true", help="a look in two minutes: a few seeds"),
    options.SETTINGS_FILES,
    argument(
        "--controllers",
        type=options.names,
        default=[],
        metavar="A,B",
        help="more laws, of your own too, judged by the same claims; NAME or NAME@ESTIMATOR",
    ),
    JOBS,
    *SCHEDULER,
    ANY_DRIVER,
)
def reproduce(arguments: argparse.Namespace) -> int:
    """Fly the whole paper again and write the report.

    Every claim with its interval and verdict, the paper's figures with bands over seeds, and the
    group's recorded runs beside ours: one page that opens offline. Interrupted, the same command
    continues.
    """
    from fullam.analysis.reproduce import entries
    from fullam.analysis.reproduce import reproduce as fly
    from fullam.control.controllers import load_settings
    from fullam.viz.report import write_report

    with continued(f"{arguments.out}/data holds the rows"), bar("flights") as progress:
        result = fly(
            arguments.out,
            runs=arguments.runs,
            quick=arguments.quick,
            jobs=arguments.jobs,
            scheduler=scheduler(arguments),
            driver=arguments.driver,
            contenders=entries(
                [load_settings(path) for path in arguments.settings], arguments.controllers
            ),
            progress=progress,
        )
    page = write_report(result, arguments.out)
    say(f"{page}")
    return OK
