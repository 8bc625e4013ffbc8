"""Sensors as sold: what is drawn, what is read, and how flights with the bias filter bear it."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from same_flights import assert_same_bits, fly_interpreted, fly_scalar
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import fullam
from fullam.analysis.judged import fly_judged
from fullam.control.estimator import Datasheet
from fullam.control.kalman_bias import Flying
from fullam.exceptions import ScenarioError
from fullam.numbers.program import program
from fullam.numbers.records import record
from fullam.simulation.block import Block
from fullam.simulation.flight import Flight
from fullam.simulation.flight_plan import datasheet
from fullam.simulation.many import fly_many
from fullam.simulation.record.run import Run
from fullam.simulation.sensor_errors import EXACT, MPU6050, SensorErrors
from fullam.simulation.simulate import prepare
from fullam.simulation.tables import Tables
from fullam.simulation.weather import PAPER, SOLD, Weather, forecast

T = np.arange(2001) * 0.01
BIAS = {"estimator": "kalman-bias"}
SOUND_POSES = MPU6050.without_lost_poses()
"""Biased sensors beside a pose sensor without gaps and outliers."""

NOISY = SensorErrors(gyroscope_density_deg=0.005, accelerometer_density_ug=400.0)
"""The same noise without bias, drift and scale error."""


# What is drawn.


def test_the_papers_draws_stay_what_they_are():
    """Noise beside outliers, gusts, parameters and the noise of the inertial sensors: same bits."""
    paper, sold = forecast(PAPER, 7, T), forecast(SOLD, 7, T)
    added = sold.pose_noise - paper.pose_noise
    assert (~added.any(axis=1)).sum() > 1900
    np.testing.assert_array_equal(sold.disturbance, paper.disturbance)
    assert sold.parameters.random() == paper.parameters.random()
    ratio = SOLD.inertial_scale(0.01)[0] / PAPER.gyroscope_noise
    # Rounding of two products.
    np.testing.assert_allclose(sold.gyroscope_noise, ratio * paper.gyroscope_noise, rtol=1e-14)
    quiet = forecast(replace(SOLD, sensors=replace(MPU6050, outlier_share=0.0)), 7, T)
    np.testing.assert_array_equal(quiet.pose_noise, paper.pose_noise)
    assert not paper.offsets.any()
    assert not paper.missing.any()
    assert (paper.gains == 1.0).all()


def test_biases_and_scales_lie_within_their_bounds_alike():
    """Uniform: of 400 draws the standard deviation is known to 3 %; four of those are allowed."""
    one = np.arange(1.0)
    drawn = [forecast(SOLD, seed, one) for seed in range(400)]
    first = np.array([np.append(d.offsets[0], d.gains - 1.0) for d in drawn])
    bounds = MPU6050.bounds
    np.testing.assert_allclose(bounds[:3], np.radians(20.0))
    np.testing.assert_allclose(bounds[3:6], np.array([50.0, 50.0, 80.0]) * 9.80665e-3)
    assert np.all(np.abs(first) <= bounds * 1.001)  # one step of the drift is in it
    np.testing.assert_allclose(first.std(axis=0), bounds / np.sqrt(3.0), rtol=0.12)
    assert np.abs(np.corrcoef(first.T) - np.eye(12)).max() < 0.2  # 4 / sqrt(400)


def test_a_drift_walks_with_its_density():
    """Differences over a second, 20 of each axis of 20 seeds: known to 5 %, three are allowed."""
    kinds = ("gyroscope_drift_deg", np.radians(0.1)), ("accelerometer_drift_mg", 9.8e-4)
    for name, size in kinds:
        weather = Weather(sensors=SensorErrors(**{name: 0.1}))
        walks = np.stack([forecast(weather, seed, T).offsets for seed in range(20)])
        part = walks[:, :, :3] if name.startswith("gyroscope") else walks[:, :, 3:]
        steps = part[:, 100::100] - part[:, :-100:100]
        np.testing.assert_allclose(steps.std(), size, rtol=0.15)


def test_noise_of_a_density_grows_with_the_rate():
    """0.005 deg/s/sqrt(Hz) at 100 Hz is the data sheet's 0.05 deg/s."""
    weather = Weather(sensors=NOISY)
    assert weather.inertial_scale(0.01)[0] == pytest.approx(np.radians(0.05))
    assert weather.inertial_scale(0.0025)[0] == pytest.approx(np.radians(0.1))
    assert PAPER.inertial_scale(0.01) == (0.005, 0.05)
    assert SOLD.inertial_scale(0.01)[1] == pytest.approx(np.hypot(0.05, 4e-3 * 9.80665))


