"""Figures in lanes: those of whole arrays, and the same bits in Python and in machine code."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from fullam.analysis import deviation
from fullam.analysis.asked_motion import AskedMotion, last_jump
from fullam.analysis.campaign_table import flatten
from fullam.analysis.judge import Judge, TrackJudge
from fullam.analysis.metrics import Metrics, measure, metrics_of, noise_floors, rows_of
from fullam.analysis.response import Response
from fullam.model.loading import load_vehicle
from fullam.numbers import program
from fullam.numbers.records import Rows
from fullam.simulation.flown import Flown
from fullam.simulation.record.run import COLUMNS, Run, allocate_columns
from fullam.simulation.scenarios.scenario import AXES, Scenario
from fullam.simulation.weather import CALM, RECORDED

PERIOD = 0.01

START = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])

ROUNDING = 1e-9
"""Double precision over filters and running sums of numbers of about 1000."""


# What the figures are, once more: whole arrays, and SciPy's filters.


def coordinates(pose):
    euler = Rotation.from_quat(pose[:, 3:]).as_euler("XYZ", degrees=True)
    return np.hstack([1e3 * pose[:, :3], euler])


def wrapped(change):
    change[:, 3:] = (change[:, 3:] + 180.0) % 360.0 - 180.0
    return change


def rms(x):
    return np.sqrt(np.mean(np.square(x), axis=0))


def settled_at(t, error, band, share):
    inside = np.abs(error) <= band
    share_left = np.cumsum(inside[::-1])[::-1] / np.arange(t.size, 0, -1)
    outside = np.minimum.accumulate(np.where(inside, t[-1], t)[::-1])[::-1]
    proven = t <= (0.5 * t[-1] if share < 1.0 else t[-1])
    rows = np.flatnonzero(inside & (outside - t >= 0.5 - 1e-9) & proven & (share_left >= share))
    return float(t[rows[0]]) if rows.size else None


def peak_of(error, step):
    return 100.0 * max(0.0, float(np.max(error * np.sign(step)))) / abs(step)


def latest(times):
    return max(times) if times and None not in times else None


def worst(values):
    return max((v for v in values if v is not None), default=None)


def expected_row(run, vehicle):
    """The figures of a run as one flat row."""
    pose, asked = coordinates(run.pose), coordinates(run.reference_pose)
    change = wrapped(np.diff(asked, axis=0, prepend=pose[:1]))
    start = last_jump(change)
    t = run.t[start:] - run.t[start]
    error, rows = wrapped(pose - asked)[start:], len(t)
    turned = Rotation.from_quat(run.pose[start:, 3:])
    turned *= Rotation.from_quat(run.reference_pose[start:, 3:]).inv()
    mask = np.array(run.scenario.axes_mask)
    position = np.where(mask[:3], error[:, :3], 0.0)
    rotation = np.where(mask[3:], turned.as_rotvec(degrees=True), 0.0)
    step = np.where(np.abs(change[start]) > np.repeat([10.0, 1.0], 3), change[start], 0.0)

    off = np.where(mask, error, 0.0)
    for half in (slice(0, 3), slice(3, 6)):
        d = np.where(mask[half], step[half], 0.0)
        if d.any():
            off[:, half] -= np.outer(off[:, half] @ d, d) / (d @ d)
    excursion = np.max(np.abs(off), axis=0)

    period = run.t[1] - run.t[0] if len(run) > 1 else 0.0
    signals = np.hstack([error, position, rotation])
    fast = np.zeros_like(signals)
    if period and rows > 1.0 / period:
        sos = butter(4, 2.0, "highpass", fs=1.0 / period, output="sos")
        fast = sosfiltfilt(sos, signals, axis=0)
    steady = slice(rows // 2, None)
    fast = fast[steady]
    jitter = rms(fast)

    floors = noise_floors(run.weather)
    window = min(rows, 2 * round(0.1 / max(period, 1e-9)) + 1)
    smoothed = uniform_filter1d(error, window, axis=0, mode="nearest")
    axes = {}
    for i in np.flatnonzero(mask):
        floor = 0.0 if floors is None else floors[i // 3]
        judged, share = (error, 1.0) if floors is None else (smoothed, 0.95)
        size = abs(float(step[i]))

        def settle(signal, band, share, ended=run.diverged):
            return None if ended else settled_at(t, signal, band, share)

        if size:
            two, five = (settle(judged[:, i], max(s * size, floor), share) for s in (0.02, 0.05))
            raw_two = settle(error[:, i], 0.02 * size, 1.0)
            until = np.inf if floors is None or two is None else max(3.0, two + 1.0)
            peak = peak_of(judged[t <= until, i], step[i])
            raw_peak, setpoint = peak_of(error[:, i], step[i]), abs(asked[-1, i])
            of_setpoint = peak * size / setpoint if setpoint > (10.0, 1.0)[i // 3] else None
        else:
            two = five = settle(judged[:, i], (20.0, 2.0)[i // 3], share)
            raw_two = peak = raw_peak = of_setpoint = None
        unit = "mm" if i < 3 else "deg"
        axes[i] = {
            f"step_{unit}": float(step[i]),
            "settling_time_s": two,
            "settling_time_5_s": five,
            "settling_time_raw_s": raw_two,
            "overshoot_percent": peak,
            "overshoot_raw_percent": raw_peak,
            "overshoot_setpoint_percent": of_setpoint,
            f"steady_error_{unit}": np.mean(error[steady, i]),
            f"rms_{unit}": rms(error[steady, i]),
            f"max_excursion_{unit}": excursion[i],
            f"jitter_{unit}": jitter[i],
        }

    def of(name, stepping=False):
        return [a[name] for i, a in axes.items() if step[i] or not stepping]

    def norm(x):
        return np.sqrt(np.mean(np.sum(np.square(x), axis=1)))

    thrust = np.square(run.rotor_speeds) @ vehicle.rotors.k_f
    row = {
        "settled": latest(of("settling_time_s")) is not None,
        "diverged": run.diverged,
        "settling_time_s": latest(of("settling_time_s")),
        "settling_time_5_s": latest(of("settling_time_5_s")),
        "settling_time_raw_s": latest(of("settling_time_raw_s", True)),
        "overshoot_percent": worst(of("overshoot_percent")),
        "overshoot_raw_percent": worst(of("overshoot_raw_percent")),
        "overshoot_setpoint_percent": worst(of("overshoot_setpoint_percent")),
        "rms_position_mm": norm(position[steady]),
        "rms_attitude_deg": norm(rotation[steady]),
        "steady_position_mm": np.linalg.norm(np.mean(position[steady], axis=0)),
        "steady_attitude_deg": np.linalg.norm(np.mean(rotation[steady], axis=0)),
        "max_excursion_mm": np.max(excursion[:3], where=mask[:3], initial=0.0),
        "max_excursion_deg": np.max(excursion[3:], where=mask[3:], initial=0.0),
        "jitter_position_mm": norm(fast[:, 6:9]),
        "jitter_attitude_deg": norm(fast[:, 9:]),
        "saturated_share": np.mean(run.saturated),
        "effort": np.mean(thrust) / (vehicle.mass * vehicle.gravity),
        "duration_s": run.t[-1],
    }
    return row | {f"{AXES[i]}_{name}": v for i, axis in axes.items() for name, v in axis.items()}


# Flights of one plan.


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("fullam")


def poses(position, rotation_vectors):
    return np.hstack([position, Rotation.from_rotvec(rotation_vectors).as_quat()])


def reference(rows, jump):
    """Asked poses: none, or a jump of x, y, phi and gamma at a row."""
    after = np.arange(rows) >= (rows if jump is None else jump)
    position, rotation = np.tile(START[:3], (rows, 1)), np.zeros((rows, 3))
    position[after] += [1.0, -0.3, 0.0]
    rotation[after] = np.radians([20.0, 0.0, 175.0])
    return poses(position, rotation)


def answer(asked, lag, noise, seed):
    """A flight that follows what was asked with a lag of so many rows, through noise."""
    rng = np.random.default_rng(seed)
    rows = len(asked)
    wanted, found = Rotation.from_quat(asked[:, 3:]).as_rotvec(), np.zeros((rows, 6))
    state = np.concatenate([START[:3], np.zeros(3)])
    rate = np.zeros(6)
    for k in range(rows):
        found[k] = state
        pull = np.concatenate([asked[k, :3], wanted[k]]) - state
        rate += (pull / lag**2 - 1.2 * rate / lag) + noise * 0.0002 * rng.standard_normal(6)
        state = state + rate
    return poses(found[:, :3], found[:, 3:])


CONDITIONS = {
    "calm step": (CALM, 700, 0, AXES),
    "step in gusts": (replace(CALM, force_disturbance=10.0), 700, 0, AXES),
    "step in noise": (RECORDED, 900, 0, AXES),
    "late jump": (RECORDED, 900, 400, AXES),
    "no jump": (RECORDED, 700, None, AXES),
    "calm, no jump": (CALM, 300, None, AXES),
    "masked axes": (RECORDED, 700, 100, ("x", "z", "psi", "gamma")),
    "below 1 s": (RECORDED, 90, 0, AXES),
    "no more than the jump": (CALM, 12, 10, ("z", "gamma")),
}
LAGS = (6.0, 9.0, 14.0, 20.0, 40.0, 90.0, 300.0, 8.0)
ENDS = (1.0, 1.0, 0.9, 1.0, 0.3, 1.0, 0.02, 0.0)
"""Share of the plan that each of eight flights lasts."""


def fly(condition, vehicle):
    """Eight runs of one plan: settled or not, three that diverged, one that never began."""
    weather, rows, jump, axes = CONDITIONS[condition]
    scenario = Scenario("synthetic", axes=axes)
    asked = reference(rows, jump)
    runs = []
    for lane, (lag, end) in enumerate(zip(LAGS, ENDS, strict=True)):
        rng = np.random.default_rng([lane, rows])
        length = int(end * rows)
        run = allocate_columns(length, vehicle.n_arm, vehicle.rotors.count, COLUMNS)
        run["t"] = np.arange(length) * PERIOD
        run["reference_pose"] = asked[:length]
        run["pose"] = answer(asked, lag, weather is not CALM, lane)[:length]
        run["saturated"] = rng.random(length) < 0.1 * lane
        run["rotor_speeds"] = 500.0 + 100.0 * rng.random((length, vehicle.rotors.count))
        metadata = {
            "scenario": scenario.to_dict(),
            "weather": weather.to_dict(),
            "vehicle": vehicle.to_data(),
            "outcome": "completed" if end == 1.0 else "diverged",
        }
        runs.append(Run(run, metadata))
    return runs


def judge_of(runs, vehicle):
    longest = max(runs, key=len)
    return Judge(
        AskedMotion.of(longest.t, longest.reference_pose, START),
        np.array(longest.scenario.axes_mask),
        noise_floors(longest.weather),
        vehicle.mass * vehicle.gravity,
    )


def track_in_lanes(runs, vehicle):
    """The runs side by side; what is behind their ends is the next flight's, or nobody's."""
    track = Rows.empty(Flown, max(map(len, runs)), lanes=len(runs))
    track.array[:] = np.random.default_rng(0).standard_normal(track.array.shape)
    for lane, run in enumerate(runs):
        thrust = np.square(run.rotor_speeds) @ vehicle.rotors.k_f
        parts = (run.pose, run.saturated[:, None], thrust[:, None])
        track.array[: len(run), :, lane] = np.hstack(parts)
    return track


def outcomes(runs):
    return [len(run) for run in runs], [run.diverged for run in runs]


def assert_equal(found, expected):
    assert found.keys() - {"tool_rms_mm"} == expected.keys() - {"tool_rms_mm"}
    for name, value in expected.items():
        if value is None or isinstance(value, bool):
            assert found[name] is value, name
        else:
            assert found[name] == pytest.approx(value, rel=ROUNDING, abs=ROUNDING), name


@pytest.mark.parametrize("condition", CONDITIONS)
def test_figures_in_lanes_are_those_of_whole_arrays(condition, vehicle):
    runs = fly(condition, vehicle)
    judge = judge_of(runs, vehicle)
    figures = judge.over(track_in_lanes(runs, vehicle)).figures(*outcomes(runs))
    for run, row, metrics in zip(runs, rows_of(figures), metrics_of(figures), strict=True):
        assert isinstance(metrics, Metrics)
        assert flatten(metrics) == row
        assert flatten(measure(run, vehicle)) == row, "one flight and lanes: the same bits"
        if len(run):
            assert_equal(row, expected_row(run, vehicle))
    if condition == "step in noise":
        whole = [row["settled"] for row in rows_of(figures) if not row["diverged"]]
        assert {*whole} == {True, False}, "the flights should be of both kinds"


@pytest.mark.parametrize("condition", ["late jump", "masked axes", "calm, no jump"])
def test_python_and_machine_code_give_the_same_bits(condition, vehicle):
    runs = fly(condition, vehicle)
    judge, track = judge_of(runs, vehicle), track_in_lanes(runs, vehicle)
    rows, diverged = outcomes(runs)
    lanes = judge.over(track).figures(rows, diverged).numbers
    for lane in (0, 2, 5, 6):
        alone = Rows(Flown, track.array[..., lane].copy())
        for compiled in (True, False):
            one = TrackJudge(judge, alone, compiled=compiled)
            figures = one.figures([rows[lane]], [diverged[lane]])
            assert np.array_equal(figures.numbers[0], lanes[lane], equal_nan=True), (lane, compiled)


def test_without_a_compiler_a_run_is_measured_in_python(vehicle, monkeypatch):
    run = fly("no more than the jump", vehicle)[0]
    with_compiler = measure(run, vehicle)
    for module in (deviation, program):
        monkeypatch.setattr(module, "available", lambda: False)
    assert deviation.lanes_here() == 0
    assert measure(run, vehicle) == with_compiler


def test_a_track_is_judged_again_after_it_is_written_anew(vehicle):
    first, second = (
        fly("no more than the jump", vehicle),
        fly("no more than the jump", vehicle)[::-1],
    )
    track = track_in_lanes(first, vehicle)
    judge = judge_of(first, vehicle).over(track)
    judge.figures(*outcomes(first))
    track.array[:] = track_in_lanes(second, vehicle).array
    fresh = judge_of(second, vehicle).over(track).figures(*outcomes(second))
    assert np.array_equal(judge.figures(*outcomes(second)).numbers, fresh.numbers, equal_nan=True)


def test_fewer_flights_than_lanes(vehicle):
    runs = fly("no more than the jump", vehicle)
    rows, diverged = outcomes(runs)
    judge = judge_of(runs, vehicle).over(track_in_lanes(runs, vehicle))
    figures, some = judge.figures(rows, diverged), judge.figures(rows[:3], diverged[:3])
    assert np.array_equal(some.numbers, figures.numbers[:3], equal_nan=True)


def test_threads_share_a_judge(vehicle):
    runs = fly("step in noise", vehicle)
    judge = judge_of(runs, vehicle)
    expected = judge.over(track_in_lanes(runs, vehicle)).figures(*outcomes(runs)).numbers
    tracks = [judge.over(track_in_lanes(runs, vehicle)) for _ in range(4)]

    def judged_again(track):
        return [track.figures(*outcomes(runs)).numbers for _ in range(4)]

    with ThreadPoolExecutor(4) as pool:
        for numbers in pool.map(judged_again, tracks):
            assert np.array_equal(numbers, 4 * [expected], equal_nan=True)


def test_integrals_are_of_the_norms_of_the_response(vehicle):
    runs = fly("late jump", vehicle)
    judge = judge_of(runs, vehicle).over(track_in_lanes(runs, vehicle))
    figures = judge.figures(*outcomes(runs))
    for lane in (0, 2, 5):
        response = Response.of(runs[lane])
        for name, signals in (("position", response.error[:, :3]), ("attitude", response.rotation)):
            expected = PERIOD * np.linalg.norm(signals, axis=1).sum()
            assert figures[f"integral_{name}"][lane] == pytest.approx(expected, rel=ROUNDING)


def test_a_track_of_another_length_is_refused(vehicle):
    runs = fly("no more than the jump", vehicle)
    track = Rows.empty(Flown, 11, lanes=8)
    with pytest.raises(ValueError, match="the track has 11 rows, the plan 12 periods"):
        judge_of(runs, vehicle).over(track)
