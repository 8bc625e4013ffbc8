"""The kernels' recursion against Pinocchio: every vehicle, any inertias, joints that slide."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.analysis.random_states import random_states
from fullam.dynamics import recursion as rec
from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.multibody import Multibody, world_acceleration
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Spatial, rotate_spatial, rotate_spatial_back
from fullam.model.chain import LinkChain
from fullam.model.loading import load_vehicle
from fullam.model.perturbation import Uncertainty, perturb
from fullam.numbers.records import flat, record

CLOSE = 1e-10
"""Relative to the largest entry: rounding, and the conditioning of inertias of any size."""

VEHICLES = ("fullam", "hextilt", "borinot", "quadrotor_arm")
CHAINS = (0, 1, 4, 7, "P", "RPR", "PPR")


class AtAnInstant:
    """A model in a state, for the kernels and for Pinocchio."""

    def __init__(self, model, q, v, ddtheta):
        self.witness, self.q, self.v, self.ddtheta = Multibody(model), q, v, ddtheta
        links = LinkRows.of(LinkChain.from_model(model)).rows.to_list()
        motions = [rec.JointMotion(*m) for m in zip(q[7:], v[6:], ddtheta, strict=True)]
        joints = [None] * len(motions)
        rec.place_joints(links, motions, joints)
        self.chain, self.gravity = rec.Chain(links, joints), -model.gravity.linear[2]
        self.R = rotation_matrix(tuple(q[3:7].tolist()))
        self.spin = tuple(v[3:6].tolist())
        self.w = tuple((np.reshape(self.R, (3, 3)) @ v[3:6]).tolist())

    def classical(self, a_A):
        """[ddp_A, dw_A] in world axes, from Pinocchio's acceleration of the base."""
        return record(Spatial, world_acceleration(self.q, self.v, a_A[:6]))


def close(found, expected):
    found, expected = np.array([*flat(found)]), np.asarray(expected)
    np.testing.assert_allclose(found, expected, rtol=0, atol=CLOSE * np.abs(expected).max())


def instants(model, rng, count=30):
    for category in ("ordinary", "fast", "singular", "stretched"):
        states = random_states(model.nv - 6, category, count, rng)
        for q, v, ddtheta, wrench in zip(
            states.q, states.v, states.ddtheta, states.wrench_A, strict=True
        ):
            yield AtAnInstant(model, q, v, ddtheta), wrench


def check(model, rng):
    for at, wrench in instants(model, rng):
        g = rec.gravity_in(at.R, at.gravity)
        a_A = at.witness.base_acceleration(at.q, at.v, at.ddtheta, wrench)
        expected = at.classical(a_A)
        found = rec.base_acceleration(at.chain, at.spin, g, record(Spatial, wrench))
        close(rotate_spatial(at.R, found), [*flat(expected)])
        wrench_W = rotate_spatial(at.R, record(Spatial, wrench))
        found = rec.platform_acceleration(at.chain, at.R, at.w, wrench_W, at.gravity)
        close(found, [*flat(expected)])

        a = np.append(a_A, at.ddtheta)
        u_dc = rec.compensation(at.chain, at.R, at.w, expected, at.gravity)
        close(u_dc, at.witness.compensation(at.q, at.v, a))
        inertial = rec.platform_wrench(at.chain, at.R, expected)
        close(inertial, at.witness.platform_inertia(at.q) @ [*flat(expected)])
        root, still = rec.root_wrench(at.chain, at.R, at.w, expected, at.gravity)
        close(rotate_spatial_back(at.R, root), at.witness.root_wrench(at.q, at.v, a))
        at_rest = np.append(-np.cross(at.v[3:6], at.v[:3]), np.append(np.zeros(3), at.ddtheta))
        close(rotate_spatial_back(at.R, still), at.witness.root_wrench(at.q, at.v, at_rest))


@pytest.mark.parametrize("name", VEHICLES)
def test_of_every_vehicle_with_perturbed_inertias(name, rng):
    check(perturb(load_vehicle(name), Uncertainty(0.3), rng).model, rng)


@pytest.mark.parametrize("joints", CHAINS)
def test_of_chains_with_random_axes_inertias_and_joints_that_slide(joints, make_chain, rng):
    check(make_chain(joints, rng), rng)


@pytest.mark.parametrize("name", VEHICLES)
def test_the_composite_body_is_the_inertia_of_the_whole(name, rng):
    """Mass, first moment and inertia: Pinocchio's composite rigid body, arm frozen."""
    model = load_vehicle(name).model
    for at, _ in instants(model, rng, 5):
        body = rec.composite_body(at.chain)
        M = pin.crba(model, model.createData(), at.q)[:6, :6]
        M = np.triu(M) + np.triu(M, 1).T
        a = rng.normal(size=6)
        close(rec.inertial_wrench(body, record(Spatial, a)), M @ a)
        close(rec.solve_body(body, record(Spatial, M @ a)), a)
        center = np.array(body.first_moment) / body.mass
        np.testing.assert_allclose(body.mass, pin.computeTotalMass(model), rtol=1e-13)
        inverse = pin.Quaternion(at.q[3:7]).toRotationMatrix().T
        world = pin.centerOfMass(model, model.createData(), at.q)
        np.testing.assert_allclose(center, inverse @ (world - at.q[:3]), rtol=0, atol=1e-13)
