"""Every law with every estimator, eight flights at a time."""

from __future__ import annotations

import time

import pytest
import workloads
from meter import Row

from fullam.control.controllers import LAWS
from fullam.control.estimators import estimator_names
from fullam.simulation.many import LANES


@pytest.mark.benchmark(timer=time.process_time)
@pytest.mark.parametrize("estimator", estimator_names())
@pytest.mark.parametrize("law", sorted(law.name for law in LAWS))
def test_law(benchmark, meter, steps, law, estimator):
    flown = workloads.plan(steps=steps, law=law, estimator=estimator)
    fleet = workloads.Fleet(flown)
    group = f"Every law with every estimator: {LANES} lanes, 1 thread, all realism, record, a step"
    row = Row(group, f"{law}, {estimator}", 0.0, unit="RE")
    row.note = f"{fleet.saturated:.0%} out of reach"
    meter.measure(benchmark, lambda: fleet.fly, fleet.steps, flown.nominal, row, rounds=15)
