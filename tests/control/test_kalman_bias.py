"""The Kalman filter with bias states: consistent, finds biases, rejects outliers, comes back."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from fullam.control import bias_covariance, kalman_bias
from fullam.control.estimator import Datasheet, Inertial, Readings
from fullam.control.kalman import Kalman
from fullam.control.kalman_bias import Flying, KalmanBias, KalmanBiasSettings, carry_on
from fullam.control.pose_gate import distance
from fullam.dynamics.pose_space import pose_model
from fullam.exceptions import SettingsError
from fullam.numbers.records import record

T, FLIGHTS = 0.01, 8
NOISE = (0.010, np.radians(1.0), 0.005, 0.05)

SHEET = Datasheet(
    *NOISE,
    gyroscope_bias=np.radians(10.0),
    accelerometer_bias=0.5,
    gyroscope_drift=2e-4,
    accelerometer_drift=2e-3,
)
"""Of an uncalibrated sensor without scale error."""

MOVING = KalmanBiasSettings(sampling_noise=(1e-9, 1e-9), initial_motion=(3.0, 30.0))
"""The known motions are smooth, which needs no allowance for what sampling misses; and they are in
full swing at the start, where the readings therefore tell nothing of the biases."""


def biases_of(sheet, periods, seed=1):
    """Bias and drift of eight pairs of sensors by their datasheet, shape (N, 6, 8)."""
    rng = np.random.default_rng(seed)
    sigma = np.repeat([sheet.gyroscope_bias, sheet.accelerometer_bias], 3)
    drift = np.repeat([sheet.gyroscope_drift, sheet.accelerometer_drift], 3)
    walk = np.cumsum(rng.standard_normal((periods, 6, FLIGHTS)) * drift[:, None], axis=0)
    return sigma[:, None] * rng.standard_normal((6, FLIGHTS)) + np.sqrt(T) * walk


@pytest.fixture(scope="module")
def biased_motion(known_motion):
    """Makes known motions and the biases with which they are sensed."""

    def make(sheet, periods, seed=0):
        known, biases = known_motion(sheet, periods, T, seed), biases_of(sheet, periods)
        return replace(known, inertial_noise=known.inertial_noise + biases), biases

    return make


def error_and_covariance(memory, true, biases, lane=None):
    """The fifteen errors of the late estimate, and their covariance."""
    pick = (lambda rows: rows) if lane is None else (lambda rows: rows[..., lane])
    flying = record(Flying, pick(memory.late.array[0]))
    P = pick(memory.covariance.array[:, :, 0]).copy()
    v = Rotation.from_quat(true[3:7]).apply(true[7:10]) - flying.now.velocity
    motion = pin.difference(pose_model(), np.concatenate(flying.now.pose), true[:7])
    return np.concatenate([motion, v, biases - np.concatenate(flying.bias)]), P


def errors_along(estimator, motion, flight, delay=0, every=50, first=300):
    """Errors and covariances of all lanes, every so many periods from the third second on."""
    known, biases = motion
    for k in range(0, len(known.motion) - every, every):
        flight.run(k, k + every)
        at = k + every - 1 - delay
        if k >= first:
            for lane in range(FLIGHTS):
                true = known.motion[at, :, lane], biases[at, :, lane]
                yield error_and_covariance(flight.memory, *true, lane)


def squared(e, P):
    return e @ np.linalg.solve(P, e)


@pytest.mark.parametrize(("delay", "every"), [(0, 1), (3, 5)])
def test_the_covariance_tells_the_truth(delay, every, biased_motion, sensed_flight):
    """The NEES of eight smooth, fast motions lies within its 99.8 % chi-square bounds.

    All fifteen, the nine of the motion and the six of the biases; errors of the biases decay with
    some 2 s, so samples are 2 s apart. Poses are never taken for outliers but once in 10 000.
    """
    sheet = replace(SHEET, delay_periods=delay, pose_every=every)
    estimator = KalmanBias(sheet, MOVING)
    motion = biased_motion(sheet, 6000)
    flight = sensed_flight(estimator, motion[0])
    found = list(errors_along(estimator, motion, flight, delay, every=200, first=400))
    assert len(found) >= 8 * 26
    for part in (slice(0, 15), slice(0, 9), slice(9, 15)):
        values = [squared(e[part], P[part, part]) for e, P in found]
        count = (part.stop - part.start) * len(values)
        low, high = chi2.ppf([0.001, 0.999], count) / len(values)
        assert low < np.mean(values) < high


def test_the_biases_are_found(biased_motion, sensed_flight):
    """In three seconds to 0.1 deg/s and 10 mg, one sigma, of 10 deg/s and 50 mg.

    Poses of 1 deg at 100 Hz tell the mean rate of 3 s to sqrt(12) 1 deg / (3 s sqrt(300)) =
    0.07 deg/s.
    """
    estimator = KalmanBias(SHEET, MOVING)
    motion = biased_motion(SHEET, 301)
    flight = sensed_flight(estimator, motion[0])
    flight.run(0, 301)
    true = motion[0].motion[300], motion[1][300]
    errors = [
        error_and_covariance(flight.memory, true[0][:, i], true[1][:, i], i)[0]
        for i in range(FLIGHTS)
    ]
    rms = np.sqrt(np.mean(np.square(errors), axis=0))[9:]
    assert rms[:3].max() < np.radians(0.15)
    assert rms[3:].max() < 0.1


BUGS = {
    "sign of the gyroscope's bias": ("pull", lambda carry: lambda s, x, w, f: carry(
        s, x, tuple(-1.0 * n for n in w), f)),
    "sign of the accelerometer's bias": ("pull", lambda carry: lambda s, x, w, f: carry(
        s, x, w, tuple(-1.0 * n for n in f))),
}  # fmt: skip


@pytest.mark.parametrize("bug", BUGS)
def test_a_wrong_sign_is_found_out(bug, biased_motion, sensed_flight, monkeypatch):
    """The errors of a filter with the bug are thousands of times what its covariance says."""
    motion = biased_motion(SHEET, 400)
    sound = sensed_flight(KalmanBias(SHEET, MOVING), motion[0], 0, compiled=False)
    monkeypatch.setattr(bias_covariance, "carry_biased", BUGS[bug][1](bias_covariance.carry_biased))
    wrong = sensed_flight(KalmanBias(SHEET, MOVING), motion[0], 0, compiled=False)
    wrong.run(0, 400)
    monkeypatch.undo()
    sound.run(0, 400)
    true = motion[0].motion[399, :, 0], motion[1][399, :, 0]
    high = chi2.ppf(0.999, 15)
    assert squared(*error_and_covariance(sound.memory, *true)) < high
    assert squared(*error_and_covariance(wrong.memory, *true)) > 100.0 * high


def test_the_covariance_stays_symmetric_and_positive(biased_motion, sensed_flight):
    estimator, motion = KalmanBias(SHEET, MOVING), biased_motion(SHEET, 600)
    flight = sensed_flight(estimator, motion[0])
    flight.run(0, 600)
    for P in np.moveaxis(flight.memory.covariance.array[:, :, 0], -1, 0):
        np.testing.assert_array_equal(P, P.T)
        assert np.linalg.eigvalsh(P).min() > 0.0


def test_F_is_the_derivative_of_a_period():
    """F P F^T against differences of the estimate's own step, for P = 1, 2, ... 15 on the diagonal.

    Tolerance: E is the mean of a turn to T^3 w^2 b / 12, and differences of 1e-6 round at 1e-9.
    """
    numbers = KalmanBias(SHEET, MOVING).numbers()
    still = numbers.kalman._replace(position=0.0, mixed=0.0, velocity=0.0, attitude=0.0)
    numbers = numbers._replace(kalman=still, drift=(0.0, 0.0), scale=(0.0, 0.0))
    rng, h = np.random.default_rng(3), 1e-6
    attitude = Rotation.from_rotvec([0.3, -0.4, 0.2]).as_quat()
    start = record(Flying, np.concatenate([rng.normal(size=3), attitude, rng.normal(size=27)]))
    reading = record(Inertial, rng.normal(size=6))

    def after(x):
        return carry_on(numbers, kalman_bias.corrected(start, x.tolist()), reading)

    base, F = after(np.zeros(15)), np.zeros((15, 15))
    for j, x in enumerate(h * np.eye(15)):
        moved = after(x)
        poses = (np.concatenate(flying.now.pose) for flying in (base, moved))
        F[:, j] = np.concatenate([
            pin.difference(pose_model(), *poses),
            np.subtract(moved.now.velocity, base.now.velocity),
            np.subtract(np.concatenate(moved.bias), np.concatenate(base.bias)),
        ]) / h  # fmt: skip
    step = bias_covariance.bias_step(T, start.now, base.now)
    first = np.diag(np.arange(1.0, 16.0))
    P = [row.tolist() for row in first]
    bias_covariance.predict(numbers, P, step, reading)
    np.testing.assert_allclose(P, F @ first @ F.T, atol=1e-5)
    assert np.abs(F @ first @ F.T - first).max() > 0.1


def test_the_distance_is_mahalanobis():
    rng = np.random.default_rng(0)
    A, y = rng.normal(size=(15, 15)), rng.normal(size=6)
    estimator = KalmanBias(SHEET)
    memory = estimator.memory()
    memory.covariance.array[:, :, 0] = A @ A.T
    memory.innovation.array[:, 0] = y
    lists = kalman_bias.BiasMemory(*(rows.to_list() for rows in memory))
    S = (A @ A.T)[:6, :6] + np.diag(np.repeat(NOISE[:2], 3) ** 2)
    # Rounding of a 6 x 6 solution.
    assert distance(estimator.numbers(), lists) == pytest.approx(squared(y, S), rel=1e-9)


def test_at_rest_the_first_readings_tell_the_biases():
    """Gyroscope to its noise; accelerometer to what the attitude's noise leaves, g 1 deg."""
    estimator, rng = KalmanBias(SHEET), np.random.default_rng(4)
    errors = []
    for _ in range(50):
        turn = Rotation.from_rotvec(rng.normal(size=3))
        seen = turn * Rotation.from_rotvec(rng.normal(size=3) * NOISE[1])
        b_w, b_f = rng.normal(size=3) * SHEET.gyroscope_bias, rng.normal(size=3) * 0.5
        w = b_w + rng.normal(size=3) * NOISE[2]
        f = turn.inv().apply([0.0, 0.0, 9.81]) + b_f + rng.normal(size=3) * NOISE[3]
        position = rng.normal(size=3) * NOISE[0]
        numbers = np.concatenate([position, seen.as_quat(), np.zeros(6), w, f, [1.0]])
        estimator.forget()
        estimator.estimate(record(Readings, numbers))
        flying, P = estimator.state.late[0], np.array(estimator.state.covariance)
        told = Rotation.from_quat(flying.now.pose.attitude)
        e = np.concatenate([
            -np.array(flying.now.pose.position), (told.inv() * turn).as_rotvec(), np.zeros(3),
            b_w - flying.bias.gyroscope, b_f - flying.bias.accelerometer,
        ])  # fmt: skip
        keep = [0, 1, 2, 3, 4, 5, *range(9, 15)]  # the velocity is 0 for sure
        errors.append((squared(e[keep], P[np.ix_(keep, keep)]), *e[9:]))
    values = np.array(errors)
    low, high = chi2.ppf([0.001, 0.999], 12 * len(values)) / len(values)
    assert low < values[:, 0].mean() < high
    rms = np.sqrt(np.mean(values[:, 1:] ** 2, axis=0))
    assert rms[:3].max() < 1.5 * NOISE[2]  # of 50 draws: known to 10 %
    assert rms[3:].max() < 1.5 * 9.81 * NOISE[1]


