"""Against crazyflow's rigid quadrotor in 1 000 worlds, burst by burst in one run, by the clock."""

from __future__ import annotations

import statistics
import time

import pytest
import workloads
from apart import HERE, apart
from crazyflow_apart import PYTHON, floor
from meter import Row

from fullam.numbers.program import program
from fullam.simulation.weather import CALM

pytestmark = pytest.mark.benchmark(timer=time.perf_counter)

THREADS = 2


def in_lanes(weather):
    """Our flights: eight in each of two threads, with arm, allocation, sensors and record."""

    def ours(steps):
        fleet = workloads.Fleet(workloads.plan(steps=steps, weather=weather), threads=THREADS)
        return fleet.fly, fleet.steps

    return ours


def plant_in_lanes(steps):
    """Our plant alone, one thread: arm, rotor lags, gusts, midpoint rule."""
    fleet = workloads.Fleet(workloads.plan(steps=steps))
    move = program([fleet.blocks[0].stages()["move"]])
    return lambda: move.run(0, steps - 1), fleet.steps


CASES = {
    "closed loop; ours with all realism, 2 threads": ("state", in_lanes(None)),
    "closed loop; ours in calm air, 2 threads": ("state", in_lanes(CALM)),
    "plant alone; ours with arm, lags, gusts, 1 thread": ("rotor_vel", plant_in_lanes),
}
"""What of crazyflow's is timed, and what of ours."""


@pytest.mark.parametrize("name", CASES)
def test_against_crazyflow(benchmark, meter, smoke, steps, tmp_path, name):
    if not PYTHON.exists():
        pytest.skip("crazyflow is not installed (python benchmarks/crazyflow_apart.py install)")
    control, ours = CASES[name]
    worlds, stretch = 1000, 200
    if smoke:
        worlds, stretch, control = 10, 5, "rotor_vel"  # compiles soonest
    row = Row("Against crazyflow's rigid quadrotor, 1000 worlds, Euler, float32", name, 0.0)
    row.unit = "x"
    if "all realism" in name:
        row.must, row.aim = 3.0, 6.0
        row.promise = "against crazyflow's rigid quadrotor, 1 000 worlds, closed loops at 1 kHz"
    work, calls = ours(steps)
    arguments = [str(worlds), str(stretch), control]
    bursts, floors = [], []
    command = [str(PYTHON), str(HERE / "crazyflow_apart.py"), *arguments]
    with apart(command, cwd=tmp_path) as process:  # MuJoCo writes a log where it starts

        def rival():
            floors.append(floor())
            bursts.append(process.burst())
            return bursts[-1]["clock"]

        meter.against(benchmark, rival, lambda: work, calls, row, rounds=15)
    processor = statistics.median(burst["processor"] for burst in bursts) * 1e6
    share = statistics.median(
        burst["floor"] / here for burst, here in zip(bursts, floors, strict=True)
    )
    # The same plain Python in both processes: the machine treats them alike.
    row.note += f", {processor:.2g} us of processor; floor {share:.2f} of ours"
