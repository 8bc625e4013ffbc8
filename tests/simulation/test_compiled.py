"""The compiled engine is the reference engine over again, faster."""

from __future__ import annotations

import builtins
import dataclasses
import importlib
import sys
import time

import numpy as np
import pinocchio as pin
import pytest

import fullam
from fullam.control.controller import Measurement, ReferencePoint, controller_class, make_settings
from fullam.control.pid import Pid
from fullam.control.tick import ControlTick
from fullam.dynamics.multibody import Multibody
from fullam.exceptions import Diverged, MissingDependency, NonFiniteWrench, SettingsError
from fullam.model.chain import LinkChain
from fullam.model.loading import load_vehicle
from fullam.model.perturbation import Uncertainty, perturb
from fullam.model.wrench_axes import controllable_axes
from fullam.simulation.flight import Flight
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.simulate import prepare, simulate

pytest.importorskip("numba", reason="the compiled engine needs the extra 'fast'")

from fullam.simulation.compiled import arrays, batch, engine, entries, jit
from fullam.simulation.compiled.arrays import arm_of
from fullam.simulation.compiled.box_qp import CLIP, CYCLES, UNCONFIRMED, UNSETTLED, U
from fullam.simulation.compiled.dynamics import chain_rows
from fullam.simulation.compiled.integrate import POSE, VELOCITY
from fullam.simulation.compiled.law import INTEGRAL
from fullam.simulation.compiled.tick import CompiledTick

VEHICLES = ("fullam", "hextilt", "borinot", "quadrotor_arm")
CONTROLLERS = ("pid", "dc-pid", "backstepping")

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


@pytest.mark.parametrize("place", [0, 5, 8])
def test_a_tick_refuses_a_measurement_that_is_not_finite(place):
    """An angle of the arm as well, which this law needs for the centre of mass alone."""
    vehicle, far = load_vehicle("fullam"), ReferencePoint()
    far.pose[2] = 40.0
    m = Measurement(vehicle)
    m.q[place] = np.nan
    with pytest.raises(NonFiniteWrench):
        CompiledTick(Pid(vehicle), fullam.Allocator(vehicle.rotors)).speeds(m, far)
    with pytest.raises(NonFiniteWrench):
        ControlTick(Pid(vehicle), fullam.Allocator(vehicle.rotors)).speeds(0.0, m, far)


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


def test_saturated_allocations_are_the_reference_allocators():
    vehicle, rng = load_vehicle("fullam"), np.random.default_rng(2)
    allocator = fullam.Allocator(vehicle.rotors)
    tick = CompiledTick(Pid(vehicle), allocator)
    scale = vehicle.rotors.normalized_coupling.sum(axis=1)
    largest = np.abs(vehicle.rotors.normalized_coupling).sum(axis=1)
    saturated = 0
    for _ in range(2000):
        wrench = 0.3 * scale + 0.4 * largest * rng.normal(size=6)
        u, out_of_reach = tick.allocate(wrench)
        expected = allocator.solve(wrench)
        saturated += expected.saturated
        assert out_of_reach == expected.saturated
        assert np.abs(u - expected.squared).max() < FLIGHT_TOLERANCE
    assert saturated > 1000
    assert not tick.allotment.counters[[CLIP, CYCLES, UNCONFIRMED]].any()


def test_the_clip_answers_when_nothing_else_does():
    vehicle = load_vehicle("fullam")
    tick = CompiledTick(Pid(vehicle), fullam.Allocator(vehicle.rotors))
    # A search that may not change its active set once cannot settle.
    tick.allotment = tick.allotment._replace(minimisers=np.zeros(0, dtype=np.int64))
    u, out_of_reach = tick.allocate(np.array([0.0, 0.0, 1e4, 0.0, 0.0, 0.0]))
    assert out_of_reach
    assert u.min() >= 0.0
    assert u.max() <= 1.0
    assert tick.allotment.counters[CLIP] == 1


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


def test_a_wrench_that_is_not_finite_is_refused():
    plan = prepare("task-1", calm=True)
    job = arrays.job_of(plan)
    job.law.numbers[:] = np.nan
    with pytest.raises(NonFiniteWrench):
        engine.fly_job(plan, job)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_batch_is_the_single_flights(threads, monkeypatch):
    monkeypatch.setattr(batch, "TOGETHER", 2)
    plan = prepare("task-2", seed=99)
    for flown in batch.fly_seeds(plan, range(5), threads):
        run, single = flown.run(), simulate("task-2", seed=flown.plan.seed, engine="compiled")
        assert run.metadata == single.metadata
        for name, column in single.columns.items():
            assert np.array_equal(column, run.columns[name]), name


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


def test_without_numba_the_error_says_what_to_install(monkeypatch):
    real = builtins.__import__

    def blocked(name, *rest):
        if name == "numba":
            raise ImportError(name)
        return real(name, *rest)

    for module in [m for m in sys.modules if m.startswith("fullam.simulation.compiled.")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.delattr(importlib.import_module("fullam.simulation.compiled"), "engine")
    monkeypatch.setattr(builtins, "__import__", blocked)
    with pytest.raises(MissingDependency, match=r"fullam\[fast\]"):
        simulate("task-1", engine="compiled")


def test_compiling_is_announced(caplog, monkeypatch):
    monkeypatch.setattr(jit, "ANNOUNCE_AFTER", 0.0)

    class Slow:
        signatures = ()
        stats = entries.fly.stats._replace(cache_misses={"x": 1})

    with jit.announced("a thing", Slow()):
        time.sleep(0.05)
    text = caplog.text
    assert "compiling a thing" in text
    assert "kept in" in text


def test_the_machine_code_on_disk_is_keyed_by_all_sources():
    assert jit.sources() in [c.cell_contents for c in entries.fly.py_func.__closure__]