def test_with_sensors_that_have_no_bias_it_is_the_filter_without(known_motion, sensed_flight):
    """To a hundredth of the noise: F is finer here, biases that are certain stay zero.

    The motion is not at rest at the start, so that reading is given no weight.
    """
    sheet = Datasheet(*NOISE)
    known = known_motion(sheet, 500, T)
    settings = KalmanBiasSettings(initial_motion=(1e9, 1e9), gate=1e6)
    flights = [sensed_flight(e, known) for e in (Kalman(sheet), KalmanBias(sheet, settings))]
    for flight in flights:
        flight.run(0, 500)
    plain, biased = (flight.told.array for flight in flights)
    np.testing.assert_allclose(biased[:, :3], plain[:, :3], atol=0.01 * NOISE[0])
    np.testing.assert_allclose(biased[:, 3:7], plain[:, 3:7], atol=0.01 * NOISE[1])


def outlying(known, share, seed=5):
    """The motions, with a share of the poses half a metre and 20 deg off; which ones."""
    rng = np.random.default_rng(seed)
    hit = rng.random(known.noise[:, 0].shape) < share
    hit[0] = False
    far = rng.standard_normal(known.noise.shape)
    far[:, :3] *= 0.5 / np.linalg.norm(far[:, :3], axis=1, keepdims=True)
    far[:, 3:] *= np.radians(20.0) / np.linalg.norm(far[:, 3:], axis=1, keepdims=True)
    return replace(known, noise=known.noise + hit[:, None] * far), hit


