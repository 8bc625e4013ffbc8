import numpy as np
import pinocchio as pin
import pytest

from fullam.analysis.random_states import random_states
from fullam.dynamics import kinematics as kin
from fullam.dynamics.rotations import exponential, logarithm, relative_rotation
from fullam.model.chain import LinkChain

COUNT = 40
H = 5e-3
"""Step of the stencils [s]."""

STENCIL = 1e-5
"""Relative error of the finite differences. They are of fourth order: h^4 f^(5) / 30 and h^4
f^(6) / 90 with rates up to 7 rad/s adding up along the chain, so h w < 0.1 and the share left out
is below (h w)^4 / 30 = 3e-6; rounding is 1e-16 / h^2 = 4e-12."""

ROUNDING = 1e-13
"""Some ten products along the chain."""


class Path:
    """A smooth motion whose first and second derivatives at t = 0 are given."""

    def __init__(self, chain, rng):
        self.chain = chain
        self.p, self.v, self.a, self.w, self.dw = rng.uniform(-2, 2, (5, COUNT, 3))
        self.theta, self.dtheta, self.ddtheta = rng.uniform(-2, 2, (3, COUNT, chain.n))
        axes = rng.normal(size=(COUNT, 3))
        self.R = exponential(axes / np.linalg.norm(axes, axis=1, keepdims=True), 1.0)
        self.motion = kin.link_motion(
            chain, self.R, self.p, self.w, self.v, self.theta, self.dtheta
        )
        self.acceleration = kin.link_acceleration(chain, self.motion, self.ddtheta, self.dw, self.a)

    def attitudes(self, t):
        """Rotation vector w t + dw t^2 / 2: angular velocity w and acceleration dw at t = 0."""
        turned = self.w * t + self.dw * (t * t / 2)
        angle = np.linalg.norm(turned, axis=1)
        axis = turned / np.where(angle > 0, angle, 1.0)[:, None]
        return kin.attitudes(self.chain, exponential(axis, angle) @ self.R, self.joints(t))

    def joints(self, t):
        return self.theta + self.dtheta * t + self.ddtheta * (t * t / 2)

    def positions(self, t):
        at_t = self.p + self.v * t + self.a * (t * t / 2)
        p, p_c = kin.positions(self.chain, self.attitudes(t), at_t, self.joints(t))
        return np.concatenate([p[:, :-1], p_c], axis=1)


@pytest.fixture(params=["R", "RRR", "RRRRRR", "P", "RPR", "PRPPR"])
def path(request, make_chain):
    rng = np.random.default_rng(len(request.param))
    return Path(LinkChain.from_model(make_chain(request.param, rng), "tool"), rng)


def first(f):
    """df/dt at 0, fourth order."""
    return (8 * (f(H) - f(-H)) - (f(2 * H) - f(-2 * H))) / (12 * H)


def second(f):
    """d^2f/dt^2 at 0, fourth order."""
    return (16 * (f(H) + f(-H)) - (f(2 * H) + f(-2 * H)) - 30 * f(0.0)) / (12 * H * H)


def assert_close(found, expected):
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, atol=STENCIL * scale, rtol=0)


def turned_since_start(path):
    """Rotation vector of every link relative to t = 0; its derivatives at 0 are w and dw."""
    start = path.attitudes(0.0)
    return lambda t: logarithm(relative_rotation(path.attitudes(t), start))


def test_angular_velocity_8_is_the_derivative_of_the_attitudes_5(path):
    assert_close(path.motion.w, first(turned_since_start(path)))


def test_velocities_9_are_the_derivative_of_the_positions_6(path):
    both = np.concatenate([path.motion.v, path.motion.v_c], axis=1)
    assert_close(both, first(path.positions))


def test_angular_acceleration_10_is_the_second_derivative_of_the_attitudes_5(path):
    assert_close(path.acceleration.dw, second(turned_since_start(path)))


def test_accelerations_11_are_the_second_derivative_of_the_positions_6(path):
    both = np.concatenate([path.acceleration.ddp, path.acceleration.ddp_c], axis=1)
    assert_close(both, second(path.positions))


def test_positions_6_and_motion_are_pinocchios(vehicle):
    chain, model = LinkChain.from_vehicle(vehicle), vehicle.model
    states = random_states(vehicle.n_arm, "ordinary", COUNT, np.random.default_rng(0))
    motion = kin.motion_of(chain, states.q, states.v)
    data = vehicle.create_data()
    for k in range(COUNT):
        pin.forwardKinematics(model, data, states.q[k], states.v[k])
        pin.updateFramePlacements(model, data)
        tool = data.oMf[model.getFrameId(vehicle.tool)].translation
        np.testing.assert_allclose(motion.p[k, -1], tool, atol=ROUNDING * 10)
        for i in range(chain.n + 1):
            placement = data.oMi[i + 1]
            velocity = pin.getVelocity(model, data, i + 1, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            com = placement.act(model.inertias[i + 1].lever)
            for found, expected in (
                (motion.R[k, i], placement.rotation),
                (motion.p[k, i], placement.translation),
                (motion.p_c[k, i], com),
                (motion.w[k, i], velocity.angular),
                (motion.v[k, i], velocity.linear),
            ):
                # Positions are up to 10 m from the origin.
                np.testing.assert_allclose(found, expected, atol=10 * ROUNDING)


def test_platform_pose_1_maps_body_points_to_world():
    R = exponential(np.array([0.0, 0.0, 1.0]), np.pi / 2)
    T = kin.platform_pose(R, np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(T @ [1.0, 0, 0, 1], [1.0, 3.0, 3.0, 1.0], atol=ROUNDING)


def test_a_batch_equals_its_states_one_by_one(vehicle):
    chain = LinkChain.from_vehicle(vehicle)
    states = random_states(vehicle.n_arm, "fast", 6, np.random.default_rng(1))
    q, v = states.q.reshape(2, 3, -1), states.v.reshape(2, 3, -1)
    batch = kin.motion_of(chain, q, v)
    for j in range(2):
        for k in range(3):
            one = kin.motion_of(chain, q[j, k], v[j, k])
            for name, value in vars(one).items():
                # Matrix products of a batch may be summed in another order: rounding only.
                np.testing.assert_allclose(
                    getattr(batch, name)[j, k], value, rtol=1e-12, atol=1e-12
                )


def test_parameters_may_be_a_batch_too(make_chain):
    rng = np.random.default_rng(5)
    chains = [LinkChain.from_model(make_chain(3, rng), "tool") for _ in range(4)]
    states = random_states(3, "ordinary", 4, rng)
    batch = kin.motion_of(LinkChain.stack(chains), states.q, states.v)
    for k, chain in enumerate(chains):
        one = kin.motion_of(chain, states.q[k], states.v[k])
        np.testing.assert_allclose(batch.v_c[k], one.v_c, atol=10 * ROUNDING)
        np.testing.assert_allclose(batch.p[k], one.p, atol=10 * ROUNDING)
