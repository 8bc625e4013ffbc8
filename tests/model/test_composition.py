"""A platform and an arm in two files, and files that are written as xacro."""

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from fullam.exceptions import MissingDependency, VehicleError
from fullam.model.loading import load_vehicle
from fullam.model.meshes import missing_remark, resolve_meshes

BODY = """<inertial><mass value="{}"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>"""
MESH = '<visual><geometry><mesh filename="{}"/></geometry><material name="grey"/></visual>'
GREY = '<material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>'
PLATFORM = f"""<robot name="platform">{GREY}
<link name="base">{BODY.format(2)}{MESH.format("meshes/base.stl")}</link><link name="belly"/>
<joint name="to_belly" type="fixed"><parent link="base"/><child link="belly"/>
<origin xyz="0 0 -0.1"/></joint></robot>"""
ARM = f"""<robot name="arm">{GREY}
<link name="base">{BODY.format(0.3)}{MESH.format("meshes/base.stl")}</link>
<link name="forearm">{BODY.format(0.2)}{MESH.format("package://none/forearm.stl")}</link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="forearm"/>
<origin xyz="0 0 0.05"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
TOML = """name = "composed"
urdf = "platform/p.urdf"
platform = "base"
tool = "arm_forearm"
[arm]
urdf = "arms/short/a.urdf"
prefix = "arm_"
joints = ["arm_shoulder"]
mount = { link = "belly", position = [0.1, 0.0, -0.02], rpy_deg = [180.0, 0.0, 90.0] }
[[rotor]]
position = [0.0, 0.0, 0.1]
axis = [0.0, 0.0, 1.0]
spin = 1
k_f = 1e-5
k_tau = 1e-7
max_speed = 2000.0
lag = 0.02
"""


def write(folder: Path, toml=TOML, platform=PLATFORM, arm=ARM) -> Path:
    for place, text in (("platform/p.urdf", platform), ("arms/short/a.urdf", arm)):
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        (folder / place).write_text(text)
    (folder / "v.toml").write_text(toml)
    return folder / "v.toml"


def test_an_arm_is_mounted_where_the_toml_says(tmp_path):
    vehicle = load_vehicle(write(tmp_path))
    assert vehicle.arm_joints == ("arm_shoulder",)
    assert vehicle.mass == pytest.approx(2.5, rel=1e-15)
    data = vehicle.create_data()
    pin.framesForwardKinematics(vehicle.model, data, vehicle.neutral())
    found = data.oMf[vehicle.model.getFrameId("arm_forearm")]
    # Upside down, so the arm's z points down; 1e-15 is the rounding of 180 deg in radians.
    np.testing.assert_allclose(found.translation, [0.1, 0.0, -0.17], atol=1e-15)
    np.testing.assert_allclose(found.rotation, pin.rpy.rpyToMatrix(np.pi, 0, np.pi / 2), atol=1e-15)


def test_a_composed_vehicle_is_rebuilt_from_its_data_alone(tmp_path):
    vehicle = load_vehicle(write(tmp_path))
    again = type(vehicle).from_data(vehicle.to_data())
    assert again.model == vehicle.model
    assert again.arm_joints == vehicle.arm_joints


def test_a_mount_is_the_platform_itself_unless_said(tmp_path):
    toml = TOML.replace(TOML[TOML.index("mount") : TOML.index("[[rotor]]")], "")
    vehicle = load_vehicle(write(tmp_path, toml))
    np.testing.assert_array_equal(vehicle.model.jointPlacements[2].translation, [0, 0, 0.05])


@pytest.mark.parametrize(
    ("old", "new", "field", "problem"),
    [
        ('prefix = "arm_"\n', "", "arm.urdf", "has a link 'base'"),
        ('"belly"', '"bely"', "arm.mount.link", "'bely' is no link"),
        ("position = [0.1", "pos = [0.1", "arm.mount.pos", "not a known key"),
        ("180.0, 0.0, 90.0", "180.0", "arm.mount.rpy_deg", "is [180.0]"),
        ("short/a.urdf", "long/a.urdf", "urdf", "cannot be read"),
        ('joints = ["arm_shoulder"]', 'joints = ["shoulder"]', "arm", "no joint"),
        ("prefix =", "prefx =", "arm.prefx", "not a known key"),
        ('urdf = "arms/short/a.urdf"', "", "arm.prefix", "not a known key"),
    ],
)
def test_a_mistake_is_named(tmp_path, old, new, field, problem):
    assert old in TOML
    with pytest.raises(VehicleError) as caught:
        load_vehicle(write(tmp_path, TOML.replace(old, new)))
    assert caught.value.field == field
    assert problem in caught.value.problem
    assert str(tmp_path) in caught.value.where


def test_an_arm_of_two_roots_is_refused(tmp_path):
    arm = ARM.replace("</robot>", '<link name="loose"/></robot>')
    with pytest.raises(VehicleError, match=r"root links \['arm_base', 'arm_loose'\]"):
        load_vehicle(write(tmp_path, arm=arm))


def test_each_finds_its_own_meshes_and_the_missing_are_named(tmp_path):
    vehicle = load_vehicle(write(tmp_path))
    names = ("meshes/base.stl", "../arms/short/meshes/base.stl", "package://none/forearm.stl")
    assert resolve_meshes(vehicle)[1] == names
    assert "mesh 'meshes/base.stl' and 2 more not found" in missing_remark(vehicle)
    for folder in ("platform", "arms/short"):
        (tmp_path / folder / "meshes").mkdir()
        (tmp_path / folder / "meshes" / "base.stl").write_text("solid")
    text, missing = resolve_meshes(vehicle)
    assert missing == ("package://none/forearm.stl",)
    assert str(tmp_path / "platform" / "meshes" / "base.stl") in text
    assert "arms/short/meshes/base.stl" in text
    package = tmp_path / "none"
    package.mkdir()
    (package / "forearm.stl").write_text("solid")
    assert missing_remark(vehicle) is None


XACRO = """<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:include filename="body.xacro"/><xacro:arg name="mass" default="2"/>
<xacro:body name="base" mass="$(arg mass)"/></robot>"""
MACRO = f"""<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:macro name="body" params="name mass">
<link name="${{name}}">{BODY.format("${mass}")}</link></xacro:macro></robot>"""
XACRO_TOML = (
    TOML[: TOML.index("[arm]")].replace('"arm_forearm"', '"base"') + TOML[TOML.index("[[rotor]]") :]
)


def write_xacro(folder: Path, entry: str, xacro: str = XACRO) -> Path:
    (folder / "x.urdf.xacro").write_text(xacro)
    (folder / "body.xacro").write_text(MACRO)
    (folder / "v.toml").write_text(XACRO_TOML.replace('"platform/p.urdf"', entry))
    return folder / "v.toml"


@pytest.mark.parametrize(
    ("entry", "mass"),
    [
        ('"x.urdf.xacro"', 2.0),
        ('{ path = "x.urdf.xacro", args = { mass = 3.5 } }', 3.5),
    ],
)
def test_a_xacro_file_is_expanded(tmp_path, entry, mass):
    assert load_vehicle(write_xacro(tmp_path, entry)).mass == mass


def test_a_xacro_file_that_cannot_be_expanded_is_named(tmp_path):
    path = write_xacro(tmp_path, '"x.urdf.xacro"', XACRO.replace("xacro:body ", "xacro:bdy "))
    with pytest.raises(VehicleError, match=r"x\.urdf\.xacro' cannot be expanded"):
        load_vehicle(path)


def test_without_xacrodoc_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacrodoc", None)
    with pytest.raises(MissingDependency, match=r"'xacrodoc'.*fullam\[xacro\]"):
        load_vehicle(write_xacro(tmp_path, '"x.urdf.xacro"'))
