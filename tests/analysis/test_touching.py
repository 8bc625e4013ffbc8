"""What the tool did to the world, told."""

from dataclasses import replace

import pytest

from fullam.analysis.diagnosis import diagnose
from fullam.analysis.metrics import measure
from fullam.analysis.pushed import hover_of
from fullam.analysis.touching import contact_of, contact_warning, pushed_axes, unsettled_axes
from fullam.cli import main
from fullam.simulation.scenarios.scenario import load_scenario
from fullam.simulation.simulate import prepare, simulate

PUSH = replace(load_scenario("push-wall"), duration=7.0)
BEHIND = replace(PUSH, reference=replace(PUSH.reference, position=(0.1, 0.0, 1.0)))
"""A target that the wall is in the way of."""


def test_a_contact_is_told_by_its_time_and_force():
    run = simulate(PUSH, "hybrid-force", driver="fused", calm=True)
    found = contact_of(run)
    assert 3.0 < found.first < 5.0 and found.share > 0.9 and found.touches <= 2
    assert found.mean == pytest.approx(3.0, abs=0.2) and found.largest > found.mean
    assert contact_warning(run) is None


def test_a_wall_nearby_is_none_of_the_loops_margins_and_what_holds_an_axis_off_is_said():
    """The hover that margins are read from met the wall in its fourth second: "unstable"."""
    near = replace(PUSH, world=(replace(PUSH.world[0], point=(0.63, 0.0, 0.0)),))
    assert hover_of(prepare(near, "hybrid-force", calm=True)).scenario.world == ()
    (found,) = diagnose(simulate(BEHIND, "dc-pid", driver="fused", calm=True))
    assert found.kind == "contact" and "x (" in found.what and "hybrid-force" in found.remedy


def test_axes_along_which_a_law_pushes_need_not_settle():
    run = simulate(PUSH, calm=True, driver="fused")
    assert run.controller == "hybrid-force", "the scenario's own"
    metrics = measure(run)
    assert pushed_axes(run) == ("x",) and unsettled_axes(run, metrics) == ()
    off = replace(PUSH, reference=replace(PUSH.reference, position=(0.0, 0.3, 1.0)), duration=3.6)
    assert not metrics.settled and diagnose(run) == []
    missed = simulate(off, "hybrid-force", calm=True, driver="fused")
    assert pushed_axes(missed) == (), "it has not touched yet"


def test_a_law_that_knows_of_no_contact_is_told_of():
    run = simulate(BEHIND, "dc-pid-plus", driver="fused", calm=True)
    warning = contact_warning(run)
    assert "dc-pid-plus touched" in warning and "hybrid-force" in warning


def test_what_touches_nothing_is_not_spoken_of():
    assert contact_of(simulate("position-1", driver="fused", calm=True)) is None
    far = replace(PUSH, duration=1.0)
    run = simulate(far, "dc-pid-plus", driver="fused", calm=True)
    assert contact_of(run) is None and contact_warning(run) is None


def test_the_command_line_says_so(capsys):
    line = ["run", "push-wall", "--calm", "--driver", "fused"]
    assert main(line) == 0
    said = capsys.readouterr().out
    assert "hybrid-force" in said and "contact: touched from" in said and "SETTLED" not in said
