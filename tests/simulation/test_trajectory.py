"""Smooth motions: they pass where they are told to, and their derivatives are those of the motion.

Derivatives are held against central differences at h = 1e-4 s, whose error is h^2 / 6 times the
third derivative (here below 1e2) and rounding 1e-16 / h: below 1e-6.
"""

import numpy as np
import pytest

import fullam
from fullam.dynamics import quaternions
from fullam.dynamics.pose_space import euler_from_pose, pose_from_euler
from fullam.exceptions import ScenarioError
from fullam.simulation.motions import references
from fullam.simulation.motions.joint_trajectory import JointTrajectory
from fullam.simulation.motions.references import tabulate
from fullam.simulation.motions.shaping import SHAPED, Shaping
from fullam.simulation.motions.trajectory import Trajectory

START = pose_from_euler(np.array([0.0, 0.0, 1.0]), np.zeros(3))
H, CLOSE = 1e-4, 2e-6

POINTS = np.array([[0, 0, 1], [1.0, 0.5, 1.2], [1.5, -0.5, 1.5], [0.5, 0.2, 1.0], [0, 0, 1.0]])
ANGLES = np.array([[0, 0, 0], [10, -20, 40.0], [25, 5, 120], [-10, 15, 210], [0, 0, 300.0]])
TIMES = np.array([0.0, 1.5, 2.5, 4.2, 6.0])

rng = np.random.default_rng(0)
T_DENSE = np.linspace(0.0, 6.0, 61)
DENSE = np.stack([np.sin(T_DENSE), np.cos(2 * T_DENSE), 1.0 + 0.1 * T_DENSE], axis=1)
SPEED = np.stack([np.cos(T_DENSE), -2 * np.sin(2 * T_DENSE), 0.1 + 0.0 * T_DENSE], axis=1)

MADE = {
    "minimum snap": Trajectory.minimum_snap(POINTS, TIMES, euler_deg=ANGLES),
    "B-spline": Trajectory.b_spline(POINTS, TIMES, euler_deg=ANGLES),
    "cubic B-spline": Trajectory.b_spline(POINTS, TIMES, euler_deg=ANGLES, degree=3),
    "by speed": Trajectory.minimum_snap(POINTS, speed=1.0, euler_deg=ANGLES, at=0.5),
    "arrays": Trajectory.from_arrays(TIMES, POINTS, euler_deg=ANGLES),
    "velocities": Trajectory.from_arrays(T_DENSE, DENSE, velocity=SPEED),
    "two points": Trajectory.from_arrays([0.0, 6.0], POINTS[:2], euler_deg=ANGLES[:2]),
}


def differences(made, t):
    """Velocity and acceleration of a trajectory by central differences."""
    before, now, after = (tabulate(made, t + k * H, START) for k in (-1, 0, 1))
    turn = quaternions.product(after.pose[:, 3:], quaternions.inverse(before.pose[:, 3:]))
    moved = np.hstack(
        [after.pose[:, :3] - before.pose[:, :3], quaternions.to_rotation_vector(turn)]
    )
    return now, moved / (2 * H), (after.velocity - before.velocity) / (2 * H)


@pytest.mark.parametrize("made", MADE.values(), ids=MADE)
def test_derivatives_are_those_of_the_motion(made):
    # Not within h of a knot, where the last derivative of a spline is allowed to jump.
    t = np.setdiff1d(np.round(np.arange(0.01, 5.99, 0.037), 4), np.round(TIMES, 4))
    now, velocity, acceleration = differences(made, t)
    np.testing.assert_allclose(now.velocity, velocity, rtol=0, atol=CLOSE)
    np.testing.assert_allclose(now.acceleration, acceleration, rtol=0, atol=CLOSE)
    assert np.abs(now.acceleration[:, :3]).max() > 0.05 or len(made.times) == 2
    assert np.abs(now.velocity[:, 3:]).max() > 0.05 or not made.quaternions


