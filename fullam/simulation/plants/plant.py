"""The true vehicle in motion: rotor lag, gusts, and the platform under a prescribed arm.

Equations of motion of the platform with the joints' motion given (the servos follow theta(t)
exactly): the first six rows of the floating-base dynamics, eqs. (12)-(13). The rotors follow their
commanded speeds with first-order lags, solved exactly:
Omega(t + s) = Omega_c + (Omega - Omega_c) exp(-s / lag).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.integrators import half_steps, integrator
from fullam.dynamics.multibody import Multibody
from fullam.dynamics.recursion import Chain, base_acceleration, gravity_in
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial, add_spatial, rotate_spatial_back
from fullam.model.vehicle import Vehicle
from fullam.numbers.kernel import Number, kernel
from fullam.numbers.records import flat, record
from fullam.numbers.vectors import ZERO, axpy, cross, subtract

Array = NDArray[np.float64]


class State(NamedTuple):
    """The platform: pose, twist in body axes, and the derivative of the twist evaluated last."""

    pose: Pose
    twist: Spatial
    acceleration: Spatial


class Stepping(NamedTuple):
    """How the plant is integrated.

    Time step [s]; steps in a control period; rows of the arm in half a step, 0 if it stands still;
    gravity along -z of {W}.
    """

    period: Number
    substeps: Number
    arm_stride: Number
    gravity: Number


class Thrust(NamedTuple):
    """Wrenches of the rotors at the start, the middle and the end of a step, {A} axes."""

    start: Spatial
    middle: Spatial
    end: Spatial


class System(NamedTuple):
    """What the derivative of the twist is evaluated on.

    True links; rows of the arm, the row of the step's start, and rows in half a step; wrenches of
    the rotors; gust, world axes; gravity.
    """

    links: Any
    arm: Any
    row: Any
    stride: Any
    thrust: Thrust
    gust: Spatial
    gravity: Number


class PlantView(NamedTuple):
    """What the plant's stage is shown; `arm` on the half-step grid, `speeds` rewritten."""

    state: Any
    links: Any
    arm: Any
    rotors: Any
    stepping: Any
    gusts: Any
    speeds: Any
    commands: Any


@kernel
def rotor_wrench(rotors, speeds):
    """Force and moment of the rotors at their speeds, {A} axes, eq. (34)."""
    force = moment = ZERO
    for i in range(len(rotors)):
        square = speeds[i] * speeds[i]
        force = axpy(square, rotors[i].force, force)
        moment = axpy(square, rotors[i].moment, moment)
    return force, moment


@kernel
def follow(rotors, speeds, commands):
    """Rotor speeds half a step on."""
    for i in range(len(rotors)):
        speeds[i] = commands[i] + (speeds[i] - commands[i]) * rotors[i].half_decay


@kernel
def spin(rotors, speeds, commands):
    """The rotors' wrenches over a step, and their speeds at its end."""
    start = Spatial(*rotor_wrench(rotors, speeds))
    follow(rotors, speeds, commands)
    middle = Spatial(*rotor_wrench(rotors, speeds))
    follow(rotors, speeds, commands)
    return Thrust(start, middle, Spatial(*rotor_wrench(rotors, speeds)))


@kernel
def wrench_at(thrust, half):
    """Wrench of the rotors so many half steps behind the start of the step, {A} axes."""
    if half == 0:
        return thrust.start
    if half == 1:
        return thrust.middle
    return thrust.end


@kernel
def twist_rate(system, stage, pose, twist):
    """Derivative of the twist by the recursion (6)-(13); see `integrators`."""
    R, w, half = rotation_matrix(pose.attitude), twist.angular, half_steps(stage)
    wrench = add_spatial(wrench_at(system.thrust, half), rotate_spatial_back(R, system.gust))
    chain = Chain(system.links, system.arm[system.row + half * system.stride])
    a = base_acceleration(chain, w, gravity_in(R, system.gravity), wrench)
    return Spatial(subtract(a.linear, cross(w, twist.linear)), a.angular)


@kernel
def advance(rule, derivative, view, k):
    """Fly the plant's steps of control period k."""
    state, stepping, gust = view.state[0], view.stepping[0], view.gusts[k]
    pose, twist, rate = state.pose, state.twist, state.acceleration
    rotors, speeds, commands = view.rotors, view.speeds, view.commands
    substeps, stride = int(stepping.substeps), int(stepping.arm_stride)
    for i in range(substeps):
        thrust, row = spin(rotors, speeds, commands), 2 * stride * (k * substeps + i)
        system = System(view.links, view.arm, row, stride, thrust, gust, stepping.gravity)
        pose, twist, rate = rule(derivative, system, pose, twist, stepping.period)
    view.state[0] = State(pose, twist, rate)


@cache
def plant_stage(integrator_name: str) -> Callable[..., None]:
    """The stage that moves the vehicle on by one control period, by the recursion."""
    rule = integrator(integrator_name).step

    @kernel
    def move_vehicle(view, k):
        advance(rule, twist_rate, view, k)

    return move_vehicle


class PinocchioRate:
    """Derivative of the twist by Pinocchio: the first six rows of the floating-base dynamics.

    To be used where `twist_rate` is, with rows of `JointMotion` for the arm.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        """Own a workspace for the true vehicle."""
        self._multibody = Multibody(vehicle)
        self._q, self._v = vehicle.neutral(), np.zeros(vehicle.model.nv)
        self._ddtheta = np.zeros(vehicle.n_arm)

    def __call__(self, system: System, stage: int, pose: Pose, twist: Spatial) -> Spatial:
        """See `integrators`."""
        q, v, half = self._q, self._v, half_steps(stage)
        q[3:7], v[:6] = pose.attitude, [*twist.linear, *twist.angular]
        for i, motion in enumerate(system.arm[system.row + half * system.stride]):
            q[7 + i], v[6 + i], self._ddtheta[i] = motion
        gust = rotate_spatial_back(rotation_matrix(pose.attitude), system.gust)
        wrench = np.array(flat(add_spatial(wrench_at(system.thrust, half), gust)))
        return record(Spatial, self._multibody.base_acceleration(q, v, self._ddtheta, wrench))
