"""Computed wrench: inverse dynamics, held to the forward dynamics and to dc-PID."""

import numpy as np
import pytest
from random_measurements import (
    VEHICLES,
    assert_produces_what_it_commands,
    random_measurement,
    random_reference,
)

from fullam.control.controller import ReferencePoint
from fullam.control.controllers import make_controller
from fullam.dynamics.multibody import rotation_of
from fullam.model.loading import load_vehicle

TOLERANCE = 1e-9
"""Rounding through one RNEA and one 6 x 6 solve; light bodies amplify it."""


@pytest.mark.parametrize("name", VEHICLES)
def test_produces_the_commanded_acceleration(name, rng):
    vehicle = load_vehicle(name)
    law = make_controller("computed-wrench", vehicle)
    assert_produces_what_it_commands(law, vehicle, rng, TOLERANCE)


@pytest.mark.parametrize("name", VEHICLES)
def test_is_dc_pid_by_another_road(name, rng):
    """Pinocchio's root wrench against the paper's matrix system, which share nothing; same gains.

    The tolerance is relative: rounding times the condition number of the matrix system.
    """
    vehicle = load_vehicle(name)
    gains = {"position_gains": (9.6, 2.0, 6.0), "attitude_gains": (30.0, 5.0, 10.0)}
    one = make_controller("computed-wrench", vehicle, **gains)
    other = make_controller("dc-pid", vehicle, model="newton-euler", **gains)
    m, ref = random_measurement(vehicle, rng), random_reference(rng)
    for controller in (one, other):
        controller.reset(m, ref)
    for _ in range(5):
        m = random_measurement(vehicle, rng)
        expected = other.wrench(0.0, m, ref)
        found = one.wrench(0.0, m, ref)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())
        one.delivered(0.9 * found, -0.1 * found)
        other.delivered(0.9 * found, -0.1 * found)


def test_has_no_integral_action_by_default(rng):
    vehicle = load_vehicle("fullam")
    controller = make_controller("computed-wrench", vehicle)
    m, ref = random_measurement(vehicle, rng), random_reference(rng)
    controller.reset(m, ref)
    first = controller.wrench(0.0, m, ref).copy()
    for _ in range(10):
        np.testing.assert_array_equal(controller.wrench(0.0, m, ref), first)


def test_u_dc_is_the_wrench_without_commanded_acceleration(rng):
    vehicle = load_vehicle("fullam")
    controller = make_controller("computed-wrench", vehicle)
    m, ref = random_measurement(vehicle, rng), ReferencePoint()
    ref.pose = m.q[:7]
    ref.velocity = (m.v[:6].reshape(2, 3) @ rotation_of(m.q).T).ravel()
    controller.reset(m, ref)
    u = controller.wrench(0.0, m, ref)
    np.testing.assert_allclose(controller.u_pid, 0.0, atol=1e-12)
    np.testing.assert_allclose(u, controller.u_dc, atol=1e-10)
