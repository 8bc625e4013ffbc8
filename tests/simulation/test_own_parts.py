"""A user's own law and estimator: as kernels they fly everywhere, as classes in Python."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

import fullam
from fullam.control.controller import Controller
from fullam.control.controllers import CONTROLLERS
from fullam.control.estimator import Estimator
from fullam.control.estimators import estimator_class
from fullam.control.law import KernelLaw, LawKernels
from fullam.control.pid import PidSettings
from fullam.control.signals import Command
from fullam.dynamics.spatial import Spatial, add_spatial, axpy_spatial, subtract_spatial
from fullam.exceptions import SettingsError
from fullam.numbers.kernel import Number, kernel
from fullam.numbers.vectors import ZERO, subtract
from fullam.simulation import fused
from fullam.simulation.many import fly_many
from fullam.simulation.record.run import COLUMNS
from fullam.simulation.simulate import fly_by_python, prepare

# A law as one writes it: what it knows, what it remembers, what it does.


class SpringNumbers(NamedTuple):
    stiffness: Number
    damping: Number
    weight: Number


class SpringMemory(NamedTuple):
    informed: Number


@kernel
def start(numbers, chain, estimate):
    return SpringMemory(0.0 * estimate.pose.position[0])


@kernel
def spring(numbers, chain, estimate, target, memory):
    """Springs and dampers to the target, and the weight of the vehicle."""
    way = subtract(target.pose.position, estimate.pose.position)
    turn = subtract(target.pose.attitude[0:3], estimate.pose.attitude[0:3])
    speed = subtract_spatial(target.velocity, estimate.velocity)
    pull = axpy_spatial(numbers.damping, speed, Spatial(ZERO, ZERO))
    pull = axpy_spatial(numbers.stiffness, Spatial(way, turn), pull)
    weight = Spatial((0.0, 0.0, numbers.weight), ZERO)
    return Command(add_spatial(pull, weight), pull, weight), memory


@kernel
def delivered(numbers, chain, estimate, memory, delivery):
    return SpringMemory(memory.informed + 1.0)


class Spring(KernelLaw):
    """Not registered here, so that other tests do not meet it; `fullam.register` would do."""

    name, Settings, Memory = "spring", PidSettings, SpringMemory
    kernels = LawKernels(start, spring, delivered)

    def numbers(self):
        return SpringNumbers(6.0, 4.0, self.vehicle.mass * self.vehicle.gravity)


class NumpySpring(Controller):
    """The same as a class of one's own, in numpy."""

    name, Settings = "numpy-spring", PidSettings
    informed = 0

    def reset(self, measurement, reference):
        self.informed = 0

    def wrench(self, t, measurement, reference):
        q, v = measurement.q, measurement.v
        x, y, z, w = q[3:7]
        R = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        velocity = np.concatenate([R @ v[:3], R @ v[3:6]])
        self.u_pid = 4.0 * (reference.velocity - velocity)
        self.u_pid += 6.0 * (reference.pose[:6] - q[:6])
        self.u_dc = np.array([0, 0, self.vehicle.mass * self.vehicle.gravity, 0, 0, 0])
        return self.u_pid + self.u_dc

    def delivered(self, wrench_W, missing_W):
        self.informed += 1


@pytest.fixture(autouse=True)
def own_laws(monkeypatch):
    for law in (Spring, NumpySpring):
        monkeypatch.setitem(CONTROLLERS, law.name, law)


@pytest.fixture(params=["reachable", "far"])
def scenario(request):
    height = 1.3 if request.param == "reachable" else 5.5
    return fullam.Scenario("hop", reference=fullam.Step((0.1, 0.0, height)), duration=0.5)


def test_a_law_as_kernels_flies_everywhere(scenario):
    plan = prepare(scenario, "spring", seed=1, shaping={"max_acceleration": None})
    python, machine = fly_by_python(plan), fused.fly(plan)
    (lane,) = fly_many(plan, [1])
    for name in COLUMNS:
        np.testing.assert_array_equal(machine.columns[name], lane.columns[name])
        scale = max(1.0, np.abs(machine.columns[name]).max())
        # Rounding: Pinocchio flies the one, the recursion the other.
        np.testing.assert_allclose(
            1.0 * python.columns[name], 1.0 * machine.columns[name], rtol=0, atol=1e-9 * scale
        )
    assert python.saturated.any(), "the law is told what it does not get"


