"""Margins before take-off: known loops, the docstring's figures, delay that is really too much."""

import numpy as np
import pytest

import fullam
from fullam.analysis import margins, pushed
from fullam.analysis.margins import (
    LoopMargins,
    axis_margin,
    dies_down,
    estimator_cost,
    loop_margins,
    margin_warning,
    open_loop,
    ringing_of,
)
from fullam.analysis.pushed import Answers, answers, hover_of
from fullam.cli import main
from fullam.exceptions import NonFiniteWrench


def plan_of(scenario="task-2", controller="dc-pid-plus", calm=True, **choices):
    return fullam.prepare(scenario, controller, calm=calm, **choices)


def closed(gain, rows=400):
    """Answers of the loop L = gain / (z (z - 1)): an integrator with one more delay."""
    h, ran = np.zeros(rows), np.zeros(rows)
    x = 0.0
    ran[0] = 1.0  # the push itself
    for k in range(1, rows):
        x += ran[k - 2] if k > 1 else 0.0
        h[k] = -gain * x
        ran[k] = h[k]
    return h


def test_an_integrator_with_a_delay_has_the_margins_of_the_book():
    """L = g / (z (z - 1)): phase 90 deg less 1.5 periods, gain 1/g at the golden limit."""
    period, gain = 0.01, 0.2
    found = axis_margin(Answers(period, (2,), closed(gain)[:, None]), 0)
    w = 2.0 * np.arcsin(0.5 * gain) / period  # |z - 1| = g
    phase = 90.0 - np.degrees(1.5 * w * period)
    # The grid of frequencies is 0.15 % fine.
    assert abs(found.crossover - w) < 0.003 * w
    assert abs(found.phase - phase) < 0.2
    assert abs(found.delay - np.radians(phase) / w) < 0.005 * found.delay
    # Phase -180 deg at w T = pi/3, where |L| = g.
    assert abs(found.gain - 1.0 / gain) < 0.005 / gain
    assert found.enough


def test_the_open_loop_comes_back():
    h, angles = closed(0.2), np.geomspace(0.02, 3.0, 50)
    z = np.exp(1j * angles)
    assert np.allclose(open_loop(h, angles), 0.2 / (z * (z - 1.0)), rtol=1e-6)


def test_a_loop_that_does_not_come_to_rest_has_no_margin():
    assert dies_down(closed(0.9))
    assert not dies_down(closed(1.0))  # the limit: a root at exp(+-i pi/3)
    found = axis_margin(Answers(0.01, (4,), closed(1.0, 200)[:, None]), 0)
    assert not found.stable
    assert not found.enough
    assert found.phase is found.delay is None
    assert abs(found.ringing - 1.0 / 0.06) < 0.2  # pi/3 a period of 10 ms; a bin is 0.06 Hz
    assert not dies_down(np.full(100, np.nan))
    assert ringing_of(np.full(100, np.nan), 0.01) == 0.0
    assert "runs away" in str(axis_margin(Answers(0.01, (0,), np.arange(200.0)[:, None]), 0))


def test_the_figures_of_dc_pid_plus():
    """Its docstring's, with 5 ms to spare: the estimator's 1 % and rounding to whole degrees."""
    found = loop_margins(plan_of(simulation={"estimator": "truth"}), spare=0.005)
    for axes, phase, gain, delay in (
        (found.axes[:3], 45.0, 4.7, 0.037),
        (found.axes[3:], 38.0, 4.0, 0.027),
    ):
        for axis in axes:
            assert abs(axis.phase - phase) < 0.06 * phase
            assert abs(axis.gain - gain) < 0.06 * gain
            assert abs(axis.delay - delay) < 0.06 * delay
    behind_kalman = loop_margins(plan_of(), spare=0.005)
    assert behind_kalman.enough
    assert abs(behind_kalman.delay - 0.027) < 0.002


def test_delay_within_the_margin_is_borne_and_delay_beyond_it_is_not():
    found = loop_margins(plan_of(controller="dc-pid"))
    assert found.enough
    assert 0.03 < found.delay < 0.05
    assert loop_margins(plan_of(controller="dc-pid", simulation={"delay": 0.03})).stable
    late = loop_margins(plan_of(controller="dc-pid", simulation={"delay": 0.05}))
    assert not late.stable
    assert late.delay is None


