"""dc-PID: the compensation cancels the model, by both engines and both cuts of the loop."""

import copy

import numpy as np
import pinocchio as pin
import pytest

import fullam
from fullam.control.controller import Measurement, ReferencePoint
from fullam.control.controllers import make_controller, make_settings
from fullam.control.dc_pid import COMPENSATIONS, JointOneCompensation
from fullam.dynamics.multibody import Multibody, body_acceleration, rotation_of
from fullam.exceptions import SettingsError, UnknownName
from fullam.model.loading import load_vehicle

TOLERANCE = 1e-10
"""Rounding of one RNEA and a few products, on wrenches of tens of newtons."""

VEHICLES = ["fullam", "hextilt", "borinot", "quadrotor_arm"]


def random_measurement(vehicle, rng):
    m = Measurement(vehicle)
    m.q[:] = pin.integrate(vehicle.model, m.q, rng.normal(size=vehicle.model.nv))
    m.v[:] = rng.normal(size=vehicle.model.nv)
    m.arm_acceleration = rng.normal(size=vehicle.n_arm)
    return m


def random_reference(vehicle, rng):
    ref = ReferencePoint()
    ref.pose = pin.integrate(vehicle.model, vehicle.neutral(), rng.normal(size=vehicle.model.nv))[
        :7
    ]
    ref.velocity, ref.acceleration = rng.normal(size=(2, 6))
    return ref


@pytest.mark.parametrize("name", VEHICLES)
def test_joint_one_reading_equals_the_reference_compensation(name, rng):
    """Also for hextilt and borinot, whose platforms have their centre of mass off the origin."""
    vehicle = load_vehicle(name)
    engine, witness = JointOneCompensation(vehicle), Multibody(vehicle)
    for _ in range(50):
        m = random_measurement(vehicle, rng)
        R = rotation_of(m.q)
        a_W = rng.normal(size=6)
        engine.q[:], engine.v[3:] = m.q, m.v[3:]
        engine.a[:6] = (a_W.reshape(2, 3) @ R).ravel()
        engine.a[6:] = m.arm_acceleration
        u_dc_A = engine.wrench(R, np.empty(6))
        a = np.concatenate([body_acceleration(m.q, m.v, a_W), m.arm_acceleration])
        expected = witness.compensation(m.q, m.v, a)
        np.testing.assert_allclose((u_dc_A.reshape(2, 3) @ R.T).ravel(), expected, atol=TOLERANCE)


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("model", ["pinocchio", "newton-euler"])
def test_the_wrench_of_eq_26_produces_the_commanded_acceleration(name, model, rng):
    """Forward dynamics under u gives back u_pid exactly: the loop is cut without error."""
    vehicle = load_vehicle(name)
    controller = make_controller("dc-pid", vehicle, model=model)
    forward = Multibody(vehicle)
    for _ in range(20):
        m, ref = random_measurement(vehicle, rng), random_reference(vehicle, rng)
        controller.reset(m, ref)
        u = controller.wrench(0.0, m, ref)
        wrench_A = (u.reshape(2, 3) @ rotation_of(m.q)).ravel()
        a = forward.base_acceleration(m.q, m.v, m.arm_acceleration, wrench_A)
        wanted = body_acceleration(m.q, m.v, controller.u_pid)
        np.testing.assert_allclose(a, wanted, atol=1e-8 * np.abs(wanted).max())


@pytest.mark.parametrize("name", VEHICLES)
def test_what_is_read_at_the_root_is_what_joint_one_says(name, rng):
    """The law takes the root's wrench; u_dc read at joint 1, as eq. (20) has it, is the same."""
    vehicle = load_vehicle(name)
    law = make_controller("dc-pid", vehicle)
    joint_one, u_dc_A = JointOneCompensation(vehicle), np.zeros(6)
    for _ in range(50):
        m, ref = random_measurement(vehicle, rng), random_reference(vehicle, rng)
        law.reset(m, ref)
        u = law.wrench(0.0, m, ref).copy()
        R = pin.Quaternion(m.q[3:7]).toRotationMatrix()
        a_A = (law.u_pid.reshape(2, 3) @ R).ravel()
        joint_one.q[:], joint_one.v[3:] = m.q, m.v[3:]
        joint_one.a[:] = np.concatenate([a_A, m.arm_acceleration])
        joint_one.wrench(R, u_dc_A)
        u_dc = (u_dc_A.reshape(2, 3) @ R.T).ravel()
        inertial = ((joint_one.platform @ a_A).reshape(2, 3) @ R.T).ravel()
        np.testing.assert_allclose(law.u_dc, u_dc, rtol=0, atol=TOLERANCE)
        np.testing.assert_allclose(u, inertial + u_dc, rtol=0, atol=TOLERANCE)


