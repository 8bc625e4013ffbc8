"""Caution: smooth motion passes, noise slows down in proportion."""

import numpy as np
import pytest

from fullam.control.caution import caution_factors, caution_numbers, felt, trusted
from fullam.dynamics.spatial import Spatial
from fullam.numbers.records import record

T = 0.01


LIMITS = (8.0, 15.0)


def feed(velocities):
    """Factors after a row of velocities."""
    numbers = caution_numbers(T, LIMITS)
    memory = trusted(record(Spatial, velocities[0]))
    for v in velocities[1:]:
        memory = felt(numbers, memory, record(Spatial, v))
    return caution_factors(numbers, memory.roughness)


def test_a_smooth_motion_is_trusted():
    t = T * np.arange(300)
    motion = np.outer(np.sin(3.0 * t), np.full(6, 3.0))
    np.testing.assert_array_equal(feed(motion), 1.0)


def test_a_gust_is_no_noise():
    """One jump of 0.1 m/s and 0.5 rad/s, twice what the paper's gusts bring."""
    motion = np.zeros((200, 6))
    motion[100:] = [0.1, 0.0, 0.0, 0.5, 0.0, 0.0]
    np.testing.assert_array_equal(feed(motion), 1.0)


@pytest.mark.parametrize("sigma", [0.1, 0.2])
def test_noise_slows_down_in_proportion(sigma, rng):
    """The mean norm of three normals is sqrt(8/pi), of their second differences sqrt(6) that."""
    roughness = np.sqrt(6.0) * np.sqrt(8.0 / np.pi) * sigma / T
    velocities = rng.normal(size=(1000, 6)) * ([sigma] * 3 + [0.0] * 3)
    factors = feed(velocities)
    # The running mean holds about 30 correlated samples.
    assert factors[0] == pytest.approx(8.0 / roughness, rel=0.25)
    assert factors[1] == 1.0


def test_an_estimate_is_trusted_at_first():
    numbers = caution_numbers(T, LIMITS)
    memory = trusted(record(Spatial, np.full(6, 9.0)))
    assert caution_factors(numbers, memory.roughness) == (1.0, 1.0)
    smooth = felt(numbers, memory, record(Spatial, np.full(6, 9.0)))
    assert smooth.roughness == (0.0, 0.0)


def test_the_roughness_is_the_running_mean_of_the_second_difference():
    numbers, memory = caution_numbers(T, LIMITS), trusted(record(Spatial, np.zeros(6)))
    roughness, before = np.zeros(2), np.zeros((2, 6))
    for v in np.array([[0.3, 0, 0, 0, 0.1, 0], [0, 0.2, 0, 0, 0, 0.4], [0.1, 0, 0, 0.5, 0, 0]]):
        memory = felt(numbers, memory, record(Spatial, v))
        bend = (v - 2.0 * before[0] + before[1]).reshape(2, 3)
        before = np.array([v, before[0]])
        now = np.linalg.norm(bend, axis=1) / T
        roughness += (1.0 - np.exp(-T / 0.3)) * (now - roughness)
        np.testing.assert_allclose(memory.roughness, roughness, rtol=1e-12)
