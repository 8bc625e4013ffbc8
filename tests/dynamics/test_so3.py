"""Rotations as kernels against SciPy's and Pinocchio's, near and far from the series' edge."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from fullam.dynamics import so3
from fullam.dynamics.spatial import Pose, Spatial, move
from fullam.numbers.records import record

ROUNDING = 4e-15
"""A dozen operations on numbers up to pi; the truncated series are below it."""

EDGE = np.sqrt(so3.SMALL)


@pytest.fixture
def vectors(rng):
    """Rotation vectors of length up to pi: tiny, about the series' edge, near pi, zero."""
    directions = rng.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lengths = [
        rng.uniform(0.0, np.pi, 100),
        10.0 ** rng.uniform(-16, -1, 100),
        EDGE * (1.0 + 1e-3 * rng.uniform(-1, 1, 100)),
        np.pi - 10.0 ** rng.uniform(-12, -1, 99),
        [0.0],
    ]
    return np.concatenate(lengths)[:, None] * directions


@pytest.fixture
def quaternions(rng):
    return [tuple(q.tolist()) for q in Rotation.random(50, random_state=rng).as_quat()]


def test_exponential_and_rotation_matrix(vectors):
    for v in vectors:
        q = so3.exponential(tuple(v.tolist()))
        matrix = np.reshape(so3.rotation_matrix(q), (3, 3))
        np.testing.assert_allclose(matrix, Rotation.from_rotvec(v).as_matrix(), 0, ROUNDING)
        assert abs(np.linalg.norm(q) - 1.0) < ROUNDING


def test_logarithm_is_the_inverse_and_of_length_at_most_pi(vectors):
    """Of both quaternions of a rotation. Tiny vectors keep their digits, not only their size."""
    for v in vectors:
        q = so3.exponential(tuple(v.tolist()))
        for sign in (1.0, -1.0):
            found = np.array(so3.logarithm(tuple(sign * x for x in q)))
            # Where the angle is close to pi its sine is not; 1e-15 of a quaternion is an angle.
            np.testing.assert_allclose(
                found, v, rtol=4e-15, atol=4e-15 * np.linalg.norm(v) + 1e-300
            )


def test_products_are_rotations_in_turn(quaternions):
    for a, b in pairwise(quaternions):
        product = np.reshape(so3.rotation_matrix(so3.compose(a, b)), (3, 3))
        expected = (Rotation.from_quat(a) * Rotation.from_quat(b)).as_matrix()
        np.testing.assert_allclose(product, expected, 0, ROUNDING)


def test_box_plus_undoes_box_minus_on_its_side_of_the_double_cover(quaternions, vectors):
    for q, v in zip(quaternions * 8, vectors, strict=True):
        v = tuple(v.tolist())
        moved = so3.boxplus(q, v)
        assert np.dot(moved, q) >= 0.0
        assert abs(np.linalg.norm(moved) - 1.0) < ROUNDING
        np.testing.assert_allclose(so3.boxminus(moved, q), v, rtol=0, atol=1e-14)
        expected = pin.Quaternion(*q[3:], *q[:3]).toRotationMatrix() @ pin.exp3(np.array(v))
        matrix = np.reshape(so3.rotation_matrix(moved), (3, 3))
        np.testing.assert_allclose(matrix, expected, 0, 1e-14)


def test_box_plus_brings_a_quaternion_back_to_unit_length(quaternions):
    """One step of Newton's: an error of 1e-6 becomes one of its square."""
    for q in quaternions:
        longer = tuple((1.0 + 1e-6) * x for x in q)
        assert abs(np.linalg.norm(so3.boxplus(longer, (0.1, 0.2, 0.3))) - 1.0) < 2e-12


def screw(v, w):
    """Displacement and rotation of exp of a twist, by its power series in extended precision.

    Pinocchio's exp6 loses two digits where the angle is about 1e-2.
    """
    twist = np.zeros((4, 4), dtype=np.longdouble)
    twist[:3, :3], twist[:3, 3] = pin.skew(w), v
    total = term = np.eye(4, dtype=np.longdouble)
    for k in range(1, 50):
        term = term @ twist / k
        total = total + term
    return total[:3, 3].astype(float), total[:3, :3].astype(float)


def test_a_screw_motion_is_the_exponential_of_its_twist(quaternions, vectors, rng):
    """Position and attitude after unit time of constant twist."""
    for q, w in zip(quaternions * 8, vectors, strict=True):
        p, v = rng.normal(size=(2, 3))
        R, (way, turn) = pin.Quaternion(*q[3:], *q[:3]).toRotationMatrix(), screw(v, w)
        pose = record(Pose, np.concatenate([p, q]))
        moved = move(pose, record(Spatial, np.append(2.0 * v, 2.0 * w)), 0.5)
        np.testing.assert_allclose(moved.position, p + R @ way, 0, 1e-14)
        matrix = np.reshape(so3.rotation_matrix(moved.attitude), (3, 3))
        np.testing.assert_allclose(matrix, R @ turn, 0, 1e-14)
