"""The committed vehicles are what their parameters say, and fly what the paper asks of them."""

import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from fullam.exceptions import VehicleError
from fullam.model.craig import chain_transforms, craig_table, mount
from fullam.model.design import DESIGNS, VehicleDesign, design_vehicle, write_designs
from fullam.model.loading import load_vehicle, vehicle_path

ARM_DEG = [[-90, -90, 0, 0], [-90, 0, 0, 0], [0, 0, -90, 0], [-90, 0, -90, 0]]
"""The paper's four arm configurations."""

DIGITS = 1e-12
"""The URDF is written with 13 significant digits of numbers of order 1."""


@pytest.fixture(scope="module")
def fullam():
    return load_vehicle("fullam")


def design_of(name: str) -> VehicleDesign:
    return VehicleDesign.from_table(load_vehicle(name).definition["design"])


def arm_moment(vehicle, configuration: int) -> np.ndarray:
    """First moment of the whole vehicle about {A}: all of it is the arm's [kg m]."""
    q = vehicle.neutral(np.deg2rad(ARM_DEG[configuration - 1]))
    return vehicle.mass * pin.centerOfMass(vehicle.model, vehicle.create_data(), q)


def hover_wrench(vehicle, configuration: int, euler_deg) -> np.ndarray:
    R_WA = Rotation.from_euler("XYZ", euler_deg, degrees=True).as_matrix()
    force = R_WA.T @ [0.0, 0.0, vehicle.mass * vehicle.gravity]
    return np.concatenate(
        [force, np.cross(arm_moment(vehicle, configuration), force / vehicle.mass)]
    )


# --- the committed files -------------------------------------------------------------------------


def test_the_committed_urdfs_are_what_the_parameters_give(tmp_path):
    written = write_designs(tmp_path)
    assert [path.stem for path in written] == list(DESIGNS)
    for path in written:
        committed = vehicle_path(path.stem).with_suffix(".urdf")
        assert path.read_text() == committed.read_text(), (
            f"{committed.name} is stale: fullam.model.design.write_designs() writes it anew"
        )


def test_every_design_has_a_design_table():
    for name in DESIGNS:
        assert load_vehicle(name).definition["urdf"] == f"{name}.urdf"


@pytest.mark.parametrize("name", DESIGNS)
def test_the_tomls_lists_are_what_the_parameters_give(name):
    vehicle, design = load_vehicle(name), design_of(name)
    assert vehicle.definition["rotor"] == design.rotor_tables()
    assert vehicle.arm_joints == design.joint_names
    assert vehicle.definition["mass"] == pytest.approx(design.mass, rel=1e-15)  # a sum of six
    assert VehicleDesign.from_table(design.to_table()).to_table() == design.to_table()


def test_the_text_does_not_depend_on_the_process(tmp_path):
    code = "import sys; from fullam.model.design import write_designs; write_designs(sys.argv[1]);"
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=True)
    committed = vehicle_path("fullam").with_suffix(".urdf")
    assert (tmp_path / "fullam.urdf").read_bytes() == committed.read_bytes()


