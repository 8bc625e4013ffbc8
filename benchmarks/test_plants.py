"""What free joints cost: a step of the plant "servo" against one of "prescribed"."""

from __future__ import annotations

import time

import pytest
import workloads
from meter import Row

pytestmark = pytest.mark.benchmark(timer=time.process_time)

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
        "A step with servos against one with prescribed joints, control and plant at 1 kHz",
        f"{name}, {estimator}, {wide}",
        0.0,
        must=3.0,
        aim=2.0,
        unit="times",
    )
    servo = fleets["servo"]
    meter.measure(benchmark, lambda: servo.fly, servo.steps, plans["servo"].nominal, row, rounds=15)
    row.value = fastest(servo.fly) / fastest(fleets["prescribed"].fly)
    benchmark.extra_info["value"] = row.value
