"""Motions that excite every axis and joint."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fullam.exceptions import ScenarioError
from fullam.simulation.excitation import ArmExcitation, Excitation
from fullam.simulation.scenarios.scenario import Scenario

START = np.array([1.0, -2.0, 3.0, 0.0, 0.0, 0.0, 1.0])
STEP = 1e-5
"""Of the central differences [s], which are right to its square times the third derivative."""


def test_the_platform_begins_and_ends_at_its_start_at_rest():
    table = Excitation(period=7.0).tabulate(np.array([0.0, 7.0]), START)
    np.testing.assert_allclose(table.pose, [START, START], atol=1e-12)
    np.testing.assert_allclose(table.velocity, 0.0, atol=1e-12)


def test_velocities_and_accelerations_are_the_derivatives():
    motion, t = Excitation(euler_deg=(40.0, 50.0, 60.0), period=5.0), np.linspace(0.1, 4.9, 50)
    before, now, after = (motion.tabulate(t + h, START) for h in (-STEP, 0.0, STEP))
    turned = Rotation.from_quat(after.pose[:, 3:]) * Rotation.from_quat(before.pose[:, 3:]).inv()
    slope = (after.pose[:, :3] - before.pose[:, :3]) / (2.0 * STEP)
    np.testing.assert_allclose(now.velocity[:, :3], slope, atol=1e-8)
    np.testing.assert_allclose(now.velocity[:, 3:], turned.as_rotvec() / (2.0 * STEP), atol=1e-8)
    slope = (after.velocity - before.velocity) / (2.0 * STEP)
    np.testing.assert_allclose(now.acceleration, slope, atol=1e-7)


def test_joints_swing_within_their_amplitudes_with_exact_rates():
    motion, t = ArmExcitation((0.5, 0.1, 0.0), 10.0), np.linspace(0.0, 10.0, 1001)
    start = np.array([0.2, -0.3, 0.4])
    table = motion.tabulate(t, start)
    swings = np.abs(table.theta - start).max(axis=0)
    assert (swings <= np.array([0.5, 0.1, 0.0]) + 1e-12).all() and (swings[:2] > [0.35, 0.07]).all()
    np.testing.assert_allclose(table.theta[-1], start, atol=1e-12)
    before, after = (motion.tabulate(t + h, start) for h in (-STEP, STEP))
    np.testing.assert_allclose(table.dtheta, (after.theta - before.theta) / (2 * STEP), atol=1e-9)
    np.testing.assert_allclose(
        table.ddtheta, (after.dtheta - before.dtheta) / (2 * STEP), atol=1e-8
    )


def test_a_scenario_with_them_survives_a_file():
    scenario = Scenario("x", reference=Excitation(), arm_motion=ArmExcitation((0.1,) * 4))
    assert Scenario.from_dict(scenario.to_dict()) == scenario


def test_nonsense_is_refused():
    with pytest.raises(ScenarioError, match="period"):
        Excitation(period=0.0)
    with pytest.raises(ScenarioError, match="the arm has 4 joints"):
        ArmExcitation((0.1,)).tabulate(np.arange(3.0), np.zeros(4))
