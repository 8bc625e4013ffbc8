"""MuJoCo as a plant: it flies what ours fly, and shares no physics with them."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from fullam.analysis.judged import driver_of
from fullam.analysis.pushed import hover_of
from fullam.dynamics.servo import ServoNumbers, servo_torque
from fullam.exceptions import MissingDependency, ScenarioError, SettingsError, UnknownName
from fullam.model.loading import load_vehicle
from fullam.simulation.motions.arm_motion import SineRate
from fullam.simulation.motions.references import Step
from fullam.simulation.mujoco import spec as mujoco_spec
from fullam.simulation.mujoco.engine import Engine, mean_square
from fullam.simulation.payloads.payload import Payload
from fullam.simulation.record.refly import refly
from fullam.simulation.record.run import Run
from fullam.simulation.scenarios.scenario import Scenario, load_scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.simulate import prepare, simulate
from fullam.simulation.weather import CALM, PAPER
from fullam.simulation.world.surfaces import Box, Plane, Sphere

TASK = replace(load_scenario("task-2"), duration=3.0, weather=CALM)
SWING = replace(TASK, duration=2.0, arm_motion=SineRate(joint=3, rate=2.0, frequency=4.0))

RK4 = 2e-6
"""[m] MuJoCo's RK4 against our midpoint rule at 1 ms; whole task-2: 1.3e-6."""

FIRST_ORDER = 5e-4
"""[m] MuJoCo's implicitfast at 1 ms; whole task-2: 3.7e-4."""

POSITION, ANGLE_DEG = 2e-5, 0.002
"""[m, deg] Servo plants against each other, 3e-6 and 8e-4 here; the issue asks for 3e-4 and 0.1."""


def turned_deg(a, b):
    """Angle between the attitudes of two poses, shape (N,) [deg]; small ones to the last bit."""
    near = np.sign(np.sum(a[:, 3:] * b[:, 3:], axis=1, keepdims=True)) * b[:, 3:]
    chord = np.linalg.norm(a[:, 3:] - near, axis=1)
    return np.degrees(4.0 * np.arcsin(0.5 * chord))


def apart(a, b):
    """Largest distance [m] and angle [deg] between the poses of two runs."""
    distance = np.linalg.norm(a.pose[:, :3] - b.pose[:, :3], axis=1)
    return distance.max(), turned_deg(a.pose, b.pose).max()


@pytest.fixture(scope="module")
def task():
    return simulate(TASK, driver="fused")


def prescribed(integrator, period=0.001):
    settings = {"integrator": integrator}
    return simulate(
        TASK,
        simulation={"plant_period": period, "plant_settings": settings},
        plant="mujoco-prescribed",
    )


def test_prescribed_joints_fly_as_in_our_plant(task):
    flown = prescribed("rk4")
    distance, angle = apart(task, flown)
    assert distance < RK4 and angle < 1e-4
    np.testing.assert_array_equal(flown.arm, task.arm)


def test_what_is_left_is_our_midpoint_rules_own_error():
    ours = simulate(TASK, driver="fused", simulation={"integrator": "rk4"})
    distance, _ = apart(ours, prescribed("rk4"))
    assert distance < 0.25 * RK4  # 2.5e-7 over the whole of task-2


def test_an_integrator_of_first_order_is_nearer_by_half_with_half_the_step(task):
    coarse, _ = apart(task, prescribed("implicitfast"))
    fine, _ = apart(task, prescribed("implicitfast", 0.0005))
    assert coarse < FIRST_ORDER
    assert 1.8 < coarse / fine < 2.2


@pytest.fixture(scope="module")
def swung():
    return simulate(SWING, "dc-pid-plus", plant="servo", driver="fused")


