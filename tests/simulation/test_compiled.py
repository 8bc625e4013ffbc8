"""The compiled engine is the reference engine over again, faster."""

from __future__ import annotations

import copy
import dataclasses
import pickle

import numpy as np
import pinocchio as pin
import pytest

import fullam
from fullam.analysis.campaign import fastest_engine
from fullam.control.controller import Measurement, ReferencePoint
from fullam.control.controllers import controller_class, make_settings
from fullam.control.pid import Pid
from fullam.control.tick import ControlTick
from fullam.dynamics.multibody import Multibody
from fullam.exceptions import (
    Diverged,
    NonFiniteWrench,
    SettingsError,
    VehicleError,
)
from fullam.model.chain import LinkChain
from fullam.model.loading import load_vehicle
from fullam.model.perturbation import Uncertainty, perturb
from fullam.model.vehicle import Vehicle
from fullam.model.wrench_axes import controllable_axes
from fullam.simulation.flight import Flight
from fullam.simulation.flight_plan import divergence
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.simulate import prepare, simulate

pytest.importorskip("numba", reason="the compiled engine needs the extra 'fast'")

from fullam.simulation.compiled import arrays, batch, engine, entries
from fullam.simulation.compiled.arrays import arm_of
from fullam.simulation.compiled.box_qp import CLIP, CYCLES, UNCONFIRMED, UNSETTLED, U
from fullam.simulation.compiled.dynamics import chain_rows
from fullam.simulation.compiled.integrate import POSE, VELOCITY
from fullam.simulation.compiled.law import INTEGRAL
from fullam.simulation.compiled.loop import diverged
from fullam.simulation.compiled.tick import CompiledTick

VEHICLES = ("fullam", "hextilt", "borinot", "quadrotor_arm")
CONTROLLERS = tuple(law.name for law in arrays.LAWS)

STEP_TOLERANCE = 1e-12
"""One step or tick, relative to full scale: rounding, in a different order of operations."""

FLIGHT_TOLERANCE = 1e-9
"""Pose after 3 s: rounding, fed back 300 times or more by a loop that is stable."""

DYNAMICS_TOLERANCE = 1e-10
"""Acceleration relative to its largest entry, over states and inertias of any size."""


def worst(a, b):
    """Largest difference, relative to the largest entry (at least 1)."""
    return np.abs(1.0 * a - b).max(initial=0.0) / max(1.0, np.abs(a).max(initial=0.0))


@pytest.mark.parametrize("name", VEHICLES)
def test_accelerations_are_pinocchios_over_200_states_with_perturbed_inertias(name):
    rng = np.random.default_rng(1)
    pin.seed(1)
    vehicle = load_vehicle(name)
    for _ in range(200):
        true = perturb(vehicle, Uncertainty(0.3), rng)
        model = true.model
        q = pin.randomConfiguration(model, -3.0 * np.ones(model.nq), 3.0 * np.ones(model.nq))
        v, ddtheta = rng.normal(size=model.nv), rng.normal(size=vehicle.n_arm)
        wrench = 50.0 * rng.normal(size=6)
        state, out = np.zeros((8, 7)), np.zeros((1, 6))
        state[POSE], state[VELOCITY, :6] = q[:7], v[:6]
        links = chain_rows(LinkChain.from_model(model))
        entries.accelerate(
            links,
            arm_of(links, q[None, 7:], v[None, 6:], ddtheta[None]),
            true.gravity,
            state,
            wrench[None],
            out,
        )
        expected = Multibody(true).base_acceleration(q, v, ddtheta, wrench)
        assert np.abs(out[0] - expected).max() < DYNAMICS_TOLERANCE * np.abs(expected).max()


def both(plan):
    """The plan flown by both engines."""
    flight = Flight(plan)
    for _ in flight.ticks():
        pass
    return flight.run(), engine.fly(plan)


def check_same(reference, compiled, tolerance):
    """Every column agrees, and so does the ending."""
    assert compiled.outcome == reference.outcome
    assert len(compiled) == len(reference)
    for name, column in reference.columns.items():
        assert worst(column, compiled.columns[name]) < tolerance, name


