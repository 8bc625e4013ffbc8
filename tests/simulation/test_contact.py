"""The tool touches the world: the law of contact, its energy, and flights against walls."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from fullam.exceptions import ScenarioError, UnknownName
from fullam.model.loading import load_vehicle
from fullam.simulation.many import fly_many
from fullam.simulation.motions.references import Step
from fullam.simulation.plants.servo_motion import servo_stage
from fullam.simulation.record.refly import refly
from fullam.simulation.record.run import Run
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.simulate import prepare, simulate
from fullam.simulation.weather import CALM
from fullam.simulation.world.contact import (
    Material,
    block,
    surface_force,
    touch,
    world_force,
    world_rows,
)
from fullam.simulation.world.surfaces import Box, Plane, Sphere, surface

WALL = Plane((0.66, 0.0, 0.0), (-1.0, 0.0, 0.0))
YAW = (0.0, 0.0, -45.0)
"""The arm of the default vehicle then points along x, its tool 0.6 m from the origin."""

PUSH = Scenario(
    "push",
    Step((0.08, 0.0, 1.0), YAW),
    initial_position=(0.0, 0.0, 1.0),
    initial_euler_deg=YAW,
    initial_arm_deg=(0.0, 0.0, -90.0, 0.0),
    duration=4.0,
    weather=CALM,
    world=(WALL,),
)

SURFACES = (
    WALL,
    Sphere((1.0, 2.0, 3.0), 0.5),
    Box((0.0, -1.0, 0.0), (0.2, 0.4, 0.6), (10.0, 20.0, 30.0)),
)


def force_at(surfaces, p, v=(0.0, 0.0, 0.0)):
    world = world_rows(load_vehicle("fullam"), surfaces)
    lists = world._replace(**{n: getattr(world, n).to_list() for n in world._fields})
    return np.array(world_force(lists, tuple(map(float, p)), tuple(map(float, v))))


def test_a_plane_pushes_by_hertz_and_out_of_it_nothing_does():
    deep = force_at([WALL], (0.661, 5.0, -7.0))
    np.testing.assert_allclose(deep, [-1e5 * 0.001**1.5, 0.0, 0.0], rtol=1e-9)
    assert not force_at([WALL], (0.659, 0.0, 0.0), (1.0, 1.0, 1.0)).any()


def test_a_sphere_pushes_away_from_its_center():
    ball, way = SURFACES[1], np.array([1.0, -2.0, 2.0]) / 3.0
    force = force_at([ball], np.array(ball.center) + 0.498 * way)
    np.testing.assert_allclose(force, 1e5 * 0.002**1.5 * way, rtol=1e-9)
    assert np.isfinite(force_at([ball], ball.center)).all()


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_nearest_side_of_a_box_pushes(axis, side):
    box = SURFACES[2]
    outward = side * box.rotation[:, axis]
    at = np.array(box.center) + (0.5 * box.size[axis] - 0.001) * outward
    np.testing.assert_allclose(force_at([box], at), 1e5 * 0.001**1.5 * outward, rtol=1e-9)
    assert not force_at([box], at + 0.002 * outward).any()


def test_the_depth_in_a_box_is_the_distance_to_its_surface():
    rng, half = np.random.default_rng(0), (0.1, 0.2, 0.3)
    eye = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    for _ in range(200):
        p = rng.uniform(-0.4, 0.4, 3)
        depth, normal = block((0.0, 0.0, 0.0), eye, half, tuple(p))
        assert (depth > 0.0) == bool((np.abs(p) < half).all())
        if depth > 0.0:
            assert depth == pytest.approx(np.min(half - np.abs(p)), rel=1e-12)
            assert np.abs(np.dot(p + depth * np.array(normal), normal)) in map(pytest.approx, half)


def test_friction_is_coulombs_against_the_slip():
    force = force_at([WALL], (0.661, 0.0, 0.0), (0.0, 0.3, -0.4))
    normal = 1e5 * 0.001**1.5
    share = 0.5 * 0.5 / np.hypot(0.5, 0.02)
    np.testing.assert_allclose(force, normal * np.array([-1.0, -0.6 * share, 0.8 * share]))


def test_no_surface_ever_pulls_and_none_gives_energy_back():
    """A ball of 0.3 kg thrown at a wall, by steps so short that they do not matter."""
    material = Material(1e5, 1.0, 0.5, 0.02)
    x, v, dt, m = -1e-6, np.array([0.5, 0.4, 0.0]), 1e-6, 0.3
    energy = [0.5 * m * v @ v]
    for _ in range(60_000):
        force = np.array(surface_force(material, float(x), (-1.0, 0.0, 0.0), tuple(v)))
        assert force[0] <= 0.0
        v = v + dt * force / m
        x += dt * v[0]
        if x < -1e-5:
            break
        depth = max(x, 0.0)
        energy.append(0.5 * m * v @ v + 0.4 * 1e5 * depth**2.5)
    assert v[0] < 0.0 and abs(v[0]) < 0.5
    # Semi-implicit Euler's own error is of the order of the step.
    assert np.diff(energy).max() < 1e-9 and energy[-1] < 0.85 * energy[0]


GROUNDS = {
    "plane": Plane((0.0, 0.0, 1.2), (0.0, 0.0, 1.0), stiffness=3e4),
    "sphere": Sphere((0.2, 0.2, 0.2), 1.1, stiffness=3e4),
    "box": Box((0.2, 0.2, 0.7), (2.0, 2.0, 1.0), (10.0, -20.0, 15.0), stiffness=3e4),
}


@pytest.mark.parametrize("name", GROUNDS)
def test_energy_never_grows_in_a_bounce_without_thrust(free_of, free_joint, name):
    vehicle = load_vehicle("fullam")
    move = servo_stage("midpoint", contact=touch)
    free = free_of(vehicle, "midpoint", 2.5e-4, free_joint, move=move)
    rows = world_rows(vehicle, [GROUNDS[name]])
    free.view = free.view._replace(world=type(rows)(*(part.to_list() for part in rows)))
    weight, energies, touched = pin.computeTotalMass(free.model) * 9.81, [free.energy], 0
    for k in range(2400):
        before = free.momentum[2]
        free.move(free.view, k)
        energies.append(free.energy)
        touched += free.momentum[2] - before > -0.5 * weight * free.step
    assert touched > 20, "it must have touched something"
    # The elastic energy of the contact comes back, so it is compared with what there was.
    assert energies[-1] < energies[0] - 1e-3
    assert max(energies) < energies[0] + 1e-6 * abs(energies[0])


def test_lanes_touch_as_one_flight_does(pushed):
    plan = prepare(replace(PUSH, duration=1.5), "dc-pid-plus")
    for run in fly_many(plan, range(8), threads=1):
        rows = len(run)
        np.testing.assert_array_equal(run.contact_force, pushed.contact_force[:rows])
        np.testing.assert_array_equal(run.pose, pushed.pose[:rows])


@pytest.fixture(scope="module")
def pushed():
    return simulate(PUSH, "dc-pid-plus", driver="fused")


def test_dc_pid_plus_winds_its_observer_up_against_a_wall(pushed):
    assert pushed.well and pushed.simulation.plant == "servo"
    force = pushed.contact_force[-50:].mean(axis=0)
    assert -20.0 < force[0] < -3.0
    assert np.linalg.norm(force[1:]) < 0.5 * -force[0]  # within the cone of friction
    tool = 0.6 + pushed.pose[-1, 0]
    assert tool < 0.68  # 0.68 is where the target would have it; servos and platform give way


def test_both_drivers_touch_alike(pushed):
    slow = simulate(replace(PUSH, duration=1.5), "dc-pid-plus")
    rows = len(slow)
    # Different sums of the same dynamics, through a stiff contact.
    np.testing.assert_allclose(slow.pose, pushed.pose[:rows], atol=1e-8)
    np.testing.assert_allclose(slow.contact_force, pushed.contact_force[:rows], atol=1e-4)
    assert np.abs(slow.contact_force).max() > 0.5


def test_what_touched_flies_again_from_its_record(pushed, tmp_path):
    again = refly(Run.load(pushed.save(tmp_path / "touch.npz")))
    np.testing.assert_array_equal(again.contact_force, pushed.contact_force)


@pytest.mark.parametrize("thing", SURFACES)
def test_surfaces_survive_a_file(thing):
    assert surface(thing.to_dict()) == thing
    assert Scenario.from_dict(replace(PUSH, world=(thing,)).to_dict()).world == (thing,)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"kind": "plane", "point": [0, 0, 0], "normal": [0, 0, 0]}, "normal"),
        ({"kind": "plane", "point": [0, 0, 0]}, "normal"),
        ({"kind": "sphere", "center": [0, 0, 0], "radius": -1.0}, "radius"),
        ({"kind": "box", "center": [0, 0, 0], "size": [1, 1, 0]}, "size"),
        ({"kind": "box", "center": [0, 0, 0], "size": [1, 1, 1], "friction": -1}, "friction"),
        ({"kind": "box", "center": [0, 0, 0], "size": [1, 1, 1], "colour": "red"}, "colour"),
        ("wall", "table"),
    ],
)
def test_nonsense_is_refused(data, message):
    with pytest.raises(ScenarioError, match=message):
        surface(data)


def test_an_unknown_kind_lists_the_known_ones():
    with pytest.raises(UnknownName, match="plane, sphere, box"):
        surface({"kind": "torus"})


def test_a_world_needs_joints_that_yield():
    with pytest.raises(ScenarioError, match="servo"):
        simulate(PUSH, plant="prescribed")
