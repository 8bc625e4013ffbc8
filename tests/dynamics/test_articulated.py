"""The articulated-body kernels against Pinocchio: every vehicle, any chain, joints that slide."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest

from fullam.analysis.random_states import random_states
from fullam.dynamics import articulated as art
from fullam.dynamics import recursion as rec
from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.multibody import ROOT
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Spatial
from fullam.model.chain import LinkChain
from fullam.model.loading import load_vehicle
from fullam.model.perturbation import Uncertainty, perturb
from fullam.numbers.records import flat, record

CLOSE = 1e-10
"""Relative to the largest entry: rounding, and the conditioning of inertias of any size."""

VEHICLES = ("fullam", "hextilt", "borinot", "quadrotor_arm")
CHAINS = (0, 1, 4, 7, "P", "RPR", "PPR")


def chain_model(kinds, rng):
    """A free flyer with a serial arm of random bodies; R turns and P slides, about any axis."""
    kinds = "R" * kinds if isinstance(kinds, int) else kinds
    model, joint = pin.Model(), 0
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    for i, kind in enumerate(kinds):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        unaligned = {"R": pin.JointModelRevoluteUnaligned, "P": pin.JointModelPrismaticUnaligned}
        joint = model.addJoint(joint, unaligned[kind](axis), pin.SE3.Random(), f"joint {i}")
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    return model


class Motor(NamedTuple):
    """What the sweeps read of a servo."""

    armature: float


class Instant:
    """A model in a state under torques, for the kernels and for Pinocchio."""

    def __init__(self, model, q, v, rng):
        n = model.nv - 6
        self.model, self.data, self.q, self.v = model, model.createData(), q, v
        self.wrench, self.push = rng.normal(size=(2, 6)) * 10.0
        self.torques, self.armature = rng.normal(size=n), rng.uniform(0.0, 0.01, n)
        model.armature = np.append(np.zeros(6), self.armature)
        self.links = LinkRows.of(LinkChain.from_model(model)).rows.to_list()
        self.arm = art.ArmRows(*(rows.to_list() for rows in art.ArmRows.empty(n)))
        for i, (position, rate) in enumerate(zip(q[7:].tolist(), v[6:].tolist(), strict=True)):
            self.arm.motions[i] = rec.JointMotion(position, rate, 0.0)
        self.arm.torques[:] = self.torques.tolist()
        self.g = rec.gravity_in(rotation_matrix(tuple(q[3:7].tolist())), 9.81)

    def kernels(self):
        """Pinocchio's acceleration by the kernels, shape (nv,)."""
        w = tuple(self.v[3:6].tolist())
        art.sweep_out(self.links, w, self.arm)
        art.push_last(self.arm, record(Spatial, self.push))
        motors = [Motor(armature) for armature in self.armature.tolist()]
        a = art.swept_acceleration(motors, self.g, record(Spatial, self.wrench), self.arm)
        a = np.array([*flat(a), *self.arm.accelerations])
        a[:3] -= np.cross(self.v[3:6], self.v[:3])
        return a

    def forces(self):
        """The wrench on the platform and the push on the last link, as Pinocchio takes them."""
        pin.forwardKinematics(self.model, self.data, self.q)
        forces = pin.StdVec_Force()
        forces.extend([pin.Force.Zero() for _ in range(self.model.njoints)])
        last = self.model.njoints - 1
        placed = self.data.oMi[ROOT].actInv(self.data.oMi[last])
        forces[last] += placed.actInv(pin.Force(self.push))
        return forces

    @property
    def tau(self):
        return np.append(self.wrench, self.torques)

    def aba(self):
        return pin.aba(self.model, self.data, self.q, self.v, self.tau, self.forces()).copy()

    def rnea(self, a):
        return pin.rnea(self.model, self.data, self.q, self.v, a, self.forces()).copy()


def instants(model, rng, count=10):
    for category in ("ordinary", "fast", "singular", "stretched"):
        states = random_states(model.nv - 6, category, count, rng)
        for q, v in zip(states.q, states.v, strict=True):
            yield Instant(model, q, v, rng)


def errors(at):
    """Of the accelerations against ABA, and of the torques that RNEA finds for them; relative."""
    a = at.kernels()
    expected = at.aba()
    off = np.abs(a - expected).max() / np.abs(expected).max()
    # Torques differ by what inertia makes of an error of the accelerations.
    scale = max(np.abs(at.tau).max(), np.abs(at.rnea(0.0 * a)).max())
    return off, np.abs(at.rnea(a) - at.tau).max() / scale


def models(rng):
    for name in VEHICLES:
        nominal = load_vehicle(name)
        yield name, perturb(nominal, Uncertainty(0.5), rng).model
    for kinds in CHAINS:
        yield kinds, chain_model(kinds, rng)


MODELS = dict(models(np.random.default_rng(1)))


@pytest.mark.parametrize("name", MODELS)
def test_accelerations_are_pinocchios_and_rnea_finds_the_torques(name):
    for at in instants(MODELS[name], np.random.default_rng(2)):
        assert max(errors(at)) < CLOSE


@pytest.mark.parametrize("name", MODELS)
def test_with_the_joints_accelerations_prescribed_it_is_the_recursions(name):
    for at in instants(MODELS[name], np.random.default_rng(3), count=3):
        found = at.kernels()
        w = tuple(at.v[3:6].tolist())
        motions = [
            m._replace(acceleration=a)
            for m, a in zip(at.arm.motions, found[6:].tolist(), strict=True)
        ]
        joints = [None] * len(motions)
        rec.place_joints(at.links, motions, joints)
        wrench = record(Spatial, at.wrench + at.push)
        a = rec.base_acceleration(rec.Chain(at.links, joints), w, at.g, wrench)
        prescribed = np.array([*flat(a)])
        prescribed[:3] -= np.cross(at.v[3:6], at.v[:3])
        np.testing.assert_allclose(prescribed, found[:6], 0, CLOSE * np.abs(found).max())


@pytest.mark.parametrize("name", MODELS)
def test_torques_that_hold_the_arm_up(name):
    for at in instants(MODELS[name], np.random.default_rng(4), count=3):
        art.sweep_out(at.links, (0.0, 0.0, 0.0), at.arm)
        art.holding_torques(at.g, at.arm)
        held = pin.computeGeneralizedGravity(at.model, at.data, at.q)
        assert at.arm.torques == pytest.approx(held[6:].tolist(), rel=0, abs=CLOSE * 100.0)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("bracket", lambda u, w: Spatial((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))),
        ("momentum_rate", lambda inertia, velocity: Spatial((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))),
        (
            "less_product",
            lambda H, s, a, b: tuple(h - s * x for h, x in zip(H, a * 3, strict=True)),
        ),
        ("push_last", lambda arm, push: None),
    ],
)
def test_a_planted_bug_is_caught(monkeypatch, name, wrong):
    at = next(instants(MODELS["fullam"], np.random.default_rng(5)))
    assert max(errors(at)) < CLOSE
    monkeypatch.setattr(art, name, wrong)
    assert max(errors(at)) > 1e3 * CLOSE
