"""Sensors: noise as drawn, poses that are late and slow, and an accelerometer that is one."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.control.allocation import Allocator
from fullam.control.estimator import Inertial
from fullam.dynamics.pose_space import pose_from_euler, pose_model
from fullam.dynamics.spatial import Pose, Spatial
from fullam.model.loading import load_vehicle
from fullam.numbers.records import Rows, record
from fullam.numbers.vectors import ZERO
from fullam.simulation.motions.arm_motion import HoldArm
from fullam.simulation.sensors import keep_pose, sense_inertial, sense_pose
from fullam.simulation.weather import RECORDED, forecast

SILENT, EXACT = Inertial(ZERO, ZERO), Inertial((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))


@pytest.fixture
def history(rng):
    """True poses that differ from period to period, shape (50, 7)."""
    return pose_from_euler(rng.normal(size=(50, 3)), rng.uniform(-0.5, 0.5, (50, 3)))


def readings_of(history, noise, every=1, delay=0):
    """The pose at hand in every period, shape (N, 7)."""
    ring, reading, out = [None] * (delay + 1), None, []
    rows = zip(Rows(Pose, history).to_list(), Rows(Spatial, noise).to_list(), strict=True)
    for k, (pose, draw) in enumerate(rows):
        keep_pose(ring, pose, k)
        reading = sense_pose(ring, draw, reading, every, k)
        out.append(np.concatenate(reading))
    return np.array(out)


def test_the_noise_is_the_one_that_was_drawn(history):
    draw = forecast(RECORDED, 4, np.arange(50) * 0.01).pose_noise
    for true, read, noise in zip(history, readings_of(history, draw), draw, strict=True):
        np.testing.assert_allclose(pin.difference(pose_model(), true, read), noise, atol=1e-12)


@pytest.mark.parametrize(("every", "delay"), [(3, 2), (1, 0), (1, 4), (4, 1)])
def test_poses_come_late_and_only_now_and_then(history, every, delay):
    """Attitudes are of unit length to rounding."""
    readings, k = readings_of(history, np.zeros((50, 6)), every, delay), np.arange(50)
    expected = history[np.maximum(0, k - k % every - delay)]
    np.testing.assert_array_equal(readings[:, :3], expected[:, :3])
    np.testing.assert_allclose(readings[:, 3:], expected[:, 3:], atol=1e-15)


ARM = np.array([-1.5, 0.0, -0.8, 0.0])


@pytest.fixture
def a_plant(plant_of):
    """Makes a tilted plant with its arm held."""

    def make(speeds=None):
        vehicle, arm = load_vehicle("fullam"), HoldArm().tabulate(np.zeros(201), ARM)
        pose = pose_from_euler(np.zeros(3), np.array([0.3, -0.2, 0.1]))
        return plant_of(vehicle, arm, pose, np.zeros(8) if speeds is None else speeds, 0.001)

    return make


def felt_by(plant, noise=SILENT):
    pose, twist, rate = plant.state
    return sense_inertial(pose.attitude, twist, rate, 9.81, EXACT, noise)


def test_the_accelerometer_reads_nothing_in_free_fall_and_the_gyroscope_the_rate(a_plant):
    """Free fall of a body whose centre of mass is off the origin: only rotation is felt there.

    The plant's last evaluation lies half a step back, so the comparison is with that instant.
    """
    plant = a_plant()
    plant.advance(np.zeros(8))
    np.testing.assert_allclose(felt_by(plant).accelerometer, 0.0, atol=1e-9)
    plant.v = np.array([0.0, 0.0, 0.0, 0.1, -0.2, 0.3])
    assert felt_by(plant).gyroscope == (0.1, -0.2, 0.3)


def test_the_accelerometer_of_a_hovering_vehicle_reads_minus_gravity(a_plant):
    """R^T (0 - g): g upwards in world axes, with rotors that carry the weight."""
    vehicle, plant = load_vehicle("fullam"), a_plant()
    q = np.append(plant.q, ARM)
    weight = pin.computeGeneralizedGravity(vehicle.model, vehicle.create_data(), q)[:6]
    hover = a_plant(Allocator(vehicle.rotors).solve(weight).speeds)
    hover.advance(hover.speeds)
    R = pin.Quaternion(hover.q[3:7]).toRotationMatrix()
    # The regularised allocation is off by 1e-8 of full scale.
    np.testing.assert_allclose(felt_by(hover).accelerometer, R.T @ [0, 0, 9.81], atol=1e-5)


def test_inertial_noise_is_added(a_plant, rng):
    plant, noise = a_plant(), rng.normal(size=6)
    plant.v = rng.normal(size=6)
    plain, noisy = felt_by(plant), felt_by(plant, record(Inertial, noise))
    np.testing.assert_allclose(np.concatenate(noisy) - np.concatenate(plain), noise, atol=1e-14)


def test_the_accelerometer_feels_a_circle(rng):
    """On a steady circle the origin accelerates by w x (w x r), whatever the attitude."""
    attitude = record(Pose, pose_from_euler(np.zeros(3), rng.normal(size=3))).attitude
    R = pin.Quaternion(np.array(attitude)).toRotationMatrix()
    w, r = rng.normal(size=3), rng.normal(size=3)  # world axes
    dp, ddp = np.cross(w, r), np.cross(w, np.cross(w, r))
    up = np.array([0.0, 0.0, 9.81])
    v, w_A = R.T @ dp, R.T @ w
    a = R.T @ ddp - np.cross(w_A, v)  # dv_A/dt: zero, the circle looks the same at all times
    np.testing.assert_allclose(a, 0.0, atol=1e-14)
    velocity = record(Spatial, np.append(v, w_A))
    felt = sense_inertial(attitude, velocity, Spatial(ZERO, ZERO), 9.81, EXACT, SILENT)
    np.testing.assert_allclose(felt.accelerometer, R.T @ (ddp + up), atol=1e-14)
