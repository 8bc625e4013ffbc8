"""What the viewer shows of a tool that touches, carries and draws, and of an arm on servos."""

import base64
import threading
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import fullam
from fullam.simulation.hands.interactive import InteractiveFlight
from fullam.simulation.motions.references import Step
from fullam.simulation.payloads.payload import Payload
from fullam.simulation.scenarios.interaction import AHEAD_DEG, HOME, YAW_DEG
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.simulate import prepare, simulate
from fullam.simulation.tool.paths import CirclePath
from fullam.simulation.tool.task import ToolTask
from fullam.simulation.weather import CALM
from fullam.simulation.world.surfaces import Box, Plane, Sphere
from fullam.viz.viewer import scenery as scenery_module
from fullam.viz.viewer.export import write_html
from fullam.viz.viewer.live import LiveFlight
from fullam.viz.viewer.replay import film
from fullam.viz.viewer.scene import WIDTHS, VehicleScene
from fullam.viz.viewer.scenery import THICK, Scenery
from fullam.viz.viewer.server import ViewerServer
from fullam.viz.viewer.sketch import sketch_of
from fullam.viz.viewer.snapshot import Snapshot

SINGLE = 1e-5
"""Positions of a metre in 32-bit floats carry 1e-7 m; sums of some, and forces of 10 N, 1e-6."""

WALL = Plane((0.58, 0.0, 0.0), (-2.0, 0.0, 0.0), stiffness=2e3, dissipation=5.0)
TOUCHING = Scenario(
    "touching",
    Step(HOME, YAW_DEG),
    initial_position=HOME,
    initial_euler_deg=YAW_DEG,
    initial_arm_deg=AHEAD_DEG,
    duration=0.5,
    weather=CALM,
    world=(WALL, Sphere((0.0, 0.0, -3.0), 0.2), Box((1.0, 0.0, 0.2), (0.2, 0.2, 0.4), (0, 0, 30))),
    payloads=(Payload(0.1, 0.2, 0.4, offset=(0.01, 0.0, 0.02)),),
)
"""The tool stands 20 mm in a soft wall from the beginning on, and carries something for a while."""


@pytest.fixture(scope="module")
def run():
    return simulate(TOUCHING, "dc-pid-plus", driver="python")


def columns(movie, name):
    """Columns of the frames that belong to the track whose path ends in `name`."""
    at = 1
    for track in movie.scene["vehicles"][0]["tracks"]:
        if track.get("path", "").endswith(f"/{name}"):
            return movie.frames[:, at : at + WIDTHS[track["kind"]]]
        at += WIDTHS[track["kind"]]
    raise AssertionError(name)


def places(run, rows, arm):
    """Placements of tool and last link, with the arm of a column."""
    model, data = run.vehicle.model, run.vehicle.create_data()
    found = []
    for k in rows:
        q = np.concatenate([run.pose[k], run.columns[arm][k]])
        pin.framesForwardKinematics(model, data, q)
        tool = data.oMf[model.getFrameId(run.vehicle.tool)].translation.copy()
        found.append((tool, data.oMi[model.njoints - 1].copy()))
    return found


def test_the_arm_that_is_drawn_is_the_one_that_sags(run):
    movie = film(run, rate=20.0)
    rows = range(0, 50, 5)
    shown = columns(movie, f"link_{run.vehicle.n_arm}")[: len(rows), :3]
    true, asked = (
        np.array([link.translation for _, link in places(run, rows, arm)])
        for arm in ("arm", "arm_goal")
    )
    np.testing.assert_allclose(shown, true, atol=SINGLE)
    assert np.linalg.norm(true - asked, axis=1).max() > 1e-3


