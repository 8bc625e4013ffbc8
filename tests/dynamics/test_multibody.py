import numpy as np
import pinocchio as pin
import pytest

from fullam.analysis.random_states import CATEGORIES, random_states
from fullam.dynamics import multibody as mb
from fullam.exceptions import UnknownName, VehicleError

COUNT = 20

RELATIVE = 1e-11
"""Rounding of recursions over seven bodies at speeds up to 30 m/s."""


@pytest.fixture(params=CATEGORIES)
def states(request, vehicle):
    return random_states(vehicle.n_arm, request.param, COUNT, np.random.default_rng(0))


def rows(states):
    return zip(
        states.q,
        states.v,
        states.ddtheta,
        states.wrench_A,
        states.tool_wrench,
        strict=True,
    )


def close(found, expected, scale=None):
    scale = np.linalg.norm(expected) if scale is None else scale
    np.testing.assert_allclose(found, expected, atol=RELATIVE * max(1.0, scale), rtol=0)


def test_acceleration_and_root_wrench_invert_each_other(vehicle, states):
    engine = mb.Multibody(vehicle)
    for q, v, ddtheta, wrench_A, tool in rows(states):
        a = np.concatenate([engine.base_acceleration(q, v, ddtheta, wrench_A, tool), ddtheta])
        close(engine.root_wrench(q, v, a, tool), wrench_A, np.linalg.norm(a))


def test_acceleration_is_abas_when_aba_gets_the_joint_torques(vehicle, states):
    engine, data = mb.Multibody(vehicle), vehicle.create_data()
    for q, v, ddtheta, wrench_A, _ in rows(states):
        a = np.concatenate([engine.base_acceleration(q, v, ddtheta, wrench_A), ddtheta])
        torques = pin.rnea(vehicle.model, data, q, v, a).copy()
        torques[:6] = wrench_A
        # Joint accelerations of light links amplify rounding of the torques by 1 / inertia.
        found = pin.aba(vehicle.model, data, q, v, torques)
        np.testing.assert_allclose(found, a, atol=1e-8 * np.linalg.norm(a))


def test_platform_inertia_times_acceleration_plus_u_dc_is_the_root_wrench(vehicle, states):
    engine = mb.Multibody(vehicle)
    for q, v, ddtheta, wrench_A, tool in rows(states):
        a_A = engine.base_acceleration(q, v, ddtheta, wrench_A, tool)
        a = np.concatenate([a_A, ddtheta])
        wanted = mb.world_acceleration(q, v, a_A)
        u = engine.platform_inertia(q) @ wanted + engine.compensation(q, v, a, tool)
        R = mb.rotation_of(q)
        expected = np.concatenate([R @ wrench_A[:3], R @ wrench_A[3:]])
        close(u, expected, np.linalg.norm(a))


def test_joint_wrenches_project_to_the_joint_torques(vehicle, states):
    engine, data = mb.Multibody(vehicle), vehicle.create_data()
    for q, v, ddtheta, wrench_A, _ in rows(states):
        a = np.concatenate([wrench_A / 10.0, ddtheta])
        _, tau = engine.joint_wrenches(q, v, a)
        torques = pin.rnea(vehicle.model, data, q, v, a)
        jacobian = pin.computeJointJacobians(vehicle.model, data, q)
        axes = jacobian[3:, 6:].T  # column i of the Jacobian turns about joint axis i, world axes
        close(np.sum(axes * tau, axis=1), torques[6:], np.linalg.norm(a))


def test_joint_wrenches_are_those_of_this_configuration(fullam):
    """RNEA alone leaves the placements of an earlier call in the workspace."""
    s = random_states(4, "ordinary", 2, np.random.default_rng(0))
    used, fresh = mb.Multibody(fullam), mb.Multibody(fullam)
    a = np.zeros(10)
    used.joint_wrenches(s.q[0], s.v[0], a)
    for found, expected in zip(
        used.joint_wrenches(s.q[1], s.v[1], a), fresh.joint_wrenches(s.q[1], s.v[1], a), strict=True
    ):
        np.testing.assert_array_equal(found, expected)


def test_a_tool_wrench_does_not_outlive_its_call(fullam):
    s = random_states(4, "external", 1, np.random.default_rng(0))
    engine, a = mb.Multibody(fullam), np.zeros(10)
    free = engine.root_wrench(s.q[0], s.v[0], a)
    pushed = engine.root_wrench(s.q[0], s.v[0], a, s.tool_wrench[0])
    assert np.abs(pushed - free).max() > 1.0
    np.testing.assert_array_equal(engine.root_wrench(s.q[0], s.v[0], a), free)


def test_results_own_their_memory(fullam):
    s = random_states(4, "ordinary", 2, np.random.default_rng(0))
    engine, a = mb.Multibody(fullam), np.zeros(10)
    first = engine.root_wrench(s.q[0], s.v[0], a)
    kept = first.copy()
    engine.root_wrench(s.q[1], s.v[1], a)
    np.testing.assert_array_equal(first, kept)


def test_accelerations_convert_both_ways():
    s = random_states(2, "fast", COUNT, np.random.default_rng(0))
    for q, v, _, a_W, _ in rows(s):
        back = mb.world_acceleration(q, v, mb.body_acceleration(q, v, a_W))
        # Terms w x v reach 20 * 30.
        np.testing.assert_allclose(back, a_W, atol=1e-12)


def test_world_acceleration_is_the_frames_classical_one(fullam):
    s = random_states(4, "fast", 5, np.random.default_rng(0))
    data = fullam.create_data()
    for q, v, ddtheta, wrench_A, _ in rows(s):
        pin.forwardKinematics(fullam.model, data, q, v, np.concatenate([wrench_A, ddtheta]))
        classical = pin.getClassicalAcceleration(
            fullam.model, data, 1, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        np.testing.assert_allclose(
            mb.world_acceleration(q, v, wrench_A), classical.vector, atol=1e-11
        )


def test_platform_inertia_is_26s_blkdiag_with_the_com_at_the_origin(fullam):
    engine = mb.Multibody(fullam)
    q = fullam.neutral()
    q[3:7] = pin.Quaternion(pin.exp3(np.array([0.3, -0.4, 0.5]))).coeffs()
    R, M = mb.rotation_of(q), engine.platform_inertia(q)
    np.testing.assert_allclose(M[:3, :3], fullam.platform_mass * np.eye(3), atol=1e-15)
    np.testing.assert_allclose(M[3:, 3:], R @ fullam.platform_inertia @ R.T, atol=1e-15)
    np.testing.assert_array_equal(M[:3, 3:], np.zeros((3, 3)))


def test_a_model_without_free_flyer_or_tool_is_refused(fullam):
    model = pin.Model()
    model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "hinge")
    with pytest.raises(VehicleError, match="free flyer"):
        mb.Multibody(model)
    with pytest.raises(UnknownName, match="gripper"):
        mb.Multibody(fullam.model, "gripper")
