"""`make hostile`: thousands of bad files, many flights, kills, and a table at the end.

    python tests/hostile/run.py                        # the whole, some hours
    python tests/hostile/run.py --files 500 --flights 1000 --kills 3
    python tests/hostile/run.py --only kills flights

Exit code 1 if anything came that should not. Cases are drawn by `--seed`, so a night can be
repeated; a file that did harm is kept in the folder that is named.
"""

from __future__ import annotations

import argparse
import functools
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import answers
import api
import attacks
import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings
from kills import kill_sweeps

from fullam.analysis.campaign import Campaign, sweep
from fullam.analysis.judged import FASTEST
from fullam.cli.output import say, table
from fullam.simulation.scenarios.scenario import scenario_names

PAPER = tuple(n for n in scenario_names() if n.startswith(("position-", "tilt-hover-", "task-")))
"""The ten scenarios of the fully actuated vehicle."""

Row = tuple[str, str, int]
"""What was done, what came of it, how much of that should not have come."""


def run_attack(attack: attacks.Attack, cases: int, number: int) -> Row:
    """Let many cases of one attack happen."""
    outcomes = answers.OUTCOMES
    outcomes.clear()

    @seed(number)
    @settings(
        max_examples=cases,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
        phases=[Phase.generate],
    )
    @given(attack.cases)
    def happen(case: Any) -> None:
        start = time.monotonic()
        outcomes["cases"] += 1
        try:
            attack.happen(case)
        except answers.Hang:
            outcomes["hangs"] += 1
            keep(attack.name, case)
        except Exception as error:  # noqa: BLE001 - all of them are counted, one of each is shown
            outcomes["failures"] += 1
            where = f"from {traceback.extract_tb(error.__traceback__)[-1]}"
            outcomes[where] += 1
            if outcomes[where] == 1:
                keep(attack.name, case)
                say(traceback.format_exc(limit=-4)[-1500:])
        outcomes["slowest"] = max(outcomes["slowest"], round(1e3 * (time.monotonic() - start)))

    happen()
    text = f"{outcomes['cases']} cases; slowest {outcomes['slowest'] / 1e3:.1f} s"
    if outcomes["refused"]:
        text += f"; {outcomes['refused']} refused, {outcomes['accepted']} accepted"
    bad = outcomes["failures"] + outcomes["hangs"]
    return attack.name, f"{text}; {outcomes['failures']} failed, {outcomes['hangs']} hung", bad


def keep(name: str, case: Any) -> None:
    """Write down what did harm."""
    folder = answers.folder() / "kept"
    folder.mkdir(exist_ok=True)
    path = folder / f"{name}-{len(list(folder.iterdir()))}.txt"
    path.write_text(repr(case), encoding="utf-8", errors="backslashreplace")
    say(f"kept {path}")


def run_flights(count: int, jobs: int) -> Row:
    """dc-PID in the paper's scenarios and weather."""
    seeds = tuple(range(max(1, count // len(PAPER))))
    campaign = Campaign(PAPER, ("dc-pid",), seeds, driver=FASTEST)
    rows = sweep(campaign, answers.folder() / "flights.parquet", jobs=jobs)
    lost = rows.column("outcome") != "completed"
    excursion = float(np.nanmax(rows.column("max_excursion_mm"))) / 1e3
    where = Counter(rows.column("scenario")[lost].tolist())
    text = f"{len(rows)} flights; {int(lost.sum())} lost {dict(where) or ''}"
    return "flights", f"{text}; largest excursion {excursion:.2f} m", int(lost.sum())


def run_kills(count: int) -> Row:
    """Sweeps killed and continued."""
    with tempfile.TemporaryDirectory() as folder:
        toll = kill_sweeps(count, Path(folder))
    text = ", ".join(f"{value} {name}" for name, value in vars(toll).items())
    return "kills", text, toll.bad


def run_api() -> Row:
    """The Python API with wrong types."""
    count, bad = api.failures()
    for line in bad[:10]:
        say(line)
    return "Python API", f"{count} calls; {len(bad)} errors of another's", len(bad)


def main() -> int:
    """Everything, and the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--files", type=int, default=10_000, help="of each kind (10000)")
    parser.add_argument("--flights", type=int, default=100_000, help="(100000)")
    parser.add_argument("--kills", type=int, default=20, help="(20)")
    parser.add_argument("--jobs", type=int, default=2, help="for the flights (2)")
    parser.add_argument("--seed", type=int, default=0, help="of the cases (0)")
    parts = [*(attack.name for attack in attacks.ATTACKS), "API", "kills", "flights"]
    parser.add_argument(
        "--only", nargs="+", choices=parts, default=parts, metavar="PART", help="(all)"
    )
    options = parser.parse_args()
    work: dict[str, Callable[[], Row]] = {
        attack.name: functools.partial(run_attack, attack, options.files, options.seed)
        for attack in attacks.ATTACKS
    }
    work |= {
        "API": run_api,
        "kills": lambda: run_kills(options.kills),
        "flights": lambda: run_flights(options.flights, options.jobs),
    }
    warnings.simplefilter("ignore")
    rows = []
    for part in options.only:
        start = time.monotonic()
        name, text, bad = work[part]()
        rows.append((name, text, str(bad), f"{time.monotonic() - start:.0f}"))
        say(f"{name}: {text}")
        sys.stdout.flush()
    say("\n" + table(rows, ("", "what came", "bad", "s"), left=2))
    return int(any(int(bad) for *_, bad, _ in rows))


if __name__ == "__main__":
    sys.exit(main())