def test_the_contact_force_ends_at_the_tool(run):
    movie = film(run, rate=20.0)
    rows = range(0, 50, 5)
    shown = columns(movie, "contact")[: len(rows)]
    np.testing.assert_allclose(shown[:, 3:], run.contact_force[:50:5], atol=SINGLE)
    assert np.abs(run.contact_force).max() > 0.5
    tracks = movie.scene["vehicles"][0]["tracks"]
    (scale,) = (t["scale"] for t in tracks if t.get("path", "").endswith("/contact"))
    tools = [tool for tool, _ in places(run, rows, "arm")]
    np.testing.assert_allclose(shown[:, :3] + scale * shown[:, 3:], tools, atol=SINGLE)
    assert [text for _, text in movie.scene["legend"] if text.startswith("force of it")]


def test_what_is_carried_is_at_the_tool_while_it_is(run):
    movie = film(run, rate=100.0)
    ball, rows = columns(movie, "payload_0"), range(0, 50, 7)
    t = movie.frames[:, 0]
    np.testing.assert_array_equal(ball[:, 3] > 0.5, (t > 0.195) & (t < 0.395))
    for k, (tool, link) in zip(rows, places(run, rows, "arm"), strict=True):
        center = tool + link.rotation @ np.array([0.01, 0.0, 0.02])
        np.testing.assert_allclose(ball[k, :3], center, atol=SINGLE)


def test_at_rest_the_arm_carries_weights_and_contact(run):
    """What platform and arm share holds the arm, what it carries, and is pushed by the world."""
    vehicle = run.vehicle
    around = Scenery.of(TOUCHING, vehicle, 0.01, np.zeros((1, 3)))
    part = VehicleScene(vehicle, "", around=around)
    pose, arm = run.pose[0], run.arm[0]
    q, contact = np.concatenate([pose, arm]), np.array([-2.0, 0.5, 0.3])
    (tool, link), *_ = places(run, [0], "arm")
    R = pin.Quaternion(pose[3:]).toRotationMatrix()
    weight_A = pin.computeGeneralizedGravity(vehicle.model, vehicle.create_data(), q)[:6]
    load = np.array([0.0, 0.0, 0.1 * vehicle.gravity])
    ball = tool + link.rotation @ np.array(TOUCHING.payloads[0].offset) - pose[:3]
    force = R @ weight_A[:3] + load - contact
    moment = R @ weight_A[3:] + np.cross(ball, load) - np.cross(tool - pose[:3], contact)
    n = vehicle.n_arm
    rest = Snapshot(
        pose, np.zeros(6), arm, np.zeros(n), np.zeros(n), run.rotor_speeds[0],
        np.concatenate([force, moment]), np.zeros(6), pose, False, np.zeros(8),
        contact=contact, carried=[True],
    )  # fmt: skip
    of_arm = np.array([0.0, 0.0, (vehicle.mass - vehicle.platform_mass) * vehicle.gravity])
    # Rounding of forces of 30 N in double precision, through a 6 x 6 solution.
    np.testing.assert_allclose(part.joint_wrench(q, rest)[:3], of_arm + load - contact, atol=1e-9)


def test_a_wall_is_drawn_where_it_is_about_the_flight(run):
    movie = film([run, run], offset=2.0)
    for number, vehicle in enumerate(movie.scene["vehicles"]):
        (tile,) = [s for s in vehicle["shapes"] if s["path"].endswith("/world/plane_0")]
        place = pin.XYZQUATToSE3(np.array(tile["pose"]))
        shift = offset_of(movie, number, run)
        face = place.act(np.array([0.0, 0.0, 0.5 * THICK])) - shift
        assert face[0] == pytest.approx(0.58)
        np.testing.assert_allclose(place.rotation[:, 2], [-1.0, 0.0, 0.0], atol=1e-12)
        inside = place.inverse().act(run.pose[0, :3] + shift)
        assert np.all(np.abs(inside[:2]) < 0.5 * np.array(tile["size"][:2]))


def offset_of(movie, number, run):
    """Where a vehicle of a film is drawn, less where it flew."""
    at = 1 + number * sum(WIDTHS[t["kind"]] for t in movie.scene["vehicles"][0]["tracks"])
    return movie.frames[0, at : at + 3].astype(float) - run.pose[0, :3]


