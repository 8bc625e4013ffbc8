"""Motions from CSV files: units, separators, and the line of what is wrong."""

import numpy as np
import pytest

import fullam
from fullam.exceptions import ScenarioError
from fullam.simulation.motions.joint_trajectory import JointTrajectory
from fullam.simulation.motions.motion_csv import read_columns
from fullam.simulation.motions.trajectory import Trajectory


def file(tmp_path, text, name="motion.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


BODY = "0,0,0,1\n1,1,2,1.5\n2.5,2,2,1\n"


@pytest.mark.parametrize(
    "text",
    [
        f"t,x,y,z\n{BODY}",
        f"# a remark\n\nt [s], x [m], y [m], z [m]\n{BODY}".replace(",", ", "),
        f"t;x;y;z\n{BODY}".replace(",", ";"),
        f"t\tx\ty\tz\n{BODY}".replace(",", "\t"),
        f"\ufefft_s,x_m,y_m,z_m\r\n{BODY}".replace("\n", "\r\n"),
        "t_ms,z [mm],y (m),x_cm\n0,1000,0,0\n1000,1500,2,100\n2500,1000,2,200\n",
        f"t,x,y,z,joint_1_deg\n{BODY}".replace("0,0,0,1\n", "0,0,0,1,5\n")
        .replace("1.5\n", "1.5,6\n")
        .replace("2,2,1\n", "2,2,1,7\n"),
    ],
)
def test_the_same_motion_however_it_is_written(tmp_path, text):
    made = Trajectory.from_csv(file(tmp_path, text))
    np.testing.assert_allclose(made.times, [0.0, 1.0, 2.5], rtol=1e-15)
    np.testing.assert_allclose(made.positions, [[0, 0, 1], [1, 2, 1.5], [2, 2, 1]], rtol=1e-15)
    assert made.quaternions == ()


def test_attitudes_as_angles_or_quaternions_and_velocities(tmp_path):
    euler = Trajectory.from_csv(
        file(tmp_path, "t,x,y,z,phi_deg,psi_rad,gamma [deg]\n0,0,0,1,0,0,0\n1,0,0,1,10,0.1,90\n")
    )
    plain = Trajectory.from_arrays(
        [0, 1], [[0, 0, 1]] * 2, euler_deg=[[0, 0, 0], [10, np.degrees(0.1), 90]]
    )
    np.testing.assert_allclose(euler.quaternions, plain.quaternions, rtol=0, atol=1e-15)
    rows = "\n".join(
        ",".join(map(repr, (t, 0.0, 0.0, 1.0, *q, 0.5, 0.0, 0.0)))
        for t, q in zip((0.0, 1.0), plain.quaternions, strict=True)
    )
    moving = Trajectory.from_csv(file(tmp_path, f"t,x,y,z,qx,qy,qz,qw,vx,vy,vz_m_s\n{rows}\n"))
    np.testing.assert_allclose(moving.quaternions, plain.quaternions, rtol=0, atol=1e-15)
    assert moving.velocities == ((0.5, 0.0, 0.0),) * 2


TEXTS = {
    "no number": ("t,x,y,z\n0,0,0,1\n1,0,high,1\n", r"line 3: y is 'high'"),
    "nan": ("t,x,y,z\n0,0,0,1\n\n1,0,nan,1\n", r"line 4: y is 'nan'"),
    "too few": ("t,x,y,z\n0,0,0,1\n1,0,0\n", r"line 3: has 3 entries; give 4: t, x, y, z"),
    "backwards": ("t,x,y,z\n0,0,0,1\n2,0,0,1\n#\n1,0,0,1\n", r"line 5: t is 1 s after 2 s"),
    "no t": ("time,x,y,z\n0,0,0,1\n1,0,0,1\n", r"'time' is no column"),
    "no z": ("t,x,y\n0,0,0\n1,0,0\n", r"has x, y and no z"),
    "half a quaternion": ("t,x,y,z,qx,qw\n0,0,0,1,0,1\n1,0,0,1,0,1\n", r"has qx, qw and no qy, qz"),
    "no unit": ("t,x,y,z,phi,psi,gamma\n0,0,0,1,0,0,0\n1,0,0,1,0,0,0\n", r"'phi' has no unit"),
    "a strange unit": ("t,x [ft],y,z\n0,0,0,1\n1,0,0,1\n", r"'x' is in 'ft'; name it 'x \[m\]'"),
    "twice": ("t,x,x,z\n0,0,0,1\n1,0,0,1\n", r"line 1: names 2 columns 'x'"),
    "no length": (
        "t,x,y,z,qx,qy,qz,qw\n0,0,0,1,0,0,0,1\n1,0,0,1,0,0,0,0.5\n",
        r"line 3: quaternions\[1\]: has length 0.5",
    ),
    "half a round": (
        "t,x,y,z,phi_deg,psi_deg,gamma_deg\n0,0,0,1,0,0,0\n1,0,0,1,0,0,180\n",
        r"line 3: attitude \[1\]: is turned by 180 deg",
    ),
    "endless": (f"t,x,y,z\n0,0,0,{'1' * 200_000}\n1,0,0,1\n", r"line 2: cannot be read \(field la"),
    "empty": ("t,x,y,z\n", r"has 1 lines"),
    "far": ("t,x,y,z\n0,0,0,1\n1,0,1e9,1\n", r"line 3: positions\[1\]\[1\]: is 1e\+09"),
}


@pytest.mark.parametrize("case", TEXTS)
def test_what_is_wrong_is_named_with_its_line(tmp_path, case):
    text, words = TEXTS[case]
    with pytest.raises(ScenarioError, match=rf"motion\.csv: .*{words}"):
        Trajectory.from_csv(file(tmp_path, text))


def test_what_is_no_file_is_refused(tmp_path):
    for path in (tmp_path / "none.csv", tmp_path, 3):
        with pytest.raises(ScenarioError):
            read_columns(path)


def test_joints_by_name_and_unit(tmp_path):
    path = file(tmp_path, "t,joint_2 [rad],joint_4_deg\n0,0,0\n1,0.5,45\n")
    made = JointTrajectory.from_csv(path)
    assert made.joints == ("joint_2", "joint_4")
    assert made.units == ("deg", "deg")
    assert made.positions_deg[1] == pytest.approx((np.degrees(0.5), 45.0))


JOINTS = {
    "none": ("t,x,y,z\n0,0,0,1\n1,0,0,1\n", r"names no joint"),
    "some units": ("t,joint_1_deg,joint_2\n0,0,0\n1,0,0\n", r"'joint_2' has no unit"),
    "a strange unit": ("t,joint_1 [ft]\n0,0\n1,0\n", r"'joint_1' is in 'ft'"),
}


@pytest.mark.parametrize("case", JOINTS)
def test_what_is_wrong_with_joints_is_named(tmp_path, case):
    text, words = JOINTS[case]
    with pytest.raises(ScenarioError, match=rf"motion\.csv: .*{words}"):
        JointTrajectory.from_csv(file(tmp_path, text))


SCENARIO = """
name = "tour"
weather = "calm"
duration = 2.0
initial_position = [0, 0, 1]
[reference]
kind = "csv"
path = "motions/tour.csv"
degree = 5
ends = "rest"
[arm_motion]
kind = "csv"
path = "motions/tour.csv"
degree = 5
ends = "rest"
"""


def test_a_scenario_takes_its_motions_along_and_flies_again_without_the_files(tmp_path):
    (tmp_path / "motions").mkdir()
    tour = file(
        tmp_path / "motions",
        "t,x,y,z,joint_1_deg,joint_3_deg\n"
        "0,0,0,1,-90,-45\n0.7,0.1,0,1,-80,-60\n1.3,0.15,0.05,1.05,-80,-50\n2,0.2,0.1,1.1,-70,-45\n",
        "tour.csv",
    )
    scenario = fullam.load_scenario(file(tmp_path, SCENARIO, "tour.toml"))
    run = fullam.simulate(scenario)
    run.save(tmp_path / "run.npz")
    tour.unlink()
    again = fullam.Run.load(tmp_path / "run.npz")
    assert again.scenario == scenario
    assert np.array_equal(fullam.refly(again).pose, run.pose)
    # Where the arm's motion begins the arm starts, without being told.
    np.testing.assert_allclose(np.degrees(run.arm[0]), [-90, 0, -45, 0], atol=1e-12)
    np.testing.assert_allclose(np.degrees(run.arm[-1]), [-70, 0, -45, 0], atol=1e-9)
    # The plain law in calm air, along a motion from rest to rest.
    assert np.abs(run.pose[:, :3] - run.reference_pose[:, :3]).max() < 2e-3


BOTH = "t,x,y,z,shoulder [deg],reach [m]\n0,0,0,1,0,0\n1,1,0,1,10,0.1\n2,1,0,2,20,0.1\n"


def test_one_file_for_platform_and_arm_with_the_joints_own_names(tmp_path):
    """The platform's reader leaves them to the arm's, which knows whether there are such joints."""
    path = file(tmp_path, BOTH)
    with pytest.raises(ScenarioError, match=r"'shoulder' is no column of the platform; .*with_arm"):
        Trajectory.from_csv(path)
    assert Trajectory.from_csv(path, with_arm=True).positions[2] == (1.0, 0.0, 2.0)
    table = '{ kind = "csv", path = "motion.csv" }'
    scenario = file(
        tmp_path, f'name = "both"\nreference = {table}\narm_motion = {table}\n', "both.toml"
    )
    assert fullam.load_scenario(scenario).arm_motion.joints == ("shoulder", "reach")
    alone = file(tmp_path, f'name = "alone"\nreference = {table}\n', "alone.toml")
    with pytest.raises(ScenarioError, match="'shoulder' is no column"):
        fullam.load_scenario(alone)
    with pytest.raises(ScenarioError, match="shoulder"):  # the default vehicle has no such joint
        fullam.simulate(str(scenario), calm=True)


def test_a_missing_file_is_named_by_the_scenario_that_wants_it(tmp_path):
    path = file(tmp_path, SCENARIO, "tour.toml")
    with pytest.raises(ScenarioError, match=r"tour\.toml: .*motions.tour\.csv: file: cannot be"):
        fullam.load_scenario(path)
    path.write_text("name='x'\nreference={kind='csv'}\n")
    with pytest.raises(ScenarioError, match=r"tour\.toml.*path: is missing"):
        fullam.load_scenario(path)
    path.write_text("name='x'\nreference={kind='csv', path='a.csv', spline=3}\n")
    with pytest.raises(ScenarioError, match=r"tour\.toml.*spline.*it has path, degree, ends, at"):
        fullam.load_scenario(path)


def test_a_record_reads_no_file_of_ours():
    """Records come from anywhere: what a scenario's table names is never opened."""
    data = {"name": "x", "reference": {"kind": "csv", "path": "/etc/hostname"}}
    with pytest.raises(fullam.FullamError, match="unknown kind of reference 'csv'"):
        fullam.Scenario.from_dict(data)
