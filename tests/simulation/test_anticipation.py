"""Anticipation takes known lags off a commanded motion, and leaves the rest alone."""

from dataclasses import replace

import numpy as np
import pytest

import fullam
from fullam.control.first_order import FirstOrder
from fullam.control.signals import Estimate
from fullam.control.truth import Truth
from fullam.dynamics.pose_space import pose_from_euler
from fullam.dynamics.so3 import boxplus
from fullam.numbers.records import Rows, flat, record
from fullam.simulation.anticipation import STILL, Anticipation, advance
from fullam.simulation.motions.blending import blend_jumps
from fullam.simulation.motions.references import Step, tabulate

T = np.arange(301) * 0.01
START = pose_from_euler(np.zeros(3), np.zeros(3))

ROW_60 = [
    *(0.043793309873077724, 0.021896654936538862, -0.008758661974615563),
    *(0.011095152157823383, -0.008092421522088425, 0.002789816944506726),
    *(0.08251805381501309, 0.041259026907506546, -0.01650361076300233),
    *(0.02090616958385977, -0.015248239436316258, 0.0052567450468586074),
    *(0.009256040154250626, -0.006751036622851209, 0.0023273820218098497),
]
SUMS = [
    *(4.555555555312823, 2.2777777776564117, 0.9111111110625661),
    *(1.1541621813035476, 0.8418061098310927, 0.29020793625070507),
    *(11.843539522720388, 5.921769761360194, 2.3687079045440815),
    *(3.0005924072106342, 2.1885286681719807, 0.7544829869946401),
    *(0.886734463489126, 0.6467535509783083, 0.22296466027062936),
]
"""Of the numpy implementation that stood here before: row 60, and absolute sums of all rows that
do not count as zero."""


@pytest.fixture
def table():
    step = tabulate(Step((1.0, 0.5, -0.2), (15.0, -10.0, 5.0)), T, START)
    return blend_jumps(step, START, 2.6, 8.0)


def test_the_estimate_of_a_vehicle_on_the_reference_becomes_the_reference(table):
    """The filter sees the reference late; advanced, it stands on it.

    Rounding of two maps; rows that count as zero leave up to `STILL`.
    """
    anticipation = Anticipation.of(table, FirstOrder(), 0.035)
    seen = Rows(Estimate, np.hstack(FirstOrder().as_seen(table.pose, table.velocity))).to_list()
    ahead = anticipation.rows.to_list()
    for k in range(0, 301, 10):
        now, atol = advance(seen[k], ahead[k]), 1e-12 if any(flat(ahead[k])) else STILL
        np.testing.assert_allclose(now.pose.position, table.pose[k, :3], atol=atol)
        cosine = abs(np.dot(now.pose.attitude, table.pose[k, 3:]))
        assert cosine == pytest.approx(1.0, abs=1e-12)
        np.testing.assert_allclose(np.concatenate(now.velocity), table.velocity[k], atol=atol)


def test_the_thrust_turns_with_the_platform():
    """By R^T w lag in {A}: what the reference turns in a short lag, to second order in it."""
    lag, start = 0.01, pose_from_euler(np.zeros(3), np.array([0.5, -0.6, 0.9]))
    step = tabulate(Step((1.0, 0.5, -0.2), (-15.0, 10.0, -50.0)), T, start)
    table = blend_jumps(step, start, 2.6, 8.0)
    ahead = Anticipation.of(table, Truth(), lag).rows.to_list()
    for k in (20, 50, 80):
        now = record(Estimate, np.append(table.pose[k], table.velocity[k]))
        later = np.dot(boxplus(now.pose.attitude, ahead[k].turn), table.pose[k + 1, 3:])
        # By at most half the angular acceleration times lag^2; the angle's half, squared.
        assert 1.0 - abs(later) < 0.5 * (0.25 * 8.0 * lag**2) ** 2
        assert np.linalg.norm(ahead[k].turn) > 0.003


def test_it_is_what_it_always_was(table):
    """To rounding; the sums add up 301 rows."""
    rows = Anticipation.of(table, FirstOrder(), 0.035).rows
    np.testing.assert_allclose(rows.array[60], ROW_60, atol=1e-13)
    sums = np.abs(rows.array).sum(axis=0)
    np.testing.assert_allclose(sums, SUMS, rtol=1e-12, atol=1e-12)


