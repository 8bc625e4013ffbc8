"""Vehicles are found by name and by path, and every mistake in their files is named."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from fullam.exceptions import UnknownName, VehicleError
from fullam.model.loading import load_vehicle, vehicle_folders, vehicle_names

URDF = """<robot name="mini">
  <link name="base">
    <inertial><mass value="1"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
  </link>
  <link name="motor"/>
  <joint name="motor_joint" type="fixed"><parent link="base"/><child link="motor"/>
    <origin xyz="0.3 0.1 0" rpy="0.5 0 0"/></joint>
  <link name="arm">
    <inertial><origin xyz="0 0 -0.1"/><mass value="0.2"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
  </link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/>
    <axis xyz="0 1 0"/><limit effort="1" velocity="1" lower="-1" upper="1"/></joint>
  <link name="tip"/>
  <joint name="tip_joint" type="fixed"><parent link="arm"/><child link="tip"/></joint>
</robot>
"""
TOML = """name = "mini"
urdf = "mini.urdf"
platform = "base"
arm = ["shoulder"]
tool = "tip"
mass = 1.2
[rotor_defaults]
k_f = 1e-5
k_tau = 1e-7
max_speed = 1000.0
lag = 0.02
[[rotor]]
frame = "motor"
spin = 1
[[rotor]]
name = "left"
position = [0.0, 0.3, 0.0]
axis = [0.0, 0.0, 1.0]
spin = -1
k_f = 2e-5
"""


def write(folder: Path, toml: str = TOML, urdf: str = URDF) -> Path:
    (folder / "mini.urdf").write_text(urdf)
    path = folder / "mini.toml"
    path.write_text(toml)
    return path


def test_a_vehicle_of_ones_own_loads_from_its_path(tmp_path):
    vehicle = load_vehicle(write(tmp_path))
    rotors = vehicle.rotors
    assert rotors.names == ("motor", "left")
    np.testing.assert_allclose(rotors.positions, [[0.3, 0.1, 0.0], [0.0, 0.3, 0.0]])
    # The frame's z after a roll of 0.5 rad; 1e-12 covers the rounding of Pinocchio's rotation.
    tilted = [0.0, -np.sin(0.5), np.cos(0.5)]
    np.testing.assert_allclose(rotors.axes, [tilted, [0.0, 0.0, 1.0]], atol=1e-12)
    np.testing.assert_array_equal(rotors.k_f, [1e-5, 2e-5])
    np.testing.assert_array_equal(rotors.spins, [1.0, -1.0])
    assert vehicle.source == str(tmp_path / "mini.toml")
    assert vehicle.mass == pytest.approx(1.2, rel=1e-15)
    assert load_vehicle(str(tmp_path / "mini.toml")).name == "mini"


def test_gravity_can_be_stated(tmp_path):
    vehicle = load_vehicle(write(tmp_path, "gravity = 9.8\n" + TOML))
    assert vehicle.gravity == 9.8
    np.testing.assert_array_equal(vehicle.model.gravity.linear, [0.0, 0.0, -9.8])


def test_a_vehicle_without_an_arm_loads(tmp_path):
    start, end = URDF.index('  <link name="arm">'), URDF.index("</robot>")
    toml = TOML.replace('["shoulder"]', "[]").replace('"tip"', '"base"').replace("1.2", "1.0")
    vehicle = load_vehicle(write(tmp_path, toml, URDF[:start] + URDF[end:]))
    assert vehicle.n_arm == 0
    assert vehicle.neutral().shape == (7,)


def test_the_registered_names_are_the_files():
    assert {"fullam", "hextilt", "borinot", "quadrotor_arm"} <= set(vehicle_names())
    assert vehicle_names() == tuple(sorted(vehicle_names()))


def test_a_new_file_is_a_new_name(tmp_path, monkeypatch):
    shutil.copytree(vehicle_folders()[0], tmp_path / "urdf")
    write(tmp_path / "urdf")
    monkeypatch.setattr("fullam.model.loading.vehicle_folders", lambda: (tmp_path / "urdf",))
    assert "mini" in vehicle_names()
    assert load_vehicle("mini").name == "mini"


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(UnknownName, match="Did you mean 'hextilt'") as caught:
        load_vehicle("hextil")
    assert caught.value.kind == "vehicle"
    assert caught.value.known == vehicle_names()


MISTAKES = {
    "syntax": (("arm =", "arm ="[:-1]), "TOML", "line 4"),
    "unknown key": (('tool = "tip"', 'tool = "tip"\nwings = 2'), "wings", "not a known key"),
    "unknown rotor key": (("k_f = 2e-5", "kf = 2e-5"), "rotor[2].kf", "not a known key"),
    "unknown default": (("lag = 0.02", "lagg = 0.02"), "rotor_defaults.lagg", "not a known key"),
    "no name": (('name = "mini"\n', ""), "name", "missing"),
    "name not text": (('name = "mini"', "name = 3"), "name", "is 3"),
    "no platform": (('platform = "base"\n', ""), "platform", "missing"),
    "platform not the root": (('"base"', '"arm"'), "platform", "not the root link"),
    "no tool": (('tool = "tip"\n', ""), "tool", "missing"),
    "tool not a link": (('"tip"', '"tup"'), "tool", "'tup' is not a link"),
    "missing joint": (('["shoulder"]', "[]"), "arm", "is []"),
    "unknown joint": (('["shoulder"]', '["shoulder", "elbow"]'), "arm", "elbow"),
    "arm not a list": (('["shoulder"]', '"shoulder"'), "arm", "is 'shoulder'"),
    "mass disagrees": (("mass = 1.2", "mass = 1.3"), "mass", "is 1.3 kg"),
    "mass not a number": (("mass = 1.2", 'mass = "1.2"'), "mass", "is '1.2'"),
    "missing URDF": (('"mini.urdf"', '"maxi.urdf"'), "urdf", "maxi.urdf"),
    "missing package": (
        ('"mini.urdf"', '{package = "no-such-data", path = "x"}'),
        "urdf.package",
        "not installed",
    ),
    "missing file in package": (
        ('"mini.urdf"', '{package = "example-robot-data", path = "x.urdf"}'),
        "urdf",
        "x.urdf",
    ),
    "unknown package key": (('"mini.urdf"', '{pakage = "a"}'), "urdf.pakage", "not a known key"),
    "missing frame": (('"motor"', '"rotor"'), "rotor[1].frame", "'rotor' is not a link"),
    "rotor on the arm": (('"motor"', '"tip"'), "rotor[1].frame", "moves with joint 'shoulder'"),
    "frame and axis": (
        ('frame = "motor"', 'frame = "motor"\naxis = [0, 0, 1]'),
        "rotor[1]",
        "has a frame and",
    ),
    "no place": (("axis = [0.0, 0.0, 1.0]\n", ""), "rotor[2]", "has no place"),
    "axis not unit": (("[0.0, 0.0, 1.0]", "[0.0, 0.0, 1.1]"), "axis of rotor 'left'", "length"),
    "axis too short": (("[0.0, 0.0, 1.0]", "[0.0, 1.0]"), "rotor[2].axis", "is [0.0, 1.0]"),
    "axis infinite": (("[0.0, 0.0, 1.0]", "[0.0, 0.0, inf]"), "rotor[2].axis", "is inf"),
    "no spin": (("spin = -1\n", ""), "rotor[2].spin", "missing"),
    "spin of two": (("spin = -1", "spin = -2"), "spins of rotor 'left'", "is -2"),
    "no speed": (("max_speed = 1000.0\n", ""), "rotor[1].max_speed", "missing"),
    "negative k_f": (("k_f = 1e-5", "k_f = -1e-5"), "k_f of rotor 'motor'", "is -1e-05"),
    "boolean": (("lag = 0.02", "lag = true"), "rotor[1].lag", "is True"),
    "same name": (('name = "left"', 'name = "motor"'), "rotor", "motor"),
    "no rotors": ((TOML[TOML.index("[[rotor]]") :], ""), "rotors", "there is none"),
    "rotor not a list": ((TOML[TOML.index("[[rotor]]") :], "[rotor]\n"), "rotor", "not a list"),
}


def assert_named(path, field, problem):
    """The error names the file, the field and the problem, and says what would be right."""
    with pytest.raises(VehicleError) as caught:
        load_vehicle(path)
    assert str(path) in caught.value.where
    assert caught.value.field == field
    assert problem in caught.value.problem
    assert caught.value.remedy


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_the_toml_is_named(tmp_path, mistake):
    (old, new), field, problem = MISTAKES[mistake]
    assert old in TOML
    assert_named(write(tmp_path, TOML.replace(old, new)), field, problem)


URDF_MISTAKES = {
    "not XML": (("</robot>", ""), "XML", "no element found"),
    "negative mass": (('value="0.2"', 'value="-0.2"'), "mass of link 'arm'", "is -0.2 kg"),
    "impossible inertia": (('izz="0.001"', 'izz="0.003"'), "inertia of link 'arm'", "above the"),
    "floating joint": (('type="revolute"', 'type="floating"'), "joint 'shoulder'", "floating"),
    "no limits": (
        ('<limit effort="1" velocity="1" lower="-1" upper="1"/>', ""),
        "URDF",
        "Pinocchio refuses it",
    ),
    "planar joint": (('type="revolute"', 'type="planar"'), "arm", "'shoulder', a planar joint"),
    "no links": ((URDF, "<robot name='r'/>"), "URDF", "has no links"),
    "two roots": (('<parent link="base"/><child link="arm"/>', ""), "platform", "root"),
}


@pytest.mark.parametrize("mistake", URDF_MISTAKES)
def test_a_mistake_in_the_urdf_is_named(tmp_path, mistake):
    (old, new), field, problem = URDF_MISTAKES[mistake]
    assert old in URDF
    assert_named(write(tmp_path, urdf=URDF.replace(old, new)), field, problem)


def without_inertial(link: str) -> str:
    start = URDF.index("<inertial>", URDF.index(f'<link name="{link}">'))
    return URDF[:start] + URDF[URDF.index("</inertial>", start) + len("</inertial>") :]


def test_a_platform_without_mass_is_named(tmp_path):
    with pytest.raises(VehicleError, match="mass") as caught:
        load_vehicle(write(tmp_path, urdf=without_inertial("base")))
    assert caught.value.field == "link 'base'"


def test_an_arm_link_without_mass_is_remarked_upon(tmp_path):
    toml = TOML.replace("mass = 1.2", "mass = 1.0")
    vehicle = load_vehicle(write(tmp_path, toml, without_inertial("arm")))
    assert vehicle.remarks == ("joint 'shoulder' moves a body without mass",)


def test_a_branching_arm_is_named(tmp_path):
    branch = URDF.replace(
        '<link name="tip"/>',
        '<link name="tip"/><link name="other"><inertial><mass value="0.1"/><inertia ixx="0.001" '
        'ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link><joint name="side" '
        'type="revolute"><parent link="base"/><child link="other"/><axis xyz="0 1 0"/>'
        '<limit effort="1" velocity="1" lower="-1" upper="1"/></joint>',
    )
    toml = TOML.replace('["shoulder"]', '["shoulder", "side"]').replace("1.2", "1.3")
    with pytest.raises(VehicleError, match="'side' does not follow 'shoulder'"):
        load_vehicle(write(tmp_path, toml, branch))


@pytest.mark.parametrize("name", ["gone.toml", "folder/gone.toml", "folder/gone"])
def test_a_missing_file_is_named(tmp_path, name):
    with pytest.raises(VehicleError, match="cannot be read") as caught:
        load_vehicle(str(tmp_path / name))
    assert caught.value.where == str(tmp_path / name)


def test_a_urdf_is_not_a_vehicle(tmp_path):
    write(tmp_path)
    with pytest.raises(VehicleError, match="give the TOML beside it"):
        load_vehicle(tmp_path / "mini.urdf")


def test_bytes_that_are_not_text_are_refused(tmp_path):
    path = write(tmp_path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(VehicleError, match="cannot be read"):
        load_vehicle(path)