@pytest.mark.parametrize("weather", ["calm", "paper"])
@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("scenario", ["task-2", "position-2", "quadrotor-arm"])
def test_the_same_flight(scenario, controller, weather):
    scenario = dataclasses.replace(fullam.load_scenario(scenario), duration=3.0)
    check_same(*both(prepare(scenario, controller, weather=weather, seed=3)), FLIGHT_TOLERANCE)


@pytest.mark.parametrize(
    "changes",
    [
        {"integrator": "rk4"},
        {"integrator": "semi-implicit-euler"},
        {"estimator": "truth"},
        {"pose_period": 0.03},
        {"delay": 0.02},
        {"control_period": 0.001},
    ],
)
def test_the_same_flight_however_simulated(changes):
    scenario = dataclasses.replace(fullam.load_scenario("task-2"), duration=1.0)
    simulation = SimulationSettings(**changes)
    check_same(*both(prepare(scenario, simulation=simulation, seed=1)), FLIGHT_TOLERANCE)


@pytest.mark.parametrize(
    "settings",
    [
        {"compensation": "previous_wrench"},
        {"compensation": "previous_wrench", "rounds": 1},
        {"model": "newton-euler"},
        {"anticipate": False, "max_acceleration": None},
        {"wrench_bounds": (5.0, 5.0, 60.0, 0.5, 0.5, 0.5)},
    ],
)
def test_the_same_flight_whatever_the_settings(settings):
    scenario = dataclasses.replace(fullam.load_scenario("task-2"), duration=1.0)
    check_same(*both(prepare(scenario, settings=settings, seed=1)), FLIGHT_TOLERANCE)


def test_the_same_flight_of_another_vehicle():
    scenario = dataclasses.replace(fullam.load_scenario("hextilt-step"), duration=2.0)
    check_same(*both(prepare(scenario, seed=2)), FLIGHT_TOLERANCE)


def random_measurement(vehicle, rng, pace):
    """A measurement and a reference near it, in motion."""
    m, point = Measurement(vehicle), ReferencePoint()
    m.q[:3], m.q[7:] = rng.uniform(-1.0, 1.0, 3), rng.uniform(-1.0, 1.0, vehicle.n_arm)
    m.q[3:7] = pin.Quaternion(pin.exp3(pace * rng.normal(size=3))).coeffs()
    m.v[:] = pace * rng.normal(size=m.v.size)
    m.arm_acceleration[:] = pace * rng.normal(size=vehicle.n_arm)
    turn = np.concatenate([0.3 * pace * rng.normal(size=6), np.zeros(vehicle.n_arm)])
    point.pose = pin.integrate(vehicle.model, m.q, turn)[:7]
    point.velocity, point.acceleration = pace * rng.normal(size=(2, 6))
    return m, point


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("vehicle", ["fullam", "hextilt", "quadrotor_arm"])
def test_one_tick_to_rounding(vehicle, controller):
    """In reach and out of it: the wrench, the speeds, and what is left of the integrator."""
    vehicle, rng = load_vehicle(vehicle), np.random.default_rng(5)
    axes = controllable_axes(vehicle.rotors)
    law = controller_class(controller)(vehicle, make_settings(controller), 0.001, axes)
    integral = law._integral if controller == "backstepping" else law.law.integral
    reference = ControlTick(law, fullam.Allocator(vehicle.rotors, axes=axes))
    scale = np.abs(vehicle.rotors.normalized_coupling).sum(axis=1).max()
    tick = CompiledTick(law, fullam.Allocator(vehicle.rotors, axes=axes))
    saturated = 0
    for trial in range(100):
        m, point = random_measurement(vehicle, rng, 1.0 if trial % 2 else 0.05)
        law.reset(m, point)
        reference.allocator.reset()
        tick.reset()
        integral[:] = tick.memory[INTEGRAL] = rng.normal(size=6)
        reference.speeds(0.0, m, point)
        tick.speeds(m, point)
        assert np.abs(tick.wrench_A - reference.wrench_A).max() < STEP_TOLERANCE * scale
        assert tick.saturated == reference.saturated
        squared = reference.allocator.squared
        # Rounding 1e-16 over eps: what the null space of the coupling may turn it into.
        assert np.abs(tick.allotment.unknowns[U] - squared).max() < FLIGHT_TOLERANCE
        assert np.abs(tick.memory[INTEGRAL] - integral).max() < FLIGHT_TOLERANCE
        saturated += tick.saturated
    assert 10 < saturated < 100
    assert not tick.allotment.counters[[CLIP, CYCLES, UNCONFIRMED, UNSETTLED]].any()


