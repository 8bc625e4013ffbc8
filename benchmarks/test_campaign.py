"""Many flights of one plan: lanes, threads, what is drawn and judged besides, and growth."""

from __future__ import annotations

import resource
import sys
import time

import pytest
import workloads
from meter import Row
from workloads import Fleet, Tables

from fullam.analysis.campaign import Campaign, sweep
from fullam.analysis.judged import fly_judged
from fullam.simulation.many import LANES

THREADS = 2

PROCESSOR = pytest.mark.benchmark(timer=time.process_time)
CLOCK = pytest.mark.benchmark(timer=time.perf_counter)

FLOWN = "Flights, all realism, drawn before, 8 lanes, 1 thread and record unless said, a step"
SWEPT = (
    "Campaigns as `sweep` flies them: drawn, flown, judged, a row a flight; a step, by the clock"
)
SWEPT_LAWS = {
    "dc-pid": ("first-order", "dc-PID", 0.45, 0.18),
    "dc-pid-plus": ("kalman", "dc-PID+ with Kalman", 0.9, 0.32),
}
"""Estimator, name in the table of bounds, must and aim of a campaign [RE]."""

GROWTH = f"Growth of a campaign with its flights, {THREADS} threads, a step, by the clock"


@PROCESSOR
@pytest.mark.parametrize("keep", ["record", "track"])
@pytest.mark.parametrize("lanes", [0, 4, 8, 16])
def test_lanes(benchmark, meter, steps, smoke, lanes, keep):
    flown = workloads.plan(steps=steps)
    fleet = Fleet(flown, LANES if smoke else lanes, keep=keep)
    wide = f"{lanes} lanes" if lanes else "one flight, scalar"
    row = Row(FLOWN, f"dc-pid, first-order, {wide}, {keep}", 0.0, unit="RE")
    row.note = f"{fleet.saturated:.0%} out of reach" if keep == "record" else ""
    meter.measure(benchmark, lambda: fleet.fly, fleet.steps, flown.nominal, row)


@CLOCK
@pytest.mark.parametrize(
    ("law", "estimator", "must", "aim"),
    [("dc-pid", "first-order", 0.20, 0.11), ("dc-pid-plus", "kalman", None, None)],
)
def test_threads(benchmark, meter, steps, law, estimator, must, aim):
    flown = workloads.plan(steps=steps, law=law, estimator=estimator)
    fleet = Fleet(flown, threads=THREADS)
    name = f"{law}, {estimator}, {THREADS} threads by the clock"
    row = Row(FLOWN, name, 0.0, must=must, aim=aim, unit="RE")
    row.note = f"{fleet.saturated:.0%} out of reach"
    if must:
        row.promise = "dc-PID campaign, all realism, record, drawn before, 2 threads, a step"
    calls = fleet.steps
    meter.measure(benchmark, lambda: fleet.fly, calls, flown.nominal, row, timer=time.perf_counter)


@PROCESSOR
def test_draws(benchmark, meter, steps):
    """Weather and true vehicles alone."""
    flown = workloads.plan(steps=steps)
    drawn, first = Tables(flown).draws.rows(LANES), iter(range(0, sys.maxsize, LANES))
    row = Row(FLOWN, "weather and true vehicles alone", 0.0, unit="RE")

    def work():
        start = next(first)
        drawn.fill(range(start, start + LANES))

    meter.measure(benchmark, lambda: work, LANES * steps, flown.nominal, row)


@PROCESSOR
def test_figures(benchmark, meter, steps):
    """The figures alone, of tracks that are there."""
    flown = workloads.plan(steps=steps)
    fleet = Fleet(flown, keep="track")
    judge = workloads.judging(flown, fleet.blocks[0])
    row = Row(FLOWN, "figures alone", 0.0, unit="RE")
    meter.measure(benchmark, lambda: judge, fleet.steps, flown.nominal, row)


@CLOCK
@pytest.mark.parametrize("threads", [1, THREADS])
@pytest.mark.parametrize("law", SWEPT_LAWS)
def test_sweep(benchmark, meter, steps, flights, threads, law):
    estimator, title, must, aim = SWEPT_LAWS[law]
    flown = workloads.plan(steps=steps, law=law, estimator=estimator)
    row = Row(SWEPT, f"{law}, {estimator}, {flights} flights, {threads} threads", 0.0, unit="RE")
    if threads == THREADS:
        row.must, row.aim = must, aim
        row.promise = f"{title} campaign with weather, vehicles and metrics, 2 threads, a step"

    def work():
        assert sum(map(len, fly_judged(flown, range(flights), threads=threads))) == flights

    calls = flights * steps
    meter.measure(benchmark, lambda: work, calls, flown.nominal, row, 5, timer=time.perf_counter)


@CLOCK
def test_sweep_to_a_file(benchmark, meter, steps, flights, tmp_path):
    """The call that a user makes, with its file of rows."""
    flown, out = workloads.plan(steps=steps), tmp_path / "sweep.parquet"
    campaign = Campaign(
        (flown.scenario,), ("dc-pid",), tuple(range(flights)), simulation=flown.simulation
    )
    row = Row(SWEPT, f"sweep(), to its file, {flights} flights, {THREADS} jobs", 0.0, unit="RE")

    def work():
        assert len(sweep(campaign, out, jobs=THREADS, overwrite=True)) == flights

    calls = flights * steps
    meter.measure(benchmark, lambda: work, calls, flown.nominal, row, 5, timer=time.perf_counter)


@CLOCK
@pytest.mark.parametrize("exponent", range(6))
def test_growth(benchmark, meter, steps, smoke, flights, exponent):
    """1 to 100 000 flights: a hundred times --flights at most."""
    count = flights if smoke else 10**exponent
    if count > 100 * flights:
        pytest.skip(f"{count} flights want --flights {count // 100}")
    flown = workloads.plan(steps=steps)
    row = Row(GROWTH, f"{count} flights", 0.0, unit="RE")

    def work():
        assert sum(map(len, fly_judged(flown, range(count), threads=THREADS))) == count

    rounds, calls = (5 if count <= 1000 else 1), count * steps
    meter.measure(
        benchmark, lambda: work, calls, flown.nominal, row, rounds, timer=time.perf_counter
    )
    row.note = f"{row.us * calls * 1e-6:.3g} s, {peak_memory():.0f} MB at most until here"


def peak_memory():
    """The most memory that this process has had [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
