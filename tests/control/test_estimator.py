"""Every estimator: one source, the same bits; the paper's filter; what hands them to the law."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.control.controller import Measurement
from fullam.control.estimator import Datasheet, Estimator, KernelEstimator, Readings
from fullam.control.estimators import (
    estimator_class,
    estimator_names,
    make_estimator_settings,
    register_estimator,
)
from fullam.control.first_order import FirstOrder, FirstOrderSettings
from fullam.control.kalman import KalmanSettings
from fullam.control.truth import Truth
from fullam.dynamics.pose_space import euler_from_pose, pose_from_euler, pose_model
from fullam.exceptions import SettingsError, UnknownName
from fullam.model.loading import load_vehicle
from fullam.numbers.records import record

NOISY = {
    "position_noise": 0.010,
    "attitude_noise": 0.017,
    "gyroscope_noise": 0.005,
    "accelerometer_noise": 0.05,
}


def readings_of(pose, *others):
    """A record of the pose alone, or with velocity, gyroscope and accelerometer."""
    return record(Readings, np.concatenate([pose, *(others or [np.zeros(12)]), [1.0]]))


def follow(estimator, poses):
    """Poses and velocities that the estimator tells, shapes (N, 7) and (N, 6), {A} axes."""
    m, told = Measurement(load_vehicle("fullam")), []
    estimator.reset(readings_of(poses[0]))
    for pose in poses:
        estimator.update(readings_of(pose), m)
        told.append(np.concatenate([m.q[:7], m.v[:6]]))
    return np.array(told)[:, :7], np.array(told)[:, 7:]


@pytest.mark.parametrize("delay", [0, 3])
@pytest.mark.parametrize("every", [1, 5])
@pytest.mark.parametrize("name", ["first-order", "kalman", "kalman-bias", "truth"])
def test_python_machine_code_and_lanes_tell_the_same_bits(
    name, every, delay, known_motion, sensed_flight
):
    sheet = Datasheet(**NOISY, delay_periods=delay, pose_every=every)
    known, estimator = known_motion(sheet, 300, 0.01), estimator_class(name)(sheet)
    flights = [sensed_flight(estimator, known)]
    flights += [sensed_flight(estimator, known, 5, compiled) for compiled in (True, False)]
    for flight in flights:
        flight.run(0, 300)
    lanes, scalar, python = (flight.told.array for flight in flights)
    assert np.abs(python[-1]).max() > 0.1
    np.testing.assert_array_equal(scalar, python)
    np.testing.assert_array_equal(lanes[..., 5], python)


RECORDED = {
    "first-order": [
        *(0.1620965596362118, 0.03321459019102815, -0.22776083241294362),
        *(0.13932870904587816, 0.03460672205263809, -0.010262700457213647, 0.9895880772340105),
        *(2.262870020370584, -0.45176184970592576, -0.5797155678072118),
        *(1.173688479912255, 0.4870157560270169, 1.0726473787377049),
    ],
    "kalman": [
        *(0.04514623453680917, -0.007122331604341383, -0.15854439350716784),
        *(0.0682371159751855, 0.024308829584494727, -0.05179203671338189, 0.9960272896566141),
        *(0.31548003546948605, -0.5103269421439668, -0.17173878439116722),
        *(-0.5250784707927013, -0.4101385805058615, -1.2690679920444046),
    ],
    "truth": [
        *(0.17434873827149527, 0.031559056327797624, -0.23243603429728876),
        *(0.14267050802953807, 0.03549648634289626, -0.007238388327207883, 0.989107037347489),
        *(1.9006956054711368, -0.06704158795978239, -0.6153255562418422),
        *(1.3314008877540449, -0.014323763762160636, -0.7312558498282987),
    ],
}
"""What the numpy implementations that stood here before told at the end, q[:7] and v[:6]."""


@pytest.mark.parametrize("name", RECORDED)
def test_tells_what_it_always_told(name):
    """To rounding of 44 periods, which the filters do not amplify."""
    rng, periods = np.random.default_rng(20260102), 44
    walk = np.cumsum(rng.normal(scale=0.02, size=(periods, 6)), axis=0)
    poses = pose_from_euler(walk[:, :3], walk[:, 3:])[np.arange(periods) // 5 * 5]
    velocity, w, f = (rng.normal(size=(periods, n)) for n in (6, 3, 3))
    f[:, 2] += 9.81
    sheet = Datasheet(0.01, 0.02, 0.005, 0.05, delay_periods=3, pose_every=5)
    estimator, m = estimator_class(name)(sheet), Measurement(load_vehicle("fullam"))
    for row in zip(poses, velocity, w, f, strict=True):
        estimator.update(readings_of(*row), m)
    np.testing.assert_allclose(np.append(m.q[:7], m.v[:6]), RECORDED[name], atol=1e-12)


def test_position_is_the_published_recursion(rng):
    """y0 += 0.01 * 18 * (y - y0)."""
    x = rng.normal(size=(200, 3))
    told, _ = follow(FirstOrder(), pose_from_euler(x, np.zeros((200, 3))))
    y = x[0].copy()
    for row, pose in zip(x, told, strict=True):
        y += 0.01 * 18.0 * (row - y)
        np.testing.assert_allclose(pose[:3], y, atol=1e-14)


def test_attitude_is_the_published_recursion_to_second_order(rng):
    """On Euler angles they filter; the manifold differs by products of angles, 0.03^2 here."""
    angles = np.cumsum(rng.normal(scale=0.003, size=(200, 3)), axis=0)
    told, _ = follow(FirstOrder(), pose_from_euler(np.zeros((200, 3)), angles))
    y, scale = angles[0].copy(), np.abs(angles).max()
    for row, pose in zip(angles, told, strict=True):
        y += 0.01 * 18.0 * (row - y)
        np.testing.assert_allclose(euler_from_pose(pose), y, atol=scale**2)


def test_a_steady_turn_lags_by_the_time_constant():
    """A ramp comes out late by 1/cutoff minus one sample's share, with the right rate."""
    model, step = pose_model(), np.array([0.01, 0, 0, 0, 0, 0.005])
    poses = [pose_from_euler(np.zeros(3), np.zeros(3))]
    for _ in range(200):
        poses.append(pin.integrate(model, poses[-1], step))
    told, velocity = follow(FirstOrder(), np.array(poses))
    R = pin.Quaternion(told[-1, 3:]).toRotationMatrix()
    np.testing.assert_allclose(R @ velocity[-1, :3], step[:3] / 0.01, atol=1e-9)
    np.testing.assert_allclose(velocity[-1, 3:], step[3:] / 0.01, atol=1e-9)
    lag = pin.difference(model, told[-1], poses[-1])
    np.testing.assert_allclose(lag, step * (1.0 / 0.18 - 1.0), atol=1e-9)


