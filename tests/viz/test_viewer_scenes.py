"""What the viewer shows of a scene in MJCF: shapes where they stand, and where joints move them."""

import base64
import json
import threading
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from fullam.exceptions import FullamWarning, MissingDependency
from fullam.simulation.hands.interactive import InteractiveFlight
from fullam.simulation.motions.references import Step
from fullam.simulation.mujoco import scene as mujoco_scene
from fullam.simulation.record.run import Run
from fullam.simulation.scenarios.scenario import Scenario, load_scenario
from fullam.simulation.scenarios.turn_valve import HINGE, HOOP, PIN, RADIUS
from fullam.simulation.simulate import prepare, simulate
from fullam.simulation.weather import CALM
from fullam.simulation.world.world_file import WorldFile
from fullam.viz.viewer import mjcf
from fullam.viz.viewer.export import write_html
from fullam.viz.viewer.live import LiveFlight
from fullam.viz.viewer.mjcf import TILE, DrawnScene
from fullam.viz.viewer.replay import film
from fullam.viz.viewer.scene import WIDTHS
from fullam.viz.viewer.scenery import Scenery
from fullam.viz.viewer.server import ViewerServer
from fullam.viz.viewer.sketch import sketch_of

SINGLE = 1e-6
"""Places of a metre and numbers of a quaternion in 32-bit floats, after some sums."""

