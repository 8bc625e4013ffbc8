import numpy as np
import pytest

from fullam.analysis.random_states import random_states
from fullam.dynamics.multibody import Multibody, body_acceleration, rotation_of
from fullam.dynamics.paper_model import PaperModel
from fullam.exceptions import FullamError

RELATIVE = 1e-10
"""Rounding, 1e-16, times the matrix's condition number and the sums of a hundred terms."""

COUNT = 10


def cases(vehicle):
    s = random_states(vehicle.n_arm, "external", COUNT, np.random.default_rng(0))
    return zip(s.q, s.v, s.ddtheta, s.wrench_A, s.tool_wrench, strict=True)


def close(found, expected):
    tolerance = RELATIVE * np.linalg.norm(expected)
    np.testing.assert_allclose(found, expected, atol=tolerance, rtol=0)


def test_compensation_for_a_wanted_acceleration_is_the_witnesss(vehicle):
    model, witness = PaperModel(vehicle), Multibody(vehicle)
    for q, v, ddtheta, wanted, tool in cases(vehicle):
        a = np.concatenate([body_acceleration(q, v, wanted), ddtheta])
        found = model.compensation(q, v, ddtheta, acceleration_W=wanted, tool_wrench=tool)
        close(found, witness.compensation(q, v, a, tool))


def test_compensation_for_a_given_wrench_is_the_witnesss(vehicle):
    model, witness = PaperModel(vehicle), Multibody(vehicle)
    for q, v, ddtheta, wrench_A, tool in cases(vehicle):
        a_A = witness.base_acceleration(q, v, ddtheta, wrench_A, tool)
        R = rotation_of(q)
        wrench_W = np.concatenate([R @ wrench_A[:3], R @ wrench_A[3:]])
        found = model.compensation(q, v, ddtheta, wrench_W=wrench_W, tool_wrench=tool)
        close(found, witness.compensation(q, v, np.concatenate([a_A, ddtheta]), tool))


def test_papers_five_links_give_the_same_compensation(fullam):
    four, five = PaperModel(fullam), PaperModel(fullam, released="tool_joint")
    assert (four.system.layout.size, five.system.layout.size) == (66, 81)
    for q, v, ddtheta, wanted, tool in cases(fullam):
        pair = [
            model.compensation(q, v, ddtheta, acceleration_W=wanted, tool_wrench=tool)
            for model in (four, five)
        ]
        close(pair[1], pair[0])


def test_the_two_readings_of_the_loop_must_be_told_apart(fullam):
    model, zero = PaperModel(fullam), np.zeros(6)
    q, v, still = fullam.neutral(), np.zeros(10), np.zeros(4)
    with pytest.raises(FullamError, match="either"):
        model.solve(q, v, still)
    with pytest.raises(FullamError, match="either"):
        model.solve(q, v, still, acceleration_W=zero, wrench_W=zero)


def test_previous_wrench_iteration_converges_to_the_exact_compensation(fullam):
    """The paper's text: solve (21) with the wrench applied last, period after period."""
    model = PaperModel(fullam)
    q, v, still = fullam.neutral([-1.5, 0.2, 0.3, 0.4]), np.zeros(10), np.zeros(4)
    wanted = np.array([0.5, -0.3, 0.2, 1.0, 0.5, -0.5])
    exact = model.compensation(q, v, still, acceleration_W=wanted)
    inertia = Multibody(fullam).platform_inertia(q)
    u, apart = np.zeros(6), []
    for _ in range(60):
        u_dc = model.compensation(q, v, still, wrench_W=u)
        apart.append(np.linalg.norm(u_dc - exact))
        u = inertia @ wanted + u_dc
    assert apart[-1] < 1e-9 * np.linalg.norm(exact)
    # It contracts by the arm's share of the inertia: neither at once nor not at all.
    rate = apart[20] / apart[19]
    assert 0.05 < rate < 0.9
