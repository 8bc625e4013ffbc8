import numpy as np
import pytest

from fullam.analysis.random_states import CATEGORIES, random_states
from fullam.dynamics import kinematics as kin
from fullam.dynamics import newton_euler as ne
from fullam.model.chain import LinkChain

COUNT = 50

RELATIVE = 1e-11
"""Rounding of sums over the chain, relative to the largest term in them."""


class Case:
    """Random states of one category, with the recursion's answers."""

    def __init__(self, chain, category, seed=0):
        self.chain = chain
        s = random_states(chain.n, category, COUNT, np.random.default_rng(seed))
        self.motion = kin.motion_of(chain, s.q, s.v)
        self.wrench_W, self.tool_wrench, self.ddtheta = s.wrench_A, s.tool_wrench, s.ddtheta
        self.base = ne.base_acceleration(
            chain, self.motion, s.ddtheta, self.wrench_W, self.tool_wrench
        )
        self.acceleration = kin.link_acceleration(
            chain, self.motion, s.ddtheta, self.base[:, 3:], self.base[:, :3]
        )
        self.f, self.tau = ne.joint_wrenches(
            chain, self.motion, self.acceleration, self.tool_wrench
        )
        self.scale = max(
            np.abs(term).max()
            for term in (
                *ne.inertial_wrenches(chain, self.motion, self.acceleration),
                self.f,
                self.tau,
                self.wrench_W,
            )
        )


SYSTEMS = {"RRRR": 4, "PRRP": 4, "RRRR, tool on link 2": 2, "RPRR, tool on the platform": 0}
"""Kinds of the joints, and the link that carries the tool."""


@pytest.fixture(scope="module", params=SYSTEMS)
def chain(request, make_chain):
    joints, tool_link = request.param[:4], SYSTEMS[request.param]
    model = make_chain(joints, np.random.default_rng(3), tool_link)
    return LinkChain.from_model(model, "tool")


@pytest.fixture(scope="module", params=CATEGORIES)
def case(request, chain):
    return Case(chain, request.param)


def test_residual_of_12_vanishes(case):
    residual = ne.platform_residual(
        case.chain, case.motion, case.acceleration, case.wrench_W, case.f, case.tau
    )
    np.testing.assert_allclose(residual, 0.0, atol=RELATIVE * case.scale)


def test_residual_of_13_vanishes(case):
    residual = ne.link_residuals(case.chain, case.motion, case.acceleration, case.f, case.tau)
    np.testing.assert_allclose(residual, 0.0, atol=RELATIVE * case.scale)


def test_residuals_see_a_wrong_wrench(case):
    wrong = case.f.copy()
    wrong[:, 1] += 1.0  # f_2 is in the equations of links 1 and 2
    residual = ne.link_residuals(case.chain, case.motion, case.acceleration, wrong, case.tau)
    assert (np.abs(residual).max(axis=(0, 2)) > 0.1).tolist() == [True, True, False, False]


def test_root_wrench_is_the_one_that_made_the_acceleration(case):
    found = ne.inverse_dynamics(case.chain, case.motion, case.ddtheta, case.base, case.tool_wrench)
    np.testing.assert_allclose(found, case.wrench_W, atol=RELATIVE * case.scale)


def test_momentum_of_the_whole_vehicle_changes_by_the_outer_wrenches(case):
    """Joint wrenches cancel in the sum over all bodies; the balance knows nothing of them."""
    chain, motion, acceleration = case.chain, case.motion, case.acceleration
    force, moment = ne.inertial_wrenches(chain, motion, acceleration)
    about_origin = motion.p_c - motion.p[:, :1]
    f_end, tau_end = case.tool_wrench[:, :3], case.tool_wrench[:, 3:]
    reach = motion.p[:, -1] - motion.p[:, 0]
    outer_force = case.wrench_W[:, :3] - f_end
    outer_moment = case.wrench_W[:, 3:] - tau_end - np.cross(reach, f_end)
    total_moment = np.sum(moment + np.cross(about_origin, force), axis=1)
    np.testing.assert_allclose(force.sum(axis=1), outer_force, atol=RELATIVE * case.scale)
    np.testing.assert_allclose(total_moment, outer_moment, atol=RELATIVE * case.scale)


