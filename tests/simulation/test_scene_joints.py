"""What the joints of a scene do is in the record: by name, through files, flown again, exported."""

import json
from dataclasses import replace

import numpy as np
import pytest

import fullam
from fullam.analysis.scene_motion import scene_motions
from fullam.cli import main
from fullam.exceptions import RunFileError, UnknownName
from fullam.simulation.hands.interactive import InteractiveFlight
from fullam.simulation.motions.references import Step
from fullam.simulation.record.refly import refly
from fullam.simulation.record.run import Run
from fullam.simulation.record.tables import columns_of, units_of
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.simulate import prepare, simulate
from fullam.simulation.weather import CALM
from fullam.simulation.world.scene_joints import SceneJoint, named
from fullam.simulation.world.world_file import WorldFile

SCENE = """
<mujoco model="things">
  <compiler angle="radian"/>
  <worldbody>
    <body name="tool">
      <geom size="0.004" mass="0.001"/>
      <body pos="0 0 0.01"><joint name="flap" type="hinge"/>
        <geom size="0.004" mass="0.001" pos="0.005 0 0"/></body>
    </body>
    <body name="box" pos="2 0 3" euler="0 0 0.5"><freejoint/>
      <geom type="box" size="0.1 0.1 0.1"/></body>
    <body name="lamp" pos="0 2 2"><joint type="ball"/>
      <geom size="0.05" pos="0.3 0 -0.4" mass="1"/></body>
    <body name="door" pos="0 -2 1"><joint name="door" type="hinge" axis="0 0 1" ref="0.2"/>
      <geom type="box" size="0.4 0.02 0.9" pos="0.4 0 0"/></body>
    <body name="drawer" pos="-2 0 1"><joint name="drawer" type="slide" axis="0 0.6 0.8"/>
      <geom type="box" size="0.2 0.2 0.1"/></body>
  </worldbody>
</mujoco>
"""
"""A box that falls, a lamp that swings, a door that nobody opens, a drawer that slides down a slope
whose sine is 0.8, and a flap at the tool."""

COMPONENTS = (
    *("box_x", "box_y", "box_z", "box_qx", "box_qy", "box_qz", "box_qw"),
    *("lamp_qx", "lamp_qy", "lamp_qz", "lamp_qw", "door", "drawer", "flap"),
)
UNITS = (*("m",) * 3, *("",) * 8, "rad", "m", "rad")


def things(duration=0.4):
    file = WorldFile("things.xml", SCENE)
    return Scenario(
        "things", Step((0.0, 0.0, 1.0)), duration=duration, weather=CALM, world_file=file
    )


@pytest.fixture(scope="module")
def run():
    return simulate(things())


def test_joints_have_the_scenes_names_and_kinds(run):
    assert [(j.name, j.kind) for j in run.scene_joints] == [
        *(("box", "free"), ("lamp", "ball"), ("door", "hinge"), ("drawer", "slide")),
        ("flap", "hinge"),
    ]
    assert run.units["scene"] == "m, quaternion xyzw; quaternion xyzw; rad; m; rad"
    assert run.scene.shape == (41, 14) and "scene" in run.meanings


