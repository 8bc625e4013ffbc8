"""Why a flight failed: every cause is found where it was put, and none in a good flight."""

from dataclasses import replace

import pytest

import fullam
from fullam.analysis.diagnosis import diagnose
from fullam.cli import main
from fullam.exceptions import Diverged
from fullam.simulation.record.run import Run

HOME = (0.0, 0.0, 2.0)


def held(tilt, vehicle="hextilt", **parts):
    target = fullam.Step(HOME, (tilt, 0.0, 0.0))
    return fullam.Scenario("held", target, vehicle=vehicle, initial_position=HOME, **parts)


def fly(scenario, controller, **choices):
    return fullam.simulate(scenario, controller, driver="fused", throw=False, **choices)


def kinds(run):
    return {finding.kind: finding for finding in diagnose(run)}


def test_tilt_beyond_what_the_vehicle_holds():
    found = kinds(fly(held(35.0), "dc-pid-plus"))
    assert "35.0 deg is asked for" in found["reach"].what
    assert "can be held" in found["reach"].what
    assert "deg or less" in found["reach"].remedy
    assert "deg of tilt" in found["governor"].what
    stubborn = kinds(fly(held(35.0), "dc-pid-plus", simulation={"governor": "off"}))
    assert "governor" not in stubborn
    assert "speed for up to" in stubborn["saturation"].what
    assert "s at a stretch from" in stubborn["saturation"].what
    assert "reach" not in kinds(fly(held(10.0), "dc-pid-plus"))


def test_a_vehicle_that_leans_saturates_on_one_side():
    """More mass under one side than the rotors bear: those are at the largest speed."""
    wind = replace(fullam.weather("calm"), moment_disturbance=3.0, gust_duration=0.4)
    run = fly(held(0.0, "fullam"), "dc-pid-plus", weather=wind)
    assert "side)" in kinds(run)["saturation"].what


@pytest.mark.parametrize("controller", ["dc-pid", "pid"])
def test_delay_beyond_the_margin(controller):
    run = fly("task-1", controller, simulation={"delay": 0.06})
    assert run.diverged
    found = kinds(run)["delay"]
    assert "arrives 60 ms late and the loop bears" in found.what
    assert "kalman" in found.remedy
    assert "delay" not in kinds(fly("task-1", controller, simulation={"delay": 0.01}))


def test_a_law_without_a_margin_and_with_a_strange_estimator():
    found = kinds(fly("hextilt-step", "pid"))
    assert "pid with first-order has no margin on hextilt" in found["margin"].what
    assert "before it diverged the rotation about" in found["swing"].what
    assert "Hz" in found["swing"].what
    strange = {"simulation": {"estimator": "first-order"}}
    swung = kinds(fly("hextilt-step", "dc-pid-plus", **strange))
    assert "kalman" in swung["estimator"].remedy
    assert "swing" in swung
    calm = kinds(fly("hextilt-step", "dc-pid-plus", calm=True, **strange))
    assert "kalman" in calm["margin"].remedy


def test_gusts_beyond_the_reserve_but_not_kicks():
    weather = replace(fullam.weather("paper"), force_disturbance=40.0, gust_duration=0.5)
    run = fly("task-1", "dc-pid-plus", weather=weather)
    assert run.diverged
    assert "0.50 s at a stretch from 1.00 s on" in kinds(run)["gusts"].what
    short = replace(weather, gust_duration=0.01)
    assert "gusts" not in kinds(fly("task-1", "dc-pid-plus", weather=short))


@pytest.mark.parametrize("scenario", ["position-1", "task-2", "hextilt-step"])
def test_nothing_is_found_in_a_good_flight(scenario):
    run = fly(scenario, "dc-pid-plus")
    assert run.well
    assert diagnose(run) == []


def test_an_axis_that_does_not_settle_is_named_where_nothing_else_is():
    run = fly("hextilt-step", "dc-pid")
    assert run.well
    assert not fullam.measure(run).settled
    (found,) = diagnose(run)
    assert found.kind == "unsettled"
    assert "deg RMS" in found.what


def test_the_record_alone_is_enough(tmp_path):
    run = fly("task-1", "dc-pid", simulation={"delay": 0.06})
    again = Run.load(run.save(tmp_path / "late.npz"))
    assert fullam.diagnose(again) == diagnose(run)


def test_a_law_that_is_not_registered_here_keeps_the_other_findings(monkeypatch):
    run = fly("hextilt-step", "pid")
    unknown = Run(dict(run.columns), run.metadata | {"controller": "somebody's"})
    found = {finding.kind for finding in diagnose(unknown)}
    assert "margin" not in found
    assert {"swing", "saturation"} <= found


def test_diverged_says_where_to_look():
    with pytest.raises(Diverged, match=r"fullam\.diagnose\(error\.run\)") as caught:
        fullam.simulate("hextilt-step", "pid", driver="fused")
    assert fullam.diagnose(caught.value.run)[0].kind == "margin"


def test_run_warns_flies_and_explains(capsys):
    late = ["--driver", "fused", "--estimator", "first-order"]
    assert main(["run", "hextilt-step", "--controller", "dc-pid-plus", *late]) == 1
    out, err = capsys.readouterr()
    assert "dc-pid-plus is made for the estimator kalman: with first-order" in err
    assert "OSCILLATING, dc-pid-plus: rotation about z swings by" in out
    assert "fly it with the estimator it is made for, kalman" in out
    assert main(["compare", "hextilt-step", "--controllers", "pid,dc-pid-plus", *late[:2]]) == 1
    out, err = capsys.readouterr()
    assert "no margin: pid with the estimator first-order on hextilt" in err
    assert "DIVERGED, pid: at t =" in out
    assert "dc-pid-plus" not in err
    assert main(["run", "hextilt-step", "--controller", "dc-pid-plus", *late[:2]]) == 0
    out, err = capsys.readouterr()
    assert "dc-pid-plus is made" not in err
    assert "NOT SETTLED" not in out


def test_run_tells_findings_as_json(capsys):
    assert main(["run", "hextilt-step", "--controller", "pid", "--driver", "fused", "--json"]) == 1
    out = capsys.readouterr().out
    assert '"kind": "margin"' in out
    assert '"remedy"' in out
