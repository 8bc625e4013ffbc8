"""What is not the arm's is held; Pinocchio's own reduction of a model is the witness."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.exceptions import VehicleError
from fullam.model.articulation import articulate, build_model
from fullam.model.chain import LinkChain
from fullam.model.vehicle import Vehicle

ROUNDING = 1e-12
"""A placement written as decimal text and read again, and sums in another order."""

LINK = """<link name="{}"><inertial><origin xyz="0.02 0.01 -0.05"/><mass value="{}"/>
<inertia ixx="0.01" ixy="0.001" ixz="0" iyy="0.012" iyz="0" izz="0.009"/></inertial></link>"""
JOINT = """<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/>
<origin xyz="0.1 -0.2 0.05" rpy="0.3 -0.2 0.5"/><axis xyz="{}"/>
<limit lower="{}" upper="{}" effort="1" velocity="2"/></joint>"""
BRANCHES = "\n".join(
    [
        '<robot name="r">',
        *(LINK.format(name, mass) for name, mass in zip("abcdefg", range(1, 8), strict=True)),
        JOINT.format("slide", "prismatic", "a", "b", "0 0.6 0.8", -0.1, 0.15),
        JOINT.format("wheel", "continuous", "b", "c", "1 0 0", 0, 0),
        JOINT.format("wrist", "revolute", "c", "d", "0 0 1", -1, 1.5),
        JOINT.format("claw", "prismatic", "d", "e", "0 1 0", 0.02, 0.08),
        JOINT.format("propeller", "continuous", "a", "f", "0 0 1", 0, 0),
        JOINT.format("leg", "revolute", "b", "g", "0.6 0 0.8", 0.2, 1),
        "</robot>",
    ]
)
"""Platform a with the arm b, c, d, the claw e, and branches f and g."""

DEFINITION = {
    "name": "branches",
    "platform": "a",
    "arm": ["slide", "wheel", "wrist"],
    "tool": "d",
    "rotor": [
        {"frame": "f", "spin": 1, "k_f": 1e-5, "k_tau": 1e-7, "max_speed": 900, "lag": 0.0},
    ],
}


def load(**more):
    return Vehicle.from_definition(DEFINITION | more, BRANCHES)


@pytest.mark.parametrize(
    ("held", "positions"),
    [({}, (0.02, 0.0, 0.2)), ({"claw": 0.05, "propeller": -2.0, "leg": 0.7}, (0.05, -2.0, 0.7))],
)
def test_held_joints_are_pinocchios_reduced_model(held, positions):
    vehicle = load(held=held)
    whole = build_model(BRANCHES)
    q = pin.neutral(whole)
    for name, position in zip(("claw", "propeller", "leg"), positions, strict=True):
        q[whole.idx_qs[whole.getJointId(name)]] = position
    locked = [whole.getJointId(name) for name in ("claw", "propeller", "leg")]
    reduced = pin.buildReducedModel(whole, locked, q)
    assert list(vehicle.model.names) == list(reduced.names)
    theta = np.array([0.1, 2.5, -0.4])
    for model in (vehicle.model, reduced):
        model.gravity.linear = np.array([0.0, 0.0, -9.81])
    state = np.concatenate([pin.neutral(reduced)[:7], theta])
    v, a = np.random.default_rng(0).normal(size=(2, reduced.nv))
    forces = [pin.rnea(m, m.createData(), state, v, a) for m in (vehicle.model, reduced)]
    np.testing.assert_allclose(forces[0], forces[1], atol=ROUNDING * np.abs(forces[1]).max())
    frames = []
    for model in (vehicle.model, reduced):
        data = model.createData()
        pin.framesForwardKinematics(model, data, state)
        frames.append([data.oMf[model.getFrameId(link)].homogeneous for link in "abcdefg"])
    np.testing.assert_allclose(frames[0], frames[1], atol=ROUNDING)
    (remark,) = vehicle.remarks
    assert all(name in remark for name in ("claw", "propeller", "leg"))


def test_a_continuous_joint_turns_as_pinocchios_with_two_coordinates():
    ours, theirs = build_model(BRANCHES), pin.buildModelFromXML(BRANCHES, pin.JointModelFreeFlyer())
    assert ours.nq == ours.nv + 1
    assert theirs.nq == ours.nq + 2
    q, their_q = pin.neutral(ours), pin.neutral(theirs)
    for name, angle in (("wheel", 7.5), ("propeller", -0.3)):
        q[ours.idx_qs[ours.getJointId(name)]] = angle
        start = theirs.idx_qs[theirs.getJointId(name)]
        their_q[start : start + 2] = np.cos(angle), np.sin(angle)
    one, other = ours.createData(), theirs.createData()
    pin.framesForwardKinematics(ours, one, q)
    pin.framesForwardKinematics(theirs, other, their_q)
    for link in "abcdefg":
        mine, its = one.oMf[ours.getFrameId(link)], other.oMf[theirs.getFrameId(link)]
        np.testing.assert_allclose(mine.homogeneous, its.homogeneous, atol=ROUNDING)


def test_joints_tell_kind_units_limits_and_rest():
    joints = load().joints
    assert joints.names == ("slide", "wheel", "wrist")
    assert joints.units == ("m", "deg", "deg")
    np.testing.assert_array_equal(joints.lower, [-0.1, -np.inf, -1.0])
    np.testing.assert_array_equal(joints.upper, [0.15, np.inf, 1.5])
    np.testing.assert_array_equal(joints.max_rates, [2.0, 2.0, 2.0])
    np.testing.assert_array_equal(joints.rest, np.zeros(3))
    np.testing.assert_allclose(joints.from_typed([0.1, 720.0, 45.0]), [0.1, 4 * np.pi, np.pi / 4])
    np.testing.assert_allclose(joints.to_typed(joints.from_typed([0.1, 9, 45])), [0.1, 9, 45])


@pytest.mark.parametrize(
    ("position", "problem"),
    [
        ([0.15, 100.0, 1.5], None),
        ([0.4, 0.0, 0.0], "takes joint 'slide' to 0.4 m; it goes from -0.1 to 0.15 m"),
        ([0.0, 0.0, -1.1], "takes joint 'wrist' to -63.03 deg; it goes from -57.3 to 85.94 deg"),
    ],
)
def test_a_position_beyond_a_limit_is_named_in_its_unit(position, problem):
    joints = load().joints
    rows = np.vstack([np.zeros(3), position])
    assert joints.position_problem(rows) == problem


def test_a_rate_beyond_a_limit_is_named_in_its_unit():
    joints = load().joints
    assert joints.rate_problem(np.array([[0.0, -2.1, 0.0]])) == (
        "moves joint 'wheel' at 120.3 deg/s; it can 114.6 deg/s"
    )


def test_the_chain_is_the_arms():
    chain = LinkChain.from_vehicle(load(tool="b"))
    assert chain.prismatic.tolist() == [True, False, False]
    assert chain.tool_link == 1
    assert chain.mass.tolist() == [1 + 6, 2 + 7, 3, 4 + 5]


@pytest.mark.parametrize(
    ("change", "field", "problem"),
    [
        ({"arm": ["slide", "wrist"]}, "arm", "'wheel' moves the arm, too"),
        ({"tool": "e"}, "arm", "'claw' moves the tool 'e', too"),
        ({"arm": ["slide", "leg", "wheel"]}, "arm", "'wheel' does not follow 'leg'"),
        ({"arm": ["wheel", "slide"]}, "arm", "'slide' does not follow 'wheel'"),
        ({"arm": ["slide", "a"]}, "arm", "names 'a', no joint"),
        ({"held": {"wing": 0.0}}, "held.wing", "is no joint"),
        ({"held": {"wrist": 0.0}}, "held.wrist", "is a joint of the arm"),
        ({"held": {"claw": 0.0}}, "held.claw", "is 0"),
        ({"held": {"claw": "open"}}, "held.claw", "is 'open'"),
        ({"held": ["claw"]}, "held", "is ['claw']"),
        ({"arm": {"joints": ["slide"], "joint": 1}}, "arm.joint", "not a known key"),
    ],
)
def test_a_mistake_is_named(change, field, problem):
    with pytest.raises(VehicleError) as caught:
        load(**change)
    assert caught.value.field == field
    assert problem in caught.value.problem
    assert caught.value.remedy


def test_a_joint_of_the_chain_can_be_held_by_name():
    vehicle = load(arm={"joints": ["slide", "wrist"]}, held={"wheel": 1.0})
    assert vehicle.arm_joints == ("slide", "wrist")


def test_held_data_rebuild_the_vehicle_bit_for_bit():
    vehicle = load(held={"leg": 0.7})
    again = Vehicle.from_data(vehicle.to_data())
    assert again.model == vehicle.model
    assert again.urdf == vehicle.urdf


def test_what_needs_no_change_keeps_its_text():
    arm = ("slide", "wheel", "wrist", "claw", "propeller", "leg")
    with pytest.raises(VehicleError, match="branches"):
        articulate(BRANCHES, arm, "e", {}, "here")
    once = articulate(BRANCHES, arm[:4], "e", {}, "here").urdf
    assert articulate(once, arm[:4], "e", {}, "here").urdf is once
