"""What free joints and contact cost: a step of the plant "servo" against one of "prescribed"."""

from __future__ import annotations

import time

import numpy as np
import pytest
import workloads
from meter import Row

pytestmark = pytest.mark.benchmark(timer=time.process_time)

GROUP = "A step with servos against one with prescribed joints, control and plant at 1 kHz"

ROUNDS = 9
"""Of the flights with prescribed joints, whose fastest counts."""


def fastest(work, rounds=ROUNDS):
    """Shortest time of some calls [s]."""
    times = []
    for _ in range(rounds):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


@pytest.mark.parametrize("law", [("dc-pid", "first-order"), ("dc-pid-plus", "kalman")], ids=str)
@pytest.mark.parametrize("lanes", [0, 8])
def test_servo_against_prescribed(benchmark, meter, steps, lanes, law):
    """Whole steps at 1 kHz, both compiled: the twin and the servos' goals included."""
    name, estimator = law
    plans = {
        plant: workloads.plan(steps=steps, law=name, estimator=estimator, plant=plant)
        for plant in ("prescribed", "servo")
    }
    fleets = {plant: workloads.Fleet(plan, lanes) for plant, plan in plans.items()}
    wide = f"{lanes} lanes" if lanes else "scalar"
    row = Row(
        GROUP,
        f"{name}, {estimator}, {wide}",
        0.0,
        must=3.0,
        aim=2.0,
        unit="times",
    )
    against(benchmark, meter, fleets, plans["servo"].nominal, row)


@pytest.mark.parametrize("lanes", [0, 8])
def test_contact_against_prescribed(benchmark, meter, steps, lanes):
    """The same against a wall, which the tool touches from the first step on."""
    plans = {
        plant: workloads.pushing(steps, world=plant == "servo", plant=plant)
        for plant in ("prescribed", "servo")
    }
    fleets = {plant: workloads.Fleet(plan, lanes) for plant, plan in plans.items()}
    touches = fleets["servo"].blocks[0].plant.touches.array
    assert np.mean(np.abs(touches).max(axis=1) > 0.0) > 0.9
    wide = f"{lanes} lanes" if lanes else "scalar"
    row = Row(GROUP, f"hybrid-force at a wall, {wide}", 0.0, must=3.0, aim=2.0, unit="times")
    if not lanes:
        row.promise = "a step with servos and contact, compiled, against the prescribed step"
    against(benchmark, meter, fleets, plans["servo"].nominal, row)


def against(benchmark, meter, fleets, vehicle, row):
    """Time a fleet on servos, and put it in times of the one with prescribed joints."""
    servo = fleets["servo"]
    meter.measure(benchmark, lambda: servo.fly, servo.steps, vehicle, row, rounds=15)
    row.value = fastest(servo.fly) / fastest(fleets["prescribed"].fly)
    benchmark.extra_info["value"] = row.value
