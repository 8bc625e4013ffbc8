"""Sensors: noise as drawn, poses that are late and slow, and an accelerometer that is one."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.dynamics.pose_space import pose_from_euler, pose_model
from fullam.model.loading import load_vehicle
from fullam.simulation.arm_motion import HoldArm
from fullam.simulation.plant import Plant
from fullam.simulation.sensors import Sensors
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.weather import CALM, RECORDED, forecast

T = np.arange(50) * 0.01


@pytest.fixture
def history(rng):
    """A log of true poses that differ from row to row."""
    return pose_from_euler(rng.normal(size=(50, 3)), rng.uniform(-0.5, 0.5, (50, 3)))


def a_plant(speeds=None):
    vehicle = load_vehicle("fullam")
    arm = HoldArm().tabulate(np.zeros(201), np.array([-1.5, 0.0, -0.8, 0.0]))
    speeds = np.zeros(8) if speeds is None else speeds
    pose = pose_from_euler(np.zeros(3), np.array([0.3, -0.2, 0.1]))
    return Plant(vehicle, arm, pose, speeds, 0.001, "midpoint")


def test_the_noise_is_the_one_that_was_drawn(history):
    draw = forecast(RECORDED, 4, T)
    sensors = Sensors(SimulationSettings(), draw, 9.81, history)
    plant, model = a_plant(), pose_model()
    for k in (0, 7, 49):
        pose = sensors.read(k, plant).pose
        noise = pin.difference(model, history[k], pose)
        np.testing.assert_allclose(noise, draw.pose_noise[k], atol=1e-12)


def test_poses_come_late_and_only_now_and_then(history):
    settings = SimulationSettings(pose_period=0.03, delay=0.02)
    sensors, plant = Sensors(settings, forecast(CALM, 0, T), 9.81, history), a_plant()
    for k in range(50):
        readings = sensors.read(k, plant)
        assert readings.pose_is_new == (k % 3 == 0)
        taken = k - k % 3
        np.testing.assert_array_equal(readings.pose, history[max(0, taken - 2)])


def test_the_accelerometer_reads_nothing_in_free_fall_and_the_gyroscope_the_rate():
    """Free fall of a body whose centre of mass is off the origin: only rotation is felt there.

    The plant's last evaluation lies half a step back, so the comparison is with that instant.
    """
    plant = a_plant()
    plant.advance(np.zeros(8), None, 1)
    sensors = Sensors(SimulationSettings(), forecast(CALM, 0, T), 9.81, np.zeros((50, 7)))
    sensors.read_inertial(0, plant)
    np.testing.assert_allclose(sensors.readings.accelerometer, 0.0, atol=1e-9)
    plant.v[3:6] = 0.1, -0.2, 0.3
    sensors.read_inertial(0, plant)
    np.testing.assert_allclose(sensors.readings.gyroscope, [0.1, -0.2, 0.3], atol=1e-15)


def test_the_accelerometer_of_a_hovering_vehicle_reads_minus_gravity():
    """R^T (0 - g): g upwards in world axes, with rotors that carry the weight."""
    from fullam.control.allocation import Allocator

    vehicle, plant = load_vehicle("fullam"), a_plant()
    weight = pin.computeGeneralizedGravity(vehicle.model, vehicle.create_data(), plant.q)[:6]
    hover = a_plant(Allocator(vehicle.rotors).solve(weight).speeds)
    hover.advance(hover.speeds.copy(), None, 1)
    sensors = Sensors(SimulationSettings(), forecast(CALM, 0, T), 9.81, np.zeros((50, 7)))
    sensors.read_inertial(0, hover)
    R = pin.Quaternion(hover.q[3:7]).toRotationMatrix()
    # The regularised allocation is off by 1e-8 of full scale.
    np.testing.assert_allclose(sensors.readings.accelerometer, R.T @ [0, 0, 9.81], atol=1e-5)
