"""Scenes and films say what the record says."""

import base64
import json

import numpy as np
import pinocchio as pin
import pytest

import fullam
from fullam.analysis.atlas.envelope import Envelope
from fullam.dynamics.multibody import Multibody
from fullam.exceptions import InvalidInput
from fullam.model import meshes
from fullam.viz.viewer import shapes
from fullam.viz.viewer.portrait import hover, portrait
from fullam.viz.viewer.replay import film
from fullam.viz.viewer.scene import WIDTHS

SINGLE = 1e-5
"""Positions of some 10 m in 32-bit floats carry 1e-6 m; arrows of 30 N the same share."""


@pytest.fixture(scope="module")
def run():
    return fullam.simulate(short("task-2"), "dc-pid", seed=3)


def short(name, duration=0.6):
    data = fullam.load_scenario(name).to_dict()
    return fullam.Scenario.from_dict(data | {"duration": duration})


def columns(movie, vehicle, kind, name=""):
    """Columns of the frames that belong to the tracks of a kind whose path ends in `name`."""
    at, found = 1, []
    for part, spec in enumerate(movie.scene["vehicles"]):
        for track in spec["tracks"]:
            width = WIDTHS[track["kind"]]
            if part == vehicle and track["kind"] == kind and track.get("path", "").endswith(name):
                found.append(slice(at, at + width))
            at += width
    assert at == movie.frames.shape[1]
    return found


def test_a_film_is_as_long_as_the_flight(run):
    movie = film(run, rate=20.0)
    assert movie.duration == pytest.approx(0.6)
    assert len(movie.frames) == 13
    np.testing.assert_allclose(movie.frames[:, 0], np.arange(13) / 20.0, atol=1e-6)


def test_frames_hold_the_poses_of_the_record(run):
    movie = film(run, rate=20.0)
    rows = run.pose[:: round(0.05 / 0.01)]
    (platform,) = columns(movie, 0, "pose", "platform")
    np.testing.assert_allclose(movie.frames[:, platform][:, :3], rows[:, :3], atol=SINGLE)
    turned = np.abs(np.sum(movie.frames[:, platform][:, 3:] * rows[:, 3:], axis=1))
    np.testing.assert_allclose(turned, 1.0, atol=SINGLE)
    (target,) = columns(movie, 0, "pose", "target")
    np.testing.assert_allclose(
        movie.frames[:, target][:, :3], run.reference_pose[::5, :3], atol=SINGLE
    )


def test_the_trail_goes_through_the_tool(run):
    movie = film(run, rate=20.0)
    vehicle = run.vehicle
    data = vehicle.create_data()
    (trail,) = columns(movie, 0, "trail")
    for k in (0, 6, 12):
        q = np.concatenate([run.pose[5 * k], run.arm[5 * k]])
        pin.framesForwardKinematics(vehicle.model, data, q)
        tool = data.oMf[vehicle.model.getFrameId(vehicle.tool)].translation
        np.testing.assert_allclose(movie.frames[k, trail], tool, atol=SINGLE)


def test_arrows_are_the_wrench_and_the_thrusts_of_the_record(run):
    movie = film(run, rate=20.0)
    (force,) = columns(movie, 0, "vector", "rotor_force")
    (moment,) = columns(movie, 0, "vector", "rotor_moment")
    shown = np.hstack([movie.frames[:, force][:, 3:], movie.frames[:, moment][:, 3:]])
    np.testing.assert_allclose(shown, run.rotor_wrench[::5], rtol=1e-6, atol=1e-5)
    shares = np.hstack([movie.frames[:, at] for at in columns(movie, 0, "thrust")])
    rotors = run.vehicle.rotors
    np.testing.assert_allclose(
        shares, (run.rotor_speeds[::5] / rotors.max_speeds) ** 2, rtol=1e-5, atol=1e-7
    )


def test_at_rest_the_joint_wrench_carries_the_arm():
    vehicle = fullam.load_vehicle("fullam")
    movie = portrait(vehicle, [-90.0, 0.0, -45.0, 0.0])
    (force,) = columns(movie, 0, "vector", "joint_force")
    arm = vehicle.mass - vehicle.platform_mass
    carried = movie.frames[0, force][3:]
    # At rest exactly the weight; what is left is rounding in 32 bits.
    np.testing.assert_allclose(carried, [0.0, 0.0, arm * vehicle.gravity], atol=1e-5)


