import numpy as np
import pytest

from fullam.analysis.random_states import random_states
from fullam.dynamics import kinematics as kin
from fullam.dynamics import matrix_system as ms
from fullam.dynamics import newton_euler as ne
from fullam.exceptions import FullamError
from fullam.model.chain import LinkChain

COUNT = 30

RELATIVE = 1e-10
"""Rounding, 1e-16, times the condition number (up to 1e4) and the sums of a hundred terms."""


def setting(chain, category="external", count=COUNT):
    s = random_states(chain.n, category, count, np.random.default_rng(0))
    return kin.motion_of(chain, s.q, s.v), s


@pytest.fixture(scope="module")
def chain(make_chain):
    """Four links, the platform's centre of mass off the origin of {A}."""
    return LinkChain.from_model(make_chain(4, np.random.default_rng(2)), "tool")


@pytest.mark.parametrize(("n", "size"), [(4, 66), (5, 81), (0, 6)])
def test_layout_gives_each_unknown_and_each_equation_one_place(n, size):
    at = ms.SystemLayout(n)
    assert at.size == size
    links = range(1, n + 1)
    columns = [at.dw_A, at.ddp_A]
    for group in (at.f, at.tau, at.dw, at.ddp, at.ddp_c):
        columns += [group(i) for i in links]
    # The order of X_s is the paper's, so the columns follow one another.
    assert [k for c in columns for k in range(c.start, c.stop)] == list(range(size))
    rows = [at.moment_rows(0), at.force_rows(0)]
    for i in links:
        rows += [
            rows_of(i)
            for rows_of in (
                at.moment_rows,
                at.force_rows,
                at.angular_rows,
                at.com_rows,
                at.origin_rows,
            )
        ]
    assert [k for r in rows for k in range(r.start, r.stop)] == list(range(size))


def test_solution_21_is_the_recursions(chain):
    motion, s = setting(chain)
    system = ms.MatrixSystem(chain, (COUNT,))
    system.assemble(motion, s.ddtheta, s.tool_wrench)
    solution = system.solve_wrench(s.wrench_A)
    base = ne.base_acceleration(chain, motion, s.ddtheta, s.wrench_A, s.tool_wrench)
    full = kin.link_acceleration(chain, motion, s.ddtheta, base[:, 3:], base[:, :3])
    f, tau = ne.joint_wrenches(chain, motion, full, s.tool_wrench)
    for found, expected in (
        (solution.acceleration_W, base),
        (solution.f, f[:, :-1]),
        (solution.tau, tau[:, :-1]),
        (solution.dw, full.dw[:, 1:]),
        (solution.ddp, full.ddp[:, 1:]),
        (solution.ddp_c, full.ddp_c[:, 1:]),
    ):
        tolerance = RELATIVE * np.abs(expected).max()
        np.testing.assert_allclose(found, expected, atol=tolerance, rtol=0)
    # ddp_A of X_s itself is the centre of mass's.
    at = system.layout
    np.testing.assert_allclose(
        solution.X_s[:, at.ddp_A], full.ddp_c[:, 0], atol=RELATIVE * np.abs(full.ddp_c).max()
    )


def test_wanted_acceleration_gives_the_joint_wrenches_of_inverse_dynamics(chain):
    motion, s = setting(chain)
    system = ms.MatrixSystem(chain, (COUNT,))
    system.assemble(motion, s.ddtheta, s.tool_wrench)
    wanted = s.wrench_A / 10.0  # any six numbers
    solution = system.solve_acceleration(wanted)
    full = kin.link_acceleration(chain, motion, s.ddtheta, wanted[:, 3:], wanted[:, :3])
    f, tau = ne.joint_wrenches(chain, motion, full, s.tool_wrench)
    np.testing.assert_allclose(solution.acceleration_W, wanted, atol=1e-12)
    np.testing.assert_allclose(solution.f, f[:, :-1], atol=RELATIVE * np.abs(f).max())
    np.testing.assert_allclose(solution.tau, tau[:, :-1], atol=RELATIVE * np.abs(tau).max())


def test_a_solve_leaves_the_system_as_it_was(chain):
    motion, s = setting(chain)
    system = ms.MatrixSystem(chain, (COUNT,))
    system.assemble(motion, s.ddtheta)
    first = system.solve_wrench(s.wrench_A).X_s
    system.solve_acceleration(s.wrench_A)
    np.testing.assert_array_equal(system.solve_wrench(s.wrench_A).X_s, first)


def test_one_state_equals_its_place_in_a_batch(chain):
    motion, s = setting(chain, count=2)
    batch, single = ms.MatrixSystem(chain, (2,)), ms.MatrixSystem(chain)
    batch.assemble(motion, s.ddtheta, s.tool_wrench)
    one = kin.motion_of(chain, s.q[1], s.v[1])
    # Assembled twice, so that nothing of an earlier state may stay behind.
    single.assemble(kin.motion_of(chain, s.q[0], s.v[0]), s.ddtheta[0], 2.0 * s.tool_wrench[0])
    single.assemble(one, s.ddtheta[1], s.tool_wrench[1])
    np.testing.assert_allclose(single.M, batch.M[1], atol=1e-12)
    np.testing.assert_allclose(single.b, batch.b[1], atol=1e-12)


