"""How a response is read: coordinates, deviations, moving average."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from fullam.analysis.deviation import asked_rows, coordinates, deviations, euler_xyz, wrap
from fullam.analysis.response import rows_inside, smooth, window
from fullam.dynamics.pose_space import euler_from_pose


def random_poses(count, seed=0):
    rng = np.random.default_rng(seed)
    return np.hstack([rng.standard_normal((count, 3)), Rotation.random(count, rng).as_quat()])


def test_coordinates_are_millimetres_and_scipys_euler_angles():
    poses = random_poses(500)
    found = coordinates(poses)
    assert np.array_equal(found[:, :3], 1e3 * poses[:, :3])
    # Rounding of 1e-16 grows by 1 / cos(psi), at most some hundreds here.
    assert found[:, 3:] == pytest.approx(np.degrees(euler_from_pose(poses)), abs=1e-10)


def test_a_quaternion_need_not_be_of_unit_length():
    q = random_poses(1)[0, 3:]
    assert euler_xyz(tuple(1.3 * q)) == pytest.approx(euler_xyz(tuple(q)), rel=1e-13)


@pytest.mark.parametrize(("angle", "expected"), [(180.0, -180.0), (-180.0, -180.0), (359.0, -1.0)])
def test_differences_of_angles_stay_below_a_half_turn(angle, expected):
    assert wrap(angle) == expected
    assert wrap(5.0) == 5.0


def test_deviations_are_errors_and_one_rotation_vector():
    poses, asked = random_poses(200, 1), random_poses(200, 2)
    found = deviations(poses, asked_rows(coordinates(asked), asked))
    assert np.array_equal(found[:, :3], coordinates(poses)[:, :3] - coordinates(asked)[:, :3])
    turned = Rotation.from_quat(poses[:, 3:]) * Rotation.from_quat(asked[:, 3:]).inv()
    # Near a half turn the vector's direction loses digits to 1 / (pi - angle), below 100 here.
    assert found[:, 6:] == pytest.approx(turned.as_rotvec(degrees=True), abs=1e-9)


@pytest.mark.parametrize(("rows", "period"), [(1, 0.0), (2, 0.01), (14, 0.01), (900, 0.01)])
def test_moving_average_is_scipys(rows, period):
    signal = 1000.0 * np.random.default_rng(rows).standard_normal(rows)
    before, after = window(rows, period)
    out = [0.0] * rows
    smooth(signal.tolist(), before, after, out)
    expected = uniform_filter1d(signal, before + after + 1, mode="nearest")
    # Running sums of 1000 numbers of about 1000, each right to 1e-13.
    assert out == pytest.approx(expected, abs=1e-10)


def test_a_share_of_the_rows_is_no_matter_of_its_last_bit():
    t = 0.01 * np.arange(2000)
    enough = rows_inside(t, 0.95)
    left = np.arange(2000, 0, -1)
    proven = t <= 0.5 * t[-1]
    assert np.all(enough[proven] / left[proven] >= 0.95)
    assert np.all((enough[proven] - 1.0) / left[proven] < 0.95)
    assert np.all(np.isinf(enough[~proven]))
    assert np.array_equal(rows_inside(t), left)
