"""Each law flies with the estimator that it is made for, unless told otherwise, everywhere."""

import pytest

import fullam
from fullam.analysis.judged import driver_of
from fullam.analysis.tuned_gains import contender_name, tuned_names, tuned_settings
from fullam.control.controllers import (
    CONTROLLERS,
    controller_class,
    controller_names,
    recommended_estimator,
)
from fullam.control.estimators import estimator_names
from fullam.control.law import KernelLaw
from fullam.control.pid import Pid
from fullam.simulation.record.refly import plan_of, refly

OWN = {"dc-pid-plus": "kalman", "hybrid-force": "kalman", "admittance": "kalman"}


@pytest.mark.parametrize("name", controller_names())
def test_a_law_flies_with_its_own_estimator(name):
    own = OWN.get(name, "first-order")
    assert recommended_estimator(name) == controller_class(name).estimator == own
    assert fullam.SimulationSettings().estimator is None
    assert fullam.prepare("task-1", name).simulation.estimator == own
    other = {"estimator": "truth"}
    assert fullam.prepare("task-1", name, simulation=other).simulation.estimator == "truth"
    assert own in estimator_names()


def test_a_record_names_it_and_flies_again_with_it():
    scenario = fullam.Scenario("short", duration=0.05)
    run = fullam.simulate(scenario, "dc-pid-plus", driver="fused")
    assert run.metadata["simulation"]["estimator"] == "kalman"
    assert plan_of(run).simulation == run.simulation
    assert (refly(run).pose == run.pose).all()


def test_a_law_of_one_s_own_declares_its_own(monkeypatch):
    monkeypatch.setattr(
        "fullam.control.controllers.CONTROLLERS", type(CONTROLLERS)("controller", CONTROLLERS)
    )

    class Keen(Pid):
        estimator = "truth"

    fullam.register("keen")(Keen)
    assert fullam.prepare("task-1", "keen").simulation.estimator == "truth"
    assert KernelLaw.estimator == "first-order"


def test_names_of_contenders_and_tuned_gains_follow():
    assert contender_name("dc-pid-plus", None) == contender_name("dc-pid-plus", "kalman")
    assert contender_name("dc-pid-plus", "kalman") == "dc-pid-plus"
    assert contender_name("dc-pid-plus", "first-order") == "dc-pid-plus@first-order"
    assert contender_name("dc-pid", "kalman") == "dc-pid@kalman"
    assert "dc-pid" in tuned_names()
    assert tuned_settings("dc-pid") == tuned_settings("dc-pid", "first-order")
    assert driver_of("dc-pid-plus", None) == driver_of("dc-pid-plus", "kalman")


def test_contenders_of_a_campaign_fly_with_their_own():
    pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")
    from fullam.analysis.campaign import Campaign

    names = ("dc-pid", "dc-pid-plus", "dc-pid-plus@first-order")
    campaign = Campaign(("task-1",), names, (0,))
    flown = [
        campaign.plan(campaign.scenarios[0], contender).simulation.estimator
        for contender in campaign.contenders
    ]
    assert flown == ["first-order", "kalman", "first-order"]
    settings = fullam.SimulationSettings(estimator="truth")
    told = Campaign(("task-1",), names[:2], (0,), simulation=settings)
    plans = [told.plan(told.scenarios[0], contender) for contender in told.contenders]
    assert [plan.simulation.estimator for plan in plans] == ["truth", "truth"]
