"""The momentum observer, on a vehicle whose motion is integrated exactly as the observer's law."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.control.caution import Halves
from fullam.control.controller import Measurement
from fullam.control.law import estimate_of, motions_of
from fullam.control.pid import Pid
from fullam.control.wrench_observer import asked, nothing_observed, observed, observer_numbers
from fullam.dynamics.integrators import integrator
from fullam.dynamics.multibody import Multibody, rotation_of
from fullam.dynamics.spatial import Pose, Spatial
from fullam.model.loading import load_vehicle
from fullam.numbers.records import flat, record

T = 0.01
LAG = 0.03


class Observer:
    """The kernels, period by period; `wrench` and `actual` in world axes."""

    def __init__(self, vehicle, rates, lag=LAG):
        self.law, self.factors = Pid(vehicle), Halves(1.0, 1.0)
        self.numbers = observer_numbers(vehicle, T, rates, lag)

    def reset(self, m):
        self.chain, self.R = self.law.chain(motions_of(m)), rotation_of(m.q)
        self.memory = nothing_observed(self.numbers, self.chain, estimate_of(m))

    def applied(self, wrench_W):
        wrench_A = (wrench_W.reshape(2, 3) @ self.R).ravel()
        self.memory = asked(self.memory, record(Spatial, wrench_A))

    def update(self, m):
        self.chain, self.R = self.law.chain(motions_of(m)), rotation_of(m.q)
        self.memory = observed(self.numbers, self.factors, self.chain, estimate_of(m), self.memory)
        return np.array([*flat(self.memory.wrench)])

    def actual(self):
        actual_A = np.array([*flat(self.memory.actual)])
        return (actual_A.reshape(2, 3) @ self.R.T).ravel()


class Body:
    """A vehicle under a commanded wrench that lags in {A}, a disturbance, and a moving arm."""

    def __init__(self, vehicle, moving=True):
        self.vehicle, self.body = vehicle, Multibody(vehicle)
        self.m, self.t = Measurement(vehicle), 0.0
        self.swing = 1.0 if moving else 0.0
        self._arm(0.0, self.m.q, self.m.v)
        self.actual_A = pin.computeGeneralizedGravity(
            vehicle.model, vehicle.create_data(), self.m.q
        )[:6].copy()

    def _arm(self, t, q, v):
        n, s = self.vehicle.n_arm, self.swing
        q[7:], v[6:] = 0.5 * np.sin(3.0 * t) * s, 1.5 * np.cos(3.0 * t) * s
        return np.full(n, -4.5 * np.sin(3.0 * t) * s)

    def weight_W(self):
        data = self.vehicle.create_data()
        g_A = pin.computeGeneralizedGravity(self.vehicle.model, data, self.m.q)[:6]
        return (g_A.reshape(2, 3) @ rotation_of(self.m.q).T).ravel()

    def advance(self, wrench_W, disturbance_W):
        command_A = (wrench_W.reshape(2, 3) @ rotation_of(self.m.q)).ravel()
        h, steps = 0.001, 10
        for _ in range(steps):
            start = self.actual_A.copy()

            def acceleration(_, stage, pose, twist, start=start):
                q, v = self.m.q.copy(), self.m.v.copy()
                q[:7], v[:6] = [*flat(pose)], [*flat(twist)]
                ddtheta = self._arm(self.t + 0.5 * stage * h, q, v)
                w_A = command_A + (start - command_A) * np.exp(-0.5 * stage * h / LAG)
                w_A = w_A + (disturbance_W.reshape(2, 3) @ rotation_of(q)).ravel()
                return record(Spatial, self.body.base_acceleration(q, v, ddtheta, w_A))

            pose, twist = record(Pose, self.m.q[:7]), record(Spatial, self.m.v[:6])
            pose, twist, _ = integrator("midpoint").step(acceleration, None, pose, twist, h)
            self.m.q[:7], self.m.v[:6] = [*flat(pose)], [*flat(twist)]
            self.actual_A = command_A + (start - command_A) * np.exp(-h / LAG)
            self.t += h
            self._arm(self.t, self.m.q, self.m.v)


def fly(vehicle_name, rates, disturbance, seconds, moving=True, factors=(1.0, 1.0)):
    """The observed wrench, row by row, while the rotors carry weight and disturbance."""
    vehicle = load_vehicle(vehicle_name)
    body = Body(vehicle, moving)
    observer = Observer(vehicle, rates)
    observer.factors = Halves(*factors)
    observer.reset(body.m)
    rows = []
    for k in range(round(seconds / T)):
        d_W = disturbance(k * T)
        command = body.weight_W() - disturbance(1e9)
        observer.applied(command)
        body.advance(command, d_W)
        rows.append(observer.update(body.m))
    return np.array(rows)


@pytest.mark.parametrize("name", ["fullam", "hextilt"])
def test_finds_a_constant_wrench_while_the_arm_swings(name):
    """After 1 s, 15 time constants, d is known to a hundredth: the arm's motion does not show."""
    d = np.array([1.0, -2.0, 3.0, 0.05, -0.04, 0.03])
    rows = fly(name, (15.0, 15.0), lambda t: d, 1.0)
    np.testing.assert_allclose(rows[-1, :3], d[:3], atol=0.03)
    np.testing.assert_allclose(rows[-1, 3:], d[3:], atol=0.004)