def test_python_and_machine_code_tabulate_the_same_bits(table, monkeypatch):
    compiled = Anticipation.of(table, FirstOrder(), 0.035)
    monkeypatch.setattr("fullam.numbers.program.available", lambda: False)
    python = Anticipation.of(table, FirstOrder(), 0.035)
    np.testing.assert_array_equal(python.rows.array, compiled.rows.array)


def test_the_table_cannot_be_written(table):
    """Plans are shared by threads."""
    rows = Anticipation.of(table, FirstOrder(), 0.035).rows
    with pytest.raises(ValueError, match="read-only"):
        rows.array[0] = 1.0


def test_an_estimator_without_lag_is_left_alone(table):
    anticipation = Anticipation.of(table, Truth(), 0.0)
    assert not anticipation.moves
    assert not anticipation.rows.array.any()
    np.testing.assert_array_equal(anticipation.reference.acceleration, table.acceleration)


def test_a_reference_at_rest_needs_nothing():
    table = tabulate(Step((0.0, 0.0, 0.0)), T, START)
    assert not Anticipation.of(table, FirstOrder(), 0.035).moves


def test_late_and_slow_poses_are_anticipated_too():
    """A commanded motion does not overshoot for the age of its poses, which is known."""
    simulation = fullam.SimulationSettings(pose_period=0.02, delay=0.02)
    for estimator in ("first-order", "truth"):
        chosen = replace(simulation, estimator=estimator)
        run = fullam.simulate("position-1", calm=True, simulation=chosen)
        without = fullam.simulate(
            "position-1", calm=True, simulation=chosen, shaping={"anticipate": False}
        )
        assert fullam.measure(run).overshoot_percent < 1.0
        assert fullam.measure(run).overshoot_percent < fullam.measure(without).overshoot_percent


NO_LIMITS = {"max_acceleration": None, "max_angular_acceleration": None}
TURN = fullam.Step((0, 0, 1), (10, 0, 0), at=0.2)
SIDEWAYS = fullam.Step((1, 0, 1), at=0.2)


@pytest.mark.parametrize(
    ("reference", "limits", "anticipated"),
    [
        (TURN, NO_LIMITS, False),
        (TURN, {"max_angular_acceleration": None}, False),
        (TURN, {"max_acceleration": None}, True),
        (SIDEWAYS, {"max_acceleration": None}, False),
        (SIDEWAYS, {"max_angular_acceleration": None}, True),
        (SIDEWAYS, {}, True),
    ],
)
def test_jumps_that_are_left_in_are_not_anticipated(reference, limits, anticipated):
    scenario = fullam.Scenario("jump", reference=reference, duration=1.0)
    a, b = (
        fullam.simulate(scenario, calm=True, shaping=limits | {"anticipate": wanted})
        for wanted in (True, False)
    )
    assert np.array_equal(a.pose, b.pose) is not anticipated


def test_a_smooth_reference_is_anticipated_without_limits_too():
    """It has no jumps, so a limit on their acceleration makes no difference."""
    scenario = fullam.Scenario(
        "circle",
        initial_position=(1.0, 0.0, 1.0),
        reference=fullam.Circle((0.0, 0.0, 1.0), radius=1.0, period=6.0),
        duration=2.0,
    )
    limited = fullam.simulate(scenario, calm=True)
    free = fullam.simulate(scenario, calm=True, shaping=NO_LIMITS)
    late = fullam.simulate(scenario, calm=True, shaping=NO_LIMITS | {"anticipate": False})
    np.testing.assert_array_equal(free.pose, limited.pose)
    errors = [np.linalg.norm(r.pose[-1, :3] - r.reference_pose[-1, :3]) for r in (free, late)]
    assert errors[0] < 0.5 * errors[1]


def test_it_is_what_keeps_the_step_from_overshooting():
    scenario = fullam.load_scenario("position-1")
    with_it = fullam.measure(fullam.simulate(scenario, calm=True))
    without = fullam.measure(fullam.simulate(scenario, calm=True, shaping={"anticipate": False}))
    assert with_it.overshoot_percent < 0.5 < without.overshoot_percent
