"""Goals of the arm's servos: where its joints are wanted, shifted by what the servos give way.

A position servo of stiffness k sags by torque / k. Its goal is therefore put beyond where the joint
is wanted by what holds the arm there, of the nominal arm in the estimated attitude: gravity's
torque, and, if the motion is fed forward, what the motor loses by turning and takes to accelerate
its rotor,

    goal = theta + (g(theta) + [d dtheta + armature ddtheta]) / k,

in whole steps of the servo.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.dynamics.articulated import holding_torques, sweep_out
from fullam.dynamics.recursion import gravity_in
from fullam.dynamics.servo import shifted_goal
from fullam.dynamics.so3 import rotation_matrix
from fullam.numbers.kernel import Number, kernel
from fullam.numbers.vectors import rotate_back

FEED_FORWARD = {"gravity": (1.0, 0.0), "motion": (1.0, 1.0), "off": (0.0, 0.0)}
"""What is fed forward: shares of gravity's torque, and of the motion's."""


class GoalNumbers(NamedTuple):
    """Shares of gravity and motion that are fed forward; gravity along -z of {W} [m/s^2]."""

    weight: Number
    motion: Number
    gravity: Number


class GoalView(NamedTuple):
    """What `steer` is shown.

    One row of `GoalNumbers`; nominal links; servos; motion wanted of the arm, and its rows in a
    control period (one row); the estimate; room. Written are the goals.
    """

    numbers: Any
    links: Any
    servos: Any
    motions: Any
    joint_rows: Any
    estimate: Any
    room: Any
    goals: Any


@kernel
def steer(view, k):
    """Write the servos' goals of control period k."""
    numbers, room, wanted = view.numbers[0], view.room, view.motions[k * int(view.joint_rows[0])]
    for i in range(len(view.goals)):
        room.motions[i] = wanted[i]
    estimate = view.estimate[0]
    R = rotation_matrix(estimate.pose.attitude)
    sweep_out(view.links, rotate_back(R, estimate.velocity.angular), room)
    holding_torques(gravity_in(R, numbers.gravity), room)
    for i in range(len(view.goals)):
        servo, motion = view.servos[i], wanted[i]
        moving = servo.damping * motion.rate + servo.armature * motion.acceleration
        torque = numbers.weight * room.torques[i] + numbers.motion * moving
        view.goals[i] = shifted_goal(servo, motion.position, torque)
