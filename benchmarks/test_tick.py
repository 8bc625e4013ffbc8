"""The controller tick, called from Python: law, turn to {A}, allocation, rotor speeds."""

from __future__ import annotations

import functools
import time

import numpy as np
import pytest
import workloads
from meter import RE_OF_FLOORS, Row

from fullam.control.controllers import LAWS

pytestmark = pytest.mark.benchmark(timer=time.process_time)

FLOOR, FLOOR_PROXQP = 1.25 / RE_OF_FLOORS, 3.3 / RE_OF_FLOORS
"""A tick of dc-PID in C++, with the exact map and with one ProxQP solve [RE]."""

KKT_TOLERANCE = 1e-6
"""Optimality of a saturated answer, as a share of full scale."""

SATURATED = "Saturated tick, dc-PID (mean over the bank)"

BY = {True: "compiled", False: "python"}


@functools.cache
def bank(vehicle):
    return workloads.record(vehicle)


@functools.cache
def demanding(vehicle):
    """States of which half or more ask for wrenches out of reach."""
    return workloads.record_demanding(vehicle)


def out_of_reach(tick, states):
    """Fly the bank once: the share of its wrenches that are out of reach."""
    shares = []
    for m, point in states.pairs:
        tick.speeds(0.0, m, point)
        shares.append(tick.saturated)
    return float(np.mean(shares))


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("law", sorted(law.name for law in LAWS))
def test_tick(benchmark, meter, law, compiled, vehicle):
    states, bounded = bank(vehicle), law == "dc-pid"
    group = f"Controller tick, in bounds, {BY[compiled]}"
    row = Row(group, f"{law}, {vehicle}", 0.0, floor=FLOOR if bounded else None, unit="RE")
    if bounded and compiled:
        row.must, row.aim = 4.0, 2.5
        row.promise = f"compiled tick called from Python, in bounds, {vehicle}"
    tick = states.tick(law, compiled)
    share = out_of_reach(tick, states)
    assert share == 0.0 or not bounded
    row.note = f"{share:.0%} out of reach" if share else ""

    def prepare():
        tick.reset()
        return states.replay(tick)

    rounds = 25 if compiled else 5
    meter.measure(benchmark, prepare, states.calls, states.vehicle, row, rounds)


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize("compiled", [True, False])
def test_saturated_tick(benchmark, meter, compiled, vehicle):
    states = demanding(vehicle)
    row = Row(SATURATED, f"{BY[compiled]}, {vehicle}", 0.0, unit="RE")
    if compiled:
        row.must, row.aim = 6.0, 4.0
        row.promise = f"compiled tick called from Python, saturated, {vehicle}"
    # The maps of the active sets are there from this lap on.
    tick = states.tick("dc-pid", compiled)
    share = out_of_reach(tick, states)
    row.note = f"{share:.0%} out of reach"
    # Most wrenches are out of reach, and what is asked for is not always the same.
    assert share >= 0.5
    assert len({tuple(point.pose) for point in states.references}) >= 4

    def prepare():
        tick.reset()
        return states.replay(tick)

    rounds = 25 if compiled else 5
    meter.measure(benchmark, prepare, states.calls, states.vehicle, row, rounds)


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize("method", ["active-set", "proxqp"])
def test_allocation_alone(benchmark, meter, method, vehicle):
    """The allocator's own face, in Python, and ProxQP as the other solver of the same problems."""
    states = demanding(vehicle)
    rng, B = np.random.default_rng(0), states.vehicle.rotors.normalized_coupling
    center, spread = B.sum(axis=1), np.abs(B).sum(axis=1)
    wrenches = [0.3 * center + 0.4 * spread * rng.normal(size=6) for _ in range(100)]
    allocator = states.allocator(method="proxqp" if method == "proxqp" else "ladder")
    worst = max(allocator.solve(wrench).kkt_residual() for wrench in wrenches)
    assert worst <= KKT_TOLERANCE
    row = Row(SATURATED, f"allocation alone, python, {method}, {vehicle}", 0.0, unit="RE")
    row.floor = FLOOR_PROXQP if method == "proxqp" else None
    row.note = f"KKT {worst:.0e}"

    def work():
        for wrench in wrenches:
            allocator.allocate(wrench)

    meter.measure(benchmark, lambda: work, len(wrenches), states.vehicle, row, rounds=7)


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("kind", ["in bounds", "demanding"])
def test_slowest_ticks(benchmark, meter, smoke, kind, compiled, vehicle):
    """Each tick by the clock: a real-time loop has to bear the slowest."""
    states = bank(vehicle) if kind == "in bounds" else demanding(vehicle)
    fly = functools.partial(states.tick("dc-pid", compiled).speeds, 0.0)
    clock, laps = time.perf_counter_ns, []

    def lap():
        times = []
        for m, point in states.pairs:
            start = clock()
            fly(m, point)
            times.append(1e-3 * (clock() - start))
        laps.append(times)

    benchmark.pedantic(lap, rounds=100 if compiled else 20)
    if smoke:
        return
    warm = np.concatenate(laps[1:])
    row = Row(
        "Single dc-PID ticks, by the clock: median, and what 99 % stay below",
        f"{BY[compiled]}, {kind}, {vehicle}",
        float(np.median(warm)),
        value=float(np.percentile(warm, 99.0)),
        unit="us",
        note=f"slowest {warm.max():.0f}, in the first lap {max(laps[0]):.0f}",
    )
    meter.add(benchmark, row)