def test_gaps_and_outliers():
    draw = forecast(SOLD, 3, T)
    assert draw.missing[0] == 0.0
    edges = np.flatnonzero(np.diff(draw.missing))
    starts, ends = edges[::2], edges[1::2]
    assert len(starts) == 4  # one in each 5 s of 20 s
    np.testing.assert_array_equal(ends - starts, 50)
    np.testing.assert_array_equal(starts // 500, range(4))
    added = draw.pose_noise - forecast(PAPER, 3, T).pose_noise
    hit = added.any(axis=1)
    assert not hit[0]
    # 40 of 2000 are expected, give or take 6; three times that is allowed.
    assert 22 <= hit.sum() <= 58
    np.testing.assert_allclose(np.linalg.norm(added[hit, :3], axis=1), 0.5, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(added[hit, 3:], axis=1), np.radians(20.0), rtol=1e-12)


def test_the_estimator_gets_the_datasheet():
    simulation = fullam.SimulationSettings(**BIAS)
    sheet = datasheet(simulation, SOLD, 9.81)
    assert sheet.gyroscope_bias == pytest.approx(np.radians(20.0) / np.sqrt(3.0))
    assert sheet.accelerometer_bias == pytest.approx(80e-3 * 9.80665 / np.sqrt(3.0))
    assert sheet.gyroscope_scale == pytest.approx(0.03 / np.sqrt(3.0))
    assert sheet.gyroscope_drift == pytest.approx(np.radians(0.01))
    own = Datasheet(0.01, np.radians(1.0), 0.005, 0.05)
    assert datasheet(simulation, PAPER, 9.81) == own


# As data.


def test_names_and_plain_data():
    assert fullam.weather("sold") is SOLD
    assert Weather.from_dict(SOLD.to_dict()) == SOLD
    old = PAPER.to_dict()
    del old["sensors"]  # a record from before there were any
    assert Weather.from_dict(old) == PAPER


TOML = """
name = "mine"
duration = 1.0
[weather]
position_noise = 0.01
[weather.sensors]
{0}
"""


def test_a_scenario_may_have_sensors_of_its_own(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(TOML.format("gyroscope_bias_deg = [1.0, 2.0, 3.0]\noutlier_share = 0.1"))
    sensors = fullam.load_scenario(path).weather.sensors
    assert sensors == SensorErrors(gyroscope_bias_deg=(1.0, 2.0, 3.0), outlier_share=0.1)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("gyro_bias = 1.0", r"mine.toml: weather: sensors: gyro_bias: .*it has gyroscope_bias_deg"),
        ("gyroscope_bias_deg = 20.0", r"gyroscope_bias_deg: is 20.0.*three finite numbers"),
        ("accelerometer_bias_mg = [50, 50, -80]", r"accelerometer_bias_mg\[2\]: .*0 to 100000 mg"),
        ("outlier_share = 2.0", r"outlier_share: is 2.0.*from 0 to 1"),
        ("gap_duration = 20.0", r"gap_duration: 20.0 s is longer than gap_interval"),
        ("gap_interval = 0.0", r"gap_interval: is 0.0.*from 0.001"),
        ("gyroscope_scale = nan", r"gyroscope_scale: is NaN"),
    ],
)
def test_errors_name_file_and_field(tmp_path, line, message):
    path = tmp_path / "mine.toml"
    path.write_text(TOML.format(line))
    with pytest.raises(ScenarioError, match=message):
        fullam.load_scenario(path)


# What is read.


def flown_readings(errors, seed=2, **simulation):
    """True rows, readings and forecast of a flight of two seconds by Python."""
    scenario = replace(fullam.load_scenario("task-2"), duration=2.0)
    weather = replace(fullam.weather("calm"), sensors=errors)
    plan = prepare(
        scenario, "pid", seed=seed, weather=weather,
        simulation={**BIAS, **simulation},
    )  # fmt: skip
    flight, rows = Flight(plan), []
    readings = flight.lists.of(flight.block.readings)
    for _ in flight.ticks():
        rows.append(readings[0])
    return flight.run(), rows, plan.forecast


