"""The Python driver and machine code fly the same flight, and end it in the same way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from same_flights import assert_same_bits

import fullam
from fullam.control.controllers import CONTROLLERS, LAWS
from fullam.control.law import LawKernels
from fullam.control.pid import Pid, delivered, start
from fullam.control.pid import command as pid_command
from fullam.control.signals import Command
from fullam.dynamics.spatial import Pose, Spatial
from fullam.exceptions import Diverged, NonFiniteWrench
from fullam.numbers.kernel import kernel, select
from fullam.numbers.records import record
from fullam.numbers.vectors import ZERO
from fullam.simulation import fused
from fullam.simulation.block import Block
from fullam.simulation.flight import Flight
from fullam.simulation.flight_plan import divergence
from fullam.simulation.record.run import COLUMNS
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.simulate import fly_by_python, prepare
from fullam.simulation.stages import WatchView, watch
from fullam.simulation.tables import Tables

NAMES = tuple(law.name for law in LAWS)

ROUNDING = 1e-9
"""Relative to a column's largest entry (at least 1), after 3 s: rounding of other sums of the same
dynamics, fed back 300 times or more by a loop that is stable."""


def flown(plan):
    """The plan flown by both drivers."""
    return fly_by_python(plan), fused.fly(plan)


def assert_same_flight(python, machine):
    """Every column agrees to rounding, and so does the ending."""
    assert (machine.outcome, len(machine)) == (python.outcome, len(python))
    for name in COLUMNS:
        a, b = 1.0 * python.columns[name], 1.0 * machine.columns[name]
        scale = max(1.0, np.abs(a).max(initial=0.0))
        np.testing.assert_allclose(b, a, rtol=0, atol=ROUNDING * scale, err_msg=name)


def for_seconds(name, duration):
    return replace(fullam.load_scenario(name), duration=duration)


@pytest.mark.parametrize("weather", ["calm", "paper"])
@pytest.mark.parametrize("controller", NAMES)
@pytest.mark.parametrize("scenario", ["task-2", "position-2", "quadrotor-arm", "hextilt-step"])
def test_the_same_flight(scenario, controller, weather):
    plan = prepare(for_seconds(scenario, 3.0), controller, weather=weather, seed=3)
    assert_same_flight(*flown(plan))


@pytest.mark.parametrize(
    "changes",
    [
        {"integrator": "rk4"},
        {"integrator": "semi-implicit-euler"},
        {"estimator": "truth"},
        {"estimator": "kalman", "pose_period": 0.02},
        {"estimator": "kalman", "estimator_settings": {"initial_speed": 0.05}},
        {"estimator_settings": {"cutoff": 9.0}},
        {"pose_period": 0.03},
        {"delay": 0.02},
        {"control_period": 0.001},
        {"control_period": 0.004, "plant_period": 0.002},
    ],
)
def test_the_same_flight_however_simulated(changes):
    plan = prepare(for_seconds("task-2", 1.0), simulation=SimulationSettings(**changes), seed=1)
    assert_same_flight(*flown(plan))


@pytest.mark.parametrize(
    "choices",
    [
        {"settings": {"compensation": "previous_wrench"}},
        {"settings": {"compensation": "previous_wrench", "rounds": 1}},
        {"settings": {"model": "newton-euler"}},
        {"settings": {"wrench_bounds": (5.0, 5.0, 60.0, 0.5, 0.5, 0.5)}},
        {"shaping": {"anticipate": False, "max_acceleration": None}},
        {"shaping": {"max_angular_acceleration": 30.0}},
    ],
)
def test_the_same_flight_whatever_is_chosen(choices):
    assert_same_flight(*flown(prepare(for_seconds("task-2", 1.0), seed=1, **choices)))


def test_the_same_flight_of_a_true_vehicle_of_ones_own():
    plan = prepare(for_seconds("task-2", 1.0), seed=2)
    vehicle = plan.nominal
    failed = replace(vehicle, rotors=vehicle.rotors.with_failed(3))
    python, machine = flown(plan.with_true(failed))
    assert_same_flight(python, machine)
    assert np.abs(python.pose - fly_by_python(plan).pose).max() > 1e-3


def test_machine_code_is_watched_and_can_be_interrupted():
    plan, told = prepare("task-2", seed=4), []
    whole, pieces = fused.fly(plan), fused.fly(plan, lambda k, n: told.append((k, n)))
    assert_same_bits(whole, pieces)
    assert told[-1] == (1201, 1201)
    assert [k for k, _ in told] == sorted({k for k, _ in told})

    def interrupt(k, n):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fused.fly(plan, interrupt)


def test_python_tells_its_progress():
    told = []
    fly_by_python(prepare(for_seconds("task-2", 3.0)), lambda k, n: told.append((k, n)))
    assert told[0] == (1, 301)
    assert told[-1] == (301, 301)
    assert 90 < len(told) < 120


FALLING = {"position_gains": (0.0, 0.0, 0.0), "wrench_bounds": (1.0,) * 6}


def test_divergence_is_the_same():
    errors = []
    for driver in ("python", "fused"):
        with pytest.raises(Diverged) as caught:
            fullam.simulate("task-1", settings=FALLING, driver=driver)
        errors.append(caught.value)
        value = fullam.simulate("task-1", settings=FALLING, driver=driver, throw=False)
        assert_same_bits(value, caught.value.run)
        assert value.metadata["reason"] == caught.value.reason
    assert errors[0].reason == errors[1].reason
    assert 0 < len(errors[0].run) == len(errors[1].run) < 1201
    assert_same_flight(errors[0].run, errors[1].run)


def test_divergence_before_the_first_period():
    """In row 0, where there is nothing in the record but the start."""
    plan = prepare("task-1")
    pose = plan.reference.pose + 1e3 * np.eye(7)[2]
    plan = replace(plan, reference=replace(plan.reference, pose=pose))
    python, machine = flown(plan)
    assert (python.outcome, len(python)) == ("diverged", 0)
    assert_same_flight(python, machine)
    assert machine.metadata["reason"] == python.metadata["reason"]


def test_a_flight_that_is_left_has_the_rows_it_has_flown():
    """A viewer stops where it likes; those rows are the whole flight's."""
    plan = prepare(for_seconds("task-2", 0.5), seed=1)
    flight, whole = Flight(plan), fly_by_python(plan)
    for k in flight.ticks():
        if k == 19:
            break
    part = flight.run()
    assert (part.outcome, len(part)) == ("flying", 20)
    for name in COLUMNS:
        np.testing.assert_array_equal(part.columns[name], whole.columns[name][:20], err_msg=name)
    np.testing.assert_array_equal(flight.pose, whole.pose[20])
    np.testing.assert_array_equal(flight.rotor_speeds, whole.rotor_speeds[20])