def test_a_law_as_a_class_flies_in_python_as_its_kernels_do(scenario):
    choices = {"seed": 1, "shaping": {"max_acceleration": None}}
    own = fullam.simulate(scenario, "numpy-spring", **choices)
    kernels = fullam.simulate(scenario, "spring", **choices)
    # Rounding of the same sums in another order, over 50 periods.
    np.testing.assert_allclose(own.pose, kernels.pose, rtol=0, atol=1e-10)
    np.testing.assert_allclose(own.u_pid, kernels.u_pid, rtol=0, atol=1e-9)


def test_every_law_is_shaped_and_anticipated():
    """Blending and lags are the scenario's, whoever flies."""
    step = fullam.Scenario("step", reference=fullam.Step((0.5, 0.0, 1.0)), duration=0.3)
    shaped, bare = (
        prepare(step, "numpy-spring", shaping=shaping)
        for shaping in ({}, {"max_acceleration": None, "anticipate": False})
    )
    assert shaped.reference.pose[0, 0] == 0.0
    assert bare.reference.pose[0, 0] == 0.5
    assert shaped.anticipation is not None
    assert bare.anticipation is None


def test_a_law_knows_whether_it_is_anticipated():
    step = fullam.Scenario("step", reference=fullam.Step((0.5, 0.0, 1.0)), duration=0.3)
    for anticipate in (True, False):
        plan = prepare(step, "dc-pid-plus", shaping={"anticipate": anticipate})
        law = plan.make_controller()
        assert law.anticipated is anticipate
        assert (law.numbers().turn_ahead > 0.0) is anticipate
    # A jump that is left in the motion: nothing is anticipated, and the law is told so.
    left = prepare(step, "dc-pid-plus", shaping={"max_acceleration": None})
    assert not left.make_controller().anticipated


def test_machine_code_cannot_fly_a_class_and_says_what_can():
    scenario = fullam.Scenario("hop", duration=0.1)
    words = r"'numpy-spring' is not written as kernels.*driver='python'.*KernelLaw"
    with pytest.raises(SettingsError, match=words):
        fullam.simulate(scenario, "numpy-spring", driver="fused")
    with pytest.raises(SettingsError, match=words):
        list(fly_many(prepare(scenario, "numpy-spring"), [0]))


class Stale(Estimator):
    """Somebody's estimator in numpy: the pose as read, and no velocity."""

    name = "stale"

    def reset(self, readings):
        self.resets = 1

    def update(self, readings, measurement):
        measurement.q[:7] = np.concatenate(readings.pose)
        measurement.v[:6] = 0.0


def test_an_estimator_as_a_class_flies_in_python_and_is_named_by_machine_code(monkeypatch):
    registry = {"stale": Stale}

    def with_own(name):
        return registry.get(name) or estimator_class(name)

    for module in ("control.estimators", "simulation.settings", "simulation.flight_plan"):
        monkeypatch.setattr(f"fullam.{module}.estimator_class", with_own)
    scenario = fullam.Scenario("hop", duration=0.2)
    simulation = fullam.SimulationSettings(estimator="stale")
    run = fullam.simulate(scenario, simulation=simulation, seed=2)
    assert not run.measured_velocity.any()
    assert np.abs(run.measured_pose[:, :3] - run.pose[:, :3]).max() > 0.0
    with pytest.raises(SettingsError, match=r"'stale' is not written as kernels.*KernelEstimator"):
        fullam.simulate(scenario, simulation=simulation, driver="fused")


def test_a_law_that_answers_no_wrench_is_told_so(monkeypatch):
    monkeypatch.setattr(NumpySpring, "wrench", lambda self, t, m, r: np.zeros(3))
    with pytest.raises(SettingsError, match=r"'numpy-spring': wrench: is .*six numbers"):
        fullam.simulate(fullam.Scenario("hop", duration=0.1), "numpy-spring")