def test_what_is_read_off_biased_sensors():
    """Gain x + offset, entry by entry, against a flight with exact sensors and the same motion."""
    errors = replace(SOUND_POSES, gyroscope_density_deg=0.0, accelerometer_density_ug=0.0)
    run, rows, draw = flown_readings(errors)
    read = np.array([row.gyroscope for row in rows])
    R = fullam.dynamics.rotations.quaternion_rotation(run.pose[:, 3:])
    w = np.einsum("nji,nj->ni", R, run.velocity[:, 3:])
    np.testing.assert_allclose(read, draw.gains[:3] * w + draw.offsets[:, :3], atol=1e-12)
    first = np.array(rows[0].accelerometer)
    felt = R[0].T @ [0.0, 0.0, 9.81]
    np.testing.assert_allclose(first, draw.gains[3:] * felt + draw.offsets[0, 3:], atol=1e-12)


def test_in_a_gap_the_last_pose_stays_and_is_told_to_be_old():
    gaps = SensorErrors(gap_interval=1.0, gap_duration=0.3)
    run, rows, draw = flown_readings(gaps, pose_period=0.02)
    is_new = np.array([row.is_new for row in rows])
    due = np.arange(len(rows)) % 2 == 0
    np.testing.assert_array_equal(is_new, due & (draw.missing == 0.0))
    assert 50 < is_new.sum() < 80
    for before, row in itertools.pairwise(rows):
        assert row.is_new or row.pose == before.pose
    seen = np.array([np.concatenate(row.pose) for row in rows])
    np.testing.assert_allclose(seen[is_new > 0.0], run.pose[is_new > 0.0], atol=1e-12)


# How it is flown.


SIMULATIONS = [{}, {"delay": 0.03, "pose_period": 0.02}]


@pytest.mark.parametrize("estimator", ["kalman", "kalman-bias"])
@pytest.mark.parametrize("simulation", SIMULATIONS, ids=str)
def test_the_same_bits_whoever_flies(simulation, estimator):
    """Kernels in Python, scalar machine code and lanes; and what one flies meanwhile is its own.

    In lanes some flights take a pose that others miss or reject.
    """
    scenario = replace(fullam.load_scenario("task-2"), duration=3.0)
    sensors = replace(MPU6050, gap_interval=1.0, outlier_share=0.1)
    if estimator == "kalman":  # which believes them, and would not fly for long
        sensors = replace(sensors, outlier_share=0.0, gyroscope_bias_deg=(0.1, 0.1, 0.1))
    plan = prepare(
        scenario, "dc-pid-plus", seed=4, weather=replace(PAPER, sensors=sensors),
        simulation={"estimator": estimator, **simulation},
    )  # fmt: skip
    lanes = list(fly_many(plan, range(8), threads=1))
    for lane, alone in zip(lanes, fly_scalar(plan, range(8)), strict=True):
        assert_same_bits(lane, alone)
    assert_same_bits(fly_interpreted(plan), lanes[4])


@pytest.mark.parametrize("driver", ["python", "fused"])
def test_a_record_flies_again(driver, tmp_path):
    scenario = replace(fullam.load_scenario("task-2"), duration=1.0)
    run = fullam.simulate(
        scenario, "dc-pid-plus", seed=5, weather="sold", simulation=BIAS, driver=driver
    )
    run.save(tmp_path / "sold.npz")
    again = fullam.refly(Run.load(tmp_path / "sold.npz"))
    np.testing.assert_array_equal(again.pose, run.pose)
    assert run.weather == SOLD


def figures(errors, scenario="task-1", seeds=range(32), estimator="kalman-bias", weather=PAPER):
    """RMS over flights of position [mm] and attitude [deg], and how many completed."""
    plan = prepare(
        scenario, "dc-pid-plus", weather=replace(weather, sensors=errors),
        simulation={"estimator": estimator},
    )  # fmt: skip
    found = list(fly_judged(plan, seeds))
    rms = [
        np.sqrt(np.mean(np.concatenate([np.square(j.figures[name]) for j in found])))
        for name in ("rms_position_mm", "rms_attitude_deg")
    ]
    outcomes = [outcome for judged in found for outcome in judged.outcomes]
    return np.array(rms), outcomes.count("completed")


@pytest.mark.parametrize("scenario", ["task-1", "task-2", "position-1"])
def test_biased_sensors_cost_a_flight_little(scenario):
    """Against the same noise without bias, drift and scale errors: 15 % at most."""
    sound, _ = figures(NOISY, scenario)
    biased, completed = figures(SOUND_POSES, scenario)
    assert completed == 32
    assert np.all(biased < 1.15 * sound)