@pytest.mark.parametrize("share", [0.02, 0.2])
def test_outliers_leave_no_trace(share, biased_motion, sensed_flight):
    """What the filter tells beside outliers is what it tells without these poses, nearly.

    Its error grows by the share of the poses that is missing, and by nothing else.
    """
    motion, _ = biased_motion(SHEET, 2000)
    spoilt, _ = outlying(motion, share)
    rms = []
    for known in (motion, spoilt):
        flight = sensed_flight(KalmanBias(SHEET, MOVING), known)
        flight.run(0, 2000)
        error = flight.told.array[300:, :3] - known.motion[300:, :3]
        rms.append(np.sqrt(np.mean(error**2)))
    assert rms[1] < (1.0 + 1.5 * share) * rms[0]
    believing = sensed_flight(Kalman(Datasheet(*NOISE)), spoilt)
    believing.run(0, 2000)
    error = believing.told.array[300:, :3] - spoilt.motion[300:, :3]
    assert np.sqrt(np.mean(error**2)) > 3.0 * rms[1]


@pytest.mark.parametrize("growth", [3.0, 1.0 + 1e-9])
def test_it_never_locks_itself_out(growth, biased_motion, sensed_flight):
    """Put 30 m and 90 deg elsewhere, it is back within half a second; without growth it is not."""
    settings = replace(MOVING, growth=growth)
    motion, _ = biased_motion(SHEET, 400)
    flight = sensed_flight(KalmanBias(SHEET, settings), motion)
    flight.run(0, 300)
    late = flight.memory.late.array[0]
    late[:3] += 30.0
    turned = Rotation.from_quat(late[3:7].T) * Rotation.from_rotvec([0.0, 0.0, np.pi / 2.0])
    late[3:7] = turned.as_quat().T
    flight.run(300, 400)
    away = np.abs(flight.told.array[350, :3] - motion.motion[350, :3])
    if growth > 2.0:
        assert away.max() < 0.1  # ten sigma of one pose
    else:
        assert away.max() > 10.0


