"""The true vehicle in motion with its joints free: torques of their servos move them.

The whole floating-base dynamics by the articulated-body algorithm, `dynamics.articulated`. Joints
are integrated by the platform's own rule (`dynamics.integrators`): every stage of it evaluates them
at the start of the step plus so many half steps of the slope evaluated last. Their goals are held
over a control period.

Something may push the last link: a *contact*, a kernel

    contact(world, links, arm, pose, twist) -> Spatial

that is asked in every stage of the rule, once the arm is placed (`ArmRows`: attitudes and ways in
`arm.joints`, motions in `arm.bodies`), and gives force and moment on the last link about the origin
of {A}, {A} axes. `world` is a view of its own. `tip_motion` tells where a point of the link is.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.dynamics.articulated import push_last, sweep_out, swept_acceleration
from fullam.dynamics.integrators import half_steps, integrator
from fullam.dynamics.multibody import ROOT
from fullam.dynamics.recursion import JointMotion, Link, gravity_in
from fullam.dynamics.servo import servo_torque
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import (
    Spatial,
    add_spatial,
    rotate_spatial_back,
    scale_spatial,
    subtract_spatial,
)
from fullam.model.servos import Servos
from fullam.model.vehicle import Vehicle
from fullam.numbers.kernel import Number, kernel, subroutine
from fullam.numbers.records import flat, record
from fullam.numbers.vectors import ZERO, add, axpy, cross, rotate, subtract
from fullam.simulation.plants.plant import State, spin, wrench_at

Array = NDArray[np.float64]
Function = Callable[..., Any]


class Slope(NamedTuple):
    """Rate and acceleration of a joint in a stage, or their weighted sums over the stages."""

    rate: Number
    acceleration: Number


class NoWorld(NamedTuple):
    """What a contact that touches nothing is shown."""


class ServoView(NamedTuple):
    """What the plant's stage is shown; `arm` (`JointMotion`s), `speeds` and `state` rewritten.

    The rest is room: slopes and sums of a step, the joints' rates at the start of a period.
    """

    state: Any
    links: Any
    rotors: Any
    stepping: Any
    gusts: Any
    speeds: Any
    commands: Any
    servos: Any
    goals: Any
    arm: Any
    slopes: Any
    sums: Any
    rates: Any
    room: Any
    world: Any


class ServoSystem(NamedTuple):
    """What the derivatives are evaluated on: the plant's view, rotor wrenches, gust, gravity."""

    rows: Any
    thrust: Any
    gust: Spatial
    period: Number
    gravity: Number


class ArmEntry(NamedTuple):
    """A joint's part of a row of the record."""

    position: Number
    rate: Number
    goal: Number
    torque: Number
    told: Number
    told_rate: Number


class ArmRecordView(NamedTuple):
    """What `record_arm` is shown: the true motion, servos and goals, what the law is told."""

    arm: Any
    servos: Any
    goals: Any
    told: Any
    entries: Any


@kernel
def no_contact(world, links, arm, pose, twist):
    """Nothing pushes."""
    return Spatial(ZERO, ZERO)


@kernel
def tip_motion(arm, point, w):
    """Where a point of the last link is from the origin of {A}, and how fast it moves from there.

    Args:
        arm: `ArmRows`, swept.
        point: In the axes of the last link, from its joint (the platform's if there is no arm).
        w: Angular velocity of {A}.

    Returns:
        Position and velocity relative to the origin of {A}, {A} axes.
    """
    place = velocity = ZERO
    spin_rate, reach = w, point
    for i in range(len(arm.joints)):
        place = add(place, arm.joints[i].step)
        reach = rotate(arm.joints[i].rotation, point)
        axis, rate = arm.bodies[i + 1].axis, arm.motions[i].rate
        velocity = axpy(rate, axis.linear, velocity)
        spin_rate = axpy(rate, axis.angular, spin_rate)
    place = add(place, reach)
    return place, add(velocity, cross(spin_rate, place))


@kernel
def by_recursion(system, pose, twist, wrench, push):
    """Acceleration of the platform, the joints' into the room: the articulated-body algorithm."""
    view, R = system.rows, rotation_matrix(pose.attitude)
    push_last(view.room, push)
    return swept_acceleration(view.servos, gravity_in(R, system.gravity), wrench, view.room)


@cache
def servo_rate(name: str, solve: Function = by_recursion, contact: Function = no_contact) -> Any:
    """The derivative of the twist that moves the joints, too, by the integrator of that name."""
    weights = integrator(name).weights

    @subroutine
    def twist_and_joint_rates(system, stage, pose, twist):
        view, half, weight = system.rows, half_steps(stage), weights[stage]
        room, ahead = view.room, 0.5 * half * system.period
        for i in range(len(view.arm)):
            start, slope = view.arm[i], view.slopes[i]
            position = start.position + ahead * slope.rate
            rate = start.rate + ahead * slope.acceleration
            room.motions[i] = JointMotion(position, rate, 0.0)
            room.torques[i] = servo_torque(view.servos[i], view.goals[i], position, rate)
        sweep_out(view.links, twist.angular, room)
        push = contact(view.world, view.links, room, pose, twist)
        gust = rotate_spatial_back(rotation_matrix(pose.attitude), system.gust)
        a = solve(system, pose, twist, add_spatial(wrench_at(system.thrust, half), gust), push)
        for i in range(len(view.arm)):
            rate, acceleration, sums = room.motions[i].rate, room.accelerations[i], view.sums[i]
            view.slopes[i] = Slope(rate, acceleration)
            view.sums[i] = Slope(
                sums.rate + weight * rate, sums.acceleration + weight * acceleration
            )
        return Spatial(subtract(a.linear, cross(twist.angular, twist.linear)), a.angular)

    return twist_and_joint_rates


