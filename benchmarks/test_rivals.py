"""Against rotorpy and MuJoCo, in one run: `pip install 'fullam[bench]'` brings both."""

from __future__ import annotations

import statistics
import time
import warnings
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import workloads
from meter import Row

from fullam.control.controller import ReferencePoint
from fullam.simulation.flight import Flight
from fullam.simulation.settings import SimulationSettings

pytestmark = pytest.mark.benchmark(timer=time.process_time)

STEPS = 200


def against(benchmark, meter, rival, ours, row, rounds=9):
    """Time a rival and ours in alternating bursts of STEPS calls; the value is the ratio.

    Args:
        benchmark: The fixture; it times ours.
        meter: Where the row goes.
        rival: Called before each round, untimed; returns the rival's burst.
        ours: The same for ours.
        row: The row; `us` becomes our time, and its note the rival's.
        rounds: How many rounds.
    """
    rivals = []

    def setup():
        work = rival()
        start = time.process_time()
        work()
        rivals.append((time.process_time() - start) / STEPS)
        return (ours(),), {}

    benchmark.pedantic(lambda work: work(), setup=setup, rounds=rounds, warmup_rounds=1)
    if not benchmark.enabled:
        return
    times = [t / STEPS for t in benchmark.stats.stats.data]
    pairs = list(zip(rivals[-len(times) :], times, strict=True))
    row.us = statistics.median(times) * 1e6
    row.value, row.unit = statistics.median(theirs / t for theirs, t in pairs), "x"
    row.note = f"it takes {statistics.median(theirs for theirs, _ in pairs) * 1e6:.1f} us"
    meter.add(benchmark, row)


def numpy_loop(plan):
    """A burst of our controller and one step of the plant, in Python: what rotorpy does."""
    flight = Flight(plan)
    tick, plant, reference = flight.tick, flight.plant, plan.reference
    m, point = flight.measurement, ReferencePoint()
    flight.controller.reset(m, point)

    def work():
        for k in range(STEPS):
            m.q[:], m.v[:] = plant.q, plant.v
            point.pose, point.velocity = reference.pose[k], reference.velocity[k]
            point.acceleration = reference.acceleration[k]
            plant.advance(tick.speeds(0.0, m, point), None, 1)

    return work


def numpy_flight(plan):
    """A burst of our flight in Python: sensors, estimator and log besides."""
    flight = Flight(plan)

    def work():
        for _ in flight.ticks():
            pass

    return work


def compiled_flight(plan):
    """A burst of our flight as machine code, without the making of the record."""
    pytest.importorskip("numba", reason="numba is not installed (fullam[fast])")
    from fullam.simulation.compiled import entries
    from fullam.simulation.compiled.arrays import job_of, log_of
    from fullam.simulation.run import allocate_columns

    job = job_of(plan)
    columns = allocate_columns(plan.t.size, plan.nominal.n_arm, plan.nominal.rotors.count)
    log = log_of(columns)
    return lambda: entries.fly(job, log, 0, STEPS, STEPS - 1)


def rotorpy_flight():
    """A burst of rotorpy: its SE(3) controller and one step of its quadrotor, at 1 kHz.

    It integrates by scipy's RK45, its default.
    """
    pytest.importorskip("rotorpy", reason="rotorpy is not installed (fullam[bench])")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its own, on import
        from rotorpy.controllers.quadrotor_control import SE3Control
        from rotorpy.vehicles.crazyflie_params import quad_params
        from rotorpy.vehicles.multirotor import Multirotor

    vehicle, controller = Multirotor(quad_params), SE3Control(quad_params)
    state = {
        "x": np.array([1.0, 0.0, 2.0]),
        "v": np.zeros(3),
        "q": np.array([0.0, 0.0, 0.0, 1.0]),
        "w": np.zeros(3),
        "wind": np.zeros(3),
        "rotor_speeds": np.full(4, 1788.53),
    }

    still, flats = np.zeros(3), []
    for angle in np.arange(STEPS) * 0.001 * 2.0 * np.pi / 8.0:
        flats.append(
            {
                "x": np.array([np.cos(angle), np.sin(angle), 2.0]),
                "x_dot": still,
                "x_ddot": still,
                "x_dddot": still,
                "x_ddddot": still,
                "yaw": 0.0,
                "yaw_dot": 0.0,
                "yaw_ddot": 0.0,
            }
        )

    def work():
        now = state
        for k, flat in enumerate(flats):
            now = vehicle.step(now, controller.update(0.001 * k, now, flat), 0.001)

    return work


@pytest.mark.parametrize(
    ("ours", "name", "bounded"),
    [
        (numpy_loop, "controller and step, numpy", True),
        (numpy_flight, "and sensors, estimator, log, numpy", False),
        (compiled_flight, "and sensors, estimator, log, compiled", True),
    ],
)
def test_against_rotorpy(benchmark, meter, ours, name, bounded):
    plan = workloads.plan("fullam", 0.001 * STEPS)
    must, aim = (30.0, 70.0) if bounded else (None, None)
    group = "Against rotorpy: its controller and its step by RK45, 1 kHz (ours: arm, allocation)"
    row = Row(group, name, 0.0, must=must, aim=aim, unit="x")
    against(benchmark, meter, rotorpy_flight, lambda: ours(plan), row)


def mujoco_steps(vehicle, arm):
    """A burst of MuJoCo's Euler steps of the same vehicle, its joints driven freely."""
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (fullam[bench])")
    robot = ET.fromstring(vehicle.urdf)
    for link in robot.findall("link"):
        for tag in ("visual", "collision"):
            for element in link.findall(tag):
                link.remove(element)
    options = ET.SubElement(robot, "mujoco")
    ET.SubElement(options, "compiler", inertiafromgeom="false", balanceinertia="false")
    spec = mujoco.MjSpec.from_string(ET.tostring(robot, encoding="unicode"))
    spec.body(vehicle.platform).add_freejoint()
    spec.option.timestep = 0.001
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[7:] = arm

    def work():
        step = mujoco.mj_step
        for _ in range(STEPS):
            step(model, data)

    return work


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize(
    ("engine", "rule"),
    [
        ("numpy", "semi-implicit-euler"),
        ("compiled", "semi-implicit-euler"),
        ("compiled", "midpoint"),
    ],
)
def test_against_mujoco(benchmark, meter, engine, rule, vehicle):
    simulation = SimulationSettings(control_period=0.001, integrator=rule)
    plan = workloads.plan(vehicle, 0.001 * STEPS, simulation=simulation)
    row = Row(
        "Against MuJoCo's Euler step of the same vehicle (its joints free, ours prescribed)",
        f"{engine}, {rule}, {vehicle}",
        0.0,
        must=1.0 if engine == "compiled" else None,
        aim=2.0 if engine == "compiled" else None,
        unit="x",
    )

    def ours():
        if engine == "compiled":
            pytest.importorskip("numba", reason="numba is not installed (fullam[fast])")
            from fullam.simulation.compiled import entries
            from fullam.simulation.compiled.arrays import job_of

            job = job_of(plan)

            def work():
                step, craft, arm = entries.step, job.craft, job.tables.arm
                state, speeds, gusts = job.state, job.speeds, job.draw.gusts
                for k in range(STEPS):
                    step(*craft, arm, 2 * k, state, speeds, gusts)

            return work
        plant = Flight(plan).plant
        commands = plant.speeds * 1.01

        def work_in_python():
            for _ in range(STEPS):
                plant.advance(commands, None, 1)

        return work_in_python

    theta = plan.arm.theta[0]
    against(benchmark, meter, lambda: mujoco_steps(plan.nominal, theta), ours, row)