@pytest.mark.parametrize("joints", ["RRR", "PRP"])
def test_energy_balance_holds_the_power_of_the_joints(make_chain, joints):
    """dE/dt = rotor power + joint power, with E from (8)(9) alone and f, tau from (13)."""
    chain = LinkChain.from_model(make_chain(joints, np.random.default_rng(8)), "tool")
    case = Case(chain, "ordinary")
    m, a = case.motion, case.acceleration
    inertia = m.R @ chain.inertia @ np.swapaxes(m.R, -1, -2)
    Iw = np.einsum("...ij,...j->...i", inertia, m.w)
    # d/dt of w.I w / 2 is w . I dw: the derivative of I drops out.
    kinetic = np.sum(m.v_c * a.ddp_c * chain.mass[:, None], axis=(1, 2)) + np.sum(
        Iw * a.dw, axis=(1, 2)
    )
    potential = -np.sum(m.v_c * ne.weights(chain), axis=(1, 2))
    rotors = np.sum(case.wrench_W * np.concatenate([m.v[:, 0], m.w[:, 0]], axis=1), axis=1)
    sliding = kin.slides(chain, m.R) * m.dtheta[..., None]
    joints = np.sum(case.tau[:, :-1] * (m.w[:, 1:] - m.w[:, :-1]), axis=(1, 2))
    joints += np.sum(case.f[:, :-1] * sliding, axis=(1, 2))
    scale = np.abs(kinetic).max()
    np.testing.assert_allclose(kinetic + potential, rotors + joints, atol=RELATIVE * scale)


def test_at_rest_joint_one_carries_the_arms_weight(fullam):
    chain = LinkChain.from_vehicle(fullam)
    q, v = fullam.neutral([0.3, -0.4, 0.5, 0.6]), np.zeros(fullam.model.nv)
    motion = kin.motion_of(chain, q, v)
    rest = kin.link_acceleration(chain, motion, np.zeros(4), np.zeros(3), np.zeros(3))
    f, tau = ne.joint_wrenches(chain, motion, rest)
    arm = chain.mass[1:].sum()
    np.testing.assert_allclose(f[0], [0, 0, arm * fullam.gravity], rtol=1e-14, atol=1e-14)
    com = (chain.mass[1:] @ motion.p_c[1:]) / arm
    np.testing.assert_allclose(tau[0], np.cross(com - motion.p[1], f[0]), atol=1e-14)
    # Erratum of (12): were G_A the whole vehicle's weight, the arm's would count twice.
    U_f = ne.root_wrench(chain, motion, rest, f, tau)[:3]
    np.testing.assert_allclose(U_f, [0, 0, fullam.mass * fullam.gravity], rtol=1e-14, atol=1e-14)


def test_the_tool_wrench_reaches_every_joint(fullam):
    chain = LinkChain.from_vehicle(fullam)
    motion = kin.motion_of(chain, fullam.neutral([0.1, 0.2, 0.3, 0.4]), np.zeros(10))
    rest = kin.link_acceleration(chain, motion, np.zeros(4), np.zeros(3), np.zeros(3))
    tool_wrench = np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])
    f, tau = ne.joint_wrenches(chain, motion, rest, tool_wrench)
    f_free, tau_free = ne.joint_wrenches(chain, motion, rest)
    for i in range(4):
        reach = motion.p[-1] - motion.p[i + 1]
        np.testing.assert_allclose(f[i] - f_free[i], tool_wrench[:3], atol=1e-14)
        expected = tool_wrench[3:] + np.cross(reach, tool_wrench[:3])
        np.testing.assert_allclose(tau[i] - tau_free[i], expected, atol=1e-14)
    np.testing.assert_array_equal(np.concatenate([f[-1], tau[-1]]), tool_wrench)


def test_a_platform_alone_falls_and_turns_as_a_rigid_body(make_chain):
    chain = LinkChain.from_model(make_chain(0, np.random.default_rng(1)), "tool")
    case = Case(chain, "external")
    # The tool's wrench then acts on the platform itself.
    np.testing.assert_array_equal(case.f[:, 0], case.tool_wrench[:, :3])
    residual = ne.platform_residual(
        chain, case.motion, case.acceleration, case.wrench_W, case.f, case.tau
    )
    np.testing.assert_allclose(residual, 0.0, atol=RELATIVE * case.scale)


def test_locked_inertia_is_symmetric_and_positive(case):
    M = ne.locked_inertia(case.chain, case.motion)
    np.testing.assert_allclose(M, np.swapaxes(M, -1, -2), atol=1e-13)
    assert np.linalg.eigvalsh(M).min() > 0.0
