"""Caution: smooth motion passes, noise slows down in proportion."""

import numpy as np
import pytest

from fullam.control.caution import Caution

T = 0.01


def feed(caution, velocities):
    caution.reset(velocities[0])
    for v in velocities[1:]:
        caution.update(v)
    return caution.factors


def test_a_smooth_motion_is_trusted():
    t = T * np.arange(300)
    motion = np.outer(np.sin(3.0 * t), np.full(6, 3.0))
    np.testing.assert_array_equal(feed(Caution(T, (8.0, 15.0)), motion), 1.0)


def test_a_gust_is_no_noise():
    """One jump of 0.1 m/s and 0.5 rad/s, twice what the paper's gusts bring."""
    motion = np.zeros((200, 6))
    motion[100:] = [0.1, 0.0, 0.0, 0.5, 0.0, 0.0]
    np.testing.assert_array_equal(feed(Caution(T, (8.0, 15.0)), motion), 1.0)


@pytest.mark.parametrize("sigma", [0.1, 0.2])
def test_noise_slows_down_in_proportion(sigma, rng):
    """The mean norm of three normals is sqrt(8/pi), of their second differences sqrt(6) that."""
    roughness = np.sqrt(6.0) * np.sqrt(8.0 / np.pi) * sigma / T
    velocities = rng.normal(size=(1000, 6)) * ([sigma] * 3 + [0.0] * 3)
    factors = feed(Caution(T, (8.0, 15.0)), velocities)
    # The running mean holds about 30 correlated samples.
    assert factors[0] == pytest.approx(8.0 / roughness, rel=0.25)
    assert factors[1] == 1.0