def test_previous_wrench_converges_to_the_same_wrench_at_rest(rng):
    """The fixed-point iteration contracts by the arm's share of mass and inertia.

    For the default vehicle the share is 0.25 / 2.25 in mass and about a half in inertia, so 60
    periods leave nothing above 1e-9.
    """
    vehicle = load_vehicle("fullam")
    m = Measurement(vehicle)
    m.q[:] = vehicle.neutral(np.radians([-90.0, 0.0, -45.0, 0.0]))
    ref = ReferencePoint()
    ref.pose = m.q[:7].copy()
    ref.acceleration = np.array([0.5, -0.3, 0.2, 0.4, 0.1, -0.2])
    exact = make_controller("dc-pid", vehicle).wrench(0.0, m, ref)
    iterated = make_controller("dc-pid", vehicle, compensation="previous_wrench")
    iterated.reset(m, ref)
    errors = [np.abs(iterated.wrench(0.0, m, ref) - exact).max()]
    iterated.delivered(0.5 * exact, -0.5 * exact)
    errors += [np.abs(iterated.wrench(0.0, m, ref) - exact).max() for _ in range(60)]
    assert errors[0] < TOLERANCE  # the first period has no previous wrench
    assert errors[1] > 1e-2  # the false "delivered" has its effect ...
    assert errors[-1] < 1e-9  # ... and dies out


@pytest.mark.parametrize("compensation", COMPENSATIONS)
def test_a_whole_flight_is_the_same_on_either_model(compensation):
    """Task 2 in full weather, to 1e-9.

    The two models agree to rounding in each tick, and the closed loop is stable, so the difference
    stays at rounding.
    """
    runs = [
        fullam.simulate("task-2", seed=3, settings={"compensation": compensation, "model": model})
        for model in ("pinocchio", "newton-euler")
    ]
    np.testing.assert_allclose(runs[0].pose, runs[1].pose, rtol=0, atol=1e-9)
    np.testing.assert_allclose(runs[0].u_dc, runs[1].u_dc, rtol=0, atol=1e-9)


def test_pid_does_not_know_the_arm_and_dc_pid_does():
    """At rest in the stretched configuration only dc-PID asks for the arm's static moment."""
    vehicle = load_vehicle("fullam")
    m = Measurement(vehicle)
    m.q[:] = vehicle.neutral(np.radians([0.0, 0.0, -90.0, 0.0]))
    ref = ReferencePoint()
    ref.pose = m.q[:7].copy()
    static = pin.computeGeneralizedGravity(vehicle.model, vehicle.create_data(), m.q)[:6]
    dc = make_controller("dc-pid", vehicle).wrench(0.0, m, ref)
    plain = make_controller("pid", vehicle).wrench(0.0, m, ref)
    np.testing.assert_allclose(dc, static, atol=TOLERANCE)
    np.testing.assert_allclose(plain[:3], static[:3], atol=TOLERANCE)
    assert np.linalg.norm(static[3:]) > 0.5
    np.testing.assert_allclose(plain[3:], 0.0, atol=TOLERANCE)


def test_a_copy_is_a_fresh_controller(rng):
    vehicle = load_vehicle("fullam")
    m, ref = random_measurement(vehicle, rng), random_reference(vehicle, rng)
    controller = make_controller("dc-pid", vehicle)
    expected = controller.wrench(0.0, m, ref).copy()
    copied = copy.deepcopy(controller)
    m.q[3:7], ref.pose[3:7] = (0, 0, 0, 1), (0, 0, 0, 1)
    assert np.abs(copied.wrench(0.0, m, ref) - expected).max() > 1e-3
    np.testing.assert_array_equal(
        copy.deepcopy(controller).wrench(0.0, m, ref),
        make_controller("dc-pid", vehicle).wrench(0.0, m, ref),
    )


def test_wrong_settings_name_the_field_and_the_choices():
    with pytest.raises(SettingsError, match=r"compensation.*desired_acceleration"):
        make_settings("dc-pid", {"compensation": "none"})
    with pytest.raises(SettingsError, match=r"no setting of it.*position_gains"):
        make_settings("dc-pid", {"position_gain": 1.0})
    with pytest.raises(SettingsError, match=r"anticipate.*true or false"):
        make_settings("dc-pid", {"anticipate": "False"})
    with pytest.raises(SettingsError, match=r"DcPidSettings"):
        fullam.simulate("task-1", "pid", settings=make_settings("dc-pid"))
    with pytest.raises(SettingsError, match=r"wrong type"):
        make_settings("dc-pid", {"anti_windup": "much"})
    with pytest.raises(SettingsError, match="attitude_gains"):
        make_settings("pid", {"attitude_gains": (1.0, float("nan"), 2.0)})
    with pytest.raises(UnknownName, match=r"Did you mean 'dc-pid'"):
        make_controller("dcpid", load_vehicle("fullam"))
