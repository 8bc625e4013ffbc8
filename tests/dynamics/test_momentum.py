"""Momentum by the kernel's sweep against Pinocchio's centroidal momentum."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.momentum import momentum
from fullam.dynamics.recursion import Chain, JointMotion, place_joints
from fullam.model.chain import LinkChain
from fullam.model.loading import load_vehicle

ROUNDING = 1e-12
"""Relative: sums over a few links."""


def answers(model, q, v):
    """Momentum [h_f; h_tau] and c by the kernel, {A} axes."""
    links = LinkRows.of(LinkChain.from_model(model)).rows.to_list()
    motions = [JointMotion(x, rate, 0.0) for x, rate in zip(q[7:], v[6:], strict=True)]
    joints = [None] * len(motions)
    place_joints(links, motions, joints)
    h, c = momentum(Chain(links, joints), tuple(v[:3]), tuple(v[3:6]))
    return np.concatenate([*h]), np.array(c)


def check(model, rng):
    data = model.createData()
    for _ in range(10):
        q = pin.neutral(model)
        q[7:] = rng.uniform(-2.0, 2.0, model.nq - 7)  # {A} at the origin of the world, level
        v = rng.normal(size=model.nv)
        expected = pin.computeCentroidalMomentum(model, data, q, v).vector
        h, c = answers(model, q, v)
        np.testing.assert_allclose(h, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())
        np.testing.assert_allclose(c, data.com[0], rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("joints", ["", "R", "P", "RPR", "PRPRRP"])
def test_momentum_is_pinocchio_s(joints, make_chain, rng):
    """Random axes, placements and inertias; turning and sliding joints, and none."""
    check(make_chain(joints, rng), rng)


@pytest.mark.parametrize("name", ["fullam", "hextilt", "borinot"])
def test_momentum_of_a_vehicle_is_pinocchio_s(name, rng):
    check(load_vehicle(name).model, rng)


def test_a_frozen_arm_gives_the_momentum_of_one_rigid_body(fullam, rng):
    """h_f = m (v + w x c): the velocity of the centre of mass, whatever the arm's shape."""
    q, v = pin.neutral(fullam.model), np.zeros(fullam.model.nv)
    q[7:], v[:6] = rng.normal(size=fullam.n_arm), rng.normal(size=6)
    h, c = answers(fullam.model, q, v)
    expected = fullam.mass * (v[:3] + np.cross(v[3:6], c))
    np.testing.assert_allclose(h[:3], expected, rtol=0, atol=1e-12)
