"""dc-PID: the compensation cancels the model, by all models and both cuts of the loop."""

import copy

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
from fullam.control.compensation import MODELS, compensation_model
from fullam.control.controller import Measurement, ReferencePoint
from fullam.control.controllers import make_controller, make_settings
from fullam.control.dc_pid import COMPENSATIONS, DcPid
from fullam.control.law import estimate_of, motions_of
from fullam.dynamics.multibody import Multibody, body_acceleration, rotation_of
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Spatial
from fullam.exceptions import SettingsError, UnknownName
from fullam.model.loading import load_vehicle
from fullam.numbers.records import flat, record

TOLERANCE = 1e-10
"""Rounding of one RNEA and a few products, on wrenches of tens of newtons."""


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("model", MODELS)
def test_all_models_give_the_reference_compensation(name, model, rng):
    """Also for hextilt and borinot, whose platforms have their centre of mass off the origin."""
    vehicle = load_vehicle(name)
    one, witness = compensation_model(model, vehicle, DcPid(vehicle).links), Multibody(vehicle)
    for _ in range(20):
        m = random_measurement(vehicle, rng)
        estimate, a_W = estimate_of(m), rng.normal(size=6)
        R, w = rotation_matrix(estimate.pose.attitude), estimate.velocity.angular
        u_dc = one.compensation(
            one.chain(motions_of(m)), R, w, record(Spatial, a_W), vehicle.gravity
        )
        a = np.concatenate([body_acceleration(m.q, m.v, a_W), m.arm_acceleration])
        expected = witness.compensation(m.q, m.v, a)
        np.testing.assert_allclose([*flat(u_dc)], expected, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("model", MODELS)
def test_all_models_give_the_acceleration_under_a_wrench(name, model, rng):
    """Eq. (21) against the forward dynamics; light bodies amplify rounding."""
    vehicle = load_vehicle(name)
    one, witness = compensation_model(model, vehicle, DcPid(vehicle).links), Multibody(vehicle)
    for _ in range(20):
        m = random_measurement(vehicle, rng)
        estimate, u_W = estimate_of(m), rng.normal(size=6)
        R, w = rotation_matrix(estimate.pose.attitude), estimate.velocity.angular
        a = one.acceleration(one.chain(motions_of(m)), R, w, record(Spatial, u_W), vehicle.gravity)
        u_A = (u_W.reshape(2, 3) @ rotation_of(m.q)).ravel()
        expected = witness.base_acceleration(m.q, m.v, m.arm_acceleration, u_A)
        found = body_acceleration(m.q, m.v, np.array([*flat(a)]))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("model", MODELS)
def test_the_wrench_of_eq_26_produces_the_commanded_acceleration(name, model, rng):
    """Forward dynamics under u gives back u_pid exactly: the loop is cut without error."""
    vehicle = load_vehicle(name)
    law = make_controller("dc-pid", vehicle, model=model)
    assert_produces_what_it_commands(law, vehicle, rng, 1e-8)  # light bodies amplify rounding


@pytest.mark.parametrize("name", VEHICLES)
def test_u_is_the_platform_s_inertia_times_u_pid_plus_u_dc(name, rng):
    """Eq. (26) with Pinocchio's inertia of the platform, its centre of mass off the origin or not.

    The right side of the erratum to (20): what the arm puts on the platform, and the platform's own
    weight and centrifugal terms, is all that u_dc holds.
    """
    vehicle = load_vehicle(name)
    law, platform = make_controller("dc-pid", vehicle), vehicle.model.inertias[1]
    for _ in range(20):
        m, ref = random_measurement(vehicle, rng), random_reference(rng)
        law.reset(m, ref)
        u, R = law.wrench(0.0, m, ref), rotation_of(m.q)
        a_A = (law.u_pid.reshape(2, 3) @ R).ravel()
        inertial = ((platform.matrix() @ a_A).reshape(2, 3) @ R.T).ravel()
        np.testing.assert_allclose(u, inertial + law.u_dc, rtol=0, atol=TOLERANCE)


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


@pytest.mark.parametrize("rounds", [1, 3])
@pytest.mark.parametrize("model", MODELS)
def test_previous_wrench_solves_21_with_the_wrench_at_hand(model, rounds, rng):
    """By Pinocchio: the wrench got last, in {A}, its u_pid renewed; then u_dc for what it gives."""
    vehicle = load_vehicle("hextilt")
    settings = {"compensation": "previous_wrench", "rounds": rounds, "model": model}
    law, witness = make_controller("dc-pid", vehicle, **settings), Multibody(vehicle)
    platform, kept_A = vehicle.model.inertias[1].matrix(), None
    law.reset(random_measurement(vehicle, rng), random_reference(rng))
    for k in range(4):
        m, ref = random_measurement(vehicle, rng), random_reference(rng)
        u, R = law.wrench(0.0, m, ref).copy(), rotation_of(m.q)
        a = body_acceleration(m.q, m.v, law.u_pid)
        inertial_A = platform @ (law.u_pid.reshape(2, 3) @ R).ravel()
        rest_A = kept_A
        for _ in range(1 if kept_A is None else rounds):
            if kept_A is not None:
                at_hand_A = inertial_A + rest_A
                a = witness.base_acceleration(m.q, m.v, m.arm_acceleration, at_hand_A)
            u_dc = witness.compensation(m.q, m.v, np.append(a, m.arm_acceleration))
            rest_A = (u_dc.reshape(2, 3) @ R).ravel()
        expected = (inertial_A.reshape(2, 3) @ R.T).ravel() + u_dc
        # Relative: each round amplifies rounding by the heavy arm under the light platform.
        np.testing.assert_allclose(u, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
        got = u
        if k % 2:
            got = 0.7 * u
            law.delivered(got, got - u)
        kept_A = (got.reshape(2, 3) @ R).ravel() - inertial_A


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
    m, ref = random_measurement(vehicle, rng), random_reference(rng)
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
    with pytest.raises(SettingsError, match=r"DcPidSettings"):
        fullam.simulate("task-1", "pid", settings=make_settings("dc-pid"))
    with pytest.raises(SettingsError, match=r"anti_windup.*give a number"):
        make_settings("dc-pid", {"anti_windup": "much"})
    with pytest.raises(SettingsError, match="attitude_gains"):
        make_settings("pid", {"attitude_gains": (1.0, float("nan"), 2.0)})
    with pytest.raises(UnknownName, match=r"Did you mean 'dc-pid'"):
        make_controller("dcpid", load_vehicle("fullam"))