def test_servos_swing_the_arm_alike(swung):
    flown = simulate(SWING, "dc-pid-plus", plant="mujoco")
    distance, angle = apart(swung, flown)
    assert np.ptp(swung.arm[:, 2]) > np.radians(8.0)
    assert distance < POSITION and angle < ANGLE_DEG
    np.testing.assert_allclose(flown.arm, swung.arm, atol=np.radians(ANGLE_DEG))
    # Stiffness times the angle above, 9.2 N m/rad, and the encoders' steps are the same.
    np.testing.assert_allclose(flown.arm_torque, swung.arm_torque, atol=1e-3)


def test_gusts_and_a_true_vehicle_that_is_not_the_nominal_one():
    scenario, choices = replace(SWING, weather=PAPER, duration=1.5), {"seed": 3}
    ours = simulate(scenario, plant="servo", driver="fused", **choices)
    flown = simulate(scenario, plant="mujoco", **choices)
    assert np.abs(ours.disturbance).max() > 1.0
    distance, angle = apart(ours, flown)
    assert distance < POSITION and angle < ANGLE_DEG


def test_a_drag_torque_of_the_wrong_sign_is_seen(swung, monkeypatch):
    right = mujoco_spec.add_rotors

    def wrong(spec, platform, rotors):
        right(spec, platform, replace(rotors, spins=-rotors.spins))

    monkeypatch.setattr(mujoco_spec, "add_rotors", wrong)
    flown = simulate(replace(SWING, duration=0.5), "dc-pid-plus", plant="mujoco")
    assert turned_deg(swung.pose[: len(flown)], flown.pose).max() > 10.0 * ANGLE_DEG


def test_rotors_push_by_their_coupling_matrix():
    vehicle = load_vehicle("hextilt")
    engine = Engine(vehicle, vehicle.servos, TASK, "rk4", 0.001)
    q = np.array([1.0, 2.0, 3.0, 0.1, -0.2, 0.3, 0.9])
    q[3:] /= np.linalg.norm(q[3:])
    squares = np.linspace(1e5, 4e5, vehicle.rotors.count)
    engine.data.qpos[:7] = [*q[:3], q[6], *q[3:6]]
    engine.spin(squares)
    mujoco_spec.load_mujoco().mj_forward(engine.model, engine.data)
    R = engine.data.xmat[1].reshape(3, 3)
    found = engine.data.qfrc_actuator[:6]
    wrench = vehicle.rotors.coupling_matrix @ squares
    # A sum of six terms of some 10 N in doubles.
    np.testing.assert_allclose(np.r_[R.T @ found[:3], found[3:]], wrench, atol=1e-12)
    assert engine.model.body_mass.sum() == pytest.approx(vehicle.mass, rel=1e-14)


def test_servos_and_stops_give_the_torques_of_the_kernel():
    vehicle, rng = load_vehicle("fullam"), np.random.default_rng(0)
    servos = [ServoNumbers(*row) for row in vehicle.servos.rows.tolist()]
    engine = Engine(vehicle, vehicle.servos, TASK, "rk4", 0.001)
    data = engine.data
    beyond = 0
    for _ in range(50):
        # Up to 15 deg beyond the stops, and further off the goal than counts.
        positions, rates, goals = rng.uniform(-2.9, 2.9, 4), rng.normal(size=4), rng.normal(size=4)
        data.qpos[7:], data.qvel[6:] = positions, rates
        engine.ask(goals)
        mujoco_spec.load_mujoco().mj_forward(engine.model, data)
        torques = [
            servo_torque(*numbers) for numbers in zip(servos, goals, positions, rates, strict=True)
        ]
        # Rounding of stop * limit, 500 N m.
        given = data.qfrc_actuator[6:] + data.qfrc_passive[6:]
        np.testing.assert_allclose(given, torques, atol=1e-11)
        beyond += int(np.sum(np.abs(positions) > np.radians(150.0)))
    assert beyond > 5