@pytest.mark.parametrize(
    ("scenario", "controller", "calm", "choices"),
    [
        ("hextilt-step", "pid", False, {}),
        ("hextilt-step", "dc-pid-plus", True, {"simulation": {"estimator": "first-order"}}),
        ("task-2", "dc-pid", True, {"settings": {"attitude_gains": (200.0, 0.0, 5.0)}}),
    ],
)
def test_a_loop_without_a_margin_is_told(scenario, controller, calm, choices):
    line = margin_warning(plan_of(scenario, controller, calm, **choices))
    assert line.startswith(f"no margin: {controller} with the estimator first-order on ")
    assert "rotation about" in line


@pytest.mark.parametrize("scenario", fullam.scenario_names())
@pytest.mark.parametrize("controller", ["dc-pid", "dc-pid-plus", "backstepping", "computed-wrench"])
def test_nobody_is_warned_of_the_recommended_pairs(scenario, controller):
    assert margin_warning(plan_of(scenario, controller, calm=False)) is None


def test_python_hears_the_same_answers(monkeypatch):
    """A law that is no kernel is flown by Python; here one that machine code flies as well."""
    monkeypatch.setattr(pushed, "SETTLE", 0.05)
    monkeypatch.setattr(pushed, "HORIZON", 0.25)
    plan = hover_of(plan_of())
    fast = answers(plan)
    monkeypatch.setattr(pushed, "as_kernels", lambda plan: False)
    slow = answers(plan)
    assert fast.axes == slow.axes == tuple(range(6))
    # The answer is 0.2 of the push; the push is 1e-5 of the command, known to 1e-15 of it.
    assert np.abs(fast.commands - slow.commands).max() < 1e-8
    assert np.abs(fast.commands).max() > 0.1


def test_another_estimator_costs_what_the_line_says():
    assert estimator_cost(plan_of()) is None
    line = estimator_cost(plan_of(simulation={"estimator": "first-order"}))
    assert line.startswith(
        "dc-pid-plus is made for the estimator kalman: with first-order rotation"
    )
    assert "is unstable" in line
    assert "with kalman rotation" in line
    assert "ms of delay to spare" in line


def test_a_law_that_python_flies_is_not_flown_before_its_flight(monkeypatch):
    monkeypatch.setattr(margins, "as_kernels", lambda plan: False)
    assert margin_warning(plan_of("hextilt-step", "pid")) is None
    line = estimator_cost(plan_of(simulation={"estimator": "first-order"}))
    assert line == "dc-pid-plus is made for the estimator kalman"


def test_a_law_that_returns_nan_is_told(monkeypatch):
    def refuse(plan):
        raise NonFiniteWrench([np.nan] * 6)

    monkeypatch.setattr(margins, "answers", refuse)
    assert "is not finite" in margin_warning(plan_of())


def test_margins_as_json_and_as_a_table():
    found = loop_margins(plan_of("quadrotor-arm", "dc-pid"))
    assert isinstance(found, LoopMargins)
    assert [axis.axis for axis in found.axes] == [2, 3, 4, 5]
    data = found.to_dict()
    assert data["axes"]["rotation about z"]["phase"] == found.axes[3].phase
    assert len(found.rows()) == 4


def test_check_tells_the_margins(capsys):
    few = ("--samples", "5")
    assert main(["check", "fullam", "--controller", "dc-pid-plus", *few]) == 0
    out = capsys.readouterr().out
    assert "dc-pid-plus with the estimator kalman, margins in hover" in out
    assert "margins: enough" in out
    assert main(["check", "hextilt", "--controller", "pid", *few]) == 1
    assert "margins: NONE: rotation about" in capsys.readouterr().out
    late = ("--estimator", "first-order", "--delay", "0.06", "--control-rate", "200")
    assert main(["check", "fullam", "--controller", "dc-pid", *late, "--json", *few]) == 1
    assert '"enough": false' in capsys.readouterr().out
