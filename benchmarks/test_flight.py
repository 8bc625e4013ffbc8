"""One flight: by machine code and by Python, from the plan or from nothing to the record."""

from __future__ import annotations

import time

import pytest
import workloads
from meter import RE_OF_FLOORS, Row

from fullam.simulation import fused
from fullam.simulation.flight import Flight
from fullam.simulation.simulate import simulate
from fullam.simulation.weather import CALM

pytestmark = pytest.mark.benchmark(timer=time.process_time)

FLOOR = 4.65 / RE_OF_FLOORS
"""Closed loop in C++, middle of the range measured on hextilt [RE a step]."""

GROUP = "One flight, control and plant at 1 kHz, dc-PID, a step"


def flight_row(name, must=None, aim=None, promise=""):
    return Row(GROUP, name, 0.0, floor=FLOOR, must=must, aim=aim, unit="RE", promise=promise)


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize("weather", ["all realism", "calm"])
def test_python(benchmark, meter, steps, weather, vehicle):
    calm = CALM if weather == "calm" else None
    flown = workloads.plan(vehicle, steps, weather=calm)
    row = flight_row(f"python, {vehicle}, {weather}")
    if vehicle == "fullam" and not calm:
        row.must, row.aim = 200.0, 70.0
        row.promise = "Python driver, 1 kHz control and plant, all realism, a step"

    def prepare():
        flight = Flight(flown)

        def work():
            for _ in flight.ticks():
                pass
            assert len(flight.run()) == steps

        return work

    meter.measure(benchmark, prepare, steps, flown.nominal, row, rounds=7)


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize("weather", ["all realism", "calm"])
def test_loop(benchmark, meter, steps, weather, vehicle):
    """The loop alone, weather and vehicle drawn before."""
    flown = workloads.plan(vehicle, steps, weather=CALM if weather == "calm" else None)
    fleet = workloads.Fleet(flown, lanes=0)
    row = flight_row(f"fused, the loop alone, {vehicle}, {weather}")
    meter.measure(benchmark, lambda: fleet.fly, steps, flown.nominal, row, rounds=15)


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
def test_from_plan_to_record(benchmark, meter, steps, vehicle):
    flown = workloads.plan(vehicle, steps)

    def work():
        assert len(fused.fly(flown.with_seed(1))) == steps

    row = flight_row(f"fused, from plan to record, {vehicle}")
    meter.measure(benchmark, lambda: work, steps, flown.nominal, row, rounds=15)


@pytest.mark.parametrize("driver", ["python", "fused"])
@pytest.mark.parametrize("seconds", [1, 4])
def test_simulate(benchmark, meter, smoke, seconds, driver):
    """What a user waits for: tables, weather and true vehicle included."""
    steps = 40 if smoke else 1000 * seconds
    flown = workloads.plan(steps=steps)

    def work():
        run = simulate(
            flown.scenario,
            vehicle=flown.nominal,
            simulation=flown.simulation,
            driver=driver,
        )
        assert len(run) == steps

    row = flight_row(f"{driver}, simulate() of {seconds} s, from scenario to record, fullam")
    if driver == "fused" and seconds == 4:
        row.must, row.aim = 3.0, 2.0
        row.promise = "one flight, fused, scalar, with record and tables, 1 kHz, a step"
    rounds = 3 if driver == "python" else 15
    meter.measure(benchmark, lambda: work, steps, flown.nominal, row, rounds=rounds)
