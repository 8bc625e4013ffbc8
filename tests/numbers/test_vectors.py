"""Tuples of three, six and nine numbers against numpy."""

import numpy as np
import pytest

from fullam.numbers import vectors as v

ROUNDING = 1e-14
"""A handful of sums of products of numbers around 1."""


@pytest.fixture
def abc(rng):
    return rng.normal(size=(50, 3, 3))


def symmetric(matrix):
    """The six entries of a symmetric matrix."""
    return tuple(matrix[np.triu_indices(3)].tolist())


def close(found, expected):
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING)


def test_vectors(abc):
    for rows in abc:
        a, b, c = (tuple(row.tolist()) for row in rows)
        x, y, z = rows
        close(v.add(a, b), x + y)
        close(v.subtract(a, b), x - y)
        close(v.scale(0.3, a), 0.3 * x)
        close(v.multiply(a, b), x * y)
        close(v.axpy(0.3, a, b), 0.3 * x + y)
        close(v.dot(a, b), x @ y)
        close(v.cross(a, b), np.cross(x, y))
        low, high = np.minimum(y, z), np.maximum(y, z)
        close(v.clip_vector(a, tuple(low), tuple(high)), np.clip(x, low, high))
        assert v.add(c, v.ZERO) == c


def test_matrices(abc):
    for M in abc:
        R, a = tuple(M.ravel().tolist()), tuple(M[0].tolist())
        close(v.rotate(R, a), M @ M[0])
        close(v.rotate_back(R, a), M.T @ M[0])
        assert v.rotate(v.IDENTITY, a) == a


def test_symmetric_matrices(abc):
    for M in abc:
        J, b = M @ M.T + np.eye(3), M[0]
        six, three = symmetric(J), tuple(b.tolist())
        close(v.apply_symmetric(six, three), J @ b)
        close(v.add_symmetric(six, six), symmetric(2.0 * J))
        # A condition number below 100.
        solved = v.solve_symmetric(six, three)
        np.testing.assert_allclose(solved, np.linalg.solve(J, b), rtol=0, atol=1e-13)
