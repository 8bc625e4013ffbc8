"""Backstepping: the Lyapunov function falls as derived, and only one rigid body is cancelled."""

import numpy as np
import pinocchio as pin
import pytest
from random_measurements import (
    VEHICLES,
    assert_produces_what_it_commands,
    random_measurement,
    random_reference,
)

import fullam
from fullam.control.backstepping import BacksteppingSettings, attitude_derivative
from fullam.control.controller import Measurement, ReferencePoint
from fullam.control.controllers import make_controller
from fullam.control.law import motions_of
from fullam.dynamics.multibody import rotation_of
from fullam.dynamics.recursion import composite_body, inertial_wrench
from fullam.dynamics.so3 import SMALL
from fullam.dynamics.spatial import Spatial
from fullam.exceptions import SettingsError
from fullam.model.loading import load_vehicle
from fullam.numbers.records import flat, record

TOLERANCE = 1e-9
"""Rounding through one 6 x 6 solve; light bodies amplify it."""


@pytest.mark.parametrize("name", VEHICLES)
def test_with_the_arm_still_the_model_is_exact(name, rng):
    vehicle = load_vehicle(name)
    law = make_controller("backstepping", vehicle)
    assert_produces_what_it_commands(law, vehicle, rng, TOLERANCE, arm_moves=False)


def test_the_arm_counts_by_its_shape_and_not_by_its_motion(rng):
    vehicle = load_vehicle("fullam")
    controller = make_controller("backstepping", vehicle)
    m, ref = random_measurement(vehicle, rng, arm_moves=False), random_reference(rng)
    controller.reset(m, ref)
    still = controller.wrench(0.0, m, ref).copy()
    controller.reset(m, ref)
    m.v[6:], m.arm_acceleration = rng.normal(size=(2, vehicle.n_arm))
    np.testing.assert_array_equal(controller.wrench(0.0, m, ref), still)
    controller.reset(m, ref)
    m.q[7:] += 0.5
    assert np.abs(controller.wrench(0.0, m, ref) - still).max() > 0.01


def test_composite_inertia_is_the_sum_of_the_links(rng):
    vehicle = load_vehicle("fullam")
    model, data = vehicle.model, vehicle.create_data()
    m = Measurement(vehicle)
    m.q[7:] = rng.normal(size=vehicle.n_arm)
    body = composite_body(make_controller("backstepping", vehicle).chain(motions_of(m)))
    pin.forwardKinematics(model, data, m.q)
    placed = [data.oMi[i].act(model.inertias[i]) for i in range(1, model.njoints)]
    expected = sum((inertia.matrix() for inertia in placed), np.zeros((6, 6)))
    for unit in np.eye(6):
        wrench = inertial_wrench(body, record(Spatial, unit))
        np.testing.assert_allclose([*flat(wrench)], expected @ unit, atol=1e-12)


def lyapunov(s, p, R, v, w, ref, integrals, h):
    """V of the module's text at time h, the reference moving with its acceleration."""
    p_d = ref.pose[:3] + h * ref.velocity[:3] + 0.5 * h**2 * ref.acceleration[:3]
    w_d = ref.velocity[3:] + h * ref.acceleration[3:]
    turn = h * ref.velocity[3:] + 0.5 * h**2 * ref.acceleration[3:]
    R_d = pin.exp3(turn) @ rotation_of(ref.pose)
    errors = (p_d - p, pin.log3(R_d @ R.T))
    rates = (ref.velocity[:3] + h * ref.acceleration[:3] - v, w_d - w)
    V = 0.0
    gains = (s.position_gains, s.attitude_gains)
    for e, rate, i, (c1, _, L) in zip(errors, rates, integrals, gains, strict=True):
        integral = i + h * e  # L times the integral of e; e varies by O(h)
        z = rate + c1 * e + L * integral
        V += 0.5 * (e @ e + L * (integral @ integral) + z @ z)
    return V