def test_papers_81_unknowns_hold_the_same_vehicle_as_66(fullam):
    four = LinkChain.from_vehicle(fullam)
    five = LinkChain.from_vehicle(fullam, released="tool_joint")
    s = random_states(4, "ordinary", COUNT, np.random.default_rng(4))
    still = np.zeros((COUNT, 1))
    solutions = []
    for chain, pad in ((four, still[:, :0]), (five, still)):
        q, v = np.hstack([s.q, pad]), np.hstack([s.v, pad])
        system = ms.MatrixSystem(chain, (COUNT,))
        system.assemble(kin.motion_of(chain, q, v), np.hstack([s.ddtheta, pad]))
        solutions.append((system.layout.size, system.solve_wrench(s.wrench_A)))
    (small, short), (large, long) = solutions
    assert (small, large) == (66, 81)
    np.testing.assert_allclose(
        long.acceleration_W, short.acceleration_W, rtol=RELATIVE, atol=RELATIVE
    )
    np.testing.assert_allclose(long.f[:, :4], short.f, atol=RELATIVE * np.abs(short.f).max())
    np.testing.assert_allclose(long.tau[:, :4], short.tau, atol=RELATIVE * np.abs(short.tau).max())
    # What the fixed end link weighs and needs, joint 5 carries.
    f_5 = five.mass[5] * (long.ddp_c[:, 4] - five.gravity)
    np.testing.assert_allclose(long.f[:, 4], f_5, atol=RELATIVE * np.abs(f_5).max())


def test_condition_number_is_moderate_and_one_per_state(make_chain):
    """Fifteen to twenty with masses and inertias of order one; light links add their scale."""
    chain = LinkChain.from_model(make_chain(5, np.random.default_rng(0)), "tool")
    n = chain.n
    of_order_one = LinkChain(
        np.ones(n + 1),
        0.3 * np.ones((n + 1, 3)),
        np.tile(np.eye(3), (n + 1, 1, 1)),
        chain.placement_R,
        chain.placement_P,
        chain.axis,
        chain.tool_P,
        chain.gravity,
    )
    motion, s = setting(of_order_one)
    system = ms.MatrixSystem(of_order_one, (COUNT,))
    system.assemble(motion, s.ddtheta)
    condition = system.condition_number()
    assert condition.shape == (COUNT,)
    assert condition.max() < 100.0


def wrench_by_26(chain, motion, wanted, f_1, tau_1, compensation):
    """Eq. (26): platform inertia times the wanted acceleration plus u_dc."""
    inertia = ms.platform_inertia(chain, motion)
    return np.einsum("...ij,...j->...i", inertia, wanted) + compensation(chain, motion, f_1, tau_1)


def printed_compensation(chain, motion, f_1, tau_1):
    """Eq. (20) as printed, but for the order of its rows: the force row is G_A - f_1."""
    u_dc = ms.compensation(chain, motion, f_1, tau_1)
    printed_force = ne.weights(chain)[..., 0, :] - f_1
    return np.concatenate([printed_force, u_dc[..., 3:]], axis=-1)


def achieves(chain, wanted, compensation):
    """Whether eq. (26) with this compensation makes (12)-(13) accelerate as wanted."""
    motion, s = setting(chain, "ordinary")
    full = kin.link_acceleration(chain, motion, s.ddtheta, wanted[3:], wanted[:3])
    f, tau = ne.joint_wrenches(chain, motion, full)
    u = wrench_by_26(chain, motion, wanted, f[:, 0], tau[:, 0], compensation)
    made = ne.base_acceleration(chain, motion, s.ddtheta, u)
    return bool(np.all(np.abs(made - wanted) < 1e-8 * np.abs(wanted).max()))


WANTED = np.array([0.3, -0.2, 0.5, 1.0, -2.0, 0.7])


def test_compensation_20_with_26_achieves_the_wanted_acceleration(fullam, chain):
    # fullam: the paper's case, centre of mass at the origin; chain: off it.
    assert achieves(LinkChain.from_vehicle(fullam), WANTED, ms.compensation)
    assert achieves(chain, WANTED, ms.compensation)


def test_printed_compensation_20_does_not(fullam):
    assert not achieves(LinkChain.from_vehicle(fullam), WANTED, printed_compensation)


def test_printed_20_doubles_the_terms_that_it_should_cancel(fullam):
    """(26) with the printed row in (12): m ddp = m a + 2 (G_A - f_1) instead of m a."""
    chain = LinkChain.from_vehicle(fullam)
    motion, s = setting(chain, "ordinary")
    f_1, tau_1 = s.wrench_A[:, :3], s.wrench_A[:, 3:]
    u = printed_compensation(chain, motion, f_1, tau_1)[:, :3]
    left_over = u - f_1 + ne.weights(chain)[0]
    np.testing.assert_allclose(left_over, 2 * (ne.weights(chain)[0] - f_1), atol=1e-12)


def test_compensation_with_com_at_the_origin_is_20_literally(fullam):
    chain = LinkChain.from_vehicle(fullam)
    np.testing.assert_array_equal(chain.com[0], np.zeros(3))
    motion, s = setting(chain, "fast")
    f_1, tau_1 = s.wrench_A[:, :3], s.wrench_A[:, 3:]
    R, w = motion.R[:, 0], motion.w[:, 0]
    I_A = R @ chain.inertia[0] @ np.swapaxes(R, -1, -2)
    r_out = motion.p[:, 1] - motion.p[:, 0]
    force = f_1 - chain.mass[0] * chain.gravity
    moment = np.cross(w, np.einsum("kij,kj->ki", I_A, w)) + tau_1 + np.cross(r_out, f_1)
    found = ms.compensation(chain, motion, f_1, tau_1)
    np.testing.assert_allclose(found, np.hstack([force, moment]), atol=1e-12)


def test_nothing_can_be_solved_before_a_state_is_assembled(chain):
    system = ms.MatrixSystem(chain)
    with pytest.raises(FullamError, match="assemble"):
        system.solve_wrench(np.zeros(6))