@pytest.mark.parametrize(("place", "kind"), [(0, "wrench"), (5, "wrench"), (8, "centre of mass")])
def test_a_tick_refuses_a_measurement_that_is_not_finite(place, kind):
    """An angle of the arm as well, which this law needs for the centre of mass alone."""
    vehicle, far = load_vehicle("fullam"), ReferencePoint()
    far.pose[2] = 40.0
    m = Measurement(vehicle)
    m.q[place] = np.nan
    tick = CompiledTick(Pid(vehicle), fullam.Allocator(vehicle.rotors))
    reference = ControlTick(Pid(vehicle), fullam.Allocator(vehicle.rotors))
    errors = []
    for speeds in (lambda: tick.speeds(m, far), lambda: reference.speeds(0.0, m, far)):
        with pytest.raises(NonFiniteWrench, match=rf"{kind} \[.*nan.*\] is not finite") as caught:
            speeds()
        errors.append(caught.value)
    assert type(errors[0]) is type(errors[1])


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda tick: pickle.loads(pickle.dumps(tick))])
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_a_copied_tick_goes_on_as_the_original_does(controller, copied):
    vehicle, rng = load_vehicle("fullam"), np.random.default_rng(6)
    law = controller_class(controller)(vehicle)
    tick = CompiledTick(law, fullam.Allocator(vehicle.rotors))
    for trial in range(20):
        tick.speeds(*random_measurement(vehicle, rng, 1.0))
        twin, inputs = copied(tick), random_measurement(vehicle, rng, (0.05, 1.0)[trial % 2])
        assert (twin.saturated, twin.memory.tobytes()) == (tick.saturated, tick.memory.tobytes())
        kept = twin.speeds(*random_measurement(vehicle, rng, 1.0)).copy()
        twin = copied(tick)
        mine, copys = tick.speeds(*inputs), twin.speeds(*inputs)
        np.testing.assert_array_equal(mine, copys)
        assert np.abs(kept - mine).max() > 1.0, "the copy's arrays are its own"
        np.testing.assert_array_equal(tick.wrench_A, twin.wrench_A)
        np.testing.assert_array_equal(tick.allotment.counters, twin.allotment.counters)


def test_one_plant_step_to_rounding():
    plan = prepare("task-2", weather="paper", simulation=SimulationSettings(control_period=0.001))
    reference, job = Flight(plan).plant, arrays.job_of(plan)
    rng = np.random.default_rng(0)
    for _ in range(50):
        reference.v[:6] = rng.normal(size=6)
        job.state[POSE], job.state[VELOCITY, :6] = reference.q[:7], reference.v[:6]
        row, gust = reference._row, rng.normal(size=6)
        commands = plan.nominal.rotors.max_speeds * rng.uniform(0.3, 0.9, 8)
        job.speeds[0], job.speeds[1] = reference.speeds, commands
        reference.advance(commands, gust, 1)
        entries.step(*job.craft, job.tables.arm, row, job.state, job.speeds, gust[None])
        assert worst(reference.q[:7], job.state[POSE]) < STEP_TOLERANCE
        assert worst(reference.v[:6], job.state[VELOCITY, :6]) < STEP_TOLERANCE


def test_stretches_and_progress_change_nothing():
    told = []
    plan = prepare("task-2", seed=4)
    whole, pieces = engine.fly(plan), engine.fly(plan, lambda k, n: told.append((k, n)))
    for name, column in whole.columns.items():
        assert np.array_equal(column, pieces.columns[name]), name
    assert told[-1] == (1201, 1201)
    assert len(told) > 50


