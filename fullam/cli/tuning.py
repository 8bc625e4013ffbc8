"""`fullam tune`."""

from __future__ import annotations

import argparse
import textwrap
from typing import TYPE_CHECKING

from fullam.cli import options
from fullam.cli.output import complain, say, say_json, table
from fullam.cli.searching import ANY_DRIVER, JOBS, bar, continued
from fullam.cli.verbs import OK, argument, verb

if TYPE_CHECKING:
    from fullam.analysis.tuning_flights import TuningFlights
    from fullam.analysis.tuning_result import Tuning

WIDTH = 96
"""Of a line of text."""


@verb(
    "tune",
    argument("controller", metavar="CONTROLLER", help="NAME or NAME@ESTIMATOR"),
    argument(
        "--scenario",
        type=options.names,
        default=[],
        metavar="A,B",
        help="names or TOML files, with commas (default: four of the paper's)",
    ),
    argument(
        "--seeds",
        type=options.seeds,
        default=(),
        metavar="A,B-C",
        help="of the weather that candidates meet (default: 1000000-1000007, of the paper's "
        "scenarios three each)",
    ),
    argument(
        "--budget",
        type=options.runs,
        default=200,
        metavar="N",
        help="candidates at most; they come in generations of some ten (default: 200)",
    ),
    argument(
        "--seed",
        type=options.seed,
        default=0,
        metavar="N",
        help="seed of the optimiser (default: 0)",
    ),
    argument(
        "--settings",
        type=options.settings_path,
        metavar="FILE",
        help="where the search starts (.toml; default: the law's defaults)",
    ),
    argument(
        "--out", type=options.settings_path, metavar="FILE", help="keep the best so far (.toml)"
    ),
    *[flag for flag in options.FLIGHT if flag[0][0] not in ("--seed", "--failed")],
    JOBS,
    ANY_DRIVER,
    options.JSON,
)
def tune(arguments: argparse.Namespace) -> int:
    """Tune a controller's gains, by the same procedure and budget for every controller.

    CMA-ES searches the ranges that the law declares for its settings. The cost of a candidate is
    the mean over its flights of: integral of the error over the step [s] + RMS over 10 mm and 1 deg
    + largest excursion over 25 mm and 5 deg, position and attitude alike; 50 for a lost flight; and
    10 more if a loop has no margin, which of laws that are no kernels is not asked. Then start and
    result fly other seeds, and both costs are printed. With --out an interrupted search keeps its
    best, and the same command continues it; every verb that flies takes the file with --settings.
    """
    from fullam.analysis.tuning import tune as search
    from fullam.control.controllers import load_settings

    flights = flights_of(arguments)
    start = None if arguments.settings is None else load_settings(arguments.settings)
    where = f"{arguments.out}.journal holds the costs" if arguments.out else ""
    with continued(where), bar("candidates") as progress:

        def tell(best: Tuning) -> None:
            text = f"cost {best.cost.before:.3f} -> {best.cost.after:.3f}"
            progress(text, best.evaluations, arguments.budget)

        best = search(
            arguments.controller,
            flights,
            settings=start,
            budget=arguments.budget,
            seed=arguments.seed,
            jobs=arguments.jobs,
            out=arguments.out,
            progress=tell,
        )
    if arguments.json:
        say_json(best.to_dict() | {"out": arguments.out and str(arguments.out)})
    else:
        report(best, arguments)
    return OK


def flights_of(arguments: argparse.Namespace) -> TuningFlights:
    """What is flown, from the arguments.

    Raises:
        FullamError: No such name, or values that do not fit together.
    """
    from fullam.analysis.tuning_flights import TuningFlights

    # The seed that was typed is the optimiser's, and every rotor turns.
    given = options.flight_arguments(
        argparse.Namespace(**{**vars(arguments), "seed": 0, "failed": []})
    )
    return TuningFlights(
        tuple(arguments.scenario),
        given["vehicle"],
        "calm" if given["calm"] else given["weather"],
        given["shaping"],
        given["simulation"],
        arguments.seeds,
        driver=arguments.driver,
    )


def report(best: Tuning, arguments: argparse.Namespace) -> None:
    """Print what was found, and how to fly it."""
    from fullam.analysis.tuning_cost import IN_WORDS

    flights = best.flights
    say(
        f"{best.controller} with the estimator {best.estimator}, "
        f"{', '.join(s.name for s in flights.flown)} on {', '.join(best.vehicles)}: "
        f"{best.evaluations} candidates\n\n{textwrap.fill(f'cost, {IN_WORDS}:', WIDTH)}\n"
    )
    rows = [("training", best.cost, flights.training)]
    if best.validation is not None:
        rows.append(("seeds that the search did not see", best.validation, flights.validation))
    lines = [
        (text, str(len(flown)), f"{cost.before:.3f}", f"{cost.after:.3f}")
        for text, cost, flown in rows
    ]
    say(table(lines, ["", "flights", "before", "after"]))
    values = [(name, _text(best.start[name]), _text(v)) for name, v in best.settings.items()]
    say(f"\n{table(values, ['', 'before', 'after'])}")
    if best.remark is not None:
        complain(best.remark)
    if arguments.out is None:
        say(f"\n{best.to_toml().rstrip()}")
        return
    more = f" --vehicle {arguments.vehicle}" if arguments.vehicle else ""
    more += "".join(f" --plugin {source}" for source in arguments.plugin)
    name = arguments.scenario[0] if arguments.scenario else flights.flown[0].name
    say(f"\nsettings saved to {arguments.out}; fly them:")
    say(f"fullam run {name}{more} --settings {arguments.out}")


def _text(value: object) -> str:
    if isinstance(value, tuple | list):
        return ", ".join(map(_text, value))
    return f"{value:g}" if isinstance(value, int | float) else str(value)
