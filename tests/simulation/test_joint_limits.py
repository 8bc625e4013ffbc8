"""Joints have units and limits, in scenarios and in flight."""

import numpy as np
import pytest
from altered_vehicles import with_joint

import fullam
from fullam.exceptions import ScenarioError
from fullam.simulation.motions.arm_motion import HoldArm, SineRate
from fullam.simulation.motions.joint_trajectory import JointTrajectory
from fullam.simulation.record.run import Run

LIMITS = 'lower="-0.15" upper="0.15"'


@pytest.fixture(scope="module")
def sliding():
    return with_joint("joint_4", "prismatic", LIMITS)


HOLD = HoldArm()


def scenario(motion=HOLD, arm=(-90.0, 0.0, -45.0, 0.05), **more):
    return fullam.Scenario("reach", arm_motion=motion, initial_arm_deg=arm, duration=1.0, **more)


def test_a_prismatic_joint_starts_and_moves_in_metres(sliding, tmp_path):
    motion = SineRate(joint=4, rate=0.1, frequency=np.pi)
    run = fullam.simulate(scenario(motion), vehicle=sliding, calm=True)
    assert run.outcome == "completed"
    assert run.arm[0].tolist() == [-np.pi / 2, 0.0, -np.pi / 4, 0.05]
    # a (1 - cos w t) / w at t = 1 s.
    assert run.arm[-1, 3] == pytest.approx(0.05 + 0.2 / np.pi, rel=1e-9)
    assert run.units["arm"] == "rad, rad, rad, m"
    assert run.units["arm_rate"] == "rad/s, rad/s, rad/s, m/s"
    run.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    assert again.units == run.units
    assert np.array_equal(fullam.refly(again).pose, run.pose)


def test_a_continuous_joint_may_turn_over_and_over():
    vehicle = with_joint("joint_4", "continuous", LIMITS)
    motion = SineRate(joint=4, rate=1.0, frequency=0.5)
    run = fullam.simulate(scenario(motion, (0.0, 0.0, 0.0, 700.0)), vehicle=vehicle, calm=True)
    assert run.outcome == "completed"
    assert run.arm[0, 3] == pytest.approx(np.radians(700.0), rel=1e-15)
    assert run.pose.shape[1] == 7
    assert run.units["arm"] == "rad"


@pytest.mark.parametrize(
    ("motion", "arm", "words"),
    [
        (HOLD, (0, 0, 0, 0.2), "initial_arm_deg.*'joint_4' to 0.2 m; .* from -0.15 to 0.15 m"),
        (HOLD, (0, 300.0, 0, 0), "initial_arm_deg.*'joint_2' to 300 deg; .* -150 to 150 deg"),
        (SineRate(4, 0.2, 1.0), (0, 0, 0, 0.1), "arm motion.*'joint_4' to 0.1919 m"),
        (SineRate(2, 3.0, 1.0), (0, 120.0, 0, 0), "arm motion.*'joint_2' to .* deg"),
        (SineRate(4, 1.1, 40.0), (0, 0, 0, 0), "arm motion.*'joint_4' at 1.1 m/s; it can 1 m/s"),
        (HOLD, (0, 0, 0), r"has 3 positions.*has 4 joints \[deg, deg, deg, m\]"),
    ],
)
def test_beyond_the_limits_is_refused_before_take_off(sliding, motion, arm, words):
    with pytest.raises(ScenarioError, match=words):
        fullam.simulate(scenario(motion, arm), vehicle=sliding, calm=True)


ROWS = ((-90.0, 0.0, -45.0, 0.05), (-60.0, 10.0, -45.0, 0.10))


def moved(last, **choices):
    return JointTrajectory((0.0, 0.5), (ROWS[0], last), ends="rest", degree=5, **choices)


@pytest.mark.parametrize("driver", ["python", "fused"])
def test_several_joints_move_in_degrees_and_metres(sliding, driver, tmp_path):
    flown = fullam.Scenario("reach", arm_motion=moved(ROWS[1]), duration=0.6)
    run = fullam.simulate(flown, vehicle=sliding, calm=True, driver=driver)
    np.testing.assert_allclose(sliding.joints.to_typed(run.arm[[0, -1]]), ROWS, atol=1e-9)
    run.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    assert again.scenario.arm_motion == flown.arm_motion
    np.testing.assert_array_equal(fullam.refly(again).pose, run.pose)


@pytest.mark.parametrize(
    ("motion", "arm", "words"),
    [
        (
            moved((-60.0, 10.0, -45.0, 0.2)),
            (),
            r"'joint_4' to 0.2 m; it goes from -0.15 to 0.15 m \(first at t = 0\.29\d* s\)",
        ),
        (moved((-60, 170.0, -45, 0.0)), (), r"'joint_2' to 170 deg; it goes .* \(first at t = 0"),
        (moved((50, 10.0, -45, 0.0)), (), r"'joint_1' at 525 deg/s; it can .* \(first at t = 0"),
        (moved(ROWS[1]), (0, 0, 0, 0), r"'joint_1' at t = 0 s: is to be at -90 deg.*starts at 0"),
        (moved(ROWS[1], units=("deg",) * 4), (), r"'joint_4': is given in deg.*measured in m"),
        (moved(ROWS[1], joints=("a", "b", "c", "d")), (), r"no 'a'; it has joint_1, .*, joint_4"),
        (JointTrajectory((0, 1), ((1, 2), (3, 4))), (), "has 2 columns; the arm has 4 joints"),
    ],
)
def test_a_motion_of_joints_that_cannot_be_is_refused(sliding, motion, arm, words):
    with pytest.raises(ScenarioError, match=f"arm motion.*{words}"):
        fullam.simulate(scenario(motion, arm), vehicle=sliding, calm=True)


def test_without_positions_the_arm_is_at_rest_within_its_limits():
    vehicle = with_joint("joint_4", "prismatic", 'lower="0.02" upper="0.3"')
    run = fullam.simulate(scenario(arm=()), vehicle=vehicle, calm=True)
    assert run.arm[0].tolist() == [0.0, 0.0, 0.0, 0.02]


@pytest.mark.parametrize(
    ("kind", "arm", "rate"),
    [("prismatic", (-90.0, 0.0, -45.0, 0.05), 0.1), ("continuous", (0.0, 0.0, 0.0, 700.0), 1.0)],
)
def test_both_drivers_fly_the_same_flight(kind, arm, rate):
    """The Python driver on Pinocchio, the fused one on the recursion; 1e-12 m, of order 1 N."""
    vehicle, motion = (
        with_joint("joint_4", kind, LIMITS),
        SineRate(joint=4, rate=rate, frequency=np.pi),
    )
    by_python, fused = (
        fullam.simulate(scenario(motion, arm), vehicle=vehicle, calm=True, driver=driver)
        for driver in ("python", "fused")
    )
    assert fused.outcome == "completed"
    np.testing.assert_allclose(fused.pose, by_python.pose, atol=1e-12)
    np.testing.assert_allclose(fused.u_dc, by_python.u_dc, atol=1e-11)
    assert np.ptp(fused.u_dc, axis=0).max() > 1e-7, "the arm's motion is felt"
