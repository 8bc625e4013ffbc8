"""The robots of example-robot-data load as flying vehicles, or say which link cannot exist."""

import importlib.metadata
import xml.etree.ElementTree as ET
from pathlib import Path

import pinocchio as pin
import pytest

from fullam.analysis.agreement import agreement
from fullam.exceptions import VehicleError
from fullam.model.vehicle import Vehicle

ROBOTS = Path(
    str(importlib.metadata.distribution("example-robot-data").locate_file("cmeel.prefix"))
).joinpath("share/example-robot-data/robots")
FILES = sorted(str(path.relative_to(ROBOTS)) for path in ROBOTS.rglob("*.urdf"))

REFUSED = {
    # A moment of 3.607e-3 where 3.600e-3 is the most, and in its elbow 12 % above it.
    "romeo_description/urdf/romeo_laas_small.urdf": "inertia of link 'LShoulderYaw_link'",
    "ur_description/urdf/ur3.urdf": "URDF",  # a robot without links
}
"""What is refused, with the field that the message names."""

AGREEMENT = 1e-9
"""Largest relative difference of the witnesses: as in `fullam check`."""


def longest_chain(text):
    """Root link, the moving joints of the longest chain of links, and its tip."""
    robot = ET.fromstring(text)
    joints = robot.findall("joint")
    below = {}
    for joint in joints:
        below.setdefault(joint.find("parent").get("link"), []).append(joint)
    children = {joint.find("child").get("link") for joint in joints}
    links = [link.get("name") for link in robot.findall("link")]
    root = next((name for name in links if name not in children), "base")

    def chain(link):
        """The longest list of moving joints that starts at a link, and its last link."""
        best = ([], link)
        for joint in below.get(link, []):
            names, tip = chain(joint.find("child").get("link"))
            moves = [joint.get("name")] if joint.get("type") != "fixed" else []
            best = max(best, (moves + names, tip), key=lambda found: len(found[0]))
        return best

    return root, *chain(root)


def flying(text, **more):
    """A robot with four rotors on its root link, flown with its longest chain as the arm."""
    root, arm, tip = longest_chain(text)
    rotor = {"axis": [0, 0, 1], "k_f": 1e-5, "k_tau": 1e-7, "max_speed": 1000, "lag": 0.02}
    rotors = [
        rotor | {"position": [x, y, 0.0], "spin": x * y}
        for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))
    ]
    definition = {"name": "robot", "platform": root, "arm": arm, "tool": tip, "rotor": rotors}
    return Vehicle.from_definition(definition | more, text)


def load(file):
    text = (ROBOTS / file).read_text(encoding="utf-8")
    try:
        return flying(text)
    except VehicleError as error:
        return error


@pytest.fixture(scope="module")
def loaded():
    return {file: load(file) for file in FILES}


def test_at_least_65_of_69_robots_load(loaded):
    assert len(FILES) >= 69
    refused = {file: found for file, found in loaded.items() if isinstance(found, VehicleError)}
    assert len(FILES) - len(refused) >= len(FILES) - 4
    assert {file: error.field for file, error in refused.items()} == REFUSED
    assert all(error.problem and error.remedy for error in refused.values())


@pytest.mark.parametrize("file", [file for file in FILES if file not in REFUSED])
def test_a_loaded_robot_has_the_state_of_a_vehicle_and_its_whole_mass(loaded, file):
    vehicle = loaded[file]
    whole = pin.buildModelFromUrdf(str(ROBOTS / file), pin.JointModelFreeFlyer())
    assert vehicle.mass == pytest.approx(pin.computeTotalMass(whole), rel=1e-12)  # sums reordered
    assert (vehicle.model.nq, vehicle.model.nv) == (7 + vehicle.n_arm, 6 + vehicle.n_arm)
    assert vehicle.joints.position_problem(vehicle.neutral()[7:]) is None


@pytest.mark.parametrize(
    "file",
    [
        "allegro_hand_description/urdf/allegro_left_hand.urdf",  # impossible fingers, held
        "double_pendulum_description/urdf/double_pendulum_continuous.urdf",
        "finger_edu_description/robots/finger_edu.urdf",  # a rod
        "hector_description/robots/quadrotor_base.urdf",  # no joints
        "human_description/robots/human.urdf",  # universal joints with massless links between
        "kinova_description/robots/kinova.urdf",  # continuous and revolute
        "panda_description/urdf/panda.urdf",  # a prismatic finger
        "tiago_description/robots/tiago_no_hand.urdf",  # a prismatic torso
    ],
)
def test_the_witnesses_agree_on_a_loaded_robot(loaded, file):
    assert agreement(loaded[file], samples=6).largest < AGREEMENT


def test_trust_overrides_the_refusal():
    text = (ROBOTS / "romeo_description/urdf/romeo_laas_small.urdf").read_text()
    vehicle = flying(text, physics="trust")
    assert any("not checked" in remark for remark in vehicle.remarks)
    with pytest.raises(VehicleError, match=r"physics: is 'trusted'; give one of .*'trust'"):
        flying(text, physics="trusted")


def test_mimic_and_grippers_are_held(loaded):
    panda = loaded["panda_description/urdf/panda.urdf"]
    (held,) = panda.remarks
    assert "panda_finger_joint2" in held
    assert panda.joints.units == ("deg",) * 7 + ("m",)
    # 0 is outside the elbow's limits, so the arm rests where they end.
    assert panda.neutral()[7 + 3] == panda.joints.upper[3] < 0.0