@pytest.mark.parametrize("made", MADE.values(), ids=MADE)
def test_accelerations_are_continuous(made):
    """Within 1e-6 s an acceleration of slope below 1e3 /s^3 changes by less than 1e-3."""
    knots = np.array(made.times)[1:-1] + made.at
    before, after = (tabulate(made, knots + k * 0.5e-6, START).acceleration for k in (-1, 1))
    np.testing.assert_allclose(before, after, rtol=0, atol=1e-3)


def test_waypoints_are_passed_in_time_and_attitude():
    table = tabulate(MADE["minimum snap"], TIMES, START)
    np.testing.assert_allclose(table.pose[:, :3], POINTS, atol=1e-12)
    expected = pose_from_euler(POINTS, np.radians(ANGLES))
    cosine = np.abs(np.sum(expected[:, 3:] * table.pose[:, 3:], axis=1))
    np.testing.assert_allclose(cosine, 1.0, atol=1e-12)


def test_minimum_snap_begins_and_ends_at_rest_and_stands_outside():
    made = Trajectory.minimum_snap(POINTS, TIMES, euler_deg=ANGLES, at=1.0)
    table = tabulate(made, np.array([0.0, 0.5, 1.0, 7.0, 9.0]), START)
    np.testing.assert_allclose(table.velocity, 0.0, atol=1e-10)
    np.testing.assert_allclose(table.acceleration, 0.0, atol=1e-9)
    np.testing.assert_allclose(table.pose[[0, 1, 2], :3], POINTS[[0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(table.pose[[3, 4], :3], POINTS[[-1, -1]], atol=1e-12)
    np.testing.assert_allclose(made.final_pose[:3], POINTS[-1])


def snap_cost(times, rows, t):
    """Integral of |snap|^2 of a piecewise polynomial, by differences of what it tabulates."""
    x = tabulate(Trajectory.from_arrays(times, rows, degree=7, ends="rest"), t, START)
    snap = np.gradient(np.gradient(x.acceleration[:, :3], t, axis=0), t, axis=0)
    return np.trapezoid(np.sum(snap**2, axis=1), t)


def test_minimum_snap_is_minimal():
    """Of all that pass the waypoints: one that also passes another point costs more."""
    t = np.linspace(0.0, 6.0, 6001)
    best = snap_cost(TIMES, POINTS, t)
    middle = tabulate(MADE["minimum snap"], np.array([3.3]), START).pose[0, :3]
    times = np.insert(TIMES, 3, 3.3)
    same = snap_cost(times, np.insert(POINTS, 3, middle, axis=0), t)
    other = snap_cost(times, np.insert(POINTS, 3, middle + np.array([0.2, 0, 0]), axis=0), t)
    assert same == pytest.approx(best, rel=1e-3)  # the differences' own error
    assert other > 1.05 * best


def test_a_speed_is_reached_and_not_passed():
    made = MADE["by speed"]
    t = np.linspace(0.0, made.times[-1] + 1.0, 5001)
    speeds = np.linalg.norm(tabulate(made, t, START).velocity[:, :3], axis=1)
    assert speeds.max() == pytest.approx(1.0, rel=1e-4)  # the peak lies between two looks
    assert not speeds[t < 0.5].any()


def test_given_velocities_are_kept():
    table = tabulate(MADE["velocities"], T_DENSE, START)
    np.testing.assert_allclose(table.velocity[:, :3], SPEED, atol=1e-10)
    np.testing.assert_allclose(table.pose[:, :3], DENSE, atol=1e-12)


def test_dense_arrays_give_the_motion_they_were_taken_from():
    """A cubic spline through samples 0.1 s apart: 5/384 h^4 max|x''''| = 2e-5 m inside."""
    made = Trajectory.from_arrays(T_DENSE, DENSE)
    t = np.linspace(0.5, 5.5, 999)
    table = tabulate(made, t, START)
    np.testing.assert_allclose(table.pose[:, 0], np.sin(t), atol=2e-5)
    np.testing.assert_allclose(table.velocity[:, 1], -2 * np.sin(2 * t), atol=2e-3)


def test_one_attitude_holds_all_the_way():
    ways = (Trajectory.from_arrays, Trajectory.minimum_snap)
    times = ({"t": TIMES, "position": POINTS}, {"times": TIMES, "waypoints": POINTS})
    for make, given in zip(ways, times, strict=True):
        one, each = make(**given, euler_deg=[5.0, 0.0, 9.0]), [[5.0, 0.0, 9.0]] * len(TIMES)
        assert one == make(**given, euler_deg=each)


def test_a_turn_about_one_axis_stays_about_it():
    """Half a round in two waypoints, and one and a half in seven; gamma does not turn back."""
    for angles in (np.linspace(0, 170, 2), np.linspace(0, 540, 7)):
        euler = np.stack([0 * angles, 0 * angles, angles], axis=1)
        times = np.linspace(0, 6, len(angles))
        made = Trajectory.b_spline(np.zeros((len(angles), 3)), times, euler_deg=euler)
        table = tabulate(made, np.linspace(0, 6, 601), START)
        assert table.velocity[:, 5].min() > -1e-9
        np.testing.assert_allclose(table.velocity[:, 3:5], 0.0, atol=1e-12)
        last = np.degrees(euler_from_pose(table.pose[-1])[2])
        assert (last - angles[-1]) % 360.0 == pytest.approx(0.0, abs=1e-9) or last == pytest.approx(
            (angles[-1] + 180.0) % 360.0 - 180.0, abs=1e-9
        )


def test_a_smooth_motion_passes_shaping_as_it_is():
    """Where its acceleration passes through zero on a row too, at a jerk of 150 m/s^3."""
    made = Trajectory.minimum_snap([[0, 0, 0], [3, 0, 0]], [0.0, 1.0])
    asked = tabulate(made, np.arange(150) * 0.01, START)
    assert np.abs(asked.acceleration[50]).max() < 1e-9
    shaped = SHAPED.blend(asked, asked.pose[0])
    for name in ("pose", "velocity", "acceleration"):
        np.testing.assert_array_equal(getattr(shaped, name), getattr(asked, name))
    assert Shaping(None, None).anticipates(asked, asked.pose[0])


def test_plain_data_and_back():
    for made in MADE.values():
        data = references.to_dict(made)
        again = references.from_dict(references.KINDS, "reference", data)
        assert again == made
        np.testing.assert_array_equal(
            tabulate(again, T_DENSE, START).pose, tabulate(made, T_DENSE, START).pose
        )


BAD = {
    "times": (lambda: Trajectory.from_arrays([0, 1, 1], np.zeros((3, 3))), r"times\[2\]: is 1 s"),
    "one": (lambda: Trajectory.from_arrays([0.0], np.zeros((1, 3))), "has 1 entries; give 2"),
    "shape": (lambda: Trajectory.from_arrays([0, 1], np.zeros((3, 3))), r"shape \(3, 3\)"),
    "nan": (lambda: Trajectory.from_arrays([0, 1], np.full((2, 3), np.nan)), "positions.*finite"),
    "both": (
        lambda: Trajectory.from_arrays(
            [0, 1], np.zeros((2, 3)), np.zeros((2, 4)), np.zeros((2, 3))
        ),
        "attitude: is given twice",
    ),
    "no unit": (
        lambda: Trajectory.from_arrays([0, 1], np.zeros((2, 3)), [[0, 0, 0, 1], [0, 0, 0, 2]]),
        r"quaternions\[1\]: has length 2",
    ),
    "half a round": (
        lambda: Trajectory.minimum_snap(
            np.eye(3), [0, 1, 2], euler_deg=[[0, 0, 0], [0, 0, 10], [0, 0, 190]]
        ),
        r"attitude \[2\]: is turned by 180 deg from the one before; give one in between",
    ),
    "neither": (lambda: Trajectory.minimum_snap(np.eye(3)), "neither of them given"),
    "both times": (lambda: Trajectory.minimum_snap(np.eye(3), [0, 1, 2], 1.0), "both of them"),
    "one place": (lambda: Trajectory.minimum_snap(np.zeros((2, 3)), speed=1.0), "at one place"),
    "for ever": (
        lambda: Trajectory.minimum_snap(np.eye(3), speed=1e-308),
        "speed: is 1e-308 per second, at which the way takes inf s; arrive within 1e",
    ),
    "no speed": (lambda: Trajectory.minimum_snap(np.eye(3), speed=0.0), "speed: is 0.0"),
    "degree": (lambda: Trajectory.b_spline(np.eye(3), [0, 1, 2], degree=4), "degree: is 4"),
    "ends": (lambda: Trajectory.from_arrays([0, 1], np.zeros((2, 3)), ends="x"), "ends: is 'x'"),
    "ragged": (lambda: Trajectory.minimum_snap([[0, 0, 0], [1]], speed=1.0), r"waypoints\[1\]"),
    "texts": (lambda: Trajectory.from_arrays(np.array(["a", "b"]), np.zeros((2, 3))), "of type"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_no_trajectory_is_refused(case):
    make, words = BAD[case]
    with pytest.raises(ScenarioError, match=words):
        make()


def test_times_too_uneven_for_a_degree_are_refused():
    times = np.concatenate([[0.0], 1.0 + 1e-3 * np.arange(12)])
    points = rng.normal(size=(13, 3))
    with pytest.raises(ScenarioError, match="uneven that a spline of degree 7 swings"):
        tabulate(Trajectory.minimum_snap(points, times), T_DENSE, START)


# The arm.


@pytest.fixture(scope="module")
def joints():
    return fullam.load_vehicle("fullam").joints


def test_several_joints_move_as_their_derivatives_say(joints):
    rows = [[-90, 0, -45, 10], [-60, 20, -90, -10], [-80, -10, -20, 0.0]]
    made = JointTrajectory.minimum_snap(rows, [0.0, 1.0, 3.0])
    t = np.setdiff1d(np.round(np.arange(0.01, 2.99, 0.037), 4), [1.0])
    before, now, after = (
        made.tabulate(t + k * H, joints.from_typed(rows[0]), joints) for k in (-1, 0, 1)
    )
    np.testing.assert_allclose(now.dtheta, (after.theta - before.theta) / (2 * H), atol=CLOSE)
    np.testing.assert_allclose(now.ddtheta, (after.dtheta - before.dtheta) / (2 * H), atol=CLOSE)
    passed = made.tabulate(np.array([0.0, 1.0, 3.0, 9.0]), joints.from_typed(rows[0]), joints)
    np.testing.assert_allclose(np.degrees(passed.theta), [*rows, rows[-1]], atol=1e-9)


def test_a_motion_of_no_joints_is_refused():
    with pytest.raises(ScenarioError, match="positions_deg: has no joint"):
        JointTrajectory((0.0, 1.0), ((), ()))


def test_joints_are_named_and_others_stay(joints):
    made = JointTrajectory.b_spline([[0.0], [30.0]], speed_deg=20.0, joints=("joint_2",))
    initial = joints.from_typed([-90, 0, -45, 0])
    t = np.linspace(0, 5, 2001)
    table = made.tabulate(t, initial, joints)
    np.testing.assert_array_equal(table.theta[:, [0, 2, 3]], np.tile(initial[[0, 2, 3]], (2001, 1)))
    assert np.degrees(table.theta[-1, 1]) == pytest.approx(30.0)
    assert np.degrees(table.dtheta.max()) == pytest.approx(20.0, rel=1e-4)
