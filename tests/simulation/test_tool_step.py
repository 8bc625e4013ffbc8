"""One instant of the tool's inverse kinematics against pink, bounded least squares and projection.

Rates are of order 1; ProxQP's own accuracy and the small weight of levels leave 1e-5.
"""

import numpy as np
import pink
import pinocchio as pin
import pytest
from pink.limits import VelocityLimit
from pink.tasks import FrameTask, PostureTask
from scipy.linalg import null_space
from scipy.optimize import lsq_linear

import fullam
from fullam.simulation.tool.kinematics import ToolKinematics
from fullam.simulation.tool.step import RateSolver, RateTask

VEHICLE = fullam.load_vehicle("fullam")
N = 6 + VEHICLE.n_arm
WIDE = np.full(N, 1e3)
CLOSE = 1e-5


@pytest.fixture(params=range(5))
def state(request):
    """A configuration, its Jacobian, and a velocity for the tool."""
    rng = np.random.default_rng(request.param)
    turn = pin.exp3_quat(0.5 * rng.normal(size=3))
    q = np.concatenate([rng.normal(size=3), turn, rng.uniform(-1.0, 1.0, VEHICLE.n_arm)])
    return q, ToolKinematics(VEHICLE).jacobian(q), 0.3 * rng.normal(size=3), rng


def tasks(J, velocity, turn, level=0, rest=0):
    costs = np.array([1.0] * 3 + [0.3] * 3 + [0.05] * (N - 6))
    return [
        RateTask(J, velocity, 1e4),
        RateTask(np.eye(N)[3:6], turn, 2.0, level),
        RateTask(np.eye(N), np.zeros(N), costs, rest),
    ]


def test_the_jacobian_is_that_of_the_place():
    """Central differences at 1e-6: 1e-9."""
    q = np.array([0.3, -0.2, 1.0, *pin.exp3_quat(np.array([0.3, -0.5, 0.2])), -1.0, 0.3, 0.7, 0.1])
    kinematics = ToolKinematics(VEHICLE)
    for k, unit in enumerate(1e-6 * np.eye(N)):
        ahead, behind = (
            kinematics.place(pin.integrate(VEHICLE.model, q, sign * unit)) for sign in (1, -1)
        )
        np.testing.assert_allclose((ahead - behind) / 2e-6, kinematics.jacobian(q)[:, k], atol=1e-8)


@pytest.mark.parametrize("limit", [1e3, 0.2])
def test_pink_finds_the_same_rates(state, limit):
    """The same tasks in pink's words: costs are the square roots of weights.

    Pink's errors are logarithms on SE(3), in which way and turn mix by the length of the step
    beside that of the arm: 3 um beside 0.2 m, 1.5e-5 of rates of order 1.
    """
    q, J, velocity, rng = state
    dt, turn, model = 1e-5, 0.2 * rng.normal(size=3), VEHICLE.model.copy()
    bounds = WIDE.copy()
    bounds[6:] = limit
    ours = RateSolver(N).solve(tasks(J, velocity, turn), -bounds, bounds)

    model.velocityLimit = bounds
    configuration = pink.Configuration(model, model.createData(), q)
    tool = FrameTask(VEHICLE.tool, position_cost=100.0, orientation_cost=0.0)
    place = configuration.get_transform_frame_to_world(VEHICLE.tool)
    tool.set_target(pin.SE3(place.rotation, place.translation + velocity * dt))
    here = configuration.get_transform_frame_to_world("root_joint")
    leaning = FrameTask("root_joint", position_cost=0.0, orientation_cost=np.sqrt(2.0))
    leaning.set_target(pin.SE3(here.rotation @ pin.exp3(turn * dt), here.translation))
    still = FrameTask("root_joint", position_cost=1.0, orientation_cost=np.sqrt(0.3))
    still.set_target(here)
    posture = PostureTask(cost=np.sqrt(0.05))
    posture.set_target(q)
    found = pink.solve_ik(
        configuration,
        [tool, leaning, still, posture],
        dt,
        solver="proxqp",
        limits=[VelocityLimit(model)],
        safety_break=False,
        eps_abs=1e-12,
    )
    np.testing.assert_allclose(ours, found, atol=3e-5)
    assert (np.abs(ours[6:]).max() > limit - CLOSE) == (limit < 1.0), "the bound is met"


@pytest.mark.parametrize("limit", [1e3, 0.1])
def test_bounded_least_squares_finds_the_same_rates(state, limit):
    _, J, velocity, rng = state
    own, bounds = tasks(J, velocity, 0.2 * rng.normal(size=3)), np.full(N, limit)
    ours = RateSolver(N).solve(own, -bounds, bounds)
    roots = [np.sqrt(np.broadcast_to(task.weight, len(task.b))) for task in own]
    A = np.vstack([root[:, None] * task.A for root, task in zip(roots, own, strict=True)])
    b = np.concatenate([root * task.b for root, task in zip(roots, own, strict=True)])
    found = lsq_linear(A, b, (-bounds, bounds), method="bvls", tol=1e-14)
    np.testing.assert_allclose(ours, found.x, atol=CLOSE)
    assert (np.abs(ours).max() > limit - CLOSE) == (limit < 1.0)


def test_strict_levels_are_those_of_projection(state):
    """Unbounded: each level in the null space of those before it."""
    _, J, velocity, rng = state
    own = tasks(J, velocity, 0.2 * rng.normal(size=3), level=1, rest=2)
    ours = RateSolver(N).solve(own, -WIDE, WIDE)
    u, free = np.zeros(N), np.eye(N)
    for task in own:
        root = np.sqrt(np.broadcast_to(task.weight, len(task.b)))[:, None]
        missing = root[:, 0] * (task.b - task.A @ u)
        u = u + free @ np.linalg.lstsq(root * task.A @ free, missing, rcond=1e-9)[0]
        if len(task.b) < N:
            free = free @ null_space(task.A @ free)
    np.testing.assert_allclose(ours, u, atol=1e-4)  # LITTLE leaves 1e-6 of the tool's weight
    np.testing.assert_allclose(J @ ours, velocity, atol=CLOSE)


def test_the_first_level_does_not_give_way_to_the_second():
    """Where bounds leave no room for both: all of the first, and what it leaves of the second."""
    J = np.zeros((1, N))
    J[0, [0, 6]] = 1.0
    bounds = np.full(N, 0.1)
    own = [
        RateTask(J, np.array([0.2]), 1.0, 0),
        RateTask(np.eye(N)[6:7], np.array([-0.1]), 1e6, 1),
        RateTask(np.eye(N), np.zeros(N), 1.0, 2),
    ]
    u = RateSolver(N).solve(own, -bounds, bounds)
    np.testing.assert_allclose(u[[0, 6]], [0.1, 0.1], atol=CLOSE)
