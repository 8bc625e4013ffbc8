import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from fullam.exceptions import UnknownName, VehicleError
from fullam.model.chain import LinkChain, release_joint, released_model
from fullam.model.loading import load_vehicle


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("fullam")


def two_joint_model(kind=None, parent=None, root=None):
    model = pin.Model()
    model.name = "made"
    model.addJoint(0, root or pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.addJoint(1, pin.JointModelRY(), pin.SE3.Identity(), "first")
    model.addJoint(parent or 2, kind or pin.JointModelRX(), pin.SE3.Identity(), "second")
    return model


def test_chain_holds_the_models_numbers(vehicle):
    chain, model = LinkChain.from_vehicle(vehicle), vehicle.model
    assert chain.n == vehicle.n_arm
    for i in range(chain.n + 1):
        link = model.inertias[1 + i]
        assert chain.mass[i] == link.mass
        np.testing.assert_array_equal(chain.com[i], link.lever)
        np.testing.assert_array_equal(chain.inertia[i], link.inertia)
    np.testing.assert_array_equal(chain.axis, np.tile([0, 0, 1], (chain.n, 1)))
    np.testing.assert_array_equal(chain.gravity, [0, 0, -vehicle.gravity])
    tool = model.frames[model.getFrameId(vehicle.tool)]
    np.testing.assert_array_equal(chain.tool_P, tool.placement.translation)


def test_axes_that_are_not_z_are_read():
    # borinot's joints turn about -z
    chain = LinkChain.from_vehicle(load_vehicle("borinot"))
    np.testing.assert_array_equal(chain.axis, [[0, 0, -1], [0, 0, -1]])
    made = LinkChain.from_model(two_joint_model())
    np.testing.assert_array_equal(made.axis, [[0, 1, 0], [1, 0, 0]])


def test_prismatic_joints_are_told_from_revolute_ones():
    assert LinkChain.from_model(two_joint_model()).prismatic.tolist() == [False, False]
    slanted = np.array([0.6, 0.0, 0.8])
    chain = LinkChain.from_model(two_joint_model(kind=pin.JointModelPrismaticUnaligned(slanted)))
    assert chain.prismatic.tolist() == [False, True]
    np.testing.assert_allclose(chain.axis, [[0, 1, 0], slanted], rtol=1e-15)  # Pinocchio normalizes
    stacked = LinkChain.stack([chain, chain])
    np.testing.assert_array_equal(stacked.prismatic, [[False, True]] * 2)
    with pytest.raises(ValueError, match="read-only"):
        chain.prismatic[0] = True


def test_chain_is_frozen_and_owns_its_memory(vehicle):
    mass = np.array([1.0, 2.0])
    chain = dataclasses.replace(LinkChain.from_vehicle(vehicle), mass=mass)
    mass[0] = 5.0
    assert chain.mass[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        chain.mass[0] = 5.0


def test_platform_alone_is_a_chain_of_no_joints():
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    chain = LinkChain.from_model(model)
    assert chain.n == 0
    assert chain.axis.shape == (0, 3)
    assert chain.placement_R.shape == (0, 3, 3)


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (two_joint_model(parent=1), "branches"),
        (two_joint_model(kind=pin.JointModelHZ(0.1)), "JointModelHZ"),
        (two_joint_model(kind=pin.JointModelRUBZ()), "JointModelRUBZ"),
        (two_joint_model(root=pin.JointModelRX()), "free flyer"),
        (pin.Model(), "free flyer"),
    ],
)
def test_a_model_that_is_no_such_chain_is_refused(model, words):
    with pytest.raises(VehicleError, match=words):
        LinkChain.from_model(model)


def test_a_tool_must_exist_and_may_be_on_any_link(vehicle):
    with pytest.raises(UnknownName, match="tol"):
        LinkChain.from_model(vehicle.model, "tol")
    links = ["platform", "link_1", "link_2", "tool"]
    numbers = [LinkChain.from_model(vehicle.model, link).tool_link for link in links]
    assert numbers == [0, 1, 2, 4]
    chain = LinkChain.from_model(vehicle.model, "link_2")
    assert LinkChain.stack([chain, chain]).tool_link == 2


def test_stack_adds_a_leading_axis(vehicle):
    chain = LinkChain.from_vehicle(vehicle)
    double = dataclasses.replace(chain, mass=2.0 * chain.mass)
    stacked = LinkChain.stack([chain, double, chain])
    assert stacked.n == chain.n
    assert stacked.inertia.shape == (3, chain.n + 1, 3, 3)
    np.testing.assert_array_equal(stacked.mass, [chain.mass, double.mass, chain.mass])


def test_released_joint_makes_the_papers_fifth_link(vehicle):
    five = LinkChain.from_vehicle(vehicle, released="tool_joint")
    four = LinkChain.from_vehicle(vehicle)
    assert (four.n, five.n) == (4, 5)
    np.testing.assert_array_equal(five.mass[:4], four.mass[:4])
    # Link 4 of the short chain is links 4 and 5 of the long one; sums differ by rounding.
    assert five.mass[4] + five.mass[5] == pytest.approx(four.mass[4], rel=1e-14)
    np.testing.assert_array_equal(five.axis[4], [0, 0, 1])
    np.testing.assert_allclose(five.placement_P[4], [0, 0, 0.09], rtol=1e-14)


def test_released_model_at_zero_has_the_same_mass_matrix(vehicle):
    model = released_model(vehicle, "tool_joint")
    np.testing.assert_array_equal(model.gravity.linear, vehicle.model.gravity.linear)
    q = vehicle.neutral([0.3, -0.2, 0.5, 0.7])
    short = pin.crba(vehicle.model, vehicle.create_data(), q)
    long = pin.crba(model, model.createData(), np.append(q, 0.0))[:-1, :-1]
    np.testing.assert_allclose(np.triu(long), np.triu(short), atol=1e-14)


def test_only_a_fixed_joint_can_be_released(vehicle):
    with pytest.raises(UnknownName, match="tool_joint"):
        release_joint(vehicle.urdf, "joint_1")
