"""Impossible bodies are refused, possible ones pass."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fullam.exceptions import VehicleError
from fullam.model import physics

LINK = (
    '<robot name="r"><link name="a"><inertial><mass value="{mass}"/><inertia ixx="{ixx}" '
    'ixy="{ixy}" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial></link></robot>'
)


def check(mass="1", ixx="1", ixy="0", iyy="1", izz="1"):
    text = LINK.format(mass=mass, ixx=ixx, ixy=ixy, iyy=iyy, izz=izz)
    robot = physics.parse_urdf(text, "r.urdf")
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    return physics.check_bodies(model, robot, "r.urdf")


@given(seed=st.integers(0, 2**32 - 1), flat=st.sampled_from([1.0, 1e-3, 0.0]))
def test_every_cloud_of_masses_is_a_possible_body(seed, flat):
    # flat = 0 is a plate: exactly on the triangle inequality, where rounding needs the slack.
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(8, 3)) * [1.0, 1.0, flat]
    masses = rng.uniform(0.1, 1.0, 8)
    points -= masses @ points / masses.sum()
    inertia = sum(
        m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True)
    )
    assert physics.inertia_problem(inertia) is None


@given(
    small=st.floats(0.1, 10.0), middle=st.floats(0.1, 10.0), share=st.floats(0.01, 1.0)
)  # 1 % over the inequality: ten times the slack
def test_a_moment_above_the_sum_of_the_others_is_refused(small, middle, share):
    problem = physics.inertia_problem(np.diag([small, (small + middle) * (1 + share), middle]))
    assert problem is not None
    assert "above the sum" in problem


def test_the_check_looks_at_principal_moments_not_at_the_diagonal():
    # Diagonal (1, 1, 1) with I_xy = 0.6: principal moments 0.4, 1, 1.6, above 0.4 + 1.
    with pytest.raises(VehicleError, match="above the sum"):
        check(ixy="0.6")
    check(ixy="0.3")


@pytest.mark.parametrize(
    ("change", "field", "problem"),
    [
        ({"mass": "-1"}, "mass of link 'a'", "is -1 kg"),
        ({"mass": "nan"}, "mass/value of link 'a'", "is NaN"),
        ({"mass": "heavy"}, "mass/value of link 'a'", "is 'heavy'"),
        ({"mass": "0"}, "link 'a'", "has no mass"),
        ({"mass": "1e-12"}, "mass of link 'a'", "is 1e-12 kg"),
        ({"ixx": "-1"}, "inertia of link 'a'", "one of them negative"),
        ({"ixx": "0.5", "iyy": "0.5", "ixy": "0.51"}, "inertia of link 'a'", "negative"),
        ({"izz": "2.1"}, "inertia of link 'a'", "above the sum"),
        ({"izz": "inf"}, "inertia/izz of link 'a'", "is inf"),
    ],
)
def test_a_bad_link_is_named(change, field, problem):
    with pytest.raises(VehicleError) as caught:
        check(**change)
    error = caught.value
    assert error.where == "r.urdf"
    assert error.field == field
    assert problem in error.problem
    assert error.remedy


@pytest.mark.parametrize(
    "change",
    [
        {"ixx": "0", "iyy": "0", "izz": "0"},
        {"ixx": "0"},
        {"ixx": "-2e-22", "iyy": "3e-6", "izz": "3e-6"},
        {"ixx": "1e-35", "iyy": "-2e-35", "izz": "1e-35"},
    ],
    ids=["point mass", "rod", "rounded rod", "rounded point mass"],
)
def test_bodies_without_extent_pass(change):
    assert check(**change) == []


PLATE = """<robot name="r">
<link name="a"><inertial><mass value="1"/>
  <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
<link name="camera"><inertial><mass value="0.05"/>
  <inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="{izz}"/></inertial></link>
<joint name="to_camera" type="{kind}"><parent link="a"/><child link="camera"/>
  <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


def check_camera(kind, izz, mass="0.05"):
    text = PLATE.format(kind=kind, izz=izz).replace('"0.05"', f'"{mass}"')
    robot = physics.parse_urdf(text, "r.urdf")
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    return physics.check_bodies(model, robot, "r.urdf")


def test_an_impossible_link_is_remarked_upon_where_it_vanishes_in_its_body():
    # 1e-3 where 2e-4 is the most: a camera by itself cannot have it, the platform with it can.
    (remark,) = check_camera("fixed", "1e-3")
    assert "inertia of link 'camera'" in remark
    assert check_camera("fixed", "2e-4") == []
    (remark,) = check_camera("fixed", "1e-4", mass="0")
    assert "is not zero although the mass is" in remark


@pytest.mark.parametrize(
    ("kind", "izz", "mass"),
    [("revolute", "1e-3", "0.05"), ("fixed", "0.1", "0.05"), ("revolute", "1e-4", "0")],
)
def test_an_impossible_body_is_refused_by_the_link_that_spoils_it(kind, izz, mass):
    with pytest.raises(VehicleError, match=r"inertia of link 'camera': "):
        check_camera(kind, izz, mass)


@pytest.mark.parametrize(
    ("inertial", "match"),
    [
        ('<mass value="1"/>', "inertia/ixx of link 'a': is missing"),
        ('<mass value="heavy"/><inertia ixx="1"/>', "mass/value of link 'a': is 'heavy'"),
    ],
)
def test_a_missing_or_wrong_entry_is_named(inertial, match):
    text = f'<robot name="r"><link name="a"><inertial>{inertial}</inertial></link></robot>'
    with pytest.raises(VehicleError, match=match):
        physics.link_problems(physics.parse_urdf(text, "r.urdf"), "r.urdf")


@pytest.mark.parametrize("text", ["", "<robot", "<sdf/>"])
def test_what_is_not_a_urdf_is_refused(text):
    with pytest.raises(VehicleError, match=r"r\.urdf"):
        physics.parse_urdf(text, "r.urdf")


def test_declared_mass_must_be_the_sum():
    physics.check_total_mass(2.2515, 2.25, "v.toml")  # 0.07 %, within MASS_TOLERANCE
    with pytest.raises(VehicleError, match=r"v\.toml: mass: is 2\.3 kg, but .* weigh 2\.25 kg"):
        physics.check_total_mass(2.3, 2.25, "v.toml")