@kernel
def move_joints(view, dt, implicit):
    """The joints at the end of a step, from the sums of its slopes."""
    for i in range(len(view.arm)):
        start, sums = view.arm[i], view.sums[i]
        mean = sums.rate + implicit * dt * sums.acceleration
        view.arm[i] = JointMotion(
            start.position + dt * mean, start.rate + dt * sums.acceleration, start.acceleration
        )


@kernel
def advance_free(rule, derivative, implicit, view, k):
    """Fly the plant's steps of control period k, the joints free.

    Goals that step from period to period jerk the arm, and with it the platform, so that its
    acceleration at an instant says little of a period. What inertial sensors are shown is therefore
    the mean over it, as one that samples faster and filters tells it; the joints' likewise.
    """
    state, stepping, gust = view.state[0], view.stepping[0], view.gusts[k]
    pose, twist, dt = state.pose, state.twist, stepping.period
    for i in range(len(view.arm)):
        view.rates[i] = view.arm[i].rate
    for _ in range(int(stepping.substeps)):
        thrust = spin(view.rotors, view.speeds, view.commands)
        system = ServoSystem(view, thrust, gust, dt, stepping.gravity)
        for i in range(len(view.arm)):
            view.sums[i] = Slope(0.0, 0.0)
        pose, twist, _ = rule(derivative, system, pose, twist, dt)
        move_joints(view, dt, implicit)
    per_period, change = 1.0 / (stepping.substeps * dt), subtract_spatial(twist, state.twist)
    for i in range(len(view.arm)):
        now = view.arm[i]
        mean = per_period * (now.rate - view.rates[i])
        view.arm[i] = JointMotion(now.position, now.rate, mean)
    view.state[0] = State(pose, twist, scale_spatial(per_period, change))


@cache
def servo_stage(name: str, solve: Function = by_recursion, contact: Function = no_contact) -> Any:
    """The stage that moves the vehicle on by one control period; see `servo_rate`."""
    rule, derivative = integrator(name).step, servo_rate(name, solve, contact)
    implicit = integrator(name).implicit

    @kernel
    def move_free_vehicle(view, k):
        advance_free(rule, derivative, implicit, view, k)

    return move_free_vehicle


@kernel
def record_arm(view, k):
    """Write the joints' row of period k, before the vehicle moves on."""
    row = view.entries[k]
    for i in range(len(view.arm)):
        motion, servo, goal = view.arm[i], view.servos[i], view.goals[i]
        told = view.told[0][i]
        torque = servo_torque(servo, goal, motion.position, motion.rate)
        row[i] = ArmEntry(motion.position, motion.rate, goal, torque, told.position, told.rate)


class PinocchioJoints:
    """The same by Pinocchio's articulated-body algorithm; to be used where `by_recursion` is."""

    def __init__(self, vehicle: Vehicle, servos: Servos) -> None:
        """Own a workspace for the true vehicle, its motors' rotors at its joints."""
        self._model = pin.Model(vehicle.model)
        self._model.armature = np.append(np.zeros(6), servos.armature)
        self._data = self._model.createData()
        self._q, self._v = vehicle.neutral(), np.zeros(self._model.nv)
        self._carried: Link | None = None
        self._forces = pin.StdVec_Force()
        self._forces.extend([pin.Force.Zero() for _ in range(self._model.njoints)])

    def carry(self, link: Link, frame: Array) -> None:
        """Give the last body the mass properties of a link; `frame` turns its axes to the model's.

        Nothing happens while they stay as they are.
        """
        if link == self._carried:
            return
        self._carried = link
        inertia = np.zeros((3, 3))
        inertia[np.triu_indices(3)] = link.inertia
        inertia += np.triu(inertia, 1).T
        last = self._model.njoints - 1
        self._model.inertias[last] = pin.Inertia(
            link.mass, frame @ np.array(link.com), frame @ inertia @ frame.T
        )

    def __call__(
        self, system: ServoSystem, pose: Any, twist: Spatial, wrench: Spatial, push: Spatial
    ) -> Spatial:
        """See `by_recursion`."""
        q, v, room = self._q, self._v, system.rows.room
        q[3:7], v[:6] = pose.attitude, flat(twist)
        for i, motion in enumerate(room.motions):
            q[7 + i], v[6 + i] = motion.position, motion.rate
        tau = np.array([*flat(wrench), *room.torques])
        last = self._model.njoints - 1
        pin.forwardKinematics(self._model, self._data, q)
        placed = self._data.oMi[ROOT].actInv(self._data.oMi[last])
        self._forces[last] = placed.actInv(pin.Force(np.array(flat(push))))
        a = pin.aba(self._model, self._data, q, v, tau, self._forces)
        room.accelerations[:] = a[6:].tolist()
        rate = record(Spatial, a[:6])
        return Spatial(add(rate.linear, cross(twist.angular, twist.linear)), rate.angular)