ROOM = """
<mujoco model="room">
  <compiler angle="degree"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <asset>
    <texture name="chess" type="2d" builtin="flat" rgb1="0.2 0.4 0.6" width="8" height="8"/>
    <material name="chess" texture="chess" rgba="1 1 0.5 1"/>
    <material name="gold" rgba="0.8 0.6 0.2 0.5"/>
    <hfield name="hill" nrow="3" ncol="2" size="1 2 0.3 0.1" elevation="0 0 1 0 0 0"/>
  </asset>
  <worldbody>
    <geom type="plane" size="0 0 1" material="chess"/>
    <geom type="plane" size="0.5 0.3 1" pos="0 3 0.5" euler="0 90 0"/>
    <geom type="ellipsoid" size="0.1 0.2 0.3" pos="1 0 0" rgba="1 0 0 1"/>
    <geom type="hfield" hfield="hill" pos="0 0 -1"/>
    <geom type="box" size="9 9 9" group="3"/>
    <geom type="box" size="9 9 9" rgba="0 0 0 0"/>
    <body name="crane" pos="0 0 2">
      <joint name="crane" type="hinge" axis="0 0 1"/>
      <geom type="capsule" size="0.05" fromto="0 0 0  1 0 0" material="gold" mass="1"/>
      <body pos="1 0 0"><geom type="sphere" size="0.1" mass="0"/></body>
    </body>
    <body name="shelf" pos="0 0 1"><geom type="cylinder" size="0.2 0.05"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def valve():
    """The beginning of a turn: by some degrees."""
    return simulate(replace(load_scenario("turn-valve"), weather=CALM, duration=7.0), "dc-pid-plus")


def placed(scene, frame, number=0):
    """Each shape of a scene in MJCF, by its path, with its placement in the world of a frame."""
    at, poses = 1, {}
    for k, vehicle in enumerate(scene["vehicles"]):
        for track in vehicle["tracks"]:
            if k == number and track.get("scene"):
                poses[track["path"]] = pin.XYZQUATToSE3(frame[at : at + 7].astype(float))
            at += WIDTHS[track["kind"]]
    vehicle, found = scene["vehicles"][number], {}
    for shape in vehicle["shapes"]:
        path = shape["path"].removeprefix(f"{vehicle['path']}/")
        if path.startswith(("world/", "mounted/")):
            body = poses.get(shape["path"].rpartition("/")[0], pin.SE3.Identity())
            found[path] = shape, body * pin.XYZQUATToSE3(np.array(shape["pose"]))
    return found


def only(found, **wanted):
    """The one shape that has these values, and its placement."""
    (it,) = [
        (shape, place)
        for shape, place in found.values()
        if all(shape.get(name) == value for name, value in wanted.items())
    ]
    return it


def test_the_valves_pin_turns_by_the_recorded_angle(valve):
    movie = film(valve, rate=2.0)
    angles = valve.moved("valve")
    assert angles[-1] > 0.2
    for frame in movie.frames:
        angle = angles[round(100.0 * frame[0])]
        shape, place = only(placed(movie.scene, frame), type="capsule", radius=PIN)
        ends = place.translation + np.outer([0.5, -0.5], shape["length"] * place.rotation[:, 2])
        foot = np.array([0.0, -RADIUS * np.sin(angle), RADIUS * np.cos(angle)]) + HINGE
        ends = ends[np.argsort(-ends[:, 0])]
        np.testing.assert_allclose(ends, [foot, foot - [0.045, 0.0, 0.0]], atol=SINGLE)


def test_what_does_not_move_is_drawn_once_and_where_it_is(valve):
    movie = film(valve, rate=1.0)
    tracks = [t["path"] for t in movie.scene["vehicles"][0]["tracks"] if t.get("scene")]
    assert len(tracks) == 2 and [path.split("/")[1] for path in tracks] == ["world", "mounted"]
    shape, place = only(placed(movie.scene, movie.frames[0]), type="cylinder", radius=0.03)
    assert shape["path"].startswith("vehicle_1/world/scene/")
    np.testing.assert_allclose(place.translation, np.add(HINGE, [0.075, 0.0, 0.0]), atol=1e-12)
    np.testing.assert_allclose(np.abs(place.rotation[:, 2]), [1.0, 0.0, 0.0], atol=1e-12)


def test_what_is_mounted_goes_with_the_tool(valve):
    """The middle of the hoop's eight rods is on the tool's axis."""
    movie = film(valve, rate=1.0)
    model, data = valve.vehicle.model, valve.vehicle.create_data()
    for frame in movie.frames[::3]:
        k = round(100.0 * frame[0])
        pin.framesForwardKinematics(model, data, np.concatenate([valve.pose[k], valve.arm[k]]))
        tool = data.oMf[model.getFrameId(valve.vehicle.tool)]
        shapes = placed(movie.scene, frame)
        rods = [place for path, (_, place) in shapes.items() if path.startswith("mounted/")]
        assert len(rods) == 10
        middle = np.mean([rod.translation for rod in rods[:8]], axis=0)
        hoop = tool.act(np.array([0.0, 0.0, HOOP]))
        np.testing.assert_allclose(middle, hoop, atol=SINGLE)


def test_side_by_side_each_has_its_own(valve):
    movie = film([valve, valve], offset=[0.0, 4.0, 0.0])
    pipes = [
        only(placed(movie.scene, movie.frames[0], k), type="cylinder", radius=0.03)[1]
        for k in (0, 1)
    ]
    pins = [
        only(placed(movie.scene, movie.frames[0], k), type="capsule", radius=PIN)[1] for k in (0, 1)
    ]
    for left, right in (pipes, pins):
        np.testing.assert_allclose(
            right.translation - left.translation, [0.0, 4.0, 0.0], atol=SINGLE
        )


def test_the_force_of_a_scene_is_drawn(valve):
    scene = film(valve, rate=1.0).scene
    assert scene["contact"]
    assert [text for _, text in scene["legend"] if text.startswith("force of the scene")]
    assert scene["direction"][0] < 0.0, "it is seen from the vehicle's side of the wheel"


# Shapes of all kinds, which need no flight.


@pytest.fixture(scope="module")
def room():
    drawn = DrawnScene(WorldFile("room.xml", ROOM))
    places = np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 1.0]])
    shapes = drawn.shapes("v", np.zeros(3), places, 0.5)
    return drawn, {s["path"].removeprefix("v/"): s for s in shapes}


def test_planes_end_beneath_their_face(room):
    _, shapes = room
    floor, wall = shapes["world/scene/0"], shapes["world/scene/1"]
    assert floor["type"] == wall["type"] == "box"
    # From the wall 3 m off and the hill at 0 to the flight's end at 2 m, and half a metre more.
    assert floor["size"] == [3.0, 1.0, TILE] and wall["size"] == [1.0, 0.6, TILE]
    place = pin.XYZQUATToSE3(np.array(floor["pose"]))
    np.testing.assert_allclose(place.translation, [1.0, 0.0, -0.5 * TILE], atol=1e-12)
    face = pin.XYZQUATToSE3(np.array(wall["pose"])).act(np.array([0.0, 0.0, 0.5 * TILE]))
    np.testing.assert_allclose(face, [0.0, 3.0, 0.5], atol=1e-12)


def test_colours_are_the_geoms_or_their_materials(room):
    _, shapes = room
    assert shapes["world/scene/0"]["colour"] == "#33664c"  # texture times material, in 255ths
    assert shapes["world/scene/2"]["colour"] == "#ff0000"
    crane = shapes["world/body_1/6"]
    assert crane["colour"] == "#cc9933" and crane["opacity"] == 0.5
    assert shapes["world/scene/8"]["colour"] == "#808080"


def test_what_mujoco_hides_is_hidden(room):
    _, shapes = room
    assert not {"world/scene/4", "world/scene/5"} & shapes.keys()
    hidden = ROOM.replace("<geom ", '<geom group="4" ').replace(' group="3"', "")
    assert DrawnScene(WorldFile("hidden.xml", hidden)).bodies == ["world/body_1", "world/body_2"]


def test_ellipsoids_and_height_fields_have_their_sizes(room):
    _, shapes = room
    assert shapes["world/scene/2"]["size"] == pytest.approx([0.1, 0.2, 0.3])
    hill = shapes["world/scene/3"]
    points = np.frombuffer(base64.b64decode(hill["vertices"]), "<f4").reshape(-1, 3)
    np.testing.assert_allclose(np.ptp(points, axis=0), [2.0, 4.0, 0.3], atol=SINGLE)
    top = points[np.argmax(points[:, 2])]
    np.testing.assert_allclose(top[:2], [-1.0, 0.0], atol=SINGLE)
    faces = np.frombuffer(base64.b64decode(hill["faces"]), "<u4").reshape(-1, 3)
    a, b, c = (points[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    assert len(faces) == 4 and (normals[:, 2] > 0.0).all()
    assert 0.5 * normals[:, 2].sum() == pytest.approx(8.0), "they cover it once"


def test_a_body_takes_what_it_carries_along():
    world = WorldFile("room.xml", ROOM)
    drawn = DrawnScene(world, mujoco_scene.scene_joints(mujoco_scene.scene_model(world))[0])
    away = pin.SE3(np.eye(3), np.array([7.0, 7.0, 7.0]))
    crane, ball = drawn.places(np.array([0.5 * np.pi]), away)
    np.testing.assert_allclose(crane[:3], [0.0, 0.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(ball[:3], [0.0, 1.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(ball[3:], [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)], atol=1e-12)
    _, at_rest = drawn.places(None, away)
    np.testing.assert_allclose(at_rest, [1.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0], atol=1e-12)


def test_meshes_are_drawn_as_they_are(tmp_path):
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = ["1 3 4", "1 4 2", "5 6 8", "5 8 7", "1 2 6", "1 6 5", "3 7 8", "3 8 4", "1 5 7"]
    faces += ["1 7 3", "2 4 8", "2 8 6"]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {face}" for face in faces]
    (tmp_path / "cube.obj").write_text("\n".join(lines))
    (tmp_path / "scene.xml").write_text(
        '<mujoco><asset><mesh name="cube" file="cube.obj" scale="0.5 0.5 0.5"/></asset>'
        '<worldbody><geom type="mesh" mesh="cube" pos="1 2 3"/></worldbody></mujoco>'
    )
    world = WorldFile.read(tmp_path / "scene.xml")
    (shape,) = DrawnScene(world).shapes("v", np.zeros(3), np.zeros((1, 3)), 0.5)
    points = np.frombuffer(base64.b64decode(shape["vertices"]), "<f4").reshape(-1, 3)
    place = pin.XYZQUATToSE3(np.array(shape["pose"]))
    found = np.array([place.act(point.astype(float)) for point in points])
    np.testing.assert_allclose(found.min(axis=0), [1.0, 2.0, 3.0], atol=SINGLE)
    np.testing.assert_allclose(found.max(axis=0), [1.5, 2.5, 3.5], atol=SINGLE)
    (tmp_path / "cube.obj").unlink()
    around = scenery(world, r"not drawn: .*cube\.obj' is missing")
    assert around.scene is None and "cube.obj" in around.remark


def scenery(world, message):
    """What is drawn of a scene, of which somebody is warned."""
    scenario = Scenario("scene", duration=0.1, weather=CALM, world_file=world)
    vehicle = prepare(Scenario("nothing", duration=0.1)).nominal
    with pytest.warns(FullamWarning, match=message):
        return Scenery.of(scenario, vehicle, 0.01, np.zeros((1, 3)))


def test_a_record_names_no_files_that_nobody_has_seen(tmp_path):
    """Its text alone must not have a file of this machine opened."""
    secret = tmp_path / "secret.obj"
    secret.write_text("v 0 0 0")
    text = f'<mujoco><asset><mesh file="{secret}"/></asset></mujoco>'
    assert scenery(WorldFile("scene.xml", text), "digest: is missing").scene is None
    text = f'<mujoco><asset><texture name="a" type="cube" fileup="{secret}"/></asset></mujoco>'
    assert scenery(WorldFile("scene.xml", text), "digest: is missing").scene is None


def test_without_mujoco_a_record_is_seen_and_the_page_says_what_is_missing(valve, monkeypatch):
    def missing():
        raise MissingDependency("plant 'mujoco'", "mujoco", "contact")

    monkeypatch.setattr(mjcf, "load_mujoco", missing)
    with pytest.warns(FullamWarning, match=r"turn-valve\.xml' is not drawn.*fullam\[contact\]"):
        movie = film(valve, rate=1.0)
    assert "fullam[contact]" in movie.scene["details"]
    assert not placed(movie.scene, movie.frames[0])
    assert movie.scene["contact"] and len(movie.frames) == 8


def test_a_record_of_other_joints_shows_the_scene_at_rest(valve):
    """One from before joints were recorded, or of a scene that MuJoCo now reads in another way."""
    metadata = {name: value for name, value in valve.metadata.items() if name != "scene"}
    columns = {name: column for name, column in valve.columns.items() if name != "scene"}
    movie = film(Run(columns, metadata), rate=1.0)
    _, place = only(placed(movie.scene, movie.frames[-1]), type="capsule", radius=PIN)
    upright = np.add(HINGE, [-0.0225, 0.0, RADIUS])
    np.testing.assert_allclose(place.translation, upright, atol=SINGLE)


def test_the_line_drawing_shows_it_too(valve):
    drawn = sketch_of(film(valve, rate=10.0))
    (vehicle,) = drawn["vehicles"]
    wheel, hoop = vehicle["bodies"]
    assert len(hoop["lines"]) == 8 * 6 + 2, "slim rods are lines, others have ends and edges"
    assert len(vehicle["scene"]) == 6, "the pipe has two ends and four edges"
    steps = np.frombuffer(base64.b64decode(drawn["data"]), "<i2")
    steps = steps.reshape(drawn["count"], drawn["width"])
    x, y, z, w = steps[-1, wheel["at"] + 3 : wheel["at"] + 7] / 32767.0
    k = round(100.0 * drawn["duration"])
    half = 0.5 * valve.moved("valve")[k]
    np.testing.assert_allclose([x, y, z, w], [np.sin(half), 0.0, 0.0, np.cos(half)], atol=1e-4)
    assert len(json.dumps(drawn)) < 60_000


# Live, and in a browser.


def test_a_flight_in_the_hand_shows_it():
    scenario = Scenario(
        "room",
        Step((0.0, 0.0, 1.0)),
        duration=0.3,
        weather=CALM,
        world_file=WorldFile("room.xml", ROOM.replace('axis="0 0 1"/>', 'axis="0 1 0"/>')),
    )
    flight = InteractiveFlight(prepare(scenario))
    live = LiveFlight(flight)
    spec = live.scene.spec()
    level = only(placed(spec, live.frame()), type="capsule")[1]
    np.testing.assert_allclose(level.translation, [0.5, 0.0, 2.0], atol=SINGLE)
    flight.advance(0.2)
    angle = flight.record.moved("crane")[-1]
    assert angle > 0.1
    live.transport.past = flight.period - 1
    past = live.frame()
    live.transport.past = None
    for frame in (live.frame(), past):
        fallen = only(placed(spec, frame), type="capsule")[1]
        where = [0.5 * np.cos(angle), 0.0, 2.0 - 0.5 * np.sin(angle)]
        np.testing.assert_allclose(fallen.translation, where, atol=SINGLE)


def world_place(chromium, path):
    """Where a node is drawn, in the scene's own axes."""
    node = f"fullam.viewer.scene_tree.find({path.split('/')!r}).object"
    return chromium.evaluate(f"[{node}.position.toArray(), {node}.quaternion.toArray()]")


