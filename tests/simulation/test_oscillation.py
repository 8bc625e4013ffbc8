"""A flight that swings is not called well: synthetic errors with a known answer, and flights."""

import numpy as np
import pytest

import fullam
from fullam.simulation.oscillation import BANDS, Swing, swing
from fullam.simulation.record.run import Run

PERIOD, ROWS = 0.01, 400
T = PERIOD * np.arange(ROWS)
ALL = np.ones(6, dtype=bool)
STILL = np.zeros((ROWS, 1))


def error(axis, signal):
    e = np.zeros((ROWS, 6))
    e[:, axis] = signal
    return e


@pytest.mark.parametrize(("axis", "size"), [(1, 0.2), (4, np.radians(12.0))])
def test_a_steady_line_is_named_with_axis_amplitude_and_frequency(axis, size):
    found = swing(error(axis, 0.03 + size * np.sin(2.0 * np.pi * 2.3 * T)), PERIOD, ALL, STILL)
    assert found is not None
    assert found.axis == axis
    assert abs(found.frequency - 2.3) <= 0.5 / (ROWS * PERIOD)  # half a bin
    # Hann's window keeps a line between two bins within 1 % in five of them.
    assert abs(found.amplitude - size) < 0.01 * size
    assert "2.25 Hz" in str(found)


def test_what_is_no_swing(rng):
    line, large = np.sin(2.0 * np.pi * 2.3 * T), 3.0 * BANDS[1]
    nothing = {
        "below the band": 0.9 * BANDS[1] * line,
        "decays": large * np.exp(-2.0 * T) * line,
        "a drift": large * T,
        "two periods": large * np.sin(2.0 * np.pi * 2.0 * T / T[-1]),
        "broad": 0.5 * large * rng.standard_normal(ROWS),
    }
    for what, signal in nothing.items():
        assert swing(error(3, signal), PERIOD, ALL, STILL) is None, what
    assert swing(error(3, large * line), PERIOD, ALL, STILL) is not None
    assert swing(error(3, large * np.exp(0.5 * T) * line), PERIOD, ALL, STILL) is not None


def test_what_was_asked_for_or_is_not_controlled_is_no_swing():
    line = np.sin(2.0 * np.pi * 2.3 * T)
    e = error(3, 3.0 * BANDS[1] * line)
    assert swing(e, PERIOD, ALL, 0.2 * line[:, None]) is None
    assert swing(e, PERIOD, np.arange(6) != 3, STILL) is None
    other = np.sin(2.0 * np.pi * 0.9 * T)[:, None]
    assert swing(e, PERIOD, ALL, other) is not None


def test_gusts_in_step_widen_the_band_at_their_rate_only():
    at_rate = error(5, 1.2 * BANDS[1] * np.sin(2.0 * np.pi * 2.0 * T))
    assert swing(at_rate, PERIOD, ALL, STILL, gust_interval=1.0) is None
    assert swing(at_rate, PERIOD, ALL, STILL) is not None
    beside = error(5, 1.2 * BANDS[1] * np.sin(2.0 * np.pi * 2.5 * T))
    assert swing(beside, PERIOD, ALL, STILL, gust_interval=1.0) is not None
    assert swing(2.0 * at_rate, PERIOD, ALL, STILL, gust_interval=1.0) is not None


def test_too_short_for_an_answer():
    assert swing(np.ones((5, 6)), PERIOD, ALL, np.zeros((5, 1))) is None


def test_before_a_divergence_a_swing_may_have_begun_late():
    late = np.where(T > 2.0, 6.0 * BANDS[1] * np.sin(2.0 * np.pi * 2.5 * T), 0.0)
    late[: ROWS // 4] = BANDS[1] * np.sin(2.0 * np.pi * 2.5 * T[: ROWS // 4])
    assert swing(error(4, late), PERIOD, ALL, STILL) is None
    found = swing(error(4, late), PERIOD, ALL, STILL, steady=False)
    assert found == Swing(4, found.frequency, found.amplitude)


@pytest.mark.parametrize(
    ("controller", "choices", "axis"),
    [
        ("dc-pid-plus", {"simulation": {"estimator": "first-order"}}, "about z"),
        ("pid", {"calm": True}, "about y"),
    ],
)
def test_the_flights_that_swing(controller, choices, axis, tmp_path):
    run = fullam.simulate("hextilt-step", controller, driver="fused", throw=False, **choices)
    assert run.outcome == "oscillating"
    assert run.oscillating
    assert not run.well
    assert axis in run.metadata["reason"]
    assert "Hz" in run.metadata["reason"]
    assert len(run) == 601
    assert Run.load(run.save(tmp_path / "swings.npz")).outcome == "oscillating"


def test_calm_and_tilted_behind_the_wrong_estimator():
    """The hextilt held at 10 deg without noise: nothing makes the law cautious."""
    scenario = fullam.Scenario(
        "held", fullam.Step((0.0, 0.0, 2.0), (10.0, 0.0, 0.0)), vehicle="hextilt",
        initial_position=(0.0, 0.0, 2.0), duration=10.0,
    )  # fmt: skip
    choices = {"calm": True, "driver": "fused", "throw": False}
    well = fullam.simulate(scenario, "dc-pid-plus", **choices)
    assert well.outcome == "completed"
    simulation = {"estimator": "first-order"}
    bad = fullam.simulate(scenario, "dc-pid-plus", simulation=simulation, **choices)
    assert bad.outcome in ("oscillating", "diverged")


@pytest.mark.parametrize("scenario", ["position-3", "tilt-hover-1", "task-2", "quadrotor-arm"])
@pytest.mark.parametrize("controller", ["dc-pid", "dc-pid-plus"])
def test_good_flights_in_the_paper_s_weather_are_well(scenario, controller):
    plan = fullam.prepare(scenario, controller)
    outcomes = [run.outcome for run in fullam.fly_many(plan, range(16), threads=1)]
    assert outcomes == ["completed"] * 16
