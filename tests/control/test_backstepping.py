"""Backstepping: the Lyapunov function falls as derived, and only one rigid body is cancelled."""

import numpy as np
import pinocchio as pin
import pytest

import fullam
from fullam.control.backstepping import Backstepping, BacksteppingSettings, CompositeBody
from fullam.control.controller import Measurement, ReferencePoint
from fullam.control.controllers import make_controller
from fullam.dynamics.multibody import Multibody, body_acceleration, rotation_of
from fullam.exceptions import SettingsError
from fullam.model.loading import load_vehicle

TOLERANCE = 1e-9
"""Rounding through one 6 x 6 solve; light bodies amplify it."""

VEHICLES = ["fullam", "hextilt", "borinot", "quadrotor_arm"]


def random_measurement(vehicle, rng):
    m = Measurement(vehicle)
    m.q[:] = pin.integrate(vehicle.model, m.q, rng.normal(size=vehicle.model.nv))
    m.v[:6] = rng.normal(size=6)
    return m


def random_reference(rng):
    ref = ReferencePoint()
    quaternion = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
    ref.pose = np.concatenate([rng.normal(size=3), quaternion])
    ref.velocity, ref.acceleration = rng.normal(size=(2, 6))
    return ref


@pytest.mark.parametrize("name", VEHICLES)
def test_with_the_arm_still_the_model_is_exact(name, rng):
    vehicle = load_vehicle(name)
    controller, body = make_controller("backstepping", vehicle), Multibody(vehicle)
    for _ in range(20):
        m, ref = random_measurement(vehicle, rng), random_reference(rng)
        controller.reset(m, ref)
        u = controller.wrench(0.0, m, ref)
        wrench_A = (u.reshape(2, 3) @ rotation_of(m.q)).ravel()
        a = body.base_acceleration(m.q, m.v, m.arm_acceleration, wrench_A)
        expected = body_acceleration(m.q, m.v, controller.u_pid)
        np.testing.assert_allclose(a, expected, atol=TOLERANCE, rtol=TOLERANCE)


def test_the_arm_counts_by_its_shape_and_not_by_its_motion(rng):
    vehicle = load_vehicle("fullam")
    controller = make_controller("backstepping", vehicle)
    m, ref = random_measurement(vehicle, rng), random_reference(rng)
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
    model, data, body = vehicle.model, vehicle.create_data(), CompositeBody(vehicle)
    body.q[7:] = rng.normal(size=vehicle.n_arm)
    body.bias(np.eye(3), np.zeros(3), np.empty(6))
    pin.forwardKinematics(model, data, body.q)
    placed = [data.oMi[i].act(model.inertias[i]) for i in range(1, model.njoints)]
    expected = sum((inertia.matrix() for inertia in placed), np.zeros((6, 6)))
    np.testing.assert_allclose(body.inertia, expected, atol=1e-12)


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
        m, ref = random_measurement(vehicle, rng), random_reference(rng)
        controller.reset(m, ref)
        integrals = rng.normal(size=(2, 3)) * 0.3
        controller._integral[:3] = s.position_gains[2] * integrals[0]
        controller._integral[3:] = s.attitude_gains[2] * integrals[1]
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


def test_the_small_angle_branch_joins_the_closed_form(rng):
    """At the border both forms give the same derivative, to what cancellation leaves."""
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    w, w_d = rng.normal(size=(2, 3))
    below, above = np.empty(3), np.empty(3)
    Backstepping._attitude_derivative(axis * 0.999999e-3, w, w_d, below)
    Backstepping._attitude_derivative(axis * 1.000001e-3, w, w_d, above)
    np.testing.assert_allclose(below, above, atol=1e-8)


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
    before = controller._integral.copy()
    asked = controller.wrench(0.0, m, ref)
    controller.delivered(0.8 * asked, -0.2 * asked)
    assert 0.0 <= controller._integral[2] < before[2]


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
        {"max_acceleration": 0.0},
        {"anti_windup": -1.0},
    ],
)
def test_refuses_bad_settings(bad):
    with pytest.raises(SettingsError, match=next(iter(bad))):
        BacksteppingSettings(**bad)