def test_an_infinite_cutoff_passes_the_poses_through(rng):
    poses = pose_from_euler(rng.normal(size=(9, 3)), rng.normal(size=(9, 3)))
    told, _ = follow(FirstOrder(settings=FirstOrderSettings(np.inf)), poses)
    np.testing.assert_allclose(told[:, :3], poses[:, :3], atol=1e-15)
    assert np.abs(np.sum(told[:, 3:] * poses[:, 3:], axis=1)).min() > 1.0 - 1e-14


@pytest.mark.parametrize("name", ["first-order", "truth"])
def test_a_vehicle_at_rest_is_seen_at_rest(name):
    pose = pose_from_euler(np.array([1.0, 2.0, 3.0]), np.array([0.3, 0.2, 0.1]))
    told, velocity = follow(estimator_class(name)(), np.tile(pose, (5, 1)))
    np.testing.assert_allclose(told[-1], pose, atol=1e-15)
    np.testing.assert_allclose(velocity, 0.0, atol=1e-13)


def test_the_motion_as_seen_is_what_the_estimator_tells_of_it(rng):
    """Late and slow poses included; the one goes through a table, the other period by period."""
    poses = pose_from_euler(rng.normal(size=(40, 3)), rng.normal(size=(40, 3)))
    estimator = FirstOrder(Datasheet(delay_periods=3, pose_every=5))
    seen, rates = estimator.as_seen(poses, np.zeros((40, 6)))
    k = np.arange(40)
    told, velocity = follow(estimator, poses[np.maximum(0, k - k % 5 - 3)])
    np.testing.assert_array_equal(seen, told)
    # Told in {A} axes and turned back: rounding.
    for pose, rate, v in zip(seen, rates, velocity, strict=True):
        R = pin.Quaternion(pose[3:]).toRotationMatrix()
        np.testing.assert_allclose((v.reshape(2, 3) @ R.T).ravel(), rate, atol=1e-13)


