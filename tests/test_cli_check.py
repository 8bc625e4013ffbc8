"""`fullam check` of vehicles that are not the paper's."""

import json

import pytest

from fullam import cli
from fullam.exceptions import VehicleError

LINK = """<link name="{0}"><inertial><origin xyz="0.02 0 -0.05"/><mass value="{1}"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>"""
JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>
<origin xyz="0 0 -0.05"/><axis xyz="{4}"/>{5}</joint>"""
LIMIT = '<limit lower="-0.1" upper="0.15" effort="1" velocity="1"/>'
VISUAL = '<visual><geometry><mesh filename="package://gone/hull.dae"/></geometry></visual></link>'
URDF = "\n".join(
    [
        '<robot name="odd">',
        LINK.format("hull", 2).replace("</link>", VISUAL),
        *(LINK.format(name, 0.1) for name in ("boom", "wheel", "tip", "fin")),
        JOINT.format("slide", "prismatic", "hull", "boom", "1 0 0", LIMIT),
        JOINT.format("roll", "continuous", "boom", "wheel", "0 1 0", ""),
        JOINT.format("yaw", "revolute", "wheel", "tip", "0 0 1", LIMIT),
        JOINT.format("flap", "revolute", "hull", "fin", "0 1 0", LIMIT),
        "</robot>",
    ]
)
"""A prismatic and a continuous joint, and a branch that carries no joint of the arm."""

HEAD = """name = "odd"
urdf = "odd.urdf"
platform = "hull"
arm = ["slide", "roll", "yaw"]
tool = "wheel" # not on the last link
"""
ROTOR = """[[rotor]]
position = [{0}, {1}, 0.0]
axis = [{2}, {3}, 0.8]
spin = {4}
k_f = 1e-5
k_tau = 2e-7
max_speed = 1300.0
lag = 0.02
"""
RING = [
    ROTOR.format(0.3 * x, 0.3 * y, 0.6 * s * y, -0.6 * s * x, s)
    for x, y, s in (
        *((1.0, 0.0, 1), (0.5, 0.866025404, -1), (-0.5, 0.866025404, 1)),
        *((-1.0, 0.0, -1), (-0.5, -0.866025404, 1), (0.5, -0.866025404, -1)),
    )
]


@pytest.fixture
def odd(tmp_path):
    """The TOML of a vehicle that differs from the paper's in every way that loads."""
    (tmp_path / "odd.urdf").write_text(URDF)
    (tmp_path / "odd.toml").write_text(HEAD + "".join(RING))
    return tmp_path / "odd.toml"


@pytest.fixture
def check(capsys):
    """Run `fullam check`; gives exit code and stdout."""

    def call(*arguments):
        code = cli.main(["check", *(str(a) for a in arguments), "--samples", "12"])
        return code, capsys.readouterr().out

    return call


def test_a_vehicle_of_other_joints_is_checked_in_full(check, odd):
    code, out = check(odd)
    assert code == 0
    for line in (
        "arm pose                         0.000 m, 0.0 deg, 0.0 deg",
        "joint 1, slide                   prismatic, from -0.1 to 0.15 m",
        "joint 2, roll                    revolute, without limits",
        "joint 3, yaw                     revolute, from -5.73 to 8.594 deg",
        "remark: joints that are not the arm's are held: 'flap' at 0",
        "remark: mesh 'package://gone/hull.dae' not found",
        "dynamics: agree",
    ):
        assert line in out, out


def test_json_has_units_and_remarks(check, odd):
    data = json.loads(check(odd, "--json")[1])
    assert data["capability"]["arm_units"] == ["m", "deg", "deg"]
    assert len(data["remarks"]) == 2
    assert data["agreement"]["largest"] < data["agreement"]["tolerance"]
    assert data["passed"]


def test_where_the_equations_do_not_hold_the_table_is_printed_all_the_same(check, odd, monkeypatch):
    def refuse(*_):
        raise VehicleError("odd", "joint 'roll'", "is a JointModelSpherical", "name another")

    monkeypatch.setattr("fullam.model.chain.LinkChain.from_model", refuse)
    code, out = check(odd)
    assert code == 0
    assert "hovers level                     yes" in out
    assert "agreement: not applicable, because joint 'roll' is a JointModelSpherical" in out
    assert "hover: possible" in out
    data = json.loads(check(odd, "--json")[1])
    assert "JointModelSpherical" in data["agreement"]["not_applicable"]
    assert data["passed"]


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (["fullam", "--failed", "3"], 0, "rotor_3 stopped: position and heading are held, tilted"),
        (["fullam", "--failed", "rotor_1,rotor_5"], 1, "five of six axes are left (no force y"),
        (["hextilt", "--failed", "3"], 1, "tilted by 29 deg, with 0.9 N to spare on these axes"),
    ],
)
def test_what_is_left_without_rotors(check, arguments, code, says):
    found, out = check(*arguments)
    assert found == code
    assert says in out
    assert f"hover: {'IMPOSSIBLE' if code else 'possible'}" in out


def test_what_is_left_without_rotors_as_data(check):
    _, out = check("fullam", "--failed", "3", "--json")
    left = json.loads(out)["remaining"]
    assert left["rank"] == 6
    assert left["trim"]["failed"] == ["rotor_3"]
    assert left["trim"]["margin_N"] > 3.0 > 0.0 > left["trim"]["margin_level_N"]


def test_a_whole_vehicle_is_told_what_it_holds_without_each_rotor(check):
    _, out = check("fullam")
    assert "hovers trimmed, a rotor stopped  8 of 8" in out


def test_a_rotor_that_there_is_not(check, capsys):
    assert cli.main(["check", "fullam", "--failed", "9"]) == 2
    assert "give one of rotor_1" in capsys.readouterr().err
