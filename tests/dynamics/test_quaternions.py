"""Quaternions against SciPy's rotations, which share no code with them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fullam.dynamics import quaternions as qt
from fullam.dynamics.pose_space import euler_from_pose, pose_from_euler

ROUNDING = 1e-14
"""A dozen operations on numbers up to pi."""


@pytest.fixture
def vectors():
    """Rotation vectors of length up to 2 pi, tiny ones and zero."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(60, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lengths = np.concatenate([rng.uniform(0, 2 * np.pi, 50), 10.0 ** -np.arange(1.0, 10.0), [0.0]])
    return lengths[:, None] * directions


def as_matrices(quaternions):
    return Rotation.from_quat(quaternions).as_matrix()


def test_a_rotation_vector_becomes_the_same_rotation(vectors):
    found = qt.from_rotation_vector(vectors)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=ROUNDING)
    expected = Rotation.from_rotvec(vectors).as_matrix()
    np.testing.assert_allclose(as_matrices(found), expected, atol=ROUNDING)


def test_a_rotation_vector_comes_back_by_the_shorter_way(vectors):
    found = qt.to_rotation_vector(qt.from_rotation_vector(vectors))
    np.testing.assert_allclose(found, Rotation.from_rotvec(vectors).as_rotvec(), atol=ROUNDING)
    # Tiny vectors keep their digits, not only their size.
    np.testing.assert_allclose(found[50:], vectors[50:], rtol=1e-14)
    np.testing.assert_array_equal(found[-1], np.zeros(3))


def test_a_product_is_the_rotation_of_both_and_an_inverse_undoes_it(vectors):
    a, b = qt.from_rotation_vector(vectors), qt.from_rotation_vector(vectors[::-1])
    ab = qt.product(a, b)
    np.testing.assert_allclose(as_matrices(ab), as_matrices(a) @ as_matrices(b), atol=ROUNDING)
    np.testing.assert_allclose(qt.product(ab, qt.inverse(b)), a, atol=ROUNDING)
    np.testing.assert_allclose(qt.product(a[:, None], b[None])[3, 7], qt.product(a[3], b[7]))


def test_euler_angles_are_eq_2_there_and_back():
    euler = np.random.default_rng(1).uniform(-1.5, 1.5, (4, 5, 3))
    pose = pose_from_euler(np.zeros((4, 5, 3)), euler)
    expected = Rotation.from_euler("XYZ", euler.reshape(-1, 3)).as_matrix()
    np.testing.assert_allclose(as_matrices(pose[..., 3:].reshape(-1, 4)), expected, atol=ROUNDING)
    np.testing.assert_allclose(euler_from_pose(pose), euler, atol=1e2 * ROUNDING)  # 1 / cos 1.5