def test_what_is_recorded_is_what_mechanics_says(run):
    t, g = run.t, run.vehicle.gravity
    box = run.moved("box")
    np.testing.assert_array_equal(box[:, :2], [[2.0, 0.0]] * 41)
    # RK4 is exact where accelerations are constant.
    np.testing.assert_allclose(box[:, 2], 3.0 - 0.5 * g * t**2, rtol=0.0, atol=1e-12)
    turned = [0.0, 0.0, np.sin(0.25), np.cos(0.25)]
    np.testing.assert_allclose(box[:, 3:], [turned] * 41, atol=1e-15)
    np.testing.assert_allclose(run.moved("drawer"), -0.4 * g * t**2, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(run.moved("door"), 0.2, atol=1e-15)


def test_the_lamp_swings_as_a_pendulum_does(run):
    """Energy of a mass 0.5 m from its hinge, with the inertia of a ball of 50 mm besides."""
    lamp = run.moved("lamp")
    x, y, z, w = lamp.T
    np.testing.assert_allclose(np.linalg.norm(lamp, axis=1), 1.0, atol=1e-12)
    angle = 2.0 * np.arctan2(y, w)
    assert np.abs(x).max() < 1e-12 and np.abs(z).max() < 1e-12
    height = -0.3 * np.sin(angle) - 0.4 * np.cos(angle)
    rate, inertia = np.gradient(angle, run.t), 0.25 + 0.4 * 0.05**2
    energy = 0.5 * inertia * rate**2 + run.vehicle.gravity * height
    # Differences over 20 ms of a rate that grows by 12 rad/s^2: 0.1 %.
    np.testing.assert_allclose(energy[1:-1], energy[1], atol=2e-3)
    assert angle[-1] > 0.5


def test_a_joint_that_is_not_there_is_named_with_those_that_are(run):
    with pytest.raises(UnknownName, match=r"'doors'\. Did you mean 'door'\?.*box, lamp"):
        run.moved("doors")
    short = simulate(Scenario("nothing", duration=0.1, weather=CALM))
    assert short.scene_joints == () and "scene" not in short.columns
    with pytest.raises(UnknownName, match="door"):
        short.moved("door")


def test_files_and_second_flights_have_the_same_bits(run, tmp_path):
    loaded = Run.load(run.save(tmp_path / "things.npz"))
    again = refly(loaded)
    for other in (loaded, again):
        assert other.scene_joints == run.scene_joints
        np.testing.assert_array_equal(other.scene, run.scene)
    assert again.metadata == run.metadata


def test_a_flight_in_the_hand_records_it_and_forgets_what_it_takes_back(run):
    flight = InteractiveFlight(prepare(things()))
    assert flight.scene is None
    flight.advance(0.3)
    np.testing.assert_array_equal(flight.scene, run.scene[29])
    flight.rewind(0.1)
    np.testing.assert_array_equal(flight.scene, run.scene[9])
    np.testing.assert_array_equal(flight.run().scene, run.scene)


def test_names_are_unique_and_can_be_printed():
    found = [("a", "free"), ("a_x", "hinge"), ("a", "ball"), ("", "slide"), ("\n\u202e", "hinge")]
    joints = named(found)
    assert [j.name for j in joints] == ["a", "a_x 2", "a 2", "joint", "joint 2"]
    names = [name for joint in joints for name in joint.components]
    assert len(set(names)) == len(names) == 7 + 1 + 4 + 1 + 1


# Other people's files.


def test_tables_have_a_column_a_coordinate(run, tmp_path):
    table, units = columns_of(run), units_of(run)
    names = [name for name in table if name.startswith("scene_")]
    assert tuple(names) == tuple(f"scene_{name}" for name in COMPONENTS)
    assert tuple(units[name] for name in names) == UNITS
    np.testing.assert_array_equal(np.column_stack([table[n] for n in names]), run.scene)
    read = np.genfromtxt(run.to_csv(tmp_path / "a.csv"), delimiter=",", names=True)
    np.testing.assert_array_equal(read["scene_drawer"], run.moved("drawer"))


def test_what_a_plant_adds_is_in_tables_too(run):
    """Goals, torques and the contact's force, which only some plants record."""
    table, units = columns_of(run), units_of(run)
    assert sum(column[0].size for column in run.columns.values()) == len(table)
    np.testing.assert_array_equal(table["arm_goal_joint_2"], run.arm_goal[:, 1])
    np.testing.assert_array_equal(table["contact_force_z"], run.contact_force[:, 2])
    assert (units["arm_torque_joint_1"], units["contact_force_x"]) == ("N m", "N")


def test_pandas_xarray_parquet_and_mcap_have_it(run, tmp_path):
    pytest.importorskip("mcap", reason="the extra 'export' is not installed")
    pandas = pytest.importorskip("pandas", reason="the extra 'export' is not installed")
    from mcap.reader import make_reader

    np.testing.assert_array_equal(run.to_pandas()["scene_door"], run.moved("door"))
    data = run.to_xarray()["scene"]
    assert data.dims == ("t", "scene_coordinate")
    assert data.attrs["units"] == run.units["scene"]
    np.testing.assert_array_equal(data.sel(scene_coordinate="box_qz"), run.moved("box")[:, 5])
    read = pandas.read_parquet(run.to_parquet(tmp_path / "a.parquet"))
    np.testing.assert_array_equal(read["scene_lamp_qw"], run.moved("lamp")[:, 3])
    with run.to_mcap(tmp_path / "a.mcap").open("rb") as file:
        found = [
            (json.loads(schema.data), json.loads(message.data))
            for schema, _, message in make_reader(file).iter_messages(topics=["/scene"])
        ]
    assert len(found) == len(run)
    assert found[0][0]["properties"]["drawer"] == {"type": "number", "description": "m"}
    assert found[-1][1] == dict(zip(COMPONENTS, run.scene[-1].tolist(), strict=True))
    with (tmp_path / "a.mcap").open("rb") as file:
        box = [
            json.loads(message.data)
            for _, _, message in make_reader(file).iter_messages(topics=["/frames/scene/box"])
        ]
    assert [frame["translation"]["z"] for frame in box] == run.moved("box")[:, 2].tolist()


# Records that are wrong on purpose.


def saved(run, path, columns=None, **metadata):
    changed = {"metadata": np.array(json.dumps(run.metadata | metadata))}
    np.savez(path, **(run.columns | (columns or {}) | changed))
    return path


def changed(run, row, column, value):
    scene = run.scene.copy()
    scene[row, column] = value
    return scene


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: s[:, :-1], "shape"),
        (lambda s: np.hstack([s, s]), "shape"),
        (lambda s: s[:-1], "shape"),
        (lambda s: s[:, 0], "shape"),
        (lambda s: s[..., None], "shape"),
        (lambda s: s.astype("f4"), "float32"),
        (lambda s: s.astype(">f8"), "type"),
        (lambda s: s.astype(complex), "complex"),
        (lambda s: s.astype("U9"), "type"),
    ],
)
def test_columns_of_another_shape_or_type_are_refused(run, tmp_path, change, message):
    with pytest.raises(RunFileError, match=f"scene.*{message}"):
        Run.load(saved(run, tmp_path / "bad.npz", {"scene": change(run.scene)}))


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        (0, np.nan, "not finite"),
        (13, np.inf, "not finite"),
        (11, 1e12, "beyond sense"),
        (6, 0.5, "unit quaternions"),
        (10, -2.0, "unit quaternions"),
    ],
)
def test_numbers_that_no_flight_records_are_refused(run, tmp_path, column, value, message):
    scene = changed(run, 7, column, value)
    with pytest.raises(RunFileError, match=f"scene.*{message}"):
        Run.load(saved(run, tmp_path / "bad.npz", {"scene": scene}))