@pytest.mark.parametrize("place", range(7))
def test_a_pose_that_is_not_finite_is_out_of_bounds(place):
    """The attitude alone as well."""
    plan = prepare("task-1", calm=True)
    tables = Tables(plan)
    pose = plan.reference.pose[0].copy()
    for finite in (True, False):
        pose[place] = pose[place] if finite else np.nan
        state = Block(tables).state.to_list()
        state[0] = state[0]._replace(pose=record(Pose, pose))
        status = [Block(tables).status.to_list()[0]._replace(end=1e18)]
        view = WatchView(state, tables.targets.to_list(), tables.bounds.to_list(), status)
        watch(view, 0)
        assert (status[0].end > 0.0) is finite
        assert (divergence(plan, 0, pose) is None) is finite


@pytest.mark.parametrize("axis", range(3))
def test_bounds_count_on_controlled_axes_only(axis):
    """They are those of `divergence`, to either side of the edge."""
    scenario = fullam.Scenario("hold", axes=("z", "phi", "psi", "gamma"), vehicle="quadrotor_arm")
    plan = prepare(scenario, calm=True)
    tables, block = Tables(plan), Block(Tables(plan))
    for far in (4.99, 5.01):
        pose = plan.reference.pose[0].copy()
        pose[axis] += far
        status = [block.status.to_list()[0]._replace(end=1e18)]
        state = [block.state.to_list()[0]._replace(pose=record(Pose, pose))]
        view = WatchView(state, tables.targets.to_list(), tables.bounds.to_list(), status)
        watch(view, 0)
        assert (status[0].end == 0.0) is (axis == 2 and far > 5.0)
        assert (divergence(plan, 0, pose) is not None) is (status[0].end == 0.0)


@kernel
def command_that_breaks(numbers, chain, estimate, target, memory):
    """Not finite once the platform is asked to be higher than 2 m."""
    answer, memory = pid_command(numbers, chain, estimate, target, memory)
    lost = Spatial(ZERO, (0.0, float("nan"), 0.0))
    wrench = select(target.pose.position[2] > 2.0, lost, answer.wrench)
    return Command(wrench, answer.u_pid, answer.u_dc), memory


class Breaking(Pid):
    """A law that returns NaN in the middle of a flight."""

    kernels = LawKernels(start, command_that_breaks, delivered)


@pytest.mark.parametrize("driver", ["python", "fused"])
def test_a_wrench_that_is_not_finite_is_refused_and_named(driver, monkeypatch):
    monkeypatch.setitem(CONTROLLERS, "breaking", Breaking)
    monkeypatch.setattr(Breaking, "name", "breaking")
    scenario = fullam.Scenario(
        "high",
        initial_position=(0.0, 0.0, 1.9),
        reference=fullam.Step((0.0, 0.0, 2.2), at=0.1),
        duration=1.0,
    )
    with pytest.raises(NonFiniteWrench, match=r"wrench \[0.0, 0.0, 0.0, 0.0, nan, 0.0\]"):
        fullam.simulate(scenario, "breaking", calm=True, driver=driver)


def test_without_a_compiler_the_fused_driver_flies_in_python(monkeypatch):
    plan = prepare(for_seconds("task-2", 0.5), "dc-pid-plus", seed=3)
    compiled = fused.fly(plan)
    for module in ("fullam.simulation.fused", "fullam.numbers.program"):
        monkeypatch.setattr(f"{module}.available", lambda: False)
    again = prepare(for_seconds("task-2", 0.5), "dc-pid-plus", seed=3)
    assert_same_bits(fused.fly(again), compiled)
