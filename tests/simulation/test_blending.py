"""Blends: bounded acceleration, smooth, and the same end."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fullam.dynamics.pose_space import pose_from_euler
from fullam.simulation.motions.blending import blend_jumps, leaves_jumps
from fullam.simulation.motions.references import Circle, Step, Waypoints, tabulate

T = np.arange(601) * 0.01
START = pose_from_euler(np.array([0.0, 0.0, 1.0]), np.zeros(3))
HOME = pose_from_euler(np.array([9.0, 9.0, 9.0]), np.radians([15.0, -20.0, 10.0]))


def test_a_blend_meets_its_limits_and_ends_where_the_step_ends():
    table = tabulate(Step((10.0, 10.0, 10.0)), T, HOME)
    blended = blend_jumps(table, HOME, 2.6, 8.0)
    linear = np.linalg.norm(blended.acceleration[:, :3], axis=1)
    angular = np.linalg.norm(blended.acceleration[:, 3:], axis=1)
    assert linear.max() == pytest.approx(2.6, rel=1e-3)  # the grid may miss the peak
    assert angular.max() <= 8.0
    np.testing.assert_allclose(blended.pose[0], HOME, atol=1e-12)
    np.testing.assert_allclose(blended.pose[-1], table.pose[-1], atol=1e-12)
    assert np.all(blended.velocity[-1] == 0.0)


def test_a_blend_moves_as_its_derivatives_say():
    """Differences at 1e-2 s of a smooth blend; its third derivatives reach about 20."""
    table = tabulate(Step((10.0, 10.0, 10.0)), T, HOME)
    blended = blend_jumps(table, HOME, 2.6, 8.0)
    inner = slice(1, -1)
    speed = np.gradient(blended.pose[:, :3], T, axis=0)
    np.testing.assert_allclose(speed[inner], blended.velocity[inner, :3], atol=2e-3)
    R = Rotation.from_quat(blended.pose[:, 3:])
    turn = (R[2:] * R[:-2].inv()).as_rotvec() / 0.02
    np.testing.assert_allclose(turn, blended.velocity[inner, 3:], atol=2e-3)
    curve = np.gradient(blended.velocity, T, axis=0)
    np.testing.assert_allclose(curve[inner], blended.acceleration[inner], atol=2e-2)


@pytest.mark.parametrize("later", [0.2, 0.3, 0.4])
def test_blends_that_overlap_stay_smooth(later):
    """A second turn about another axis begins while the first is under way.

    No row may turn more than the fastest rate allows, and rates and accelerations must be the
    derivatives; tolerances as above, with third derivatives three times as large.
    """
    reference = Waypoints((0.0, later), ((0, 0, 1), (0.3, 0, 1)), ((0, 0, 60), (50, 0, 0)))
    table = tabulate(reference, T, START)
    blended = blend_jumps(table, START, 2.6, 8.0)
    R = Rotation.from_quat(blended.pose[:, 3:])
    steps = (R[1:] * R[:-1].inv()).magnitude()
    assert steps.max() < 0.06
    turn = (R[2:] * R[:-2].inv()).as_rotvec() / 0.02
    np.testing.assert_allclose(turn, blended.velocity[1:-1, 3:], atol=2e-2)
    # The acceleration of a profile jumps nowhere but its own derivative does at both ends.
    curve = np.gradient(blended.velocity, T, axis=0)
    np.testing.assert_allclose(curve[1:-1], blended.acceleration[1:-1], atol=0.3)
    np.testing.assert_allclose(blended.pose[-1], table.pose[-1], atol=1e-9)


def test_what_is_smooth_passes_unchanged():
    circle = tabulate(Circle((0, 0, 2), radius=1.0, period=5.0), T, HOME)
    blended = blend_jumps(circle, circle.pose[0], 2.6, 8.0)
    np.testing.assert_array_equal(blended.pose, circle.pose)
    np.testing.assert_array_equal(blended.acceleration, circle.acceleration)


def test_no_limits_leave_the_jump():
    table = tabulate(Step((10.0, 10.0, 10.0)), T, HOME)
    assert blend_jumps(table, HOME, None, None) is table


LINEAR = Step((1.0, 0.0, 1.0))
TURN = Step((0.0, 0.0, 1.0), (30.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("reference", "limits", "left"),
    [
        (LINEAR, (None, None), True),
        (LINEAR, (None, 8.0), True),
        (LINEAR, (2.6, None), False),
        (LINEAR, (2.6, 8.0), False),
        (TURN, (2.6, None), True),
        (TURN, (None, 8.0), False),
        (Step((1.0, 0.0, 1.0), (30.0, 0.0, 0.0), at=2.0), (2.6, None), False),
        (Step((0.0, 0.0, 1.0)), (None, None), False),
    ],
)
def test_a_jump_is_left_where_nothing_limits_what_jumps(reference, limits, left):
    table = tabulate(reference, T, START)
    assert leaves_jumps(table, START, *limits) is left
    blended = blend_jumps(table, START, *limits).pose
    far = np.abs(np.diff(blended, axis=0, prepend=START[None])).max()
    assert bool(far > 0.1) is left


def test_a_circle_has_no_jumps_when_one_starts_on_it():
    circle = tabulate(Circle((0, 0, 2), radius=1.0, period=5.0), T, START)
    assert leaves_jumps(circle, START, None, None)
    assert not leaves_jumps(circle, circle.pose[0], None, None)
