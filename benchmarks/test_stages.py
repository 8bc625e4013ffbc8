"""Where a step's time goes: each stage of a flight by itself."""

from __future__ import annotations

import time

import pytest
import workloads
from meter import Row

from fullam.numbers.program import program
from fullam.simulation.stages import OF_SERVOS, ORDER

CASES = [
    ("dc-pid", "first-order", 0),
    ("dc-pid", "first-order", 8),
    ("dc-pid-plus", "kalman", 8),
    ("dc-pid-plus", "kalman-bias", 8),
]


@pytest.mark.benchmark(timer=time.process_time)
@pytest.mark.parametrize(("law", "estimator", "lanes"), CASES)
@pytest.mark.parametrize("name", ["all stages", *(name for name in ORDER if name not in OF_SERVOS)])
def test_stage(benchmark, meter, steps, law, estimator, lanes, name):
    """The stage of every period in turn, beginning where a whole flight has just ended.

    The platform and the law's command stay what they are then, weather and reference go on.
    """
    flown = workloads.plan(steps=steps, law=law, estimator=estimator)
    fleet = workloads.Fleet(flown, lanes)
    block, wide = fleet.blocks[0], f"{lanes} lanes" if lanes else "scalar"
    group = f"A step by its stages, {law}, {estimator}, {wide}, record, ns a flight"
    row = Row(group, name, 0.0, unit="ns")
    if name == "all stages":
        work = fleet.fly
    else:
        alone = program([block.stages()[name]])

        def work():
            alone.run(0, steps - 1)

    def prepare():
        fleet.fly()
        return work

    meter.measure(benchmark, prepare, fleet.steps, flown.nominal, row, rounds=9)
    row.value = 1e3 * row.us
    benchmark.extra_info["value"] = row.value
