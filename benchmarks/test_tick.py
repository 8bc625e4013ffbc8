"""The controller tick: law, turn to {A}, allocation, rotor speeds."""

from __future__ import annotations

import functools
import time

import numpy as np
import pytest
import workloads
from meter import Row

from fullam.control.controller import controller_names

pytestmark = pytest.mark.benchmark(timer=time.process_time)

FLOOR, FLOOR_PROXQP = 1.25, 3.3
"""The same tick in C++, with the exact map and with ProxQP every time [us]."""

KKT_TOLERANCE = 1e-6
"""Optimality of a saturated answer, as a share of full scale."""

COMPILED = ("backstepping", "dc-pid", "pid")


@functools.cache
def bank(vehicle):
    return workloads.record(vehicle)


@functools.cache
def demanding(vehicle):
    """States of which half or more ask for wrenches out of reach."""
    return workloads.record_demanding(vehicle)


def replay(tick, states):
    """A function that flies the bank through a tick, LAPS times."""
    pairs = list(zip(states.measurements, states.references, strict=True)) * workloads.LAPS

    def work():
        speeds = tick.speeds
        for m, point in pairs:
            speeds(0.0, m, point)

    return work


def compiled_replay(tick, states):
    """The same for a compiled tick."""
    pairs = list(zip(states.measurements, states.references, strict=True)) * workloads.LAPS

    def work():
        speeds = tick.speeds
        for m, point in pairs:
            speeds(m, point)

    return work


def compiled_tick(states, controller):
    pytest.importorskip("numba", reason="numba is not installed (fullam[fast])")
    from fullam.simulation.compiled.tick import CompiledTick

    tick = states.tick(controller)
    return CompiledTick(tick.controller, tick.allocator)


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize("controller", controller_names())
def test_tick(benchmark, meter, controller, vehicle):
    states = bank(vehicle)
    bounded = controller == "dc-pid"
    row = Row(
        "Controller tick, in bounds, numpy + Pinocchio",
        f"{controller}, {vehicle}",
        0.0,
        floor=FLOOR,
        must=12.0 if bounded else None,
        aim=9.0 if bounded else None,
        unit="RE",
    )
    ticks = []

    def prepare():
        ticks.append(states.tick(controller))
        return replay(ticks[-1], states)

    meter.measure(benchmark, prepare, states.calls, states.vehicle, row)
    exact = ticks[-1].allocator.counters.exact / states.calls
    if exact < 1.0:  # where a lap begins again, an observer sees a jump
        row.note = f"{1.0 - exact:.0%} out of bounds"
    assert exact == 1.0 or not bounded


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize("controller", COMPILED)
def test_compiled_tick(benchmark, meter, controller, vehicle):
    states = bank(vehicle)
    bounded = controller == "dc-pid"
    row = Row(
        "Controller tick, in bounds, compiled, called from Python",
        f"{controller}, {vehicle}",
        0.0,
        floor=FLOOR,
        must=4.5 if bounded else None,
        aim=3.0 if bounded else None,
        unit="RE",
    )
    meter.measure(
        benchmark,
        lambda: compiled_replay(compiled_tick(states, controller), states),
        states.calls,
        states.vehicle,
        row,
    )


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize("method", ["ladder", "proxqp"])
def test_saturated_tick(benchmark, meter, method, vehicle):
    states = demanding(vehicle)
    ladder = method == "ladder"
    row = Row(
        "Saturated tick, dc-PID (mean over the bank)",
        f"{'warm active set' if ladder else 'ProxQP every time'}, {vehicle}",
        0.0,
        floor=None if ladder else FLOOR_PROXQP,
        must=100.0 if ladder else None,
        aim=10.0 if ladder else None,
        unit="RE",
    )
    # The share that is out of reach, and that the answers are optimal, outside of the timing.
    tick, referee = states.tick("dc-pid", method), states.tick("dc-pid", method).allocator
    saturated, worst = 0, 0.0
    for m, point in zip(states.measurements, states.references, strict=True):
        tick.speeds(0.0, m, point)
        saturated += tick.saturated
        worst = max(worst, referee.solve(tick.wrench_A).kkt_residual())
        if ladder and tick.saturated:
            own = tick.allocator
            worst = max(worst, own._box.kkt_residual(own.squared, own.asked))
    share = saturated / len(states.measurements)
    row.note = f"{share:.0%} out of reach, KKT {worst:.0e}"
    assert share >= 0.5
    assert worst <= KKT_TOLERANCE

    def prepare():
        # The maps of the active sets are there from the flight above; the past is forgotten.
        tick.allocator.reset()
        tick.controller.reset(states.measurements[0], states.references[0])
        return replay(tick, states)

    meter.measure(
        benchmark,
        prepare,
        states.calls,
        states.vehicle,
        row,
        rounds=15,
    )


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
def test_saturated_tick_compiled(benchmark, meter, vehicle):
    states = demanding(vehicle)
    row = Row(
        "Saturated tick, dc-PID (mean over the bank)",
        f"compiled, {vehicle}",
        0.0,
        must=100.0,
        aim=10.0,
        unit="RE",
    )
    tick = compiled_tick(states, "dc-pid")
    reference, worst = states.tick("dc-pid").allocator, 0.0
    for m, point in zip(states.measurements, states.references, strict=True):
        tick.speeds(m, point)
        u, _ = tick.allocate(tick.wrench_A)
        worst = max(worst, float(np.abs(u - reference.solve(tick.wrench_A).squared).max()))
    row.note = f"within {worst:.0e} of the reference"
    assert worst <= KKT_TOLERANCE

    def prepare():
        tick.reset()
        return compiled_replay(tick, states)

    meter.measure(benchmark, prepare, states.calls, states.vehicle, row)
