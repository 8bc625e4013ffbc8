"""Timing in RNEA equivalents: how a row of the table is measured.

RE is the time of one `pin.rnea` call from Python on the same vehicle. Each round times a burst of
such calls, warm, and then a burst of the thing itself, and the ratio is taken round by round, so
that the mood of the machine cancels. Bursts are timed in CPU time of the process (a busy
machine's other work does not count), except where threads or processes work side by side: there by
the clock.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from fullam.model.vehicle import Vehicle

RE_OF_FLOORS = 1.45
"""What an RE was on the machine on which the floors in C++ were measured [us]."""

UNIT_CALLS = 400
"""Calls of RNEA in a burst: about half a millisecond."""

UNIT_STATES = 8
"""Different states among them."""


@dataclass
class Row:
    """One measurement.

    Attributes:
        group: Heading under which the summary lists it.
        name: What was timed.
        us: Median time of one call [us].
        re: Median ratio to RNEA; None where the ratio means nothing.
        floor: The same work in C++ [RE].
        must: Bound that the project promises, in `unit`.
        aim: Bound that it strives for, in `unit`.
        value: What the bounds are about, in `unit`.
        unit: "RE", "us", "x real time", "x", ...; more is better where it begins with an x.
        note: What else is to be known.
        promise: The sentence under which the table of bounds has it; "" if it is not in there.
    """

    group: str
    name: str
    us: float
    re: float | None = None
    floor: float | None = None
    must: float | None = None
    aim: float | None = None
    value: float | None = None
    unit: str = ""
    note: str = ""
    promise: str = ""

    @property
    def verdict(self) -> str:
        """Whether the bounds are kept; more is better where a speed-up is counted."""
        if self.must is None or self.value is None:
            return ""
        sign = -1.0 if self.unit.startswith("x") else 1.0
        if self.aim is not None and sign * self.value <= sign * self.aim:
            return "aim"
        return "must" if sign * self.value <= sign * self.must else "MISSED"


@dataclass
class Meter:
    """Measures and collects rows.

    Attributes:
        rows: What has been measured.
        skipped: What was not, and why.
        units: Every RE that was measured [us].
    """

    rows: list[Row] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)
    units: list[float] = field(default_factory=list)

    def measure(
        self,
        benchmark: Any,
        prepare: Callable[[], Callable[[], Any]],
        calls: int,
        vehicle: Vehicle,
        row: Row,
        rounds: int = 25,
        timer: Callable[[], float] = time.process_time,
    ) -> Row:
        """Time `calls` calls a round against RNEA and complete the row.

        Args:
            benchmark: The fixture of pytest-benchmark.
            prepare: Called before each round, untimed; returns the work of the round.
            calls: How many calls the work makes.
            vehicle: Whose RNEA is the unit.
            row: The row, with us = 0.
            rounds: How many rounds, after one that does not count; a single one counts itself.
            timer: What the unit is timed with; must be the benchmark's own timer.
        """
        unit, ratios = rnea_timer(vehicle, timer), []
        processor: list[float] = []

        def setup() -> tuple[tuple[Any], dict[str, Any]]:
            ratios.append(unit())
            return (prepare(),), {}

        def work(burst: Callable[[], Any]) -> None:
            processor.append(processor_time(burst, calls))

        benchmark.pedantic(work, setup=setup, rounds=rounds, warmup_rounds=min(1, rounds - 1))
        if not benchmark.enabled:
            return row
        times = [t / calls for t in benchmark.stats.stats.data]
        units = ratios[-len(times) :]
        self.units += [u * 1e6 for u in units]
        row.us = statistics.median(times) * 1e6
        row.re = statistics.median(t / u for t, u in zip(times, units, strict=True))
        if timer is time.perf_counter:
            took = f"{statistics.median(processor) * 1e6:.3g} us of processor"
            row.note = "; ".join(text for text in (took, row.note) if text)
        if row.unit in ("RE", "us"):
            row.value = row.re if row.unit == "RE" else row.us
        self.add(benchmark, row)
        return row

    def against(
        self,
        benchmark: Any,
        rival: Callable[[], float],
        prepare: Callable[[], Callable[[], Any]],
        calls: int,
        row: Row,
        rounds: int = 9,
    ) -> Row:
        """Time a rival and ours in alternating bursts; the value is how often ours fits in.

        Args:
            benchmark: The fixture; it times ours.
            rival: One burst of the rival's; returns seconds a call.
            prepare: Called before each round, untimed; returns our burst.
            calls: How many calls ours makes.
            row: The row; `us` becomes our time, and its note tells the rival's.
            rounds: How many rounds.
        """
        rivals: list[float] = []

        def setup() -> tuple[tuple[Any], dict[str, Any]]:
            rivals.append(rival())
            return (prepare(),), {}

        benchmark.pedantic(_work, setup=setup, rounds=rounds, warmup_rounds=1)
        if not benchmark.enabled:
            return row
        times = [t / calls for t in benchmark.stats.stats.data]
        pairs = list(zip(rivals[-len(times) :], times, strict=True))
        row.us = statistics.median(times) * 1e6
        row.value, row.unit = statistics.median(theirs / t for theirs, t in pairs), "x"
        its = f"it takes {statistics.median(theirs for theirs, _ in pairs) * 1e6:.3g} us"
        row.note = "; ".join(text for text in (its, row.note) if text)
        self.add(benchmark, row)
        return row

    def add(self, benchmark: Any, row: Row) -> None:
        """Keep a complete row, in the summary and in the JSON."""
        self.rows.append(row)
        benchmark.extra_info.update(
            {k: v for k, v in vars(row).items() if v is not None}, verdict=row.verdict
        )


def _work(work: Callable[[], Any]) -> None:
    work()


def processor_time(work: Callable[[], Any], calls: int) -> float:
    """Processor time of one of the calls that some work makes [s]."""
    start = time.process_time()
    work()
    return (time.process_time() - start) / calls


def rnea_timer(vehicle: Vehicle, timer: Callable[[], float]) -> Callable[[], float]:
    """A function that times one burst of RNEA and returns seconds per call."""
    model, data = vehicle.model, vehicle.create_data()
    rng, states = np.random.default_rng(0), []
    for _ in range(UNIT_STATES):
        q = pin.integrate(model, vehicle.neutral(), rng.normal(size=model.nv))
        states.append((q, rng.normal(size=model.nv), rng.normal(size=model.nv)))
    rnea = pin.rnea

    def burst() -> float:
        laps = UNIT_CALLS // UNIT_STATES
        for lap in range(-2, laps):
            if lap == 0:  # the laps before were for the caches
                start = timer()
            for q, v, a in states:
                rnea(model, data, q, v, a)
        return (timer() - start) / (laps * UNIT_STATES)

    return burst
