"""Against rotorpy and MuJoCo, in one run: `pip install 'fullam[bench]'` brings both."""

from __future__ import annotations

import time
import warnings
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import workloads
from meter import Row, processor_time

from fullam.numbers.program import program
from fullam.simulation.flight import Flight
from fullam.simulation.weather import CALM

pytestmark = pytest.mark.benchmark(timer=time.process_time)

STEPS = 200


def python_flight(flown):
    """A burst of our flight in Python: controller and plant, and sensors, estimator and record."""
    flight = Flight(flown)

    def work():
        for _ in flight.ticks():
            pass

    return work


def fused_flight(flown):
    """The same by machine code."""
    return workloads.Fleet(flown, lanes=0).fly


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


@pytest.mark.parametrize(("ours", "name"), [(python_flight, "python"), (fused_flight, "fused")])
def test_against_rotorpy(benchmark, meter, smoke, ours, name):
    flown = workloads.plan(steps=STEPS)
    group = "Against rotorpy, its controller and its step by RK45, 1 kHz"
    row = Row(group, f"{name}, arm, allocation, sensors, estimator, record", 0.0, unit="x")
    if name == "fused":
        row.must, row.aim = 30.0, 70.0
    rival = rotorpy_flight()
    meter.against(benchmark, lambda: processor_time(rival, STEPS), lambda: ours(flown), STEPS, row)


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

    def work():
        mujoco.mj_resetData(model, data)
        data.qpos[7:] = arm
        step = mujoco.mj_step
        for _ in range(STEPS):
            step(model, data)

    return work


@pytest.mark.parametrize("vehicle", workloads.VEHICLES)
@pytest.mark.parametrize(
    ("driver", "rule"),
    [
        ("python", "midpoint"),
        ("fused", "semi-implicit-euler"),
        ("fused", "midpoint"),
        ("8 lanes", "midpoint"),
    ],
)
def test_against_mujoco(benchmark, meter, driver, rule, vehicle):
    flown = workloads.plan(vehicle, STEPS + 1, weather=CALM, integrator=rule)
    row = Row(
        "Against MuJoCo's Euler step of the same vehicle (its joints free, ours prescribed)",
        f"{driver}, {rule}, {vehicle}",
        0.0,
        must=1.0 if driver == "fused" else None,
        aim=2.0 if driver == "fused" else None,
        unit="x",
    )
    calls = STEPS

    def ours():
        """The plant's stage of every period in turn, from a flight's end on."""
        if driver == "python":
            flight = Flight(flown)
            move, view = flight.stages["move"]

            def work():
                for k in range(STEPS):
                    move(view, k)

            return work
        fleet = workloads.Fleet(flown, 0 if driver == "fused" else 8)
        alone = program([fleet.blocks[0].stages()["move"]])
        return lambda: alone.run(0, STEPS)

    if driver == "8 lanes":
        calls *= 8
    rival = mujoco_steps(flown.nominal, flown.arm.theta[0])
    meter.against(benchmark, lambda: processor_time(rival, STEPS), ours, calls, row)
