"""Motions of one's own: any object with the method flies everywhere, and its record without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from altered_vehicles import without_arm

import fullam
from fullam.analysis.campaign import Campaign
from fullam.analysis.foresight import reach_warning
from fullam.checks import Checker
from fullam.exceptions import ScenarioError
from fullam.simulation.many import fly_many
from fullam.simulation.motions import motion_rows
from fullam.simulation.motions.arm_motion import ArmTable
from fullam.simulation.motions.motion_rows import ArmRows, ReferenceRows, pack, unpack
from fullam.simulation.motions.references import ReferenceTable
from fullam.simulation.record.run import COLUMNS, Run
from fullam.simulation.simulate import fly_by_python, prepare

CHECK = Checker("rows", ScenarioError)


class Eight:
    """A figure of eight, as one writes it."""

    def __init__(self, size=0.2):
        self.size = size

    def tabulate(self, t, initial_pose):
        pose = np.tile(initial_pose, (t.size, 1))
        velocity, acceleration = np.zeros((t.size, 6)), np.zeros((t.size, 6))
        for axis, w in ((0, 1.0), (1, 2.0)):
            pose[:, axis] += self.size * np.sin(w * t)
            velocity[:, axis] = self.size * w * np.cos(w * t)
            acceleration[:, axis] = -self.size * w**2 * np.sin(w * t)
        return ReferenceTable(t, pose, velocity, acceleration)


class Wave:
    """All joints of the arm, each a little later."""

    def tabulate(self, t, initial):
        phase = t[:, None] - 0.3 * np.arange(initial.size)
        theta = initial + 0.2 * np.sin(phase)
        return ArmTable(theta, 0.2 * np.cos(phase), -0.2 * np.sin(phase))


@pytest.fixture(scope="module")
def scenario():
    return fullam.Scenario(
        "eight",
        reference=Eight(),
        arm_motion=Wave(),
        initial_arm_deg=(-90, 0, -45, 0),
        duration=0.5,
    )


def test_it_flies_under_every_driver_and_again_from_its_record(scenario, tmp_path):
    plan = prepare(scenario, "dc-pid-plus", seed=4)
    python = fly_by_python(plan)
    machine = fullam.simulate(scenario, "dc-pid-plus", seed=4, driver="fused")
    (lane,) = fly_many(plan, [4])
    for name in COLUMNS:
        np.testing.assert_array_equal(machine.columns[name], lane.columns[name])
    # Rounding: Pinocchio flies the one, the recursion the other.
    np.testing.assert_allclose(python.pose, machine.pose, rtol=0, atol=1e-10)
    assert np.ptp(python.arm, axis=0).min() > 0.05
    for run in (python, machine):
        run.save(tmp_path / "run.npz")
        again = Run.load(tmp_path / "run.npz")
        assert again.scenario == plan.scenario
        np.testing.assert_array_equal(fullam.refly(again).pose, run.pose)


def test_its_rows_are_exact_on_their_grid_and_near_on_others(scenario):
    plan = prepare(scenario)
    rows = plan.scenario.reference
    assert (rows.kind, rows.made_by) == ("reference-rows", "Eight")
    table = rows.tabulate(plan.t, scenario.initial_pose)
    np.testing.assert_array_equal(table.pose, plan.asked.pose)
    fine = np.arange(501) * 1e-3
    exact = Eight().tabulate(fine, scenario.initial_pose)
    # Linear between rows 10 ms apart: h^2 / 8 of an acceleration of 0.8 m/s^2.
    between = rows.tabulate(fine, scenario.initial_pose)
    np.testing.assert_allclose(between.pose, exact.pose, atol=1.1e-5)
    np.testing.assert_allclose(np.linalg.norm(between.pose[:, 3:], axis=1), 1.0, atol=1e-15)
    later = rows.tabulate(np.array([0.5, 0.51, 7.0]), scenario.initial_pose)
    np.testing.assert_array_equal(later.pose[1:], later.pose[[0, 0]])
    again = prepare(plan.scenario, simulation={"control_period": 0.005})
    np.testing.assert_allclose(again.asked.pose[::2], plan.asked.pose, atol=1e-15)


def test_a_campaign_flies_it_and_its_workers_need_no_class(scenario):
    campaign = Campaign((scenario,), ("dc-pid", "dc-pid-plus"), (0, 1))
    assert isinstance(campaign.scenarios[0].reference, ReferenceRows)
    assert isinstance(campaign.scenarios[0].arm_motion, ArmRows)
    other = Campaign((replace(scenario, reference=Eight(0.21)),), ("dc-pid",), (0, 1))
    assert other.identity()["scenarios"] != campaign.identity()["scenarios"]
    flown = list(campaign.fly(campaign.keys))
    assert all(cells.flights.outcomes == ("completed",) * 2 for cells in flown)


def test_a_scenario_of_ones_own_object_says_how_to_keep_it(scenario):
    with pytest.raises(ScenarioError, match=r"reference: 'Eight' is no kind.*prepare\(\.\.\.\)"):
        scenario.to_dict()
    again = fullam.Scenario.from_dict(prepare(scenario).scenario.to_dict())
    assert again == prepare(scenario).scenario


def test_it_is_looked_at_before_take_off(scenario):
    class Tilted(Eight):
        def tabulate(self, t, initial_pose):
            table = super().tabulate(t, initial_pose)
            table.pose[:, 3:] = [np.sin(0.6), 0.0, 0.0, np.cos(0.6)]
            return table

    vehicle = fullam.load_vehicle("fullam")
    assert reach_warning(scenario, vehicle) is None
    found = reach_warning(replace(scenario, reference=Tilted()), vehicle)
    assert np.degrees(found.tilt) == pytest.approx(np.degrees(1.2))


def table_with(field, value):
    class Own(Eight):
        def tabulate(self, t, initial_pose):
            return replace(super().tabulate(t, initial_pose), **{field: value})

    return Own()


def arm_with(change):
    class Own(Wave):
        def tabulate(self, t, initial):
            return change(super().tabulate(t, initial))

    return Own()


def spoiled(table):
    table.dtheta[700, 1] = np.nan
    return table


REFERENCES = {
    "no table": (type("Own", (), {"tabulate": lambda self, t, x: None})(), "pose: is None; tab"),
    "a shape": (table_with("velocity", np.zeros((51, 3))), r"velocity: is \(51, 3\).*\(51, 6\)"),
    "a list": (table_with("pose", [[0.0] * 7] * 51), "pose: is "),
    "texts": (table_with("pose", np.full((51, 7), "a")), "pose: is of type <U1"),
    "quaternions": (
        table_with("pose", np.ones((51, 7))),
        ".*quaternion of length 2; give",
    ),
    "infinite": (
        table_with("acceleration", np.full((51, 6), np.inf)),
        r"acceleration\[0\] at t = 0",
    ),
}

ARMS = {
    "no table": (arm_with(lambda table: None), r"theta: is None.*\(1001, 4\)"),
    "a shape": (arm_with(lambda a: replace(a, ddtheta=a.ddtheta[:, :2])), r"is \(1001, 2\)"),
    "nan": (arm_with(spoiled), "dtheta of joint 'joint_2' at t = 0.35 s: is not finite"),
    "too far": (
        arm_with(lambda a: replace(a, theta=a.theta * 2.0)),
        r"Own: takes joint 'joint_1' to -.* deg; it goes from .* \(first at t = 0 s\)",
    ),
    "too fast": (
        arm_with(lambda a: replace(a, dtheta=np.outer(np.arange(1001) * 1e-2, [0, 0, 1, 0]))),
        r"moves joint 'joint_3' at 573 deg/s; it can .* \(first at t = 0\.\d+ s\)",
    ),
}


@pytest.mark.parametrize("case", REFERENCES)
def test_what_is_no_reference_is_refused_before_take_off(scenario, case):
    own, words = REFERENCES[case]
    with pytest.raises(ScenarioError, match=f"reference 'Own': {words}"):
        prepare(replace(scenario, reference=own))


@pytest.mark.parametrize("case", ARMS)
def test_what_is_no_arm_motion_is_refused_before_take_off(scenario, case):
    own, words = ARMS[case]
    with pytest.raises(ScenarioError, match=f"arm motion.*{words}"):
        prepare(replace(scenario, arm_motion=own))


@pytest.mark.parametrize("field", ["reference", "arm_motion"])
def test_what_cannot_tabulate_is_refused(scenario, field):
    for value in (None, 3, Eight, "eight"):
        with pytest.raises(ScenarioError, match=f"{field}: is .*method tabulate"):
            replace(scenario, **{field: value})


def test_what_no_record_can_keep_is_refused_before_take_off(scenario, monkeypatch):
    monkeypatch.setattr(motion_rows, "MOST_PACKED", 1000)
    with pytest.raises(ScenarioError, match=r"'Eight'.*fly shorter, or give a Trajectory"):
        prepare(scenario)


def test_packed_rows_are_checked():
    rows = np.random.default_rng(0).normal(size=(7, 19))
    np.testing.assert_array_equal(unpack(pack(rows), 19, CHECK), rows)
    bad = {
        "no base 64": "ä",
        "cannot be read": "abcd",
        "holds no rows": pack(rows[:, :3]),
        "not finite": pack(np.full((1, 19), np.nan)),
    }
    for words, text in bad.items():
        with pytest.raises(ScenarioError, match=words if words != "no base 64" else "cannot be"):
            unpack(text, 19, CHECK)
    for cls in (ReferenceRows, ArmRows):
        with pytest.raises(ScenarioError, match="period"):
            cls(0.0, "abcd")


def test_an_arm_without_joints_moves_as_it_may():
    scenario = fullam.Scenario("bare", reference=Eight(), arm_motion=Wave(), duration=0.1)
    run = fullam.simulate(scenario, vehicle=without_arm(), calm=True)
    assert run.arm.shape == (11, 0)
    np.testing.assert_array_equal(fullam.refly(run).pose, run.pose)


def test_hands_fly_it_too(scenario):
    from fullam.simulation.hands.interactive import InteractiveFlight

    flight = InteractiveFlight(prepare(scenario))
    while flight.period < 20:
        flight.step()
    flight.push((1.0, 0.0, 0.0))
    while flight.step():
        pass
    run = flight.record
    np.testing.assert_array_equal(fullam.refly(run).pose, run.pose)