def test_loading_does_not_import_yourdfpy():
    code = (
        "import sys, fullam.model.design; from fullam.model.loading import load_vehicle; "
        "load_vehicle('fullam'); sys.exit('yourdfpy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_urdf_has_shapes_and_needs_no_meshes(fullam):
    robot = ET.fromstring(fullam.urdf)
    shapes = {link.get("name"): len(link.findall("visual")) for link in robot.findall("link")}
    assert min(shapes.values()) >= 1
    assert shapes["platform"] >= 1 + 8  # body and booms
    assert shapes["tool"] >= 4  # stem, palm, two fingers
    assert not list(robot.iter("mesh"))
    colours = {material.get("name") for material in robot.findall("material")}
    used = {material.get("name") for material in robot.iterfind("link/visual/material")}
    assert used <= colours
    # A visual and a collision model of the same URDF, as a viewer builds them.
    for kind in (pin.GeometryType.VISUAL, pin.GeometryType.COLLISION):
        geometry = pin.buildGeomFromUrdfString(fullam.model, fullam.urdf, kind)
        assert geometry.ngeoms >= 8


# --- geometry ------------------------------------------------------------------------------------


def test_the_rotors_sit_on_the_ring_and_lean_along_it(fullam):
    rotors = fullam.rotors
    azimuth = np.deg2rad(22.5 + 45.0 * np.arange(8))
    out = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(8)])
    along = np.column_stack([-np.sin(azimuth), np.cos(azimuth), np.zeros(8)])
    sign = np.array([1.0, -1.0] * 4)
    np.testing.assert_allclose(rotors.positions, 0.35 * out, atol=DIGITS)
    axes = (sign[:, None] * along + [0.0, 0.0, 1.0]) / np.sqrt(2.0)
    np.testing.assert_allclose(rotors.axes, axes, atol=DIGITS)
    np.testing.assert_array_equal(rotors.spins, sign)
    # Each rotor's lever and drag turn the vehicle the same way about z.
    yaw = rotors.coupling_matrix[5]
    lever = np.cross(rotors.positions, rotors.axes)[:, 2] * rotors.k_f
    assert np.all(np.abs(yaw) > np.abs(lever))
    np.testing.assert_array_equal(np.sign(yaw), sign)


def test_the_arm_is_table_1_below_the_mount(fullam):
    # The witness multiplies the Craig matrices of (4); the vehicle went through URDF text,
    # roll-pitch-yaw and Pinocchio.
    rng = np.random.default_rng(5)
    rows, data = craig_table(0.18, 0.18, 0.15, 0.09), fullam.create_data()
    for theta in rng.uniform(-np.pi, np.pi, (20, 4)):
        expected = chain_transforms(np.eye(4), rows, theta, mount())
        pin.framesForwardKinematics(fullam.model, data, fullam.neutral(theta))
        for joint in range(4):
            actual = data.oMi[joint + 2].homogeneous
            np.testing.assert_allclose(actual, expected[joint], atol=DIGITS)
        tool = data.oMf[fullam.model.getFrameId("tool")].homogeneous
        np.testing.assert_allclose(tool, expected[4], atol=DIGITS)


def test_rods_have_the_inertia_of_cylinders(fullam):
    for rod, (axis, length) in zip(
        design_of("fullam").rods(), [(0, 0.18), (0, 0.18), (1, 0.15), (2, 0.03), (2, 0.06)],
        strict=True,
    ):  # fmt: skip
        cylinder = np.diag(pin.Inertia.FromCylinder(0.05, 0.0125, length).inertia)  # along z
        expected = np.roll(cylinder, axis - 2)
        np.testing.assert_allclose(rod.inertia, np.diag(expected), rtol=1e-12, atol=1e-18)
        assert rod.length == pytest.approx(length, rel=1e-12)
    # The last moving link carries the fixed tool: 0.05 kg at 15 mm and 0.05 kg at 60 mm.
    last = fullam.model.inertias[5]
    assert last.mass == pytest.approx(0.1, rel=1e-12)
    np.testing.assert_allclose(last.lever, [0.0, 0.0, 0.0375], atol=DIGITS)


def test_the_joints_are_those_of_the_servos(fullam):
    np.testing.assert_allclose(fullam.model.upperPositionLimit[7:], np.deg2rad(150), rtol=DIGITS)
    np.testing.assert_allclose(fullam.model.lowerPositionLimit[7:], -np.deg2rad(150), rtol=DIGITS)
    np.testing.assert_allclose(fullam.model.velocityLimit[6:], 59 * np.pi / 30, rtol=DIGITS)
    np.testing.assert_array_equal(fullam.model.upperEffortLimit[6:], 1.5)


# --- what the recorded runs say ------------------------------------------------------------------

MOMENT_NOISE = 8e-4
"""What the runs read in configuration 4, where the arm hangs straight and it is 0 [kg m]."""