def test_the_joint_wrench_is_that_of_the_dynamics(run):
    """Against the record: platform and arm together must be pushed by the rotors and the gust."""
    movie = film(run, rate=100.0)
    (force,) = columns(movie, 0, "vector", "joint_force")
    vehicle, k = run.vehicle, 30
    body = Multibody(vehicle)
    R_AW = pin.Quaternion(run.pose[k, 3:]).toRotationMatrix().T
    wrench = run.rotor_wrench[k] + run.disturbance[k]
    q = np.concatenate([run.pose[k], run.arm[k]])
    v = np.concatenate([R_AW @ run.velocity[k, :3], R_AW @ run.velocity[k, 3:], run.arm_rate[k]])
    ddtheta = np.gradient(run.arm_rate, run.t, axis=0)[k]
    total = np.concatenate([R_AW @ wrench[:3], R_AW @ wrench[3:]])
    base = body.base_acceleration(q, v, ddtheta, total)
    f, _ = body.joint_wrenches(q, v, np.concatenate([base, ddtheta]))
    np.testing.assert_allclose(movie.frames[k, force][3:], f[0], rtol=1e-5, atol=1e-5)


def test_side_by_side_they_stand_apart_and_centred(run):
    movie = film([run, run], offset=2.0, labels=["a", "b"], rate=10.0)
    (left,), (right,) = columns(movie, 0, "pose", "platform"), columns(movie, 1, "pose", "platform")
    gap = movie.frames[:, right][:, :3] - movie.frames[:, left][:, :3]
    np.testing.assert_allclose(np.linalg.norm(gap, axis=1), 2.0, atol=SINGLE)
    middle = 0.5 * (movie.frames[:, right] + movie.frames[:, left])
    np.testing.assert_allclose(middle[:, :3], run.pose[::10, :3], atol=SINGLE)
    assert [vehicle["label"] for vehicle in movie.scene["vehicles"]] == ["a", "b"]


def test_a_vector_offset_is_taken_as_it_is(run):
    movie = film([run, run], offset=(0.0, 3.0, 0.0), rate=10.0)
    (left,), (right,) = columns(movie, 0, "pose", "platform"), columns(movie, 1, "pose", "platform")
    gap = movie.frames[:, right][:, :3] - movie.frames[:, left][:, :3]
    np.testing.assert_allclose(gap - [0.0, 3.0, 0.0], 0.0, atol=SINGLE)


def test_the_shorter_of_two_waits_at_its_end(run):
    longer = fullam.simulate(short("task-2", 1.0), "pid", seed=3)
    movie = film([run, longer], offset=0.0, rate=10.0)
    (first,) = columns(movie, 0, "pose", "platform")
    assert movie.duration == pytest.approx(1.0)
    np.testing.assert_allclose(movie.frames[-1, first][:3], run.pose[-1, :3], atol=SINGLE)


@pytest.mark.parametrize(
    "options", [{"labels": ["one"]}, {"offset": (1.0, 2.0)}, {"offset": float("nan")}]
)
def test_what_cannot_be_filmed_is_refused(run, options):
    with pytest.raises(InvalidInput):
        film([run, run], **options)


def test_a_flight_that_ended_nowhere_is_shown_up_to_there(run):
    columns = {name: column.copy() for name, column in run.columns.items()}
    columns["pose"][-1] = np.nan
    movie = film(fullam.Run(columns, run.metadata), rate=20.0)
    json.dumps(movie.scene, allow_nan=False)
    assert np.all(np.isfinite(movie.frames[:-1]))


def test_no_record_is_refused():
    with pytest.raises(InvalidInput):
        film([])


@pytest.mark.parametrize("name", fullam.vehicle_names())
def test_every_vehicle_has_a_scene_that_is_json(name):
    vehicle = fullam.load_vehicle(name)
    movie = portrait(vehicle)
    assert np.all(np.isfinite(movie.frames))
    json.dumps(movie.scene, allow_nan=False)
    paths = [shape["path"] for shape in movie.scene["vehicles"][0]["shapes"]]
    assert len(set(paths)) == len(paths)
    for joint in range(1, vehicle.n_arm + 1):
        assert any(f"/link_{joint}/" in path for path in paths)
    discs = [path for path in paths if path.split("/")[-1].startswith("propeller_")]
    assert len(discs) == vehicle.rotors.count


