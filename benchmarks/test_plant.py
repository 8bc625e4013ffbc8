"""The plant step: prescribed arm, rotor lag, midpoint rule of 1 ms."""

from __future__ import annotations

import time

import pytest
import workloads
from meter import RE_OF_FLOORS, Row

from fullam.simulation.flight import Flight
from fullam.simulation.settings import SimulationSettings

pytestmark = pytest.mark.benchmark(timer=time.process_time)

FLOOR = 1.9 / RE_OF_FLOORS
"""The same step in C++ [RE]."""

PERIODS = 40
"""Control periods in a burst."""


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize("substeps", [10, 1])
def test_step(benchmark, meter, substeps, vehicle):
    simulation = SimulationSettings(control_period=0.001 * substeps)
    plan = workloads.plan(vehicle, 0.5, simulation=simulation)
    row = Row(
        "Plant step, arm moving, numpy + Pinocchio",
        f"{vehicle}, {substeps} a control period",
        0.0,
        floor=FLOOR,
        must=11.0 if substeps == 10 else None,
        aim=8.0 if substeps == 10 else None,
        unit="RE",
    )

    def prepare():
        plant = Flight(plan).plant
        commands = plant.speeds * 1.01

        def work():
            advance = plant.advance
            for _ in range(PERIODS):
                advance(commands, None, substeps)

        return work

    meter.measure(benchmark, prepare, PERIODS * substeps, plan.nominal, row)


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
def test_compiled_step(benchmark, meter, vehicle):
    pytest.importorskip("numba", reason="numba is not installed (fullam[fast])")
    from fullam.simulation.compiled import entries
    from fullam.simulation.compiled.arrays import job_of

    plan = workloads.plan(vehicle, 0.5)
    row = Row(
        "Plant step, arm moving, compiled",
        f"{vehicle}, each called from Python",
        0.0,
        floor=FLOOR,
        must=4.5,
        aim=3.0,
        unit="RE",
    )

    def prepare():
        job = job_of(plan)
        job.speeds[1] *= 1.01
        arguments = (job.tables.arm, job.state, job.speeds, job.draw.gusts)

        def work():
            step, craft = entries.step, job.craft
            arm, state, speeds, gusts = arguments
            for k in range(400):
                step(*craft, arm, 2 * k, state, speeds, gusts)

        return work

    meter.measure(benchmark, prepare, 400, plan.nominal, row)