def test_the_lyapunov_function_falls_at_the_derived_rate(rng):
    """Central difference of V along the exact motion against -e C1 e - z C2 z, large angles too."""
    vehicle, h = load_vehicle("fullam"), 1e-5
    controller = make_controller("backstepping", vehicle)
    s = controller.settings
    for _ in range(30):
        m, ref = random_measurement(vehicle, rng, arm_moves=False), random_reference(rng)
        controller.reset(m, ref)
        integrals = rng.normal(size=(2, 3)) * 0.3
        of_L = integrals * [[s.position_gains[2]], [s.attitude_gains[2]]]
        controller._memory = controller._memory._replace(integral=record(Spatial, of_L.ravel()))
        controller.wrench(0.0, m, ref)
        a, R = controller.u_pid, rotation_of(m.q)
        v, w = R @ m.v[:3], R @ m.v[3:6]

        def V(h, a=a, R=R, v=v, w=w, m=m, ref=ref, integrals=integrals):
            p = m.q[:3] + h * v + 0.5 * h**2 * a[:3]
            R_h = pin.exp3(h * w + 0.5 * h**2 * a[3:]) @ R
            return lyapunov(s, p, R_h, v + h * a[:3], w + h * a[3:], ref, integrals, h)

        measured = (V(h) - V(-h)) / (2.0 * h)
        e = (ref.pose[:3] - m.q[:3], pin.log3(rotation_of(ref.pose) @ R.T))
        rate = (ref.velocity[:3] - v, ref.velocity[3:] - w)
        derived = 0.0
        for k, (c1, c2, L) in enumerate((s.position_gains, s.attitude_gains)):
            z = rate[k] + c1 * e[k] + L * integrals[k]
            derived -= c1 * e[k] @ e[k] + c2 * z @ z
        assert derived < 0.0
        # Truncation of order h^2 and rounding of V / h: both about 1e-9 of V ~ 100.
        assert measured == pytest.approx(derived, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 0.0999, 0.1001, 1.0, 3.0])
def test_the_derivative_of_the_error_is_exact_on_both_sides_of_the_series(rng, angle):
    """Central difference of log(R_d R^T) over 1e-5 s: truncation 1e-10 times derivatives of e.

    They grow towards pi, where the inverse Jacobian does.
    """
    h, e = 1e-5, rng.normal(size=3)
    e *= angle / np.linalg.norm(e)
    w, w_d = rng.normal(size=(2, 3))

    def error(t):
        return pin.log3(pin.exp3(w_d * t) @ pin.exp3(e) @ pin.exp3(-w * t))

    measured = (error(h) - error(-h)) / (2.0 * h)
    found = attitude_derivative(tuple(e), tuple(w), tuple(w_d))
    np.testing.assert_allclose(found, measured, rtol=0, atol=1e-7)


@pytest.mark.parametrize("angle", [1e-6, 0.01, 0.0999, 0.1001, 1.0, 2.0, 3.0])
def test_the_derivative_of_the_error_is_the_inverse_jacobian_of_pinocchio(rng, angle):
    """J_l^-1(e) (w_d - R_e w) to rounding of order-one numbers, of Pinocchio's 1e-13 near pi."""
    e = rng.normal(size=3)
    e *= angle / np.linalg.norm(e)
    w, w_d = rng.normal(size=(2, 3))
    R_e = pin.exp3(e)
    expected = pin.Jlog3(R_e).T @ (w_d - R_e @ w)
    found = attitude_derivative(tuple(e), tuple(w), tuple(w_d))
    np.testing.assert_allclose(found, expected, rtol=0, atol=4e-15 if angle < 3.0 else 2e-13)


def test_the_series_joins_the_closed_form(rng):
    """At the border both forms give the same derivative, but for the step of 2e-13 between them."""
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    w, w_d = (tuple(x) for x in rng.normal(size=(2, 3)))
    border = np.sqrt(SMALL)
    below, above = (
        attitude_derivative(tuple(axis * border * side), w, w_d) for side in (1 - 1e-12, 1 + 1e-12)
    )
    np.testing.assert_allclose(below, above, rtol=0, atol=1e-11)


