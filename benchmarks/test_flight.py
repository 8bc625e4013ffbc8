"""Whole flights: the closed loop against real time, and campaigns over seeds."""

from __future__ import annotations

import functools
import multiprocessing
import statistics
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import pytest
import workloads
from meter import RE_OF_FLOORS, Row

from fullam.analysis.campaign import Campaign
from fullam.simulation.flight import Flight
from fullam.simulation.simulate import fly_under_seeds, simulate
from fullam.simulation.weather import CALM

FLOOR = 4.65 / RE_OF_FLOORS
"""Closed loop in C++, middle of the range measured on hextilt [RE a step]."""

STEPS = 1000
WORKERS = 2


@functools.cache
def plan(vehicle, weather="paper"):
    weather = workloads.WEATHERS[vehicle] if weather == "paper" else CALM
    return workloads.plan(vehicle, 0.001 * (STEPS - 1), weather=weather)


def closed_loop(benchmark, meter, prepare, flown, name, must=None, aim=None, steps=STEPS):
    """Complete a row about a closed loop, in times real time."""
    row = Row(
        "Closed loop, control and plant at 1 kHz, dc-PID, from plan to record",
        name,
        0.0,
        floor=FLOOR,
        must=must,
        aim=aim,
        unit="x real time",
    )
    meter.measure(benchmark, prepare, steps, flown.nominal, row, rounds=9)
    if row.us:
        row.value = flown.simulation.control_period * 1e6 / row.us
        benchmark.extra_info.update(value=row.value, verdict=row.verdict)


@pytest.mark.benchmark(timer=time.process_time)
@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize("weather", ["paper", "calm"])
def test_closed_loop(benchmark, meter, weather, vehicle):
    flown = plan(vehicle, weather)

    def prepare():
        flight = Flight(flown)

        def work():
            for _ in flight.ticks():
                pass
            flight.run()

        return work

    name = f"numpy, {vehicle}, {'all realism' if weather == 'paper' else weather}"
    closed_loop(benchmark, meter, prepare, flown, name, 20.0, 35.0)


@pytest.mark.benchmark(timer=time.process_time)
@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize("weather", ["paper", "calm"])
def test_closed_loop_compiled(benchmark, meter, weather, vehicle):
    pytest.importorskip("numba", reason="numba is not installed (fullam[fast])")
    from fullam.simulation.compiled import engine
    from fullam.simulation.compiled.arrays import job_of

    flown = plan(vehicle, weather)

    def prepare():
        job = job_of(flown)
        return lambda: engine.fly_job(flown, job)

    name = f"compiled, {vehicle}, {'all realism' if weather == 'paper' else weather}"
    closed_loop(benchmark, meter, prepare, flown, name, 60.0, 80.0)


@pytest.mark.benchmark(timer=time.process_time)
@pytest.mark.parametrize("engine", ["reference", "compiled"])
def test_simulate(benchmark, meter, engine):
    """What a user waits for: tables, weather and true vehicle included."""
    if engine == "compiled":
        pytest.importorskip("numba", reason="numba is not installed (fullam[fast])")
    flown, steps = plan("fullam"), 4000
    scenario = replace(flown.scenario, duration=0.001 * (steps - 1))

    def work():
        run = simulate(scenario, simulation=flown.simulation, engine=engine)
        assert len(run) == steps

    name = f"simulate() of 4 s, {'numpy' if engine == 'reference' else engine}, fullam"
    closed_loop(benchmark, meter, lambda: work, flown, name, steps=steps)


def fly_share(seeds: list[int]) -> int:
    """One worker's share of a campaign in Python, records included."""
    fly = fly_under_seeds(plan("fullam"))
    for seed in seeds:
        fly(seed)
    return len(seeds)


def sweep_share(seeds: list[int]) -> int:
    """One worker's share of a campaign as `fullam sweep` flies it: records, figures, rows."""
    flown = plan("fullam")
    some = Campaign(
        (flown.scenario,),
        ("dc-pid",),
        tuple(seeds),
        weather=flown.weather,
        simulation=flown.simulation,
        engine="compiled",
    )
    return len(some.fly(some.keys))


def in_processes(share, count, then):
    """Call `then` with a function that has `WORKERS` processes do their shares of `count` seeds."""
    shares = [list(range(w, count, WORKERS)) for w in range(WORKERS)]
    # Spawned and warmed up, as a campaign's workers are.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(WORKERS, mp_context=context) as pool:
        list(pool.map(share, [[0]] * WORKERS))
        then(lambda: list(pool.map(share, shares)))


def campaign(benchmark, meter, work, flights, name, must, aim, rounds=3):
    """Complete a row about a campaign, by the clock."""
    row = Row(
        f"Campaign of 1000-step flights on {WORKERS} cores, by the clock",
        f"{name}, {flights} flights",
        0.0,
        must=must,
        aim=aim,
        unit="us",
    )
    benchmark.pedantic(work, rounds=rounds, warmup_rounds=1)
    if not benchmark.enabled:
        return
    row.us = row.value = statistics.median(benchmark.stats.stats.data) / (flights * STEPS) * 1e6
    meter.add(benchmark, row)


@pytest.mark.benchmark(timer=time.perf_counter)
def test_campaign_in_processes(benchmark, meter, flights):
    count = max(WORKERS, flights // 5)

    def measure(work):
        campaign(benchmark, meter, work, count, "numpy, processes, with records", 30.0, 26.0)

    in_processes(fly_share, count, measure)


@pytest.mark.benchmark(timer=time.perf_counter)
def test_campaign_compiled(benchmark, meter, flights):
    pytest.importorskip("numba", reason="numba is not installed (fullam[fast])")
    from fullam.simulation.compiled.batch import fly_seeds

    def work():
        for flown in fly_seeds(plan("fullam"), range(flights), threads=WORKERS):
            assert flown.rows == STEPS

    campaign(benchmark, meter, work, flights, "compiled, threads, the flights", 1.0, 0.57)


@pytest.mark.benchmark(timer=time.perf_counter)
def test_sweep_compiled(benchmark, meter, flights):
    pytest.importorskip("numba", reason="numba is not installed (fullam[fast])")

    def measure(work):
        name = "compiled, processes, with records and figures"
        campaign(benchmark, meter, work, flights, name, None, None)

    in_processes(sweep_share, flights, measure)
