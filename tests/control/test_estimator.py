"""The paper's filter and what hands it to the controller."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.control.controller import Measurement
from fullam.control.estimator import Readings, estimator_class, estimator_names
from fullam.control.filters import FirstOrderPoseFilter
from fullam.dynamics.pose_space import euler_from_pose, pose_from_euler, pose_model
from fullam.exceptions import SettingsError, UnknownName
from fullam.model.loading import load_vehicle


def test_position_is_the_published_recursion(rng):
    """y0 += 0.01 * 18 * (y - y0)."""
    x = rng.normal(size=(200, 3))
    filter_, y = FirstOrderPoseFilter(18.0, 0.01), np.zeros(3)
    for row in x:
        y += 0.01 * 18.0 * (row - y)
        filter_.update(pose_from_euler(row, np.zeros(3)))
        np.testing.assert_allclose(filter_.pose[:3], y, atol=1e-14)


def test_attitude_is_the_published_recursion_to_second_order(rng):
    """On Euler angles they filter; the manifold differs by products of angles, 0.03^2 here."""
    angles = np.cumsum(rng.normal(scale=0.003, size=(200, 3)), axis=0)
    filter_, y = FirstOrderPoseFilter(18.0, 0.01), np.zeros(3)
    for row in angles:
        y += 0.01 * 18.0 * (row - y)
        filter_.update(pose_from_euler(np.zeros(3), row))
    scale = np.abs(angles).max()
    np.testing.assert_allclose(euler_from_pose(filter_.pose), y, atol=scale**2)


def test_a_steady_turn_lags_by_the_time_constant():
    """A ramp comes out late by 1/cutoff minus one sample's share, with the right rate."""
    filter_, model = FirstOrderPoseFilter(18.0, 0.01), pose_model()
    pose, step = pose_from_euler(np.zeros(3), np.zeros(3)), np.array([0.01, 0, 0, 0, 0, 0.005])
    filter_.reset(pose)
    for _ in range(200):
        pose = pin.integrate(model, pose, step)
        filter_.update(pose)
    np.testing.assert_allclose(filter_.rate, step / 0.01, atol=1e-9)
    lag = pin.difference(model, filter_.pose, pose)
    np.testing.assert_allclose(lag, step * (1.0 / 0.18 - 1.0), atol=1e-9)


@pytest.mark.parametrize("name", ["first-order", "truth"])
def test_a_vehicle_at_rest_is_seen_at_rest(name):
    m, readings = Measurement(load_vehicle("fullam")), Readings()
    readings.pose[:] = pose_from_euler(np.array([1.0, 2.0, 3.0]), np.array([0.3, 0.2, 0.1]))
    estimator = estimator_class(name)(0.01, 0.01, 18.0)
    estimator.reset(readings)
    for _ in range(5):
        estimator.update(readings, m)
    np.testing.assert_allclose(m.q[:7], readings.pose, atol=1e-15)
    np.testing.assert_allclose(m.v[:6], 0.0, atol=1e-13)


def test_names_and_numbers():
    assert {"first-order", "truth"} <= set(estimator_names())
    with pytest.raises(UnknownName, match="first-order"):
        estimator_class("oracle")
    with pytest.raises(SettingsError, match="cutoff"):
        estimator_class("first-order")(0.01, 0.01, 0.0)
