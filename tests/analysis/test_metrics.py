"""Metrics on synthetic flights whose answers are known in closed form."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fullam.analysis.asked_motion import last_jump
from fullam.analysis.judge import HOLD_BAND
from fullam.analysis.metrics import measure
from fullam.analysis.response import DWELL, settling_time
from fullam.model.loading import load_vehicle
from fullam.simulation.motions.references import Circle, Step
from fullam.simulation.record.run import COLUMNS, Run, allocate_columns
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.weather import CALM, RECORDED

PERIOD = 0.01

TICK = 1.01 * PERIOD
"""A time read off a grid is right to one period."""

ROUNDING = 1e-9
"""Double precision over a few operations on numbers of about 1000."""


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("fullam")


@pytest.fixture
def make_run(vehicle):
    """A run with given true and reference motion; everything else rests."""

    def make(
        position,
        rotation_vectors=None,
        reference_position=None,
        reference_rotation=None,
        scenario=None,
        weather=CALM,
        outcome="completed",
    ):
        position = np.asarray(position, dtype=float)
        rows = len(position)
        still = np.zeros((rows, 3))
        columns = allocate_columns(rows, vehicle.n_arm, vehicle.rotors.count, COLUMNS)
        columns["t"] = np.arange(rows) * PERIOD
        target = still + 1.0 if reference_position is None else reference_position
        for name, p, r in (
            ("pose", position, rotation_vectors),
            ("reference_pose", target, reference_rotation),
        ):
            columns[name][:, :3] = p
            columns[name][:, 3:] = Rotation.from_rotvec(still if r is None else r).as_quat()
        scenario = scenario or Scenario("synthetic", reference=Step((1.0, 1.0, 1.0)))
        metadata = {
            "scenario": scenario.to_dict(),
            "weather": weather.to_dict(),
            "vehicle": vehicle.to_data(),
            "controller": "none",
            "seed": 0,
            "outcome": outcome,
        }
        return Run(columns, metadata)

    return make


def grid(duration=6.0):
    return np.arange(round(duration / PERIOD) + 1) * PERIOD


def along(axis, values, start=1.0):
    """Positions that rest at `start` but for one axis."""
    positions = np.full((len(values), 3), start)
    positions[:, axis] = values
    return positions


def second_order(t, damping, frequency):
    """Unit step response of w^2 / (s^2 + 2 z w s + w^2), z < 1."""
    wd = frequency * np.sqrt(1.0 - damping**2)
    decay = np.exp(-damping * frequency * t)
    return 1.0 - decay * (np.cos(wd * t) + damping * frequency / wd * np.sin(wd * t))


def test_first_order_step_settles_when_the_exponential_says(make_run):
    t, tau = grid(), 0.4
    metrics = measure(make_run(along(0, 1.0 - np.exp(-t / tau))))
    assert metrics.settled
    assert metrics.settling_time_s == pytest.approx(tau * np.log(50.0), abs=TICK)
    assert metrics.settling_time_5_s == pytest.approx(tau * np.log(20.0), abs=TICK)
    assert metrics.settling_time_raw_s == metrics.settling_time_s
    assert metrics.overshoot_percent == 0.0
    x = metrics.axes["x"]
    assert x.step == pytest.approx(1000.0)
    # RMS of exp(-t/tau) over the second half, as a sum on the grid.
    half = np.exp(-t[t.size // 2 :] / tau)
    assert x.rms == pytest.approx(1000.0 * np.sqrt(np.mean(half**2)), rel=ROUNDING)
    assert x.steady_error == pytest.approx(-1000.0 * np.mean(half), rel=ROUNDING)
    assert metrics.rms_position_mm == pytest.approx(x.rms, rel=ROUNDING)


@pytest.mark.parametrize("damping", [0.3, 0.5, 0.7])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_second_order_step_overshoots_by_the_textbook_formula(make_run, damping, sign):
    t = grid(10.0)
    y = second_order(t, damping, frequency=4.0)
    start, target = 5.0, 5.0 + sign * 2.0
    run = make_run(
        along(2, start + sign * 2.0 * y, start),
        reference_position=along(2, np.full(t.size, target), start),
    )
    metrics = measure(run)
    expected = 100.0 * np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2))
    # Between two samples the peak of the parabola is missed by at most (w dt)^2 / 8 of it.
    assert metrics.overshoot_percent == pytest.approx(expected, rel=1e-3)
    assert metrics.overshoot_raw_percent == metrics.overshoot_percent
    assert metrics.overshoot_setpoint_percent == pytest.approx(
        metrics.overshoot_percent * 2.0 / target, rel=ROUNDING
    )
    outside = np.abs(1.0 - y) > 0.02
    assert metrics.settling_time_s == pytest.approx(t[np.flatnonzero(outside)[-1] + 1])


def test_attitude_step_counts_in_degrees_about_the_right_axis(make_run):
    t, tau, angle = grid(), 0.3, np.radians(20.0)
    rotation = np.zeros((t.size, 3))
    rotation[:, 1] = angle * (1.0 - np.exp(-t / tau))
    target = np.tile([0.0, angle, 0.0], (t.size, 1))
    metrics = measure(make_run(np.ones((t.size, 3)), rotation, reference_rotation=target))
    assert metrics.axes["psi"].step == pytest.approx(20.0)
    assert metrics.axes["phi"].step == metrics.axes["gamma"].step == 0.0
    assert metrics.settling_time_s == pytest.approx(tau * np.log(50.0), abs=TICK)
    assert metrics.axes["phi"].overshoot_percent is None
    half = 20.0 * np.exp(-t[t.size // 2 :] / tau)
    assert metrics.rms_attitude_deg == pytest.approx(np.sqrt(np.mean(half**2)), rel=1e-6)
    assert metrics.axes["psi"].rms == pytest.approx(metrics.rms_attitude_deg, rel=1e-6)


def test_attitude_error_is_one_rotation_not_three_euler_errors(make_run):
    """About a world axis that is no Euler axis the rotation vector keeps its length."""
    t = grid()
    tilt = Rotation.from_euler("XYZ", [20.0, 20.0, 20.0], degrees=True)
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    off = Rotation.from_rotvec(np.radians(5.0) * axis)
    rotation = np.tile((off * tilt).as_rotvec(), (t.size, 1))
    target = np.tile(tilt.as_rotvec(), (t.size, 1))
    metrics = measure(make_run(np.ones((t.size, 3)), rotation, reference_rotation=target))
    assert metrics.rms_attitude_deg == pytest.approx(5.0, rel=ROUNDING)
    assert metrics.steady_attitude_deg == pytest.approx(5.0, rel=ROUNDING)


def test_euler_errors_do_not_jump_at_180_degrees(make_run):
    t = grid()
    about_z = np.array([0.0, 0.0, 1.0])
    rotation = np.tile(np.radians(-179.0) * about_z, (t.size, 1))
    target = np.tile(np.radians(179.0) * about_z, (t.size, 1))
    rotation[0] = target[0]
    metrics = measure(make_run(np.ones((t.size, 3)), rotation, reference_rotation=target))
    assert metrics.axes["gamma"].steady_error == pytest.approx(2.0, rel=1e-6)


def test_tilted_hover_reports_its_dip_and_when_it_is_over(make_run):
    t = grid()
    depth, width = 0.030, 0.2
    z = 1.0 - depth * np.exp(-0.5 * np.square((t - 0.8) / width))
    metrics = measure(make_run(along(2, z)))
    assert metrics.max_excursion_mm == pytest.approx(30.0, rel=1e-6)
    assert metrics.axes["z"].max_excursion == metrics.max_excursion_mm
    back = 0.8 + width * np.sqrt(2.0 * np.log(30.0 / HOLD_BAND[0]))
    assert metrics.axes["z"].settling_time_s == pytest.approx(back, abs=TICK)
    assert metrics.settling_time_raw_s is None, "nothing steps, so there is no textbook reading"
    assert metrics.overshoot_percent is None


def test_excursion_of_a_step_is_measured_off_its_straight_line(make_run):
    t = grid()
    s = 1.0 - np.exp(-t / 0.4)
    bulge = 0.04 * np.sin(np.pi * s)
    line = 1.0 + np.outer(s, [1.0, 1.0, 0.0])
    across = np.outer(bulge, [1.0, -1.0, 0.0]) / np.sqrt(2.0)
    target = np.full((t.size, 3), [2.0, 2.0, 1.0])
    metrics = measure(make_run(line + across, reference_position=target))
    # The bulge's largest sample is within 1e-3 of its peak on this grid.
    assert metrics.axes["x"].max_excursion == pytest.approx(40.0 / np.sqrt(2.0), rel=1e-3)
    assert metrics.max_excursion_mm == pytest.approx(40.0 / np.sqrt(2.0), rel=1e-3)


def test_axes_that_are_not_controlled_do_not_count(make_run):
    t = grid()
    drift = np.ones((t.size, 3))
    drift[:, 0] += 2.0 * t
    scenario = Scenario("no-x", reference=Step((1.0, 1.0, 1.0)), axes=("z", "phi", "psi", "gamma"))
    metrics = measure(make_run(drift, scenario=scenario))
    assert list(metrics.axes) == ["z", "phi", "psi", "gamma"]
    assert metrics.settled
    assert metrics.rms_position_mm == metrics.max_excursion_mm == 0.0


def test_response_starts_at_the_last_jump(make_run):
    t, tau = grid(8.0), 0.3
    x = np.where(t < 2.0, 1.0, 2.0 - np.exp(-np.maximum(t - 2.0, 0.0) / tau))
    target = along(0, np.where(t < 2.0, 1.0, 2.0))
    metrics = measure(make_run(along(0, x), reference_position=target))
    assert metrics.axes["x"].step == pytest.approx(1000.0)
    assert metrics.settling_time_s == pytest.approx(tau * np.log(50.0), abs=TICK)


def test_moving_reference_is_followed_and_only_its_jump_is_a_step(make_run):
    """A circle, entered by a jump, flown with a constant radial error of 30 mm."""
    t = grid(12.0)
    circle = Circle((0.0, 0.0, 1.0), radius=1.0, period=6.0)
    start = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    target = circle.tabulate(t, start).pose[:, :3]
    flown = target * [1.03, 1.03, 1.0]
    flown[0] = start[:3]
    scenario = Scenario("circle", reference=circle)
    metrics = measure(make_run(flown, reference_position=target, scenario=scenario))
    assert metrics.axes["x"].step == pytest.approx(1000.0)
    assert metrics.axes["y"].step == 0.0
    assert metrics.rms_position_mm == pytest.approx(30.0, rel=1e-6)
    assert not metrics.settled, "30 mm is outside 2 % of 1 m"
    assert metrics.axes["x"].settling_time_5_s == pytest.approx(PERIOD)


def test_smooth_motion_has_no_jump_however_fast():
    t = grid()
    for motion in (np.sin(3.0 * t), np.clip(t - 1.0, 0.0, 2.0), t**3):
        change = np.zeros((t.size, 6))
        change[1:, 0] = 1000.0 * np.diff(motion)
        assert last_jump(change) == 0


def test_noise_aware_reading_ignores_jitter_and_gusts_that_the_raw_one_trips_over(make_run):
    t, tau = grid(12.0), 0.4
    rng = np.random.default_rng(0)
    x = 1.0 - np.exp(-t / tau) + 0.008 * rng.standard_normal(t.size)
    for gust in (5.0, 9.0):
        x += 0.05 * np.exp(-0.5 * np.square((t - gust) / 0.05))
    noisy = measure(make_run(along(0, x), weather=RECORDED))
    # The moving average of an exponential is larger by sinh(a)/a, a = 0.1/0.4, one per cent; its
    # noise of 8 mm / sqrt(20) shifts the crossing of the slope 20 mm / 0.4 s by about 40 ms.
    assert noisy.settling_time_s == pytest.approx(tau * np.log(50.0), abs=0.12)
    assert noisy.settled
    assert noisy.settling_time_raw_s is None or noisy.settling_time_raw_s > 9.0
    assert noisy.overshoot_raw_percent > 4.0
    assert noisy.overshoot_percent < 1.5, "the gust of 50 mm comes after the transient"


def test_settling_band_is_not_narrower_than_the_sensor_sees(make_run):
    """0.3 m: 2 % are 6 mm, below two standard deviations of 10 mm."""
    t = grid()
    resting = along(0, np.where(t < 1.0, 1.0, 1.3 - 0.015))
    target = along(0, np.full(t.size, 1.3))
    noisy = measure(make_run(resting, reference_position=target, weather=RECORDED))
    calm = measure(make_run(resting, reference_position=target))
    # The centred average reaches 0.1 s ahead of the arrival.
    assert noisy.settling_time_s == pytest.approx(1.0, abs=0.1 + TICK)
    assert calm.settling_time_s is None
    assert not calm.settled


def test_jitter_is_what_moves_above_two_hertz(make_run):
    t = grid(20.0)
    slow, fast = 0.05 * np.sin(2 * np.pi * 0.2 * t), 0.003 * np.sin(2 * np.pi * 10.0 * t)
    rotation = np.zeros((t.size, 3))
    rotation[:, 2] = np.radians(0.5) * np.sin(2 * np.pi * 8.0 * t)
    metrics = measure(make_run(along(1, 1.0 + slow + fast), rotation))
    # Order 4, twice: (0.2/2)^8 of the slow motion passes, 1 - (2/8)^8 of the fast.
    assert metrics.jitter_position_mm == pytest.approx(3.0 / np.sqrt(2.0), rel=5e-3)
    assert metrics.jitter_attitude_deg == pytest.approx(0.5 / np.sqrt(2.0), rel=5e-3)
    assert metrics.axes["x"].jitter == pytest.approx(0.0, abs=ROUNDING)


def test_effort_and_saturation(make_run, vehicle):
    run = make_run(np.ones((601, 3)))
    weight = vehicle.mass * vehicle.gravity
    speeds = np.sqrt(1.5 * weight / vehicle.rotors.k_f.sum())
    columns = {name: np.array(column) for name, column in run.columns.items()}
    columns["rotor_speeds"][:] = speeds
    columns["saturated"][:150] = True
    metrics = measure(Run(columns, run.metadata))
    assert metrics.effort == pytest.approx(1.5, rel=ROUNDING)
    assert metrics.saturated_share == pytest.approx(150 / 601)


def test_diverged_run_is_measured_and_has_not_settled(make_run):
    metrics = measure(make_run(np.ones((300, 3)), outcome="diverged"))
    assert metrics.diverged
    assert not metrics.settled
    assert metrics.settling_time_s is metrics.axes["x"].settling_time_s is None
    assert metrics.rms_position_mm == 0.0


@pytest.mark.parametrize("rows", [0, 1, 2, 5])
def test_runs_of_a_few_rows_give_figures_and_not_errors(make_run, rows):
    metrics = measure(make_run(np.ones((rows, 3)), outcome="diverged"))
    assert not metrics.settled
    assert metrics.settling_time_s is None
    json.dumps(metrics.to_dict(), allow_nan=False)


def test_short_run_cannot_prove_that_it_settled(make_run):
    rows = round(DWELL / PERIOD)
    assert not measure(make_run(np.ones((rows, 3)))).settled
    assert measure(make_run(np.ones((rows + 1, 3)))).settled


def test_settling_needs_an_unbroken_dwell():
    t = grid(20.0)
    error = np.where(t < 1.0, 10.0, 0.0)
    error[t == t[130]] = 10.0  # leaves once, 0.3 s after it came
    assert settling_time(t, error, 1.0, share=0.95) == pytest.approx(1.31)
    error[1000:1050] = 10.0  # 0.5 s out of 18.7 s is within 5 %
    assert settling_time(t, error, 1.0, share=0.95) == pytest.approx(1.31)
    assert settling_time(t, error, 1.0) == pytest.approx(10.5)
    assert settling_time(t, error + 2.0, 1.0) is None


def test_share_inside_needs_half_of_the_response_to_show_it():
    t = grid(20.0)
    for arrival, settles in ((9.5, True), (10.5, False)):
        error = np.where(t < arrival, 10.0, 0.0)
        assert (settling_time(t, error, 1.0, share=0.95) is not None) is settles
        assert settling_time(t, error, 1.0) == pytest.approx(arrival)


def test_json_has_the_promised_names_flat_and_units_in_its_keys(make_run):
    data = measure(make_run(along(0, 1.0 - np.exp(-grid() / 0.4)))).to_dict()
    promised = {
        "settled",
        "settling_time_s",
        "overshoot_percent",
        "rms_position_mm",
        "rms_attitude_deg",
        "max_excursion_mm",
        "saturated_share",
        "diverged",
    }
    assert promised <= data.keys()
    assert {"rms_mm", "step_mm"} <= data["axes"]["x"].keys()
    assert "rms_deg" in data["axes"]["gamma"]
    assert json.loads(json.dumps(data, allow_nan=False)) == data


def test_gusts_alone_make_the_reading_noise_aware(make_run):
    gusty = replace(CALM, force_disturbance=10.0)
    t = grid()
    ripple = 0.019 * np.sin(2 * np.pi * 10.0 * t)
    run = make_run(along(0, 1.0 - np.exp(-t / 0.4) + ripple), weather=gusty)
    metrics = measure(run)
    # 10 Hz averages out over 20 samples; the window has 21, so 1.9 % / 21 may be left.
    assert metrics.axes["x"].overshoot_percent == pytest.approx(0.0, abs=0.1)
    assert metrics.axes["x"].overshoot_raw_percent == pytest.approx(1.9, rel=0.1)


def test_a_slow_response_overshoots_until_one_second_after_it_settled(make_run):
    t = grid(20.0)
    x = np.interp(t, [0.0, 4.0, 4.5, 8.0, 8.2, 8.4], [1.0, 2.1, 2.0, 2.0, 2.3, 2.0])
    target = along(0, np.full(t.size, 2.0))
    metrics = measure(make_run(along(0, x), reference_position=target, weather=RECORDED))
    assert 4.0 < metrics.settling_time_s < 4.5
    # Averaged over 0.1 s of either slope, 0.275 and 0.2 m/s, the peak of 10 % loses 1.2 %.
    assert metrics.overshoot_percent == pytest.approx(8.8, abs=0.2)
    assert metrics.overshoot_raw_percent == pytest.approx(30.0, rel=ROUNDING)
