"""Sine, cosine, arc tangent and 1 - exp(-x) to the last places that they promise."""

import math

import numpy as np
import pytest

from fullam.numbers.elementary import arctan2, decay, sincos

LIBRARY = 1.0
"""Units in the last place by which the mathematical library may itself be off (glibc states 1)."""


def units_apart(value, expected):
    """Largest difference in units of the last place of what is expected."""
    expected = np.asarray(expected)
    return np.max(np.abs(np.asarray(value) - expected) / np.spacing(np.abs(expected)))


@pytest.fixture
def angles(rng):
    """Ordinary and large ones, multiples of pi/4 and their neighbours, tiny ones."""
    corners = np.arange(-1200, 1200) * (np.pi / 4)
    neighbours = [np.nextafter(corners, np.inf), np.nextafter(corners, -np.inf)]
    tiny = np.geomspace(1e-300, 1e-3, 200)
    plain = [rng.uniform(-7.0, 7.0, 20_000), rng.uniform(-1000.0, 1000.0, 20_000)]
    return np.concatenate([*plain, corners, *neighbours, tiny, -tiny]).tolist()


def test_sine_and_cosine_to_one_unit_in_the_last_place(angles):
    sines, cosines = zip(*map(sincos, angles), strict=True)
    assert units_apart(sines, list(map(math.sin, angles))) <= 1.0 + LIBRARY
    assert units_apart(cosines, list(map(math.cos, angles))) <= 1.0 + LIBRARY


def test_sine_and_cosine_are_odd_and_even_bit_for_bit(angles):
    for x in angles[::7]:
        s, c = sincos(x)
        assert sincos(-x) == (-s, c)
        assert abs(s * s + c * c - 1.0) < 4e-16
    assert sincos(0.0) == (0.0, 1.0)


def test_arc_tangent_to_two_units_in_the_last_place(rng):
    x, y = rng.normal(size=(2, 20_000)) * 10.0 ** rng.uniform(-8, 8, (2, 20_000))
    found = [arctan2(b, a) for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    assert units_apart(found, list(map(math.atan2, y, x))) <= 2.0 + LIBRARY


@pytest.mark.parametrize(("y", "x"), [(0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (-1, -1), (1, -1)])
def test_arc_tangent_on_the_axes_and_diagonals(y, x):
    assert units_apart(arctan2(1.0 * y, 1.0 * x), math.atan2(y, x) or 5e-324) <= 1.0


def test_arc_tangent_of_nothing_is_nothing():
    assert arctan2(0.0, 0.0) == 0.0


def test_decay_to_three_units_in_the_last_place_from_tiny_to_large():
    """Six doublings round six times; each of them brings the relative error closer to zero."""
    x = np.concatenate([np.geomspace(1e-300, 40.0, 20_000), np.linspace(0.0, 40.0, 20_001)[1:]])
    found = list(map(decay, x.tolist()))
    assert units_apart(found, -np.expm1(-x)) <= 3.0 + LIBRARY
    assert decay(0.0) == 0.0
    assert all(decay(x) == pytest.approx(1.0, abs=2.3e-16) for x in (40.0, 1e3, 1e9, math.inf))
    assert all(0.0 <= value <= 1.0 for value in found)