DOOR = {"name": "door", "kind": "hinge"}


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (None, "list"),
        ("door", "list"),
        ({"door": "hinge"}, "list"),
        ([], "names no joint"),
        (["door"], "table"),
        ([{"name": "door"}], "kind"),
        ([DOOR | {"kind": "weld"}], "hinge, slide, ball, free"),
        ([DOOR | {"kind": ["hinge"]}], "kind"),
        ([DOOR | {"name": ""}], "name"),
        ([DOOR | {"name": 7}], "name"),
        ([DOOR | {"name": "do\nor"}], "name"),
        ([DOOR | {"axis": 1}], "axis"),
        ([DOOR, DOOR], "alike"),
        ([{"name": "a", "kind": "free"}, {"name": "a_x", "kind": "hinge"}], "alike"),
        ([DOOR], "shape"),
    ],
)
def test_joints_that_are_none_are_refused(run, tmp_path, scene, message):
    with pytest.raises(RunFileError, match=rf"bad\.npz: .*{message}"):
        Run.load(saved(run, tmp_path / "bad.npz", scene=scene))


def test_a_scene_belongs_to_flights_that_have_one(run, tmp_path):
    plain = fullam.simulate(Scenario("plain", duration=0.1, weather=CALM))
    columns = {"scene": np.zeros((len(plain), 1))}
    with pytest.raises(RunFileError, match="without a scene"):
        Run.load(saved(plain, tmp_path / "bad.npz", columns, scene=[DOOR]))
    columns = {name: column for name, column in run.columns.items() if name != "scene"}
    np.savez(tmp_path / "less.npz", metadata=np.array(json.dumps(run.metadata)), **columns)
    with pytest.raises(RunFileError, match="scene missing"):
        Run.load(tmp_path / "less.npz")


def test_older_records_without_it_are_read(run, tmp_path):
    metadata = {name: value for name, value in run.metadata.items() if name != "scene"}
    np.savez(tmp_path / "old.npz", metadata=np.array(json.dumps(metadata)), **run.columns)
    old = Run.load(tmp_path / "old.npz")
    assert "scene" not in old.columns and old.scene_joints == ()
    np.testing.assert_array_equal(refly(old).scene, run.scene)


# What is said of it.


def test_how_far_each_joint_came(run):
    box, lamp, door, drawer, _ = scene_motions(run)
    fall = 0.5 * run.vehicle.gravity * 0.4**2
    assert str(box) == f"box moved by {1e3 * fall:.1f} mm"
    assert str(door) == "door turned by 0.0 deg"
    assert drawer.change == pytest.approx(-0.8 * fall) and drawer.largest == -drawer.change
    x, y, z, w = run.moved("lamp")[-1]
    assert lamp.change == pytest.approx(2.0 * np.arctan2(np.linalg.norm([x, y, z]), w))


def test_what_came_back_is_told_by_its_largest():
    """A lid that opens by 0.5 rad and shuts again."""
    metadata = {
        "scene": [SceneJoint("lid", "hinge").to_dict()],
        "simulation": {"plant": "mujoco"},
        "scenario": {"world_file": {}},
        "outcome": "completed",
    }
    columns = {"t": np.arange(3.0), "scene": np.array([[0.1], [0.6], [0.1]])}
    (lid,) = scene_motions(Run(columns, metadata))
    assert str(lid) == "lid turned by 0.0 deg (28.6 deg at most)"


def test_the_prompt_tells_it(tmp_path, capsys):
    (tmp_path / "things.xml").write_text(SCENE)
    (tmp_path / "things.toml").write_text(
        'name = "things"\nworld_file = "things.xml"\nduration = 0.2\nweather = "calm"\n'
    )
    line = ["run", str(tmp_path / "things.toml"), "--driver", "python"]
    main(line)
    assert "scene: box moved by 196." in capsys.readouterr().out
    main([*line, "--json"])
    (drawer,) = (j for j in json.loads(capsys.readouterr().out)["scene"] if j["name"] == "drawer")
    assert drawer["kind"] == "slide"
    assert drawer["change"] == pytest.approx(-0.8 * 0.5 * 9.81 * 0.2**2)


def test_what_is_nowhere_else_is_the_vehicles_in_every_plant():
    """A flight in MuJoCo without a scene has no joints but its own, and no such column."""
    run = simulate(replace(things(0.05), world_file=None), plant="mujoco")
    assert run.scene_joints == () and "scene" not in run.columns
