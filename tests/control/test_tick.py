"""The control tick: the law with its allocator."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pinocchio as pin
import pytest

from fullam.control.allocation import Allocator
from fullam.control.controller import Measurement, ReferencePoint
from fullam.control.controllers import make_controller
from fullam.control.tick import ControlTick
from fullam.exceptions import NonFiniteCenter, NonFiniteWrench
from fullam.model.loading import load_vehicle

ROUNDING = 1e-10
"""Relative to full scale: the exact map costs up to 1e-6 of a wrench by its regulariser, and what
is compared here goes through the same map."""


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("fullam")


def tilted(vehicle, height=0.0):
    """A tilted measurement at rest, and a reference `height` above it."""
    m, ref = Measurement(vehicle), ReferencePoint()
    m.q[3:7] = pin.Quaternion(pin.exp3(np.array([0.2, -0.1, 0.3]))).coeffs()
    m.q[7:] = 0.3
    ref.pose = m.q[:7].copy()
    ref.pose[2] += height
    return m, ref


@pytest.mark.parametrize("controller", ["dc-pid", "pid", "backstepping"])
def test_speeds_give_the_wrench_that_the_law_commands(vehicle, controller):
    tick = ControlTick(make_controller(controller, vehicle), Allocator(vehicle.rotors))
    m, ref = tilted(vehicle)
    tick.controller.reset(m, ref)
    speeds = tick.speeds(0.0, m, ref)
    R = pin.Quaternion(m.q[3:7]).toRotationMatrix()
    wrench_W = (vehicle.rotors.wrench(speeds).reshape(2, 3) @ R.T).ravel()
    assert not tick.saturated
    np.testing.assert_allclose(wrench_W, tick.command, rtol=0, atol=1e-5 * np.abs(wrench_W).max())


def test_the_attitude_of_the_thrust_is_used_where_it_is_given(vehicle):
    tick = ControlTick(make_controller("dc-pid", vehicle), Allocator(vehicle.rotors))
    m, ref = tilted(vehicle)
    tick.controller.reset(m, ref)
    R = pin.exp3(np.array([0.3, 0.0, 0.0]))
    tick.speeds(0.0, m, ref, R)
    expected = (tick.command.reshape(2, 3) @ R).ravel()
    np.testing.assert_allclose(
        tick.wrench_A, expected, rtol=0, atol=ROUNDING * np.abs(expected).max()
    )


def centre_of_mass(vehicle, m):
    """In {A}."""
    return pin.centerOfMass(vehicle.model, vehicle.create_data(), vehicle.neutral(m.q[7:]))


def test_out_of_reach_the_moment_about_the_centre_of_mass_comes_first(vehicle):
    """And the law hears what it got."""
    tick = ControlTick(make_controller("dc-pid", vehicle), Allocator(vehicle.rotors))
    m, ref = tilted(vehicle, height=40.0)
    tick.controller.reset(m, ref)
    told = []
    tick.controller.delivered = lambda *both: told.extend(np.copy(both))
    speeds = tick.speeds(0.0, m, ref)
    assert tick.saturated
    achieved = vehicle.rotors.wrench(speeds)
    tolerance = ROUNDING * np.abs(achieved).max()
    np.testing.assert_allclose(tick.residual, achieved - tick.wrench_A, rtol=0, atol=tolerance)
    c = centre_of_mass(vehicle, m)
    missing = tick.residual.copy()
    missing[3:] -= np.cross(c, tick.residual[:3])
    assert np.abs(missing[3:]).max() < 0.05 * np.abs(tick.residual[:3]).max()
    R = pin.Quaternion(m.q[3:7]).toRotationMatrix()
    for said, expected in zip(told, (achieved, missing), strict=True):
        turned = (expected.reshape(2, 3) @ R.T).ravel()
        np.testing.assert_allclose(said, turned, rtol=0, atol=tolerance)


@pytest.mark.parametrize(
    ("controller", "height"), [("pid", 2.0), ("dc-pid", 2.0), ("dc-pid-plus", 0.7)]
)
def test_the_attitude_integrator_is_not_drained_by_a_moment_that_is_wanted(
    vehicle, controller, height
):
    """Force falls short, and the moment at the origin of {A} changes on purpose.

    Drained is what is missing about the centre of mass: the vertical integrator, and at most 3 %
    of those of the attitude. By the moment at the origin, one of either sign would lose 30 %.
    """
    for sign in (1.0, -1.0):
        law = make_controller(controller, vehicle)
        tick = ControlTick(law, Allocator(vehicle.rotors))
        m, ref = tilted(vehicle, height)
        m.q[7:] = np.radians([0.0, 60.0, 0.0, 0.0])
        law.reset(m, ref)
        law.law.integral[:] = [0.0, 0.0, 3.0, sign, sign, sign]
        tick.speeds(0.0, m, ref)
        assert tick.saturated
        assert law.law.integral[2] < 2.9
        np.testing.assert_allclose(law.law.integral[3:], sign, rtol=0, atol=0.03)
        at_origin = np.linalg.solve(law.rigid_inertia, tick.residual[3:])
        assert np.abs(at_origin).max() * law.law.anti_windup * law.period > 0.3


def test_the_wrench_at_hand_is_the_one_achieved(vehicle):
    """compensation="previous_wrench" goes on from what the rotors give, the moment included."""
    law = make_controller("dc-pid", vehicle, compensation="previous_wrench")
    tick = ControlTick(law, Allocator(vehicle.rotors))
    m, ref = tilted(vehicle, height=40.0)
    law.reset(m, ref)
    speeds = tick.speeds(0.0, m, ref)
    assert tick.saturated
    achieved = vehicle.rotors.wrench(speeds)
    np.testing.assert_allclose(
        law._at_hand_A, achieved, rtol=0, atol=ROUNDING * np.abs(achieved).max()
    )


def test_nan_does_not_reach_the_rotors(vehicle):
    tick = ControlTick(make_controller("dc-pid", vehicle), Allocator(vehicle.rotors))
    m, ref = tilted(vehicle)
    m.v[0] = np.nan
    with pytest.raises(NonFiniteWrench):
        tick.speeds(0.0, m, ref)


def test_an_arm_angle_that_is_not_finite_is_named(vehicle):
    """Not the wrench of a law without the arm, which is finite."""
    tick = ControlTick(make_controller("pid", vehicle), Allocator(vehicle.rotors))
    m, ref = tilted(vehicle, height=40.0)
    m.q[8] = np.nan
    with pytest.raises(NonFiniteCenter, match=r"centre of mass \[.*nan.*\] is not finite.*angles"):
        tick.speeds(0.0, m, ref)
    assert np.isfinite(tick.wrench_A).all()
    assert tick.allocator.counters.refused == 1


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda tick: pickle.loads(pickle.dumps(tick))])
@pytest.mark.parametrize("height", [0.0, 40.0])
def test_a_copy_commands_for_what_it_is_told(vehicle, copied, height):
    tick = ControlTick(make_controller("dc-pid", vehicle), Allocator(vehicle.rotors))
    m, ref = tilted(vehicle)
    tick.controller.reset(m, ref)
    tick.speeds(0.0, m, ref)
    twin = copied(tick)
    m.q[0], ref.pose[2] = 0.2, height
    answers = []
    for one in (tick, twin):
        one.controller.reset(m, ref)
        one.allocator.reset()
        answers.append((one.speeds(0.0, m, ref).copy(), one.wrench_A, one.residual, one.saturated))
    for one, other in zip(*answers, strict=True):
        np.testing.assert_array_equal(one, other)
    assert tick.saturated == (height > 0.0)
