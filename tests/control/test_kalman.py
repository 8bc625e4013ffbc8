"""The error-state Kalman filter: consistent, symmetric, and without lag."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.stats import chi2

import fullam
from fullam.control.estimator import Datasheet
from fullam.control.kalman import InertialPose, Kalman
from fullam.dynamics.pose_space import pose_from_euler, pose_model
from fullam.simulation.flight import Flight
from fullam.simulation.simulate import prepare

SEEDS = range(3)
EVERY = 50
"""Rows between two samples of the NEES: errors decay with the filter's 2 rad/s, so these are
nearly independent."""


def nees(plan, estimator=None):
    """e^T P^-1 e of a flight, every `EVERY` rows from the first second on.

    No sample falls on the one period in which a gust, once a second, is half integrated.
    """
    flight, model, values = Flight(plan), pose_model(), []
    if estimator is not None:
        flight.estimator = estimator
    for k in flight.ticks():
        if k < 100 or k % EVERY:
            continue
        filter_, pose = flight.estimator, flight._log["pose"][k]
        R = pin.Quaternion(pose[3:]).toRotationMatrix()
        velocity = R @ flight._log["velocity"][k, :3]
        e = np.append(
            pin.difference(model, filter_.state.pose, pose), velocity - filter_.state.velocity
        )
        values.append(e @ np.linalg.solve(filter_.covariance, e))
    return values


def plan_of(seed, **simulation):
    settings = fullam.SimulationSettings(estimator="kalman", **simulation)
    return prepare("position-1", "dc-pid", seed=seed, weather="recorded", simulation=settings)


@pytest.mark.parametrize("pose_period", [None, 0.05])
def test_the_covariance_tells_the_truth(pose_period):
    """The NEES of three manoeuvring, gust-hit flights lies within its 99.8 % chi-square bounds."""
    values = np.concatenate([nees(plan_of(seed, pose_period=pose_period)) for seed in SEEDS])
    low, high = chi2.ppf([0.001, 0.999], 9 * values.size) / values.size
    assert low < values.mean() < high


def test_a_filter_told_the_wrong_noise_is_found_out():
    """With a pose sensor three times as noisy as stated the same bounds are missed by far."""
    wrong = Kalman(0.01, 0.01, 18.0, Datasheet(0.0033, np.radians(0.33), 0.005, 0.05))
    values = np.array(nees(plan_of(0), wrong))
    assert values.mean() > 1.5 * chi2.ppf(0.999, 9 * values.size) / values.size


def test_the_covariance_stays_symmetric_and_positive():
    flight = Flight(plan_of(1))
    for k in flight.ticks():
        if k == 300:
            break
    P = flight.estimator.covariance
    np.testing.assert_array_equal(P, P.T)
    assert np.linalg.eigvalsh(P).min() > 0.0


@pytest.mark.parametrize("simulation", [{}, {"delay": 0.05}, {"delay": 0.05, "pose_period": 0.02}])
def test_estimates_the_present_with_any_rate_and_delay(simulation):
    """Error of pose and velocity, a fifth of the sensor's 10 mm and 1 deg, also from old poses."""
    settings = fullam.SimulationSettings(estimator="kalman", **simulation)
    run = fullam.simulate("position-1", "dc-pid", seed=3, simulation=settings)
    steady = slice(100, None)
    error = (run.measured_pose - run.pose)[steady]
    assert np.sqrt(np.mean(error[:, :3] ** 2)) < 0.004
    assert np.sqrt(np.mean(error[:, 3:] ** 2)) < 0.5 * np.radians(0.2)
    speed = (run.measured_velocity - run.velocity)[steady, :3]
    assert np.sqrt(np.mean(speed**2)) < 0.012  # the first-order filter: 0.13


def test_exact_sensors_give_the_exact_state():
    """What is left are the trapezoids of the accelerometer: 0.5 mm/s in the 1 m step."""
    settings = fullam.SimulationSettings(estimator="kalman")
    run = fullam.simulate("position-1", "dc-pid", calm=True, simulation=settings)
    np.testing.assert_allclose(run.measured_pose, run.pose, atol=5e-5)
    np.testing.assert_allclose(run.measured_velocity, run.velocity, atol=2e-3)


def test_inertial_readings_carry_a_circle():
    """A steady turn on a circle, from exact readings: the trapezoid's error is of order T^2."""
    T, w, radius, g = 0.01, 1.0, 2.0, 9.81
    state = InertialPose(T, g)
    reading = np.array([0.0, 0.0, w, -radius * w**2, 0.0, g])
    start = pose_from_euler(np.array([radius, 0.0, 0.0]), np.zeros(3))
    state.start(start, np.array([0.0, radius * w, 0.0]), reading)
    steps = 157
    for _ in range(steps):
        state.advance(reading)
    angle = w * T * steps
    expected = pose_from_euler(
        radius * np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([0.0, 0.0, angle])
    )
    np.testing.assert_allclose(state.pose[3:], expected[3:], atol=1e-12)
    np.testing.assert_allclose(state.pose[:3], expected[:3], atol=radius * (w * T) ** 2)


def test_it_has_no_lag_to_anticipate():
    poses, velocities = np.zeros((5, 7)), np.ones((5, 6))
    seen, rates = Kalman(0.01, 0.01, 18.0).as_seen(poses, velocities)
    assert seen is poses
    assert rates is velocities
