"""The control tick: the law with its allocator, by Python and by machine code."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pinocchio as pin
import pytest

from fullam.control.allocation import Allocator
from fullam.control.controller import Controller, Measurement, ReferencePoint
from fullam.control.controllers import controller_class, controller_names, make_controller
from fullam.control.pid import PidSettings
from fullam.control.tick import ControlTick
from fullam.dynamics.multibody import Multibody
from fullam.exceptions import NonFiniteCenter, NonFiniteWrench, SettingsError
from fullam.model.loading import load_vehicle
from fullam.model.wrench_axes import controllable_axes

ROUNDING = 1e-10
"""Relative to full scale: the exact map costs up to 1e-6 of a wrench by its regulariser, and what
is compared here goes through the same map."""

DRIVERS_APART = 1e-9
"""Relative to the largest speed, in saturation: rounding 1e-16 over the 1e-8 of the regulariser,
which is what the null space of the coupling may turn it into. Pinocchio is the model of the one,
the recursion of the other."""

NAMES = controller_names()

ASIDE = np.array([0.0, 0.0, 0.02, 0.02, 0.02, 0.02])
"""Way to a target beside the platform, that winds up integrators [m, rad]."""


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("fullam")


@pytest.fixture(params=[False, True], ids=["python", "machine code"])
def compiled(request):
    return request.param


def tilted(vehicle, height=0.0):
    """A tilted measurement at rest, and a reference `height` above it."""
    m, ref = Measurement(vehicle), ReferencePoint()
    m.q[3:7] = pin.Quaternion(pin.exp3(np.array([0.2, -0.1, 0.3]))).coeffs()
    m.q[7:] = 0.3
    ref.pose = m.q[:7].copy()
    ref.pose[2] += height
    return m, ref


def random_inputs(vehicle, rng, pace):
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


def tick_of(vehicle, name="dc-pid", compiled=None, **settings):
    return ControlTick(
        make_controller(name, vehicle, **settings), Allocator(vehicle.rotors), compiled
    )


def turned(wrench, R):
    """Both halves of a wrench turned by R."""
    return (np.reshape(wrench, (2, 3)) @ R.T).ravel()


@pytest.mark.parametrize("controller", NAMES)
def test_speeds_give_the_wrench_that_the_law_commands(vehicle, controller, compiled):
    tick = tick_of(vehicle, controller, compiled)
    m, ref = tilted(vehicle)
    speeds = tick.speeds(0.0, m, ref)
    wrench_W = turned(vehicle.rotors.wrench(speeds), rotation(m))
    assert not tick.saturated
    assert not tick.residual.any()
    np.testing.assert_allclose(wrench_W, tick.command, rtol=0, atol=1e-5 * np.abs(wrench_W).max())


def rotation(m):
    return pin.Quaternion(m.q[3:7]).toRotationMatrix()


def test_the_turn_of_the_platform_is_taken_where_it_is_given(vehicle, compiled):
    """The wrench is turned to the axes that {A} will have; without a turn, to those it has."""
    tick = tick_of(vehicle, compiled=compiled)
    m, ref = tilted(vehicle)
    for turn in (np.array([0.1, -0.2, 0.15]), None, np.array([0.0, 0.0, 0.3])):
        speeds = tick.speeds(0.0, m, ref, turn)
        R = rotation(m) @ pin.exp3(np.zeros(3) if turn is None else turn)
        wrench_W = turned(vehicle.rotors.wrench(speeds), R)
        tolerance = 1e-5 * np.abs(wrench_W).max()
        np.testing.assert_allclose(wrench_W, tick.command, rtol=0, atol=tolerance)


def centre_of_mass(vehicle, m):
    """In {A}."""
    return pin.centerOfMass(vehicle.model, vehicle.create_data(), vehicle.neutral(m.q[7:]))


class Listening(Controller):
    """Wants what it is given, and keeps what it is told."""

    name, Settings = "listening", PidSettings
    wanted: np.ndarray
    told: list

    def reset(self, measurement, reference):
        self.told = []

    def wrench(self, t, measurement, reference):
        return self.wanted

    def delivered(self, wrench_W, missing_W):
        self.told.append((wrench_W.copy(), missing_W.copy()))


def test_out_of_reach_the_moment_about_the_centre_of_mass_comes_first(vehicle):
    """And the law hears what it got, in world axes."""
    m, ref = tilted(vehicle)
    law = Listening(vehicle)
    law.wanted = np.array([5.0, 3.0, 200.0, 0.5, -0.4, 0.2])
    tick = ControlTick(law, Allocator(vehicle.rotors))
    assert not tick.compiled
    speeds = tick.speeds(0.0, m, ref)
    assert tick.saturated
    R, achieved = rotation(m), vehicle.rotors.wrench(speeds)
    tolerance = ROUNDING * np.abs(achieved).max()
    asked = turned(law.wanted, R.T)
    np.testing.assert_allclose(tick.residual, achieved - asked, rtol=0, atol=tolerance)
    missing = tick.residual.copy()
    missing[3:] -= np.cross(centre_of_mass(vehicle, m), tick.residual[:3])
    assert np.abs(missing[3:]).max() < 0.05 * np.abs(tick.residual[:3]).max()
    ((wrench_W, missing_W),) = law.told
    np.testing.assert_allclose(wrench_W, turned(achieved, R), rtol=0, atol=tolerance)
    np.testing.assert_allclose(missing_W, turned(missing, R), rtol=0, atol=tolerance)
    # In reach it hears nothing.
    law.wanted = np.array([0.0, 0.0, 22.0, 0.0, 0.0, 0.0])
    tick.speeds(0.01, m, ref)
    assert len(law.told) == 1


def test_a_law_of_ones_own_is_told_the_time(vehicle):
    class Clock(Listening):
        def wrench(self, t, measurement, reference):
            self.told.append(t)
            return np.array([0.0, 0.0, 22.0, 0.0, 0.0, 0.0])

    law = Clock(vehicle)
    tick = ControlTick(law, Allocator(vehicle.rotors))
    for t in (3.0, 3.01, 7.5):
        tick.speeds(t, *tilted(vehicle))
    assert law.told == [3.0, 3.01, 7.5]


@pytest.mark.parametrize("controller", NAMES)
@pytest.mark.parametrize("name", ["fullam", "hextilt", "quadrotor_arm"])
def test_machine_code_is_python_over_again(name, controller):
    """In reach and out of it, its memory carried on from period to period."""
    vehicle, rng = load_vehicle(name), np.random.default_rng(5)
    axes = controllable_axes(vehicle.rotors)
    ticks = [
        ControlTick(
            controller_class(controller)(vehicle, None, 0.001, axes),
            Allocator(vehicle.rotors, axes=axes),
            compiled,
        )
        for compiled in (False, True)
    ]
    saturated = 0
    scale = np.abs(vehicle.rotors.normalized_coupling).sum(axis=1).max()
    for trial in range(60):
        if trial % 4 == 0:
            for tick in ticks:
                tick.reset()
        inputs = random_inputs(vehicle, rng, 1.0 if trial % 3 else 0.05)
        turn = None if trial % 5 else 0.1 * rng.normal(size=3)
        python, machine = (tick.speeds(0.0, *inputs, turn).copy() for tick in ticks)
        top = vehicle.rotors.max_speeds
        # In squared speeds over their maxima, as the allocation has them.
        np.testing.assert_allclose((machine / top) ** 2, (python / top) ** 2, 0, DRIVERS_APART)
        assert ticks[0].saturated == ticks[1].saturated
        for quantity in ("command", "u_pid", "u_dc", "residual"):
            a, b = (getattr(tick, quantity) for tick in ticks)
            np.testing.assert_allclose(b, a, rtol=0, atol=DRIVERS_APART * scale, err_msg=quantity)
        saturated += ticks[1].saturated
    assert 5 < saturated < 60
    assert ticks[0].counts == ticks[1].counts


@pytest.mark.parametrize(
    ("controller", "height"), [("pid", 2.0), ("dc-pid", 2.0), ("dc-pid-plus", 0.7)]
)
def test_the_attitude_integrator_is_not_drained_by_a_moment_that_is_wanted(
    vehicle, controller, height
):
    """Force falls short, and the moment at the origin of {A} changes on purpose.

    Drained is what is missing about the centre of mass: the vertical integrator, and next to
    nothing of those of the attitude. By the moment at the origin, one of either sign would lose
    30 %. An integrator is seen in the wrench that it adds: with it less without it.
    """
    integral = {"attitude_gains": (40.0, 20.0, 11.0), "position_gains": (9.6, 3.0, 6.0)}
    if controller == "dc-pid-plus":  # a platform that does not move is pushed, it would observe
        integral["observer_rates"] = (0.0, 0.0)

    def commands(far):
        """A wrench at the target, after a while beside it, and one period above it or not."""
        tick = tick_of(vehicle, controller, **integral)
        m, ref = tilted(vehicle)
        m.q[7:] = np.radians([0.0, 60.0, 0.0, 0.0])
        aside = ReferencePoint()
        aside.pose = pin.integrate(vehicle.model, m.q, np.append(ASIDE, np.zeros(4)))[:7]
        for _ in range(250):
            tick.speeds(0.0, m, aside)
        assert not tick.saturated
        if far:
            above = ReferencePoint()
            above.pose = ref.pose + height * np.eye(7)[2]
            tick.speeds(0.0, m, above)
            assert tick.saturated
        tick.speeds(0.0, m, ref)
        return tick.u_pid

    kept, after = commands(far=False), commands(far=True)
    assert kept[2] > 0.01
    assert after[2] < 0.9 * kept[2]
    np.testing.assert_allclose(after[3:], kept[3:], rtol=0.03)


def test_the_wrench_at_hand_is_the_one_achieved(vehicle, compiled):
    """compensation="previous_wrench" goes on from what the rotors give, the moment included.

    With one round, and u_pid again what it was, eq. (21) is solved with the wrench at hand.
    """
    gains = {"position_gains": (9.6, 0.0, 6.0), "attitude_gains": (40.0, 0.0, 11.0)}
    settings = {"compensation": "previous_wrench", "rounds": 1}
    tick = tick_of(vehicle, "dc-pid", compiled, **settings, **gains)
    m, ref = tilted(vehicle, height=40.0)
    speeds = tick.speeds(0.0, m, ref).copy()
    assert tick.saturated
    tick.speeds(0.01, m, ref)
    achieved = vehicle.rotors.wrench(speeds)
    body = Multibody(vehicle)
    a_A = body.base_acceleration(m.q, m.v, m.arm_acceleration, achieved)
    u_dc = body.compensation(m.q, m.v, np.append(a_A, m.arm_acceleration))
    np.testing.assert_allclose(tick.u_dc, u_dc, rtol=0, atol=ROUNDING * np.abs(u_dc).max())


@pytest.mark.parametrize("place", [0, 4, 8])
@pytest.mark.parametrize("bounds", [None, (6.0, 6.0, 40.0, 1.0, 1.0, 9.0)])
def test_nan_does_not_reach_the_rotors(vehicle, compiled, place, bounds):
    """Nor do bounds of the wrench make a number of it; a law that is reset flies on."""
    tick = tick_of(vehicle, "dc-pid", compiled, wrench_bounds=bounds)
    m, ref = tilted(vehicle)
    good = tick.speeds(0.0, m, ref).copy()
    spoiled = copy.deepcopy(m)
    spoiled.v[place] = np.nan
    with pytest.raises(NonFiniteWrench, match="nan"):
        tick.speeds(0.01, spoiled, ref)
    tick.reset()
    np.testing.assert_array_equal(tick.speeds(0.02, m, ref), good)


def test_an_arm_angle_that_is_not_finite_is_named(vehicle, compiled):
    """Not the wrench of a law without the arm, which is finite."""
    tick = tick_of(vehicle, "pid", compiled)
    m, ref = tilted(vehicle, height=40.0)
    m.q[8] = np.nan
    with pytest.raises(NonFiniteCenter, match=r"centre of mass \[.*nan.*\] is not finite.*angles"):
        tick.speeds(0.0, m, ref)
    assert np.isfinite(tick.command).all()


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda tick: pickle.loads(pickle.dumps(tick))])
@pytest.mark.parametrize("height", [0.0, 40.0])
def test_a_copy_begins_afresh_and_is_its_own(vehicle, compiled, copied, height):
    tick = tick_of(vehicle, "dc-pid", compiled)
    m, ref = tilted(vehicle, height)
    first = tick.speeds(0.0, m, ref).copy()
    tick.speeds(0.01, *tilted(vehicle, 0.3))
    twin = copied(tick)
    assert twin.compiled == compiled
    own = tick.speeds(0.02, *tilted(vehicle, 0.1))
    before = own.copy()
    np.testing.assert_array_equal(twin.speeds(0.0, m, ref), first)
    np.testing.assert_array_equal(own, before)
    assert twin.saturated == (height > 0.0)


def test_machine_code_cannot_run_a_class_of_ones_own(vehicle):
    with pytest.raises(SettingsError, match=r"'listening' is not written as kernels"):
        ControlTick(Listening(vehicle), Allocator(vehicle.rotors), compiled=True)
