"""Many seeds of one plan are the single flights, in lanes, in threads, and one by one."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from same_flights import assert_same_bits

import fullam
from fullam.exceptions import NonFiniteWrench, ScenarioError, SettingsError
from fullam.simulation import fused
from fullam.simulation.fused import Fused, run_of
from fullam.simulation.many import fly_blocks, fly_many
from fullam.simulation.simulate import fly_by_python, prepare
from fullam.simulation.tables import Tables


@pytest.fixture(scope="module")
def plan():
    scenario = replace(fullam.load_scenario("task-2"), duration=0.6)
    return prepare(scenario, "dc-pid", shaping={"max_acceleration": None})


@pytest.fixture(scope="module")
def singles(plan):
    """Flights of twelve seeds, one by one; some of them saturate."""
    runs = [fused.fly(plan.with_seed(seed)) for seed in range(12)]
    assert any(run.saturated.any() for run in runs)
    return runs


@pytest.mark.parametrize(("lanes", "threads"), [(8, 1), (8, 2), (1, 3), (8, None)])
def test_lanes_and_threads_change_nothing(plan, singles, lanes, threads):
    """Five more seeds than lanes too: lanes that are left over fly nobody's weather."""
    many = list(fly_many(plan, range(12), lanes=lanes, threads=threads))
    assert len(many) == 12
    for a, b in zip(many, singles, strict=True):
        assert_same_bits(a, b)


def test_a_seed_of_ones_choice_is_that_seed(plan, singles):
    seeds = [7, 2, 2, 11]
    for run, seed in zip(fly_many(plan, iter(seeds), threads=1), seeds, strict=True):
        assert run.seed == seed
        assert_same_bits(run, singles[seed])


def test_the_plan_s_own_seed_and_simulate_are_the_same(plan, singles):
    run = fullam.simulate(
        plan.scenario, seed=4, driver="fused", simulation=plan.simulation, throw=False
    )
    assert_same_bits(run, singles[4])
    assert list(fly_many(plan, [])) == []


def test_some_flights_may_diverge(plan):
    """Each ends where it would have ended alone."""
    weak = {"position_gains": (3.0, 0.0, 2.0)}
    tight = replace(plan.simulation, max_position_error=0.16)
    hold = fullam.Scenario("hold", duration=2.0)
    wild = prepare(hold, settings=weak, simulation=tight)
    runs = list(fly_many(wild, range(16), threads=2))
    lengths = {len(run) for run in runs}
    assert {run.outcome for run in runs} == {"completed", "diverged"}
    assert len(lengths) > 3
    for run in runs:
        assert_same_bits(run, fused.fly(wild.with_seed(run.seed)))


def test_nan_in_one_lane_stays_in_it(plan, singles):
    """A flight whose weather is spoiled is refused, and its neighbours fly on."""
    block = Fused(Tables(plan), 8)
    block.block.draw(range(8))
    block.block.drawn.noise.array[10, :, 3] = np.nan
    block.fly()
    for lane in range(8):
        if lane == 3:
            with pytest.raises(NonFiniteWrench):
                run_of(block.block, plan.with_seed(3), 3)
        else:
            assert_same_bits(run_of(block.block, plan.with_seed(lane), lane), singles[lane])


def test_a_block_is_used_again_as_if_it_were_new(plan, singles):
    flight = Fused(Tables(plan), 8)
    for seeds in (range(4, 12), range(8)):
        flight.block.draw(seeds)
        flight.fly()
    for lane in range(8):
        assert_same_bits(run_of(flight.block, plan.with_seed(lane), lane), singles[lane])


def test_four_threads_at_once_fly_what_one_does(plan, singles):
    """Plans and tables are shared, written by nobody; each thread compiles or loads by itself."""
    tables = Tables(plan)
    start = threading.Barrier(4)

    def fly_by_fours(first):
        start.wait(10.0)
        runs = []
        for seed in range(first, 12, 4):
            own = Fused(tables)
            own.block.load(plan.with_seed(seed))
            own.fly()
            runs.append(run_of(own.block, plan.with_seed(seed)))
        return runs

    def fly_all(_):
        start.wait(10.0)
        return list(fly_many(plan, range(12), threads=2))

    with ThreadPoolExecutor(4) as pool:
        shared = list(pool.map(fly_by_fours, range(4)))
        for runs in pool.map(fly_all, range(4)):
            for a, b in zip(runs, singles, strict=True):
                assert_same_bits(a, b)
    for first, runs in enumerate(shared):
        for a, b in zip(runs, singles[first::4], strict=True):
            assert_same_bits(a, b)


def test_python_flies_a_plan_in_four_threads_at_once(plan):
    """Nothing that is written belongs to the plan."""
    start = threading.Barrier(4)

    def fly(seed):
        start.wait(10.0)
        return fly_by_python(plan.with_seed(seed))

    with ThreadPoolExecutor(4) as pool:
        runs = list(pool.map(fly, range(4)))
    for seed, run in enumerate(runs):
        assert_same_bits(run, fly_by_python(plan.with_seed(seed)))


def test_tables_of_a_plan_are_the_same_whoever_asks_first(plan):
    """What a plan and its tables work out on demand, they may be asked for by threads at once."""
    fresh = Tables(prepare(plan.scenario, seed=5))
    start = threading.Barrier(4)

    def ask(_):
        start.wait(10.0)
        joints, centers = fresh.placed
        forecast = fresh.plan.forecast
        return [fresh.hover, joints.array, centers.array, forecast.pose_noise, forecast.disturbance]

    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(ask, range(4)))
    for answer in answers[1:]:
        for a, b in zip(answers[0], answer, strict=True):
            np.testing.assert_array_equal(a, b)


def test_closed_early_no_others_start(plan):
    """What is queued is cancelled; what is in the air may land."""
    started, land = [], threading.Event()

    def collect(block):
        def slowly(seeds):
            started.append(list(seeds))
            if seeds[0] > 1:
                land.wait(10.0)
            return list(seeds)

        return slowly

    flights = fly_blocks(plan, range(100), collect, keep="track", lanes=1, threads=2)
    assert [next(flights), next(flights)] == [[0], [1]]
    threading.Timer(0.2, land.set).start()
    flights.close()
    assert len(started) <= 4


def test_seeds_may_have_no_end(plan, singles):
    def numbers():
        seed = 0
        while True:
            yield seed
            seed += 1

    for a, b in zip(islice(fly_many(plan, numbers(), threads=2), 12), singles, strict=True):
        assert_same_bits(a, b)


def test_without_a_compiler_they_fly_in_python_one_by_one(plan, singles, monkeypatch):
    modules = ("fullam.simulation.fused", "fullam.simulation.many", "fullam.numbers.program")
    for module in modules:
        monkeypatch.setattr(f"{module}.available", lambda: False)
    again = prepare(plan.scenario, seed=0)
    for a, b in zip(fly_many(again, [0, 9], threads=1), (singles[0], singles[9]), strict=True):
        assert_same_bits(a, b)


@pytest.mark.parametrize(
    ("choice", "error", "words"),
    [
        ({"lanes": 0}, SettingsError, "lanes.*is 0"),
        ({"lanes": 2.0}, SettingsError, "lanes"),
        ({"threads": 0}, SettingsError, "threads"),
        ({"seeds": [0, -1]}, ScenarioError, "seed.*-1"),
        ({"seeds": [0.5]}, ScenarioError, "seed"),
    ],
)
def test_what_cannot_be_is_refused(plan, choice, error, words):
    choice = {"seeds": [0, 1]} | choice
    with pytest.raises(error, match=words):
        list(fly_many(plan, choice.pop("seeds"), **choice))