def test_converges_at_its_rate():
    """1 - exp(-K t) after a step of the wrench, at both rates."""
    d = np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.02])
    rows = fly("fullam", (10.0, 5.0), lambda t: d, 0.4, moving=False)
    t = T * np.arange(1, len(rows) + 1)
    np.testing.assert_allclose(rows[:, 2], 2.0 * (1.0 - np.exp(-10.0 * t)), atol=0.02)
    np.testing.assert_allclose(rows[:, 5], 0.02 * (1.0 - np.exp(-5.0 * t)), atol=2e-4)


def test_slowed_down_it_converges_as_at_the_lower_rates():
    d = np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.02])
    slowed = fly("fullam", (20.0, 20.0), lambda t: d, 0.1, False, factors=(0.5, 0.25))
    lower = fly("fullam", (10.0, 5.0), lambda t: d, 0.1, False)
    np.testing.assert_array_equal(slowed, lower)


def test_an_impulse_is_paid_back_in_full():
    """A gust of 10 ms leaves K J; its integral over time is the impulse J."""
    gust = np.array([3.0, 0.0, 8.0, 0.0, 0.2, 0.0])

    def blow(t):
        return gust if abs(t - 0.1) < 0.5 * T else np.zeros(6)

    rows = fly("fullam", (12.0, 12.0), blow, 1.0, moving=False)
    np.testing.assert_allclose(rows.sum(axis=0), gust, atol=0.02 * np.abs(gust).max())
    peak = gust[2] * (1.0 - np.exp(-12.0 * T))
    assert rows[:, 2].max() == pytest.approx(peak, rel=0.01)


def test_nothing_is_observed_when_the_model_is_right():
    rows = fly("fullam", (20.0, 20.0), lambda t: np.zeros(6), 0.5)
    # The weight's moment moves with the arm while its command is held: that is what is left.
    assert np.abs(rows[:, :3]).max() < 0.02
    assert np.abs(rows[:, 3:]).max() < 0.02


def test_a_rate_of_zero_is_off():
    rows = fly("fullam", (0.0, 10.0), lambda t: np.full(6, 0.01), 0.1)
    np.testing.assert_array_equal(rows[:, :3], 0.0)
    assert np.abs(rows[-1, 3:]).min() > 0.001


def test_begins_with_rotors_that_carry_the_weight_and_nothing_unexplained():
    """Tilted and with the arm out; the estimate that it began with then tells it nothing new."""
    vehicle = load_vehicle("fullam")
    observer, m = Observer(vehicle, (5.0, 5.0)), Measurement(vehicle)
    m.q[3:7], m.q[7:] = pin.Quaternion(pin.exp3(np.array([0.4, -0.3, 0.8]))).coeffs(), 0.5
    m.v[:] = 0.3
    observer.reset(m)
    carried = pin.computeGeneralizedGravity(vehicle.model, vehicle.create_data(), m.q)[:6]
    np.testing.assert_allclose([*flat(observer.memory.actual)], carried, rtol=0, atol=1e-12)
    assert observer.memory.command == observer.memory.actual
    np.testing.assert_allclose(observer.update(m), 0.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose([*flat(observer.memory.actual)], carried, rtol=0, atol=1e-12)


def test_actual_follows_the_command_with_the_lag():
    vehicle = load_vehicle("fullam")
    observer, m = Observer(vehicle, (5.0, 5.0)), Measurement(vehicle)
    observer.reset(m)
    start = observer.actual()
    command = start + np.arange(1.0, 7.0)
    for _ in range(3):
        observer.applied(command)
        observer.update(m)
    expected = command + (start - command) * np.exp(-3.0 * T / LAG)
    np.testing.assert_allclose(observer.actual(), expected, atol=1e-12)