def test_spheres_and_boxes_are_drawn_where_they_are(run):
    shapes = film(run).scene["vehicles"][0]["shapes"]
    (ball,) = [s for s in shapes if s["path"].endswith("/world/sphere_1")]
    assert ball["pose"][:3] == [0.0, 0.0, -3.0] and ball["radius"] == 0.2
    (box,) = [s for s in shapes if s["path"].endswith("/world/box_2")]
    assert box["size"] == [0.2, 0.2, 0.4]
    turned = pin.XYZQUATToSE3(np.array(box["pose"])).rotation
    np.testing.assert_allclose(turned, TOUCHING.world[2].rotation, atol=1e-12)


@pytest.mark.parametrize("normal", [(-1, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0.2), (1, 1, 0)])
def test_one_looks_from_the_free_side_of_a_wall(normal):
    around = Scenery(world=(Plane((0, 0, 0), normal),))
    assert around.direction @ np.array(normal) > 0.0
    assert Scenery(world=(Plane((0, 0, 0), (0, 0, 1)),)).direction == pytest.approx(
        scenery_module.DIRECTION
    )


def test_a_large_plane_has_few_lines():
    far = Scenery(world=(Plane((0, 0, 0), (0, 0, 1)),), places=np.diag([200.0, 90.0, 1.0]))
    shapes = far.shapes("v", np.zeros(3), 0.4)
    assert 2 * 10 < len(shapes) < 3 + 2 * (scenery_module.MOST_CELLS + 3)


def test_the_path_asked_of_the_tool_is_dashed_along_it():
    vehicle = fullam.load_vehicle("fullam")
    task = ToolTask(CirclePath(radius=0.15, normal=(1.0, 0.0, 0.0), duration=8.0))
    scenario = replace(fullam.load_scenario("draw-circle"), tool=task)
    around = Scenery.of(scenario, vehicle, 0.01, np.zeros((1, 3)))
    dashes = [s for s in around.shapes("v", np.zeros(3), 0.4) if s["path"].startswith("v/task/")]
    middles = np.array([s["pose"][:3] for s in dashes])
    centre = 0.5 * (around.path.max(axis=0) + around.path.min(axis=0))
    # A chord of 1/120 of the round stays 0.1 mm inside.
    np.testing.assert_allclose(np.linalg.norm(middles - centre, axis=1), 0.15, atol=2e-4)
    assert sum(s["length"] for s in dashes) == pytest.approx(np.pi * 0.15, rel=0.02)


def test_a_flight_in_the_hand_feels_the_wall():
    flight = InteractiveFlight(prepare(TOUCHING, "dc-pid-plus"))
    assert not flight.contact.any()
    flight.advance(0.2)
    np.testing.assert_array_equal(flight.contact, flight.record.contact_force[-1])
    assert flight.contact[0] < 0.0
    live = LiveFlight(flight)
    shown = live.frame()
    live.transport.past = flight.period - 1
    past = live.frame()
    at = 1
    for track in live.scene.spec()["vehicles"][0]["tracks"]:
        if track.get("path", "").endswith("/contact"):
            np.testing.assert_allclose(shown[at + 3 : at + 6], flight.contact, atol=SINGLE)
            np.testing.assert_allclose(past[at + 3 : at + 6], flight.contact, atol=SINGLE)
            return
        at += WIDTHS[track["kind"]]
    raise AssertionError("no contact is drawn")


def visible(chromium, part):
    return chromium.evaluate(
        f"fullam.viewer.scene_tree.find(['vehicle_1', {part!r}]).object.visible"
    )


