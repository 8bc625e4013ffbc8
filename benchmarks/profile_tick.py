"""Where a tick's time goes, by line: `python benchmarks/profile_tick.py` (needs line_profiler)."""

from __future__ import annotations

import argparse
import linecache
import sys
from pathlib import Path

from line_profiler import LineProfiler

sys.path.insert(0, str(Path(__file__).parent))

import workloads
from page import write_section

from fullam.control.allocation import Allocator
from fullam.control.dc_pid import DcPid
from fullam.control.pid import PidLaw
from fullam.control.tick import ControlTick
from fullam.simulation.flight import Flight
from fullam.simulation.plant import Plant

PARTS = {
    ControlTick.speeds: (
        DcPid.wrench,
        PidLaw.acceleration,
        DcPid._root_wrench,
        Allocator.exact,
    ),
    Flight.ticks: (Plant._advance_by_midpoint, Plant.hold),
}
"""A whole, whose time is 100 %, and the functions it is spent in, callers first."""

SMALLEST = 0.01
"""Share of the whole below which a line is left out."""


def profile() -> str:
    """Fly one second at 1 kHz under the profiler; returns a table for each function."""
    flight = Flight(workloads.plan("fullam", 1.0, weather=workloads.WEATHERS["fullam"]))
    profiler = LineProfiler(*PARTS, *(part for parts in PARTS.values() for part in parts))
    with profiler:
        for _ in flight.ticks():
            pass
    timings = profiler.get_stats().timings
    lines = {name: (file, rows) for (file, _, name), rows in timings.items()}
    text = []
    for whole, parts in PARTS.items():
        total = sum(time for _, _, time in lines[whole.__qualname__][1])
        for function in (whole, *parts):
            file, rows = lines[function.__qualname__]
            share = sum(time for _, _, time in rows) / total
            text += ["", f"{function.__qualname__}: {share:.0%} of {whole.__qualname__}"]
            for line, hits, time in rows:
                if time >= SMALLEST * total:
                    source = linecache.getline(file, line).strip()
                    text.append(f"  {time / total:4.0%}  {hits:>5} x  {source}")
    return "\n".join(text[1:])


def main() -> None:
    """Print the profile, or write it to README.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--readme", action="store_true", help="write it to README.md")
    text = profile()
    if parser.parse_args().readme:
        write_section("profile", f"```\n{text}\n```")
    else:
        print(text)  # noqa: T201


if __name__ == "__main__":
    main()
