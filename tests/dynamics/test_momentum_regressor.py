"""The momentum regressor against Pinocchio's centroidal momentum and gravity."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.dynamics.momentum_regressor import MomentumRegressor, parameters
from fullam.model.loading import load_vehicle

POINT = np.array([0.3, -0.2, 0.5])

ROUNDING = 1e-10
"""Of momenta up to some 50 kg m^2/s, sums of a dozen products."""


@pytest.fixture(params=["fullam", "hextilt"])
def vehicle(request):
    return load_vehicle(request.param)


def states(vehicle, count=20):
    rng = np.random.default_rng(5)
    for _ in range(count):
        q = vehicle.neutral()
        q[:3] = rng.normal(size=3)
        q[3:7] = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
        q[7:] = rng.uniform(-1.0, 1.0, vehicle.n_arm)
        yield q, rng.normal(size=vehicle.model.nv)


def test_momentum_is_the_centroidal_one_carried_to_the_point(vehicle):
    regressor, pi = MomentumRegressor(vehicle, POINT), parameters(vehicle.model)
    data = vehicle.create_data()
    for q, v in states(vehicle):
        h = pin.computeCentroidalMomentum(vehicle.model, data, q, v)
        lever = data.com[0] - POINT
        expected = np.concatenate([h.linear, h.angular + np.cross(lever, h.linear)])
        np.testing.assert_allclose(regressor(q, v)[0] @ pi, expected, atol=ROUNDING)


def test_gravity_is_the_weight_at_the_center_of_mass(vehicle):
    regressor, pi = MomentumRegressor(vehicle, POINT), parameters(vehicle.model)
    data = vehicle.create_data()
    for q, v in states(vehicle):
        lever = pin.centerOfMass(vehicle.model, data, q) - POINT
        weight = vehicle.mass * vehicle.model.gravity.linear
        expected = np.concatenate([weight, np.cross(lever, weight)])
        np.testing.assert_allclose(regressor(q, v)[1] @ pi, expected, atol=ROUNDING)
