"""Scenes in MJCF around a flight, from files, with anybody's vehicle."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from fullam.exceptions import ScenarioError
from fullam.model.loading import load_vehicle, vehicle_path
from fullam.simulation.hands.interactive import InteractiveFlight
from fullam.simulation.motions.references import Step
from fullam.simulation.mujoco.engine import Engine
from fullam.simulation.record.refly import refly
from fullam.simulation.record.run import Run
from fullam.simulation.scenarios.peg_in_hole import BOTTOM, FACE, PEG
from fullam.simulation.scenarios.scenario import Scenario, load_scenario
from fullam.simulation.simulate import prepare, simulate
from fullam.simulation.weather import CALM
from fullam.simulation.world.surfaces import Box
from fullam.simulation.world.world_file import WorldFile

ROOM = """
<mujoco model="room">
  <compiler angle="degree" inertiafromgeom="true"/>
  <option timestep="0.01" gravity="0 0 -3" integrator="Euler"/>
  <worldbody>
    <geom name="tip" type="plane" size="5 5 0.1"/>
    <body name="platform" pos="2 0 0.5"><freejoint name="free"/><geom size="0.1"/></body>
    <body name="table" pos="0 0 0.1"><geom type="box" size="0.6 0.6 0.1"/></body>
  </worldbody>
  <keyframe><key qpos="2 0 0.5 1 0 0 0"/></keyframe>
</mujoco>
"""
"""A floor, a table and a ball that falls; its names are those of a vehicle, its options others."""

HEXTILT = """
name = "hextilt-room"
vehicle = "theirs.toml"
world_file = "room.xml"
initial_position = [0.0, 0.0, {height}]
duration = 1.5
weather = "calm"
reference = {{ kind = "step", position = [0.0, 0.0, {height}] }}
"""


def tool_height(vehicle):
    """Of the tool above {A}, the arm at rest [m]."""
    data = vehicle.create_data()
    pin.framesForwardKinematics(vehicle.model, data, vehicle.neutral())
    return float(data.oMf[vehicle.model.getFrameId(vehicle.tool)].translation[2])


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Somebody else's vehicle, scene and scenario: the tool begins 0.1 mm inside the table."""
    folder = tmp_path_factory.mktemp("room")
    (folder / "room.xml").write_text(ROOM)
    (folder / "theirs.toml").write_text(vehicle_path("hextilt").read_text())
    height = 0.2 + 0.002 - 0.0001 - tool_height(load_vehicle("hextilt"))
    (folder / "room.toml").write_text(HEXTILT.format(height=height))
    return folder


@pytest.fixture(scope="module")
def touched(files):
    return simulate(files / "room.toml", "dc-pid-plus")


def test_somebody_elses_vehicle_stands_on_somebody_elses_table(touched):
    assert touched.well and touched.simulation.plant == "mujoco"
    assert touched.vehicle.name == "hextilt"
    force = touched.contact_force
    assert (force[5, 2] > 0.01) and np.abs(force[:, :2]).max() < 0.1 * force[:, 2].max()


def test_a_record_flies_again_without_the_scenes_file(touched, files, tmp_path):
    loaded = Run.load(touched.save(tmp_path / "room.npz"))
    (files / "room.xml").rename(tmp_path / "gone.xml")
    try:
        again = refly(loaded)
    finally:
        (tmp_path / "gone.xml").rename(files / "room.xml")
    np.testing.assert_array_equal(again.pose, touched.pose)
    np.testing.assert_array_equal(again.contact_force, touched.contact_force)


def engine_in(text, **more):
    vehicle = load_vehicle("fullam")
    scenario = Scenario("room", world_file=WorldFile("room.xml", text), weather=CALM, **more)
    return vehicle, Engine(vehicle, vehicle.servos, scenario, "rk4", 0.001)


def test_gravity_and_step_are_the_flights_and_masses_are_not_the_scenes_affair():
    vehicle, engine = engine_in(ROOM)
    model = engine.model
    assert model.opt.timestep == 0.001 and model.opt.gravity[2] == -vehicle.gravity
    own = [i for i in range(model.nbody) if model.body(i).name.startswith("fullam/")]
    assert model.body_mass[own].sum() == pytest.approx(vehicle.mass, rel=1e-14)


def test_the_scene_moves_along_and_its_state_is_remembered():
    scenario = Scenario(
        "room", Step((0.0, 0.0, 1.0)), duration=0.6, weather=CALM, world_file=WorldFile("r", ROOM)
    )
    flight = InteractiveFlight(prepare(scenario))
    flight.advance(0.2)
    engine = flight.flight.block.plant.engine
    ball = engine.model.joint("free").qposadr[0] + 2
    fallen = 0.5 - engine.data.qpos[ball]
    assert fallen == pytest.approx(0.5 * 9.81 * flight.time**2, rel=1e-9)  # exact in RK4
    after = flight.run().pose
    flight.rewind(0.1)
    flight.advance(0.1)
    np.testing.assert_array_equal(flight.run().pose[: len(after)], after)