def test_truth_tells_the_velocity_by_the_attitude_that_it_reads(rng):
    """Its poses are late, and a late attitude turns the true body velocity wrongly: known, too."""
    poses = pose_from_euler(np.zeros((9, 3)), np.outer(np.arange(9), [0.0, 0.0, 0.1]))
    velocities = np.tile([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], (9, 1))
    seen, rates = Truth(Datasheet(delay_periods=2)).as_seen(poses, velocities)
    np.testing.assert_array_equal(seen[2:], poses[:-2])
    np.testing.assert_allclose(rates[2:, :2], np.tile([np.cos(0.2), -np.sin(0.2)], (7, 1)))


def test_after_a_reset_it_begins_anew(rng):
    poses = pose_from_euler(rng.normal(size=(20, 3)), rng.normal(size=(20, 3)))
    estimator = FirstOrder()
    first, again = follow(estimator, poses), follow(estimator, poses)
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)


class Oracle(Estimator):
    """Anybody's estimator, in numpy."""

    def reset(self, readings):
        self.seen = 0

    def update(self, readings, measurement):
        measurement.q[:7] = np.concatenate(readings.pose)
        measurement.v[:6] = np.concatenate(readings.velocity)
        self.seen += 1


def test_anybody_writes_one_in_numpy(monkeypatch):
    monkeypatch.setattr("fullam.control.estimators.ESTIMATORS", {})
    register_estimator("oracle")(Oracle)
    assert estimator_names() == ("oracle",)
    estimator, poses = estimator_class("oracle")(), np.tile(np.arange(7.0), (3, 1))
    told, _ = follow(estimator, poses)
    np.testing.assert_array_equal(told, poses)
    assert estimator.seen == 3
    assert estimator.as_seen(poses, poses)[0] is poses


def test_names_settings_and_datasheets_are_checked():
    assert {"first-order", "kalman", "kalman-bias", "truth"} <= set(estimator_names())
    assert all(issubclass(estimator_class(n), KernelEstimator) for n in RECORDED)
    with pytest.raises(UnknownName, match="first-order"):
        estimator_class("oracle")
    with pytest.raises(SettingsError, match="cutoff"):
        FirstOrderSettings(0.0)
    with pytest.raises(SettingsError, match=r"sampling_noise.*two numbers"):
        KalmanSettings(sampling_noise=(0.1,))
    with pytest.raises(SettingsError, match="give a FirstOrderSettings"):
        FirstOrder(settings=KalmanSettings())
    with pytest.raises(SettingsError, match="period"):
        FirstOrder(period=0.0)
    with pytest.raises(SettingsError, match=r"pose_every.*whole number of at least 1"):
        Datasheet(pose_every=0)
    with pytest.raises(SettingsError, match=r"delay_periods.*whole"):
        Datasheet(delay_periods=1.5)


def test_settings_are_made_by_name():
    made = make_estimator_settings("kalman", {"sampling_noise": [0.1, 0.2]})
    assert made == KalmanSettings(sampling_noise=(0.1, 0.2))
    assert KalmanSettings(**made.to_dict()) == made
    assert make_estimator_settings("truth").to_dict() == {}
    with pytest.raises(SettingsError, match=r"cutoff.*it has least_pose_noise"):
        make_estimator_settings("kalman", {"cutoff": 18.0})
    with pytest.raises(SettingsError, match="it has none"):
        make_estimator_settings("truth", {"cutoff": 18.0})
    with pytest.raises(SettingsError, match="cutoff: is 'fast'; give a number"):
        make_estimator_settings("first-order", {"cutoff": "fast"})
