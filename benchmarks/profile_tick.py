"""Where a tick's time goes, by line: `python benchmarks/profile_tick.py` (needs line_profiler)."""

from __future__ import annotations

import sys
from pathlib import Path

from line_profiler import LineProfiler

sys.path.insert(0, str(Path(__file__).parent))

import workloads

from fullam.control.allocation import Allocator
from fullam.control.dc_pid import DcPid
from fullam.control.pid import PidLaw
from fullam.control.tick import ControlTick
from fullam.simulation.flight import Flight
from fullam.simulation.plant import Plant

LINES = (
    ControlTick.speeds,
    DcPid.wrench,
    DcPid._root_wrench,
    PidLaw.acceleration,
    Allocator.exact,
    Flight.ticks,
    Plant.hold,
    Plant._advance_by_midpoint,
)


def main() -> None:
    """Fly one second at 1 kHz under the profiler and print its tables."""
    flight = Flight(workloads.plan("fullam", 1.0, weather=workloads.WEATHERS["fullam"]))
    profiler = LineProfiler(*LINES)
    with profiler:
        for _ in flight.ticks():
            pass
    profiler.print_stats(output_unit=1e-6, stripzeros=True)


if __name__ == "__main__":
    main()