def test_a_missing_pose_is_not_taken_in(biased_motion, sensed_flight):
    """Told that no pose is new, both filters go by their inertial sensors alone.

    Of the ring's last pose they take nothing: P only grows.
    """
    for cls in (Kalman, KalmanBias):
        estimator = cls(SHEET)
        reading = record(Readings, np.concatenate(
            [np.zeros(6), [1.0], np.zeros(9), [0.0, 0.0, 9.81], [1.0]]))  # fmt: skip
        for _ in range(10):
            estimator.estimate(reading)
        before = np.array(estimator.state.covariance)
        for _ in range(10):
            estimator.estimate(reading._replace(is_new=0.0))
        after = np.array(estimator.state.covariance)
        assert np.all(np.diag(after)[:9] > np.diag(before)[:9])
        assert np.all(np.diag(after) >= np.diag(before))


def test_settings_are_checked():
    with pytest.raises(SettingsError, match=r"'kalman-bias'.*gate.*a number above 0"):
        KalmanBiasSettings(gate=0.0)
    with pytest.raises(SettingsError, match=r"growth.*above 1"):
        KalmanBiasSettings(growth=1.0)
    with pytest.raises(SettingsError, match=r"'kalman-bias'.*sampling_noise.*two numbers"):
        KalmanBiasSettings(sampling_noise=(0.1,))
    with pytest.raises(SettingsError, match=r"gyroscope_bias.*at least 0"):
        Datasheet(gyroscope_bias=-1.0)