def test_without_bias_states_they_cost_a_flight_everything():
    rms, completed = figures(SOUND_POSES, estimator="kalman", scenario="task-2")
    assert completed < 24  # 20 of 32 do, metres off
    assert rms[0] > 300.0
    residual = replace(
        NOISY, gyroscope_bias_deg=(0.5, 0.5, 0.5), accelerometer_bias_mg=(20.0, 20.0, 20.0)
    )
    believing, _ = figures(residual, estimator="kalman")
    finding, _ = figures(residual)
    assert believing[0] > 5.0 * finding[0]


def test_in_the_papers_weather_it_is_as_good_as_the_filter_without():
    """To 2 %: one reading at rest levels it a little better at the start."""
    plain, _ = figures(EXACT, estimator="kalman")
    biased, _ = figures(EXACT)
    np.testing.assert_allclose(biased, plain, rtol=0.02)


def test_no_flight_is_lost_in_gaps_and_outliers():
    """Half a second in five without a pose, and 2 % outliers of 0.5 m and 20 deg."""
    rms, completed = figures(MPU6050, "task-2", range(64))
    assert completed == 64
    assert rms[0] < 10.0


def test_sensors_may_turn_bad_in_flight():
    """A filter that was told of no bias finds 20 deg/s of it all the same, and is back in 2 s.

    Far off meanwhile, but never lost; and what hands did flies again.
    """
    scenario = replace(fullam.load_scenario("task-1"), duration=6.0)
    flight = fullam.fly(scenario, "dc-pid-plus", seed=3, simulation=BIAS)
    flight.advance(1.0)
    flight.switch(weather="sold")
    run = flight.run()
    error = np.linalg.norm(run.measured_pose[:, :3] - run.pose[:, :3], axis=1)
    assert run.outcome == "completed"
    assert error[100:300].max() > 0.05
    assert error[400:].max() < 0.05
    np.testing.assert_array_equal(fullam.refly(run).pose, run.pose)


def nees_of_flights(errors, seeds, first=300, every=50):
    """Squared errors of fifteen, by their covariance, along flights of task-1 in unbounded noise.

    The bias of a sensor with a scale error is what it is off where it has lately been.
    """
    weather = replace(PAPER, sensors=errors, noise_bound=np.inf)
    plan = prepare("task-1", "dc-pid-plus", weather=weather, simulation=BIAS)
    tables, values = Tables(plan), []
    for start in range(0, len(seeds), 8):
        some = seeds[start : start + 8]
        block = Block(tables, lanes=8)
        block.draw(some)
        block.begin()
        flight = program(list(block.stages().values()))
        draws = [forecast(weather, seed, plan.t) for seed in some]
        for k in range(0, tables.periods - every - 1, every):
            flight.run(k, k + every)
            at = k + every - 1
            if at < first:
                continue
            late, P = block.estimator_memory.late.array[0], block.estimator_memory.covariance.array
            for lane, draw in enumerate(draws):
                told = record(Flying, late[:, lane])
                off = draw.offsets[at] + (draw.gains - 1.0) * np.concatenate(told.mean)
                pose = block.entries["pose"][at, :, lane]
                v = block.entries["velocity"][at, :3, lane]
                e = np.concatenate([
                    pose[:3] - told.now.pose.position,
                    turn_between(told.now.pose.attitude, pose[3:]),
                    v - told.now.velocity,
                    off - np.concatenate(told.bias),
                ])  # fmt: skip
                values.append(e @ np.linalg.solve(P[:, :, 0, lane], e))
    return np.array(values)


def turn_between(a, b):
    return (Rotation.from_quat(a).inv() * Rotation.from_quat(b)).as_rotvec()


def test_the_covariance_tells_the_truth_in_flight():
    """The NEES of 16 flights in gusts lies within its 99.8 % chi-square bounds.

    No sample falls on the one period in which a gust, once a second, is half integrated. With
    scale errors, which are no states, it must not be optimistic, nor off by a third.
    """
    exact = replace(SOUND_POSES, gyroscope_scale=0.0, accelerometer_scale=0.0)
    values = nees_of_flights(exact, range(16))
    low, high = chi2.ppf([0.001, 0.999], 15 * values.size) / values.size
    assert low < values.mean() < high
    scaled = nees_of_flights(SOUND_POSES, range(16)).mean()
    assert 10.0 < scaled < high