@pytest.mark.parametrize(("configuration", "quoted"), [(2, 0.0222), (3, 0.0940), (4, 0.0008)])
def test_static_moments_are_those_of_the_recorded_runs(fullam, configuration, quoted):
    moment = arm_moment(fullam, configuration)
    assert np.hypot(*moment[:2]) == pytest.approx(quoted, abs=MOMENT_NOISE)


def test_configuration_1_fits_worst(fullam):
    # The runs read 0.0326 there, equal links at mid-length give 0.0387. Known and kept: the split
    # of the masses that would fit all four puts more than 0.2 kg into the first link.
    assert np.hypot(*arm_moment(fullam, 1)[:2]) == pytest.approx(0.0387, abs=5e-5)


@pytest.mark.parametrize(("configuration", "moment"), [(3, (0.646, -0.646)), (2, (0.154, 0.154))])
def test_the_arm_points_where_the_recorded_moments_say(fullam, configuration, moment):
    # The platform holds the arm: tau = c x m g z = m g (c_y, -c_x), with their g of 9.8. Twice the
    # noise, because the quoted 0.646 N m is itself 0.0008 kg m below the quoted 0.0940 kg m.
    x, y, _ = arm_moment(fullam, configuration)
    np.testing.assert_allclose([9.8 * y, -9.8 * x], moment, atol=2 * 9.8 * MOMENT_NOISE)


def test_weight_thrust_and_actuation(fullam):
    weight = fullam.mass * fullam.gravity
    thrusts = fullam.rotors.max_thrusts
    assert fullam.mass == pytest.approx(2.25, rel=1e-12)
    # 8 x 9.48 N / 22.07 N, and cos 45 deg of it: the 3.4 and 2.4 of the runs' vehicle.
    assert thrusts.sum() / weight == pytest.approx(3.436, abs=5e-4)
    assert fullam.rotors.axes[:, 2] @ thrusts / weight == pytest.approx(2.430, abs=5e-4)
    assert fullam.actuation_rank() == 6


HOVER_ATTITUDES = [[0, 0, 0], [10, 10, 10], [20, 20, 20], [15, 15, 0], [20, 20, 0]]


@pytest.mark.parametrize("euler_deg", HOVER_ATTITUDES, ids=str)
@pytest.mark.parametrize("configuration", [1, 2, 3, 4])
def test_every_attitude_of_the_paper_can_be_held(fullam, configuration, euler_deg):
    wrench = hover_wrench(fullam, configuration, euler_deg)
    answer = lsq_linear(fullam.rotors.normalized_coupling, wrench, bounds=(0, 1), tol=1e-14)
    # 1e-6 N is the solver's, 1e-7 of the weight.
    np.testing.assert_allclose(answer.fun, np.zeros(6), atol=1e-6)


def test_six_such_rotors_could_not_hold_28_degrees_in_every_direction():
    # Planted weakness: the reason for eight. Turning the tilt's direction round, some hover of the
    # six-rotor variant must fail, and none of the eight-rotor one.
    def reached(vehicle):
        missed = []
        for heading in np.deg2rad(np.arange(0, 360, 10)):
            lean = Rotation.from_rotvec(
                np.deg2rad(28.0) * np.array([np.cos(heading), np.sin(heading), 0.0])
            )
            force = lean.inv().apply([0.0, 0.0, vehicle.mass * vehicle.gravity])
            wrench = np.concatenate([force, np.cross(arm_moment(vehicle, 4), force) / 2.25])
            fit = lsq_linear(vehicle.rotors.normalized_coupling, wrench, bounds=(0, 1), tol=1e-14)
            missed.append(np.abs(fit.fun).max())
        return max(missed)

    assert reached(load_vehicle("fullam")) < 1e-6
    assert reached(design_vehicle(rotor_count=6)) > 0.1  # newtons or newton-metres short


# --- variants ------------------------------------------------------------------------------------