def test_the_mean_square_of_a_speed_is_its_integrals():
    lag, period, t = 0.03, 0.01, np.linspace(0.0, 0.01, 2001)
    speed = 500.0 - 200.0 * np.exp(-t / lag)
    mean = np.trapezoid(speed**2, t) / period
    # The trapezoid's own error, (5e-6)^2 of the curvature.
    assert mean_square(300.0, 500.0, np.exp(-0.5 * period / lag)) == pytest.approx(mean, rel=1e-8)
    assert mean_square(300.0, 500.0, 0.0) == 500.0**2


def test_a_flight_that_blows_up_leaves_no_file_and_does_not_begin_anew(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    vehicle = load_vehicle("fullam")
    engine = Engine(vehicle, vehicle.servos, TASK, "rk4", 0.001)
    engine.data.qvel[0] = 1e300
    engine.step()
    assert engine.data.qvel[0] > 1e200 or np.isnan(engine.data.qvel[0])
    assert list(tmp_path.iterdir()) == []


# Contact.

SLIDE = replace(load_scenario("slide-wall"), duration=8.0, weather=CALM)


@pytest.fixture(scope="module")
def slid():
    return (
        simulate(SLIDE, "hybrid-force", driver="fused"),
        simulate(SLIDE, "hybrid-force", plant="mujoco"),
    )


def test_the_first_touch_has_the_same_impulse(slid):
    impulses = []
    for run in slid:
        push = -run.contact_force[:, 0]
        first = int(np.argmax(push > 0.0))
        impulses.append(0.01 * push[first : first + 12].sum())  # until it bounces off
    # A spring of Hertz's against a linear one; the issue asks for 15 %, and 1.2 % are found.
    assert impulses[1] == pytest.approx(impulses[0], rel=0.05)
    assert impulses[0] > 0.2


def test_what_pushes_steadily_pushes_alike(slid):
    ours, theirs = (run.contact_force[560:600, 0].mean() for run in slid)
    assert ours == pytest.approx(-3.0, rel=0.05)
    assert theirs == pytest.approx(ours, rel=0.01)


def test_what_slides_rubs_alike_and_stays_at_the_wall(slid):
    ours, theirs = (run.contact_force[720:] for run in slid)
    assert (ours[:, 0] < 0.0).all() and (theirs[:, 0] < 0.0).all()
    # Ours is regularised: at 0.1 m/s it lacks 2 % of mu f_n.
    share = theirs[:, 1].mean() / theirs[:, 0].mean()
    assert share == pytest.approx(0.5, abs=0.005)
    assert ours[:, 1].mean() == pytest.approx(theirs[:, 1].mean(), rel=0.05)


STAND = Scenario(
    "stand",
    Step((0.0, 0.0, 1.0)),
    initial_position=(0.0, 0.0, 1.0),
    initial_arm_deg=(-90.0, 0.0, -45.0, 0.0),
    duration=0.1,
    weather=CALM,
)


@pytest.mark.parametrize(
    "surface",
    [
        Plane((0.3, 0.0, 0.0), (1.0, 2.0, 2.0)),
        Sphere((0.3, 0.2, 0.1), 0.5),
        Box((0.1, -0.4, 0.2), (0.6, 0.4, 0.2), (20.0, 30.0, 40.0)),
    ],
)
def test_a_surface_pushes_the_tools_point_where_ours_does(surface):
    """A vehicle without weight, its tool 0.5 mm inside: both push along the normal, as much."""
    vehicle = load_vehicle("fullam")
    engine = Engine(vehicle, vehicle.servos, replace(STAND, world=(surface,)), "rk4", 0.001)
    mujoco = mujoco_spec.load_mujoco()
    engine.model.opt.gravity[:] = 0.0
    mujoco.mj_forward(engine.model, engine.data)
    engine.ask(engine.data.qpos[7:])
    inside, normal = point_inside(surface, 0.0005)
    tip = engine.data.geom_xpos[engine.model.geom("fullam/tip").id]
    engine.data.qpos[:3] += inside - tip
    force = engine.tool_force()
    # The spring of 1e5 N/m^(3/2) at 5 N, 3684 N/m; friction resists the motion that begins by a
    # hundredth, A / (A + R).
    np.testing.assert_allclose(force, 3684.0 * 0.0005 * normal, atol=0.02)


def point_inside(surface, depth):
    if isinstance(surface, Plane):
        return np.array(surface.point) - depth * surface.unit_normal, surface.unit_normal
    if isinstance(surface, Sphere):
        way = np.array([0.6, 0.0, -0.8])
        return np.array(surface.center) + (surface.radius - depth) * way, way
    way = surface.rotation[:, 2]
    return np.array(surface.center) + (0.5 * surface.size[2] - depth) * way, way


def test_a_box_that_the_ball_would_swallow_is_refused():
    tiny = replace(STAND, world=(Box((0.0, 0.0, 0.0), (0.003, 1.0, 1.0)),))
    with pytest.raises(ScenarioError, match="tool_radius"):
        simulate(tiny, plant="mujoco")


# Payloads, records, errors.

CARRY = replace(STAND, duration=1.5, payloads=(Payload(0.2, 0.3, 1.0, (0.0, 0.02, 0.03)),))


@pytest.fixture(scope="module")
def carried():
    return simulate(CARRY, "dc-pid-plus", plant="mujoco")


def test_payloads_are_carried_alike(carried):
    ours = simulate(CARRY, "dc-pid-plus", driver="fused")
    assert np.abs(ours.pose[:, 2] - 1.0).max() > 1e-3  # it dips
    distance, angle = apart(ours, carried)
    assert distance < POSITION and angle < ANGLE_DEG


def test_a_record_flies_again(carried, tmp_path):
    run = Run.load(carried.save(tmp_path / "carried.npz"))
    assert run.metadata["versions"]["mujoco"]
    again = refly(run)
    for name in ("pose", "arm", "arm_torque", "contact_force"):
        np.testing.assert_array_equal(getattr(again, name), getattr(carried, name))


@pytest.mark.parametrize("plant", ["mujoco", "mujoco-prescribed"])
def test_machine_code_does_not_fly_it(plant):
    with pytest.raises(SettingsError, match="fly it by 'python'"):
        simulate(STAND, plant=plant, driver="fused")


def test_sweeps_fly_it_by_python_and_margins_by_its_twin():
    assert driver_of("dc-pid", None, plants=["mujoco"]) == "python"
    plan = prepare(load_scenario("peg-in-hole"), "dc-pid")
    chosen = replace(plan.simulation, plant_settings={"integrator": "euler", "feedback": "truth"})
    hover = hover_of(replace(plan, simulation=chosen))
    assert hover.simulation.plant == "servo" and hover.scenario.world_file is None
    assert hover.simulation.plant_settings == {"feedback": "truth"}


@pytest.mark.parametrize(
    "simulation", [{"plant": "mujoco"}, SimulationSettings(plant="mujoco"), None]
)
def test_a_plant_that_was_chosen_is_not_the_scenarios(simulation):
    plan = prepare(CARRY, simulation=simulation)
    assert plan.simulation.plant == ("servo" if simulation is None else "mujoco")


@pytest.mark.parametrize("plant", ["mujoco", "mujoco-prescribed"])
def test_without_mujoco_the_extra_is_named(plant, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingDependency, match=r"fullam\[contact\]"):
        simulate(STAND, plant=plant)


@pytest.mark.parametrize("plant", ["mujoco", "mujoco-prescribed"])
def test_an_unknown_integrator_lists_the_known_ones(plant):
    with pytest.raises(UnknownName, match="rk4, implicitfast, euler"):
        simulate(STAND, plant=plant, simulation={"plant_settings": {"integrator": "rk5"}})


def test_nothing_is_touched_with_prescribed_joints():
    with pytest.raises(ScenarioError, match="yield"):
        simulate(CARRY, plant="mujoco-prescribed")