@pytest.mark.browser
def test_the_page_turns_the_wheel(chromium, valve, tmp_path):
    movie = film(valve, rate=10.0)
    chromium.open(write_html(movie, tmp_path / "valve.html"))
    chromium.evaluate("fullam.play(false)")
    track = next(t for t in movie.scene["vehicles"][0]["tracks"] if t.get("scene"))
    for moment in (0.0, 7.0):
        chromium.evaluate(f"fullam.seek({moment})")
        position, (x, y, z, w) = world_place(chromium, track["path"])
        np.testing.assert_allclose(position, HINGE, atol=SINGLE)
        angle = 2.0 * np.arctan2(x, w)
        assert angle == pytest.approx(valve.moved("valve")[round(100 * moment)], abs=1e-5)
        assert abs(y) < SINGLE and abs(z) < SINGLE
    world = "fullam.viewer.scene_tree.find(['vehicle_1', 'world']).object.visible"
    assert chromium.evaluate(world)
    chromium.evaluate("Layers.set('world', false)")
    assert not chromium.evaluate(world)


@pytest.mark.browser
def test_the_page_draws_capsules_and_ellipsoids_in_their_sizes(chromium, valve, tmp_path):
    chromium.open(write_html(film(valve, rate=1.0), tmp_path / "valve.html"))
    for spec, size in (
        ({"type": "capsule", "radius": 0.1, "length": 0.6}, [0.2, 0.2, 0.8]),
        ({"type": "ellipsoid", "size": [0.1, 0.2, 0.3]}, [0.2, 0.4, 0.6]),
    ):
        drawn = f"Shapes.shape({json.dumps(spec | {'colour': '#808080'})}).geometry"
        box = f"((g) => {{ g.computeBoundingBox(); return g.boundingBox; }})({drawn})"
        wide = chromium.evaluate(f"(({{min, max}}) => max.sub(min).toArray())({box})")
        # Facets of a ball of 32 sides and 20 rings stay 1 % inside.
        np.testing.assert_allclose(wide, size, rtol=0.01)


@pytest.mark.browser
def test_a_scene_is_seen_live(chromium):
    scenario = replace(load_scenario("turn-valve"), weather=CALM, duration=0.5)
    live = LiveFlight(prepare(scenario, "dc-pid-plus"))
    with ViewerServer(0) as server:
        live.show(server)
        chromium.open(server.url)
        assert server.wait_for_page(10.0)
        path = next(t["path"] for t in live.scene.spec()["vehicles"][0]["tracks"] if t.get("scene"))
        pilot = threading.Thread(target=live.fly, args=(server,))
        pilot.start()
        pilot.join(timeout=60.0)
        chromium.wait_for("fullam.state.time > 0.45")
        position, _ = world_place(chromium, path)
        np.testing.assert_allclose(position, HINGE, atol=SINGLE)