def test_a_scene_and_surfaces_stand_in_one_world():
    surface = Box((0.0, 0.0, 0.5), (0.4, 0.4, 0.1))
    _, engine = engine_in(ROOM, world=(surface,))
    names = {engine.model.geom(i).name for i in range(engine.model.ngeom)}
    assert {"tip", "fullam/tip", "fullam/surface 0"} <= names
    # The ball with the floor, the scene's ball, the table, and the surface.
    assert engine.model.npair == 4


def test_a_peg_finds_its_hole():
    run = simulate(
        replace(load_scenario("peg-in-hole"), duration=6.0, weather=CALM), "hybrid-force"
    )
    assert run.well
    data, model = run.vehicle.create_data(), run.vehicle.model
    pin.framesForwardKinematics(model, data, np.r_[run.pose[-1], run.arm[-1]])
    tool = data.oMf[model.getFrameId("tool")]
    tip = tool.translation + PEG * tool.rotation[:, 2]
    assert tip[0] == pytest.approx(BOTTOM, abs=0.002) and BOTTOM - FACE > 0.03
    # 2 mm of play in a hole at (3, -62) mm.
    assert abs(tip[1] - 0.003) < 0.0025 and abs(tip[2] - 0.938) < 0.0025
    assert run.contact_force[-20:, 0].mean() == pytest.approx(-3.0, rel=0.02)


# Files that a scene names, and nonsense.

CUBE = "\n".join(
    [f"v {x} {y} {z}" for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    + ["f 1 3 4", "f 1 4 2", "f 5 6 8", "f 5 8 7", "f 1 2 6", "f 1 6 5"]
    + ["f 3 7 8", "f 3 8 4", "f 1 5 7", "f 1 7 3", "f 2 4 8", "f 2 8 6"]
)
MESH = """
<mujoco>
  <compiler meshdir="parts"/>
  <asset><mesh name="cube" file="cube.obj" scale="0.5 0.5 0.5"/></asset>
  <worldbody><geom type="mesh" mesh="cube" pos="1 1 0"/></worldbody>
</mujoco>
"""


def test_meshes_are_known_by_their_digest(tmp_path):
    (tmp_path / "parts").mkdir()
    mesh = tmp_path / "parts" / "cube.obj"
    mesh.write_text(CUBE)
    (tmp_path / "scene.xml").write_text(MESH)
    world = WorldFile.read(tmp_path / "scene.xml")
    scenario = Scenario("mesh", duration=0.05, weather=CALM, world_file=world)
    run = simulate(scenario)
    np.testing.assert_array_equal(refly(run).pose, run.pose)
    mesh.write_text(CUBE.replace("v 1 1 1", "v 1 1 2"))
    with pytest.raises(ScenarioError, match="digest"):
        refly(run)
    mesh.unlink()
    with pytest.raises(ScenarioError, match=r"cube\.obj' is missing"):
        refly(run)


def test_a_scene_survives_a_file():
    scenario = Scenario("room", world_file=WorldFile("room.xml", ROOM))
    assert Scenario.from_dict(scenario.to_dict()) == scenario


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot/>", "MJCF"),
        ("<mujoco>", "well-formed"),
        ("<!DOCTYPE mujoco><mujoco/>", "document type"),
    ],
)
def test_what_is_no_mjcf_is_refused(text, message):
    with pytest.raises(ScenarioError, match=message):
        WorldFile("scene.xml", text)


def test_mujocos_own_words_are_passed_on():
    wrong = "<mujoco><worldbody><geom type='teapot'/></worldbody></mujoco>"
    with pytest.raises(ScenarioError, match="teapot"):
        engine_in(wrong)


def test_a_record_opens_no_files(tmp_path):
    (tmp_path / "room.xml").write_text(ROOM)
    assert Scenario("room", world_file=tmp_path / "room.xml").world_file.text == ROOM
    data = Scenario("room").to_dict() | {"world_file": str(tmp_path / "room.xml")}
    with pytest.raises(ScenarioError, match="table"):
        Scenario.from_dict(data)


def test_a_missing_scene_is_named(tmp_path):
    with pytest.raises(ScenarioError, match=r"nowhere\.xml"):
        Scenario("room", world_file=str(tmp_path / "nowhere.xml"))


@pytest.mark.parametrize("plant", ["servo", "prescribed", "mujoco-prescribed"])
def test_a_scene_is_mujocos(plant):
    with pytest.raises(ScenarioError, match="is for MuJoCo"):
        simulate(Scenario("room", world_file=WorldFile("room.xml", ROOM)), plant=plant)