def test_without_its_meshes_a_vehicle_is_drawn_from_its_model(monkeypatch):
    vehicle = fullam.load_vehicle("hextilt")
    whole = shapes.vehicle_shapes(vehicle, "v")
    assert any(shape["type"] == "mesh" for shape in whole)
    monkeypatch.setattr(meshes, "mesh_folders", lambda _: ["/nowhere"])
    with pytest.warns(UserWarning, match=r"mesh 'package://.*and \d+ more not found.*/nowhere"):
        stand_in = shapes.vehicle_shapes(vehicle, "v")
    assert not any(shape["type"] == "mesh" for shape in stand_in)
    bodies = {shape["path"].split("/")[1] for shape in stand_in}
    assert bodies == {"platform", *(f"link_{i}" for i in range(1, vehicle.n_arm + 1))}


def test_hover_shares_hold_the_weight():
    vehicle = fullam.load_vehicle("fullam")
    level, tilted = hover(vehicle), hover(vehicle, euler_deg=(20.0, 0.0, 0.0))
    assert level.feasible and tilted.feasible
    assert np.rad2deg(tilted.tilt) == pytest.approx(20.0)
    assert level.largest_tilt > tilted.tilt
    # The allocator prefers small speeds a little: a ten-millionth of the weight is given up.
    np.testing.assert_allclose(level.missing, 0.0, atol=1e-6 * vehicle.mass * vehicle.gravity)
    wrench = vehicle.rotors.wrench(level.speeds)
    assert wrench[2] == pytest.approx(vehicle.mass * vehicle.gravity, rel=1e-6)


def test_a_quadrotor_cannot_hold_a_tilt():
    vehicle = fullam.load_vehicle("quadrotor_arm")
    tilted = hover(vehicle, euler_deg=(15.0, 0.0, 0.0))
    assert not tilted.feasible
    # What is missing is the lateral part of the weight.
    lateral = vehicle.mass * vehicle.gravity * np.sin(np.deg2rad(15.0))
    assert np.linalg.norm(tilted.missing[:2]) == pytest.approx(lateral, rel=1e-3)
    # A hand holds it in the picture, so the arm is still at rest.
    force = tilted.snapshot().rotor_wrench + tilted.snapshot().disturbance
    np.testing.assert_allclose(force[:3], [0.0, 0.0, vehicle.mass * vehicle.gravity], atol=1e-6)


def test_the_attainable_forces_are_drawn_on_request_in_the_scale_of_the_arrows():
    vehicle = fullam.load_vehicle("fullam")
    paths = [shape["path"] for shape in portrait(vehicle).scene["vehicles"][0]["shapes"]]
    assert not any(path.endswith("/forces") for path in paths)
    drawn = portrait(vehicle, forces=True).scene["vehicles"][0]["shapes"]
    [body] = [shape for shape in drawn if shape["path"].endswith("/platform/forces")]
    points = np.frombuffer(base64.b64decode(body["vertices"]), "<f4").reshape(-1, 3)
    lift = Envelope.of(vehicle).thrust_to_weight
    arrow = 1.25 * shapes.reach(vehicle)  # of the weight
    assert points[:, 2].max() >= lift * arrow * (1.0 - 1e-6)
    flat = portrait(fullam.load_vehicle("quadrotor_arm"), forces=True).scene["vehicles"][0]
    assert not any(shape["path"].endswith("/forces") for shape in flat["shapes"])


def test_records_side_by_side_are_told_apart_by_their_seeds():
    data = fullam.load_scenario("task-2").to_dict() | {"duration": 0.05}
    scenario = fullam.Scenario.from_dict(data)
    pair = [fullam.simulate(scenario, seed=seed) for seed in (3, 7)]
    scene = film(pair).scene
    assert scene["details"] == "fullam · paper weather, seeds 3 and 7"
    assert [v["label"] for v in scene["vehicles"]] == ["dc-pid, seed 3", "dc-pid, seed 7"]
    other = fullam.simulate(scenario, "pid", calm=True)
    scene = film([pair[0], other]).scene
    assert scene["details"] == "fullam · paper weather, seed 3 and calm weather"
    assert [v["label"] for v in scene["vehicles"]] == ["dc-pid", "pid"]
