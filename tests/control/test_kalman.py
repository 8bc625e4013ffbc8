"""The error-state Kalman filter: consistent, symmetric, and without lag."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import fullam
from fullam.control.estimator import Datasheet, Inertial
from fullam.control.kalman import InertialPose, Kalman, KalmanSettings, carry
from fullam.dynamics.pose_space import pose_from_euler, pose_model
from fullam.dynamics.spatial import Pose
from fullam.numbers.records import record
from fullam.simulation.flight import Flight
from fullam.simulation.simulate import prepare

SEEDS = range(3)
EVERY = 50
"""Periods between two samples of the NEES: errors decay with the filter's 2 rad/s, so these are
nearly independent."""

SHEET = Datasheet(0.010, np.radians(1.0), 0.005, 0.05)


def squared_error(late, P, pose, velocity_W):
    """e^T P^-1 e against the true pose and velocity."""
    told, v = np.concatenate(late.pose), np.array(late.velocity)
    e = np.append(pin.difference(pose_model(), told, pose), velocity_W - v)
    return e @ np.linalg.solve(P, e)


def bounds_of_mean(count):
    """Where the mean of so many squared errors lies in 99.8 % of all cases."""
    return chi2.ppf([0.001, 0.999], 9 * count) / count


def nees_of_known_motions(estimator, known, flight, delay):
    """Squared errors of all lanes, every `EVERY` periods from the third second on."""
    values = []
    for k in range(0, len(known.motion) - EVERY, EVERY):
        flight.run(k, k + EVERY)
        if k < 300:
            continue
        true = known.motion[k + EVERY - 1 - delay].T
        for lane, row in enumerate(true):
            late = record(InertialPose, flight.memory.late.array[0, :, lane])
            P = flight.memory.covariance.array[:, :, 0, lane]
            v = Rotation.from_quat(row[3:7]).apply(row[7:10])
            values.append(squared_error(late, P, row[:7], v))
    return np.array(values)


@pytest.mark.parametrize(("delay", "every"), [(0, 1), (3, 5)])
def test_the_covariance_tells_the_truth(delay, every, known_motion, sensed_flight):
    """The NEES of eight smooth, fast motions lies within its 99.8 % chi-square bounds.

    Without the allowance for what sampling misses, of which a smooth motion has little.
    """
    sheet = Datasheet(0.01, np.radians(1.0), 0.005, 0.05, delay, every)
    estimator = Kalman(sheet, KalmanSettings(sampling_noise=(1e-9, 1e-9)))
    known = known_motion(sheet, 3000, 0.01)
    values = nees_of_known_motions(estimator, known, sensed_flight(estimator, known), delay)
    assert values.size == 8 * 53
    low, high = bounds_of_mean(values.size)
    assert low < values.mean() < high


def nees_of_flight(plan, estimator=None):
    """Squared errors of a flight, every `EVERY` periods from the first second on.

    No sample falls on the one period in which a gust, once a second, is half integrated.
    """
    flight, values = Flight(plan), []
    if estimator is not None:
        flight.estimator = estimator
    for k in flight.ticks():
        if k < 100 or k % EVERY:
            continue
        state, true = flight.estimator.state, flight.lists.of(flight.block.entries)[k]
        P, pose = np.array(state.covariance), np.concatenate(true.pose)
        values.append(squared_error(state.late[0], P, pose, np.array(true.velocity.linear)))
    return values


def plan_of(seed, **simulation):
    settings = fullam.SimulationSettings(estimator="kalman", **simulation)
    return prepare("position-1", "dc-pid", seed=seed, weather="recorded", simulation=settings)


@pytest.mark.parametrize("pose_period", [None, 0.05])
def test_the_covariance_tells_the_truth_in_gusts(pose_period):
    """The NEES of three manoeuvring, gust-hit flights lies within its 99.8 % bounds."""
    plans = [plan_of(seed, pose_period=pose_period) for seed in SEEDS]
    values = np.concatenate([nees_of_flight(plan) for plan in plans])
    low, high = bounds_of_mean(values.size)
    assert low < values.mean() < high


def test_a_filter_told_the_wrong_noise_is_found_out(known_motion, sensed_flight):
    """With a pose sensor three times as noisy as stated the same bounds are missed by far."""
    wrong = Kalman(Datasheet(0.0033, np.radians(0.33), 0.005, 0.05))
    known = known_motion(SHEET, 1000, 0.01)
    values = nees_of_known_motions(wrong, known, sensed_flight(wrong, known), 0)
    assert values.mean() > 1.5 * bounds_of_mean(values.size)[1]


def test_the_covariance_stays_symmetric_and_positive(known_motion, sensed_flight):
    known, estimator = known_motion(SHEET, 300, 0.01), Kalman(SHEET)
    flight = sensed_flight(estimator, known)
    flight.run(0, 300)
    for P in np.moveaxis(flight.memory.covariance.array[:, :, 0], -1, 0):
        np.testing.assert_array_equal(P, P.T)
        assert np.linalg.eigvalsh(P).min() > 0.0


def test_taking_a_pose_entry_by_entry_is_the_textbook_update(known_motion, sensed_flight):
    """P - K H P and K y with K = P H^T (H P H^T + N)^-1, against the filter's own prediction.

    Of two filters one is given a pose in the last period, and the other, with a slower sensor,
    is not; they part there only. Tolerance: rounding of a 6 x 6 solution.
    """
    known = known_motion(SHEET, 12, 0.01)
    filters = [Kalman(Datasheet(0.01, 0.02, 0.005, 0.05, pose_every=every)) for every in (11, 12)]
    flights = [sensed_flight(f, known, 0, compiled=False) for f in filters]
    for flight in flights:
        flight.run(0, 12)
    after, before = (record(InertialPose, f.memory.late.array[0]) for f in flights)
    P_after, P = (f.memory.covariance.array[:, :, 0] for f in flights)
    reading = pin.integrate(pose_model(), known.motion[11, :7, 0], known.noise[11, :, 0])
    y = pin.difference(pose_model(), np.concatenate(before.pose), reading)
    K = P[:, :6] @ np.linalg.inv(P[:6, :6] + np.diag(np.repeat([0.01, 0.02], 3) ** 2))
    np.testing.assert_allclose(P_after, P - K @ P[:6], atol=1e-15)
    x = K @ y
    moved = pin.integrate(pose_model(), np.concatenate(before.pose), x[:6])
    np.testing.assert_allclose(np.concatenate(after.pose), moved, atol=1e-14)
    np.testing.assert_allclose(after.velocity, np.add(before.velocity, x[6:]), atol=1e-14)


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
    reading = Inertial((0.0, 0.0, w), (-radius * w**2, 0.0, g))
    start = record(Pose, pose_from_euler(np.array([radius, 0.0, 0.0]), np.zeros(3)))
    now = InertialPose(start, (0.0, radius * w, 0.0), reading)
    numbers, steps = Kalman(period=T).numbers(), 157
    for _ in range(steps):
        now = carry(numbers, now, reading)
    angle = w * T * steps
    expected = pose_from_euler(
        radius * np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([0.0, 0.0, angle])
    )
    np.testing.assert_allclose(now.pose.attitude, expected[3:], atol=1e-12)
    np.testing.assert_allclose(now.pose.position, expected[:3], atol=radius * (w * T) ** 2)


def test_it_has_no_lag_to_anticipate():
    poses, velocities = np.zeros((5, 7)), np.ones((5, 6))
    seen, rates = Kalman().as_seen(poses, velocities)
    assert seen is poses
    assert rates is velocities