@pytest.mark.browser
def test_the_page_shows_what_is_touched_and_carried(chromium, run, tmp_path):
    chromium.open(write_html(film(run), tmp_path / "touch.html"))
    chromium.evaluate("fullam.play(false)")
    arrow = "fullam.viewer.scene_tree.find(['vehicle_1', 'contact']).object.children[0]"
    for moment, carried in ((0.0, False), (0.3, True), (0.45, False)):
        chromium.evaluate(f"fullam.seek({moment})")
        assert visible(chromium, "payload_0") is carried
        k = round(moment / 0.01)
        shown = chromium.evaluate(f"{arrow}.visible")
        assert shown is bool(np.linalg.norm(run.contact_force[k]) > 0.1)
    strips = chromium.evaluate("document.getElementById('strips').textContent")
    assert "contact force" in strips
    # The layers of what is there are offered, the others are not.
    labels = "[...document.querySelectorAll('#views label')].filter((l) => !l.hidden)"
    offered = chromium.evaluate(f"{labels}.map((l) => l.textContent.trim())")
    assert "world" in offered and "path asked for" not in offered
    assert visible(chromium, "world")
    chromium.evaluate("Layers.set('world', false)")
    assert not visible(chromium, "world")


@pytest.mark.browser
def test_a_trail_fades_with_its_age(chromium, tmp_path):
    data = fullam.load_scenario("task-2").to_dict() | {"duration": 1.0, "weather": "calm"}
    movie = film(simulate(Scenario.from_dict(data), "dc-pid"), rate=20.0)
    chromium.open(write_html(movie, tmp_path / "trail.html"))
    chromium.evaluate("fullam.play(false), fullam.seek(0.5)")
    trail = "fullam.tracks.find((t) => t.trail).trail"
    assert chromium.evaluate(f"{trail}.now.value") == pytest.approx(0.5, abs=1e-6)
    born = chromium.evaluate(f"[...{trail}.object.geometry.attributes.born.array]")
    np.testing.assert_allclose(born[:105:5], movie.frames[:, 0], atol=1e-6)
    # The renderer has compiled what fades: the shader has both numbers.
    chromium.evaluate("fullam.still()")
    programs = "fullam.viewer.renderer.info.programs.filter((p) => p.getUniforms().map.now)"
    assert chromium.evaluate(f"{programs}.length") >= 1


@pytest.mark.browser
def test_a_flight_against_a_wall_is_seen_live(chromium):
    live = LiveFlight(prepare(TOUCHING, "dc-pid-plus"))
    with ViewerServer(0) as server:
        live.show(server)
        chromium.open(server.url)
        assert server.wait_for_page(10.0)
        assert visible(chromium, "world")
        pilot = threading.Thread(target=live.fly, args=(server,))
        pilot.start()
        pilot.join(timeout=60.0)
        chromium.wait_for("fullam.state.time > 0.45")
        strips = "Charts.rows.map((row) => row[row.length - 2])"  # the last is the hand's
        assert max(chromium.evaluate(strips)) > 0.5


def test_the_line_drawing_of_a_notebook_shows_it_too(run):
    drawn = sketch_of(film(run, rate=20.0))
    (vehicle,) = drawn["vehicles"]
    # A tile and a box have two loops and four edges, a ball three rings.
    assert len(vehicle["world"]) == 6 + 3 + 6
    wall, ball = np.array(vehicle["world"][0]), np.array(vehicle["world"][6])
    np.testing.assert_allclose(wall[:, 0], 0.58, atol=1e-4)  # it is rounded to that
    np.testing.assert_allclose(np.linalg.norm(ball - [0.0, 0.0, -3.0], axis=1), 0.2, atol=1e-4)
    steps = np.frombuffer(base64.b64decode(drawn["data"]), "<i2")
    steps = steps.reshape(drawn["count"], drawn["width"]) * 1.0
    (at,) = vehicle["balls"]
    t = np.arange(drawn["count"]) / drawn["rate"]
    np.testing.assert_array_equal(steps[:, at] < 32000, (t > 0.195) & (t < 0.395))
    contact, tool = (
        steps[:, i : i + 3] * drawn["scale"] + drawn["centre"]
        for i in (vehicle["contact"], vehicle["tool"])
    )
    force = run.contact_force[[round(100 * x) for x in t]]
    length = 4.0 * VehicleScene(run.vehicle, "").force_scale * np.linalg.norm(force, axis=1)
    # Steps of the drawing's numbers are half a millimetre.
    np.testing.assert_allclose(np.linalg.norm(tool - contact, axis=1), length, atol=1e-3)