def test_a_variant_is_one_call():
    vehicle = design_vehicle(rotor_count=6, cant_deg=30, ring_radius=0.3)
    assert vehicle.rotors.count == 6
    np.testing.assert_allclose(vehicle.rotors.axes[:, 2], np.cos(np.deg2rad(30)), atol=DIGITS)
    np.testing.assert_allclose(np.linalg.norm(vehicle.rotors.positions, axis=1), 0.3, rtol=DIGITS)
    assert vehicle.name == "fullam with rotor_count=6, cant_deg=30, ring_radius=0.3"
    assert vehicle.definition["design"]["rotor_count"] == 6
    assert vehicle.actuation_rank() == 6
    again = type(vehicle).from_definition(vehicle.definition, vehicle.urdf)
    assert again.model == vehicle.model


def test_a_variant_without_changes_is_the_vehicle(fullam):
    vehicle = design_vehicle("fullam")
    assert vehicle.urdf == fullam.urdf
    assert vehicle.name == "fullam"
    assert vehicle.model == fullam.model


def test_variants_change_rotor_numbers_masses_and_arms():
    fast = design_vehicle("quadrotor_arm", name="fast", max_speed=600.0, platform_mass=1.8)
    assert fast.name == "fast"
    np.testing.assert_array_equal(fast.rotors.max_speeds, 600.0)
    assert fast.mass == pytest.approx(2.05, rel=1e-12)
    two = design_vehicle(
        craig=[[0, 0, 0], [0, 0.2, 0], [0, 0.3, 0]], link_masses=[0.1, 0.1, 0.05], tool_length=0.1
    )
    assert two.n_arm == 2
    assert two.mass == pytest.approx(2.25, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "field", "problem"),
    [
        ({"cant": 30}, "cant", "not a known key"),
        ({"rotor_count": 5}, "design.rotor_count", "is 5"),
        ({"rotor_count": 2}, "design.rotor_count", "is 2"),
        ({"rotor_count": 6.5}, "design.rotor_count", "is 6.5"),
        ({"cant_deg": 90.0}, "design.cant_deg", "is 90"),
        ({"ring_radius": 0.0}, "design.ring_radius", "is 0"),
        ({"ring_radius": float("nan")}, "design.ring_radius", "is NaN"),
        ({"platform_mass": -2.0}, "design.platform_mass", "is -2"),
        ({"platform_inertia": [0.01, 0.01, 0.03]}, "design.platform_inertia", "above the sum"),
        ({"platform_inertia": [0.01, 0.01]}, "design.platform_inertia", "is [0.01, 0.01]"),
        ({"link_masses": [0.05]}, "design.link_masses", "is [0.05]"),
        ({"link_masses": 0.05}, "design.link_masses", "is 0.05"),
        ({"craig": [[0, 0, 0]]}, "design.craig", "is [[0, 0, 0]]"),
        ({"tool_length": 0.09}, "design.craig", "without length"),
    ],
)
def test_a_bad_parameter_is_named(changes, field, problem):
    with pytest.raises(VehicleError) as caught:
        design_vehicle(**changes)
    assert caught.value.field == field
    assert problem in caught.value.problem
    assert caught.value.remedy


def test_a_missing_parameter_is_named():
    table = design_of("fullam").to_table()
    del table["ring_radius"]
    with pytest.raises(VehicleError, match=r"design\.ring_radius: is missing"):
        VehicleDesign.from_table(table)


def test_only_designs_have_variants():
    with pytest.raises(VehicleError, match="only designs have variants: fullam, quadrotor_arm"):
        design_vehicle("hextilt", rotor_count=8)


def test_the_default_folder_is_beside_the_toml(tmp_path, monkeypatch):
    for name in DESIGNS:
        source = vehicle_path(name)
        (tmp_path / source.name).write_text(source.read_text())
    monkeypatch.setattr("fullam.model.loading.vehicle_folders", lambda: (tmp_path,))
    assert write_designs() == [tmp_path / f"{name}.urdf" for name in DESIGNS]
    assert sorted(path.name for path in Path(tmp_path).iterdir()) == sorted(
        f"{name}.{kind}" for name in DESIGNS for kind in ("toml", "urdf")
    )