def test_near_the_target_it_is_the_documented_pid(rng):
    """(9.75, 3, 6) and (27.5, 15, 10) for small errors at rest: products of 1e-6 are left out."""
    vehicle = load_vehicle("fullam")
    controller = make_controller("backstepping", vehicle)
    m, ref = Measurement(vehicle), ReferencePoint()
    controller.reset(m, ref)
    e = 1e-6 * rng.normal(size=6)
    ref.pose = np.concatenate([e[:3], pin.Quaternion(pin.exp3(e[3:])).coeffs()])
    m.v[:6] = rate = 1e-6 * rng.normal(size=6)
    gains = np.repeat([[9.75, 27.5], [3.0, 15.0], [6.0, 10.0]], 3, axis=1)
    for k in range(3):  # the integral holds k errors
        controller.wrench(0.0, m, ref)
        expected = gains[0] * e - gains[2] * rate + gains[1] * (k * 0.01) * e
        np.testing.assert_allclose(controller.u_pid, expected, atol=1e-10)


def test_what_is_not_delivered_drains_the_integral():
    vehicle = load_vehicle("fullam")
    controller = make_controller("backstepping", vehicle)
    m, ref = Measurement(vehicle), ReferencePoint()
    ref.pose = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    controller.reset(m, ref)
    for _ in range(50):
        controller.wrench(0.0, m, ref)
    before = controller._memory.integral.linear[2]
    asked = controller.wrench(0.0, m, ref)
    controller.delivered(0.8 * asked, -0.2 * asked)
    assert 0.0 <= controller._memory.integral.linear[2] < before


def test_what_is_drained_is_the_undelivered_acceleration_of_the_composite_body(rng):
    """By Pinocchio's composite inertia, each axis at the rate anti_windup / C2, none past zero."""
    vehicle = load_vehicle("fullam")
    controller = make_controller("backstepping", vehicle)
    s, m, ref = (
        controller.settings,
        random_measurement(vehicle, rng, arm_moves=False),
        random_reference(rng),
    )
    controller.reset(m, ref)
    u = controller.wrench(0.0, m, ref).copy()
    got = u + 0.3 * rng.normal(size=6)
    R = rotation_of(m.q)
    M = np.triu(pin.crba(vehicle.model, vehicle.create_data(), m.q)[:6, :6])
    M += np.triu(M, 1).T
    missing_A = np.linalg.solve(M, ((got - u).reshape(2, 3) @ R).ravel())
    missing = (missing_A.reshape(2, 3) @ R.T).ravel()
    integral = np.where(rng.normal(size=6) > 0.0, -0.5, 0.5)
    integral[0] = -1e-9 * np.sign(missing[0])  # drained to zero and no further
    controller._memory = controller._memory._replace(integral=record(Spatial, integral))
    controller.delivered(got, got - u)
    c2 = np.repeat([s.position_gains[1], s.attitude_gains[1]], 3)
    step = np.minimum(np.abs(missing) * s.anti_windup * 0.01 / c2, np.abs(integral))
    expected = integral - np.where(integral * missing < 0.0, np.sign(integral) * step, 0.0)
    found = [*flat(controller._memory.integral)]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    assert found[0] == 0.0
    assert np.abs(expected - integral).max() > 1e-3


def test_flies_the_step_and_feels_the_arm_that_dc_pid_cancels():
    """In calm air, arm moving: dc-PID's error is a fifth of backstepping's."""
    step = fullam.measure(fullam.simulate("position-1", "backstepping", calm=True))
    assert step.settled
    assert step.settling_time_s < 2.0
    errors = [
        fullam.measure(fullam.simulate("task-1", name, calm=True)).rms_position_mm
        for name in ("backstepping", "dc-pid")
    ]
    assert errors[0] > 3.0 * errors[1]


@pytest.mark.parametrize(
    "bad",
    [
        {"position_gains": (0.0, 4.0, 1.0)},
        {"attitude_gains": (1.0, 2.0)},
        {"integral_limits": (1.0, -1.0)},
        {"anti_windup": -1.0},
    ],
)
def test_refuses_bad_settings(bad):
    with pytest.raises(SettingsError, match=next(iter(bad))):
        BacksteppingSettings(**bad)