def test_run_says_what_flew_it_and_flies_again_bit_for_bit():
    run = simulate("position-1", seed=1, engine="compiled")
    assert run.metadata["engine"] == "compiled"
    again = run.refly()
    for name, column in run.columns.items():
        assert np.array_equal(column, again.columns[name]), name


def test_divergence_is_the_reference_engines():
    falling = {"position_gains": (0.0, 0.0, 0.0), "wrench_bounds": (1.0,) * 6}
    errors = []
    for name in ("reference", "compiled"):
        with pytest.raises(Diverged) as caught:
            simulate("task-1", settings=falling, engine=name)
        errors.append(caught.value)
    assert errors[0].reason == errors[1].reason
    assert len(errors[0].run) == len(errors[1].run)
    # And so is that of a batch.
    flown = batch.Batch(prepare("task-1", settings=falling)).fly(0)
    assert flown.diverged
    assert flown.run().metadata["reason"] == errors[1].reason
    assert len(flown.run()) == len(errors[1].run)


def test_divergence_before_the_first_tick():
    """At row 0, where there is nothing in the log but the start."""
    plan = prepare("task-1")
    pose = plan.reference.pose + 1e3 * np.eye(7)[2]
    plan = dataclasses.replace(plan, reference=dataclasses.replace(plan.reference, pose=pose))
    reference, compiled = both(plan)
    assert (reference.outcome, len(reference)) == ("diverged", 0)
    check_same(reference, compiled, FLIGHT_TOLERANCE)
    assert compiled.metadata["reason"] == reference.metadata["reason"]
    flown = batch.Batch(plan).fly(plan.seed)
    assert flown.diverged
    assert flown.run().metadata == compiled.metadata


@pytest.mark.parametrize("place", range(7))
def test_a_pose_that_is_not_finite_is_out_of_the_bounds_of_sense(place):
    """The attitude alone as well: for numba min(1.0, nan) is 1.0, an attitude that is right."""
    plan = prepare("task-1", calm=True)
    job = arrays.job_of(plan)
    job.state[POSE] = plan.reference.pose[0]
    assert not diverged(job.rules, job.state, job.tables.target, 0)
    job.state[POSE, place] = np.nan
    assert diverged(job.rules, job.state, job.tables.target, 0)
    assert divergence(plan, 0, job.state[POSE])


def test_a_wrench_that_is_not_finite_is_refused():
    plan = prepare("task-1", calm=True)
    job = arrays.job_of(plan)
    job.law.numbers[:] = np.nan
    with pytest.raises(NonFiniteWrench):
        engine.fly_job(plan, job)


@pytest.mark.parametrize(
    ("controller", "changes", "names"),
    [
        ("dc-pid-plus", {}, ("dc-pid-plus", "backstepping")),
        ("dc-pid", {"estimator": "kalman"}, ("kalman", "first-order")),
    ],
)
def test_what_is_not_covered_is_named(controller, changes, names):
    with pytest.raises(SettingsError) as caught:
        simulate("task-1", controller, simulation=SimulationSettings(**changes), engine="compiled")
    assert all(name in str(caught.value) for name in names)
    assert "reference" in str(caught.value)


def test_the_fastest_engine_for_a_prismatic_arm_is_the_reference():
    """It is installed, but covers revolute joints alone; told before anything flies."""
    vehicle = load_vehicle("fullam")
    robot = vehicle.urdf
    urdf = robot.replace('type="revolute"', 'type="prismatic"', 1)
    assert urdf != robot
    sliding = Vehicle.from_definition(vehicle.definition, urdf)
    plan, usual = (prepare("task-1", "pid", vehicle=one) for one in (sliding, vehicle))
    assert fastest_engine([usual]) == "compiled"
    assert fastest_engine([usual, plan]) == "reference"
    with pytest.raises(VehicleError, match="must be revolute"):
        arrays.check(plan)
