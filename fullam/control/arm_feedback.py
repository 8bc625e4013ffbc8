"""What a law is told of an arm on servos: positions, rates and accelerations of its joints.

Encoders give angles, in steps. Nobody measures the accelerations that dynamic compensation asks
for, and differences of steps are noise. So a *twin* of the servos runs inside the controller, on
the goals that it sends them, with the nominal arm on a platform that turns as estimated: the same
articulated-body kernels, the platform's acceleration taken for zero. It gives the rate at the start
of the control period and the mean acceleration over it, which the goal that is sent decides.

For studies there are also the truth, the motion that is commanded, and filtered differences of
what the encoders read. Whatever it is, a stage `encode` writes it before the law is asked: motions,
the joints placed by them, and the vehicle's centre of mass for the allocation.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.dynamics.articulated import ArmRows, spread_out, sweep_in, sweep_out
from fullam.dynamics.placing import PlaceView, place
from fullam.dynamics.recursion import JointMotion, gravity_in
from fullam.dynamics.servo import read_encoder, servo_torque
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Spatial
from fullam.numbers.kernel import Number, kernel, subroutine
from fullam.numbers.vectors import rotate_back, scale

LONGEST_STEP = 0.5
"""Longest time step of the twin, in those of its fastest decay, armature / d: 5 ms of an AX-12A's.
Swings of the arm are then told as well as with steps of a tenth of that."""

DIFFERENCE_LAG = 0.03
"""Time constant of the filters that differences of encoder readings go through, each [s]."""


class FeedbackNumbers(NamedTuple):
    """Control period [s]; time steps of the twin in it; gravity; share of a filter's new value."""

    period: Number
    steps: Number
    gravity: Number
    share: Number


class EncodeView(NamedTuple):
    """What the stages here are shown.

    One row of `FeedbackNumbers`; servos and their goals; the true motion of the joints; the one
    that is commanded, and its rows in a control period; the estimate; what is remembered of each
    joint, and room for the twin. `place` has the nominal links and what is written.
    """

    numbers: Any
    servos: Any
    goals: Any
    arm: Any
    motions: Any
    joint_rows: Any
    estimate: Any
    memory: Any
    room: ArmRows
    place: PlaceView


@kernel
def encode_truth(view, k):
    """Tell the true positions and rates, and the mean acceleration of the last period."""
    seen = view.place.motions[0]
    for i in range(len(view.arm)):
        seen[i] = view.arm[i]
    place(view.place, 0)


@kernel
def encode_command(view, k):
    """Tell the motion that is commanded, as if the servos followed it."""
    seen, wanted = view.place.motions[0], view.motions[k * int(view.joint_rows[0])]
    for i in range(len(view.arm)):
        seen[i] = wanted[i]
    place(view.place, 0)


@kernel
def encode_differences(view, k):
    """Tell what the encoders read, and its first and second differences, filtered."""
    seen, numbers = view.place.motions[0], view.numbers[0]
    for i in range(len(view.arm)):
        before = view.memory[i]
        position = read_encoder(view.servos[i], view.arm[i].position)
        step = (position - before.position) / numbers.period
        rate = before.rate + numbers.share * (step - before.rate)
        bend = (rate - before.rate) / numbers.period
        acceleration = before.acceleration + numbers.share * (bend - before.acceleration)
        view.memory[i] = seen[i] = JointMotion(position, rate, acceleration)
    place(view.place, 0)


@subroutine
def twin_accelerations(view, w, g):
    """Write the accelerations of the twin in the state that its room holds."""
    room = view.room
    sweep_out(view.place.links, w, room)
    for i in range(len(view.goals)):
        motion = room.motions[i]
        room.torques[i] = servo_torque(view.servos[i], view.goals[i], motion.position, motion.rate)
    sweep_in(view.servos, room)
    spread_out(room, Spatial(scale(-1.0, g), scale(0.0, g)))


@kernel
def advance_twin(view, w, g, step):
    """Move the twin on by one time step, by the midpoint rule.

    The middle is reached by the acceleration of the step before: one evaluation instead of two.
    """
    room, twin, half = view.room, view.memory, 0.5 * step
    for i in range(len(twin)):
        now = twin[i]
        rate = now.rate + half * now.acceleration
        room.motions[i] = JointMotion(now.position + half * now.rate, rate, 0.0)
    twin_accelerations(view, w, g)
    for i in range(len(twin)):
        now, a = twin[i], room.accelerations[i]
        twin[i] = JointMotion(now.position + step * room.motions[i].rate, now.rate + step * a, a)


@kernel
def encode_twin(view, k):
    """Tell what the encoders read, and the twin's rates and mean accelerations."""
    seen, numbers, estimate = view.place.motions[0], view.numbers[0], view.estimate[0]
    R = rotation_matrix(estimate.pose.attitude)
    w, g = rotate_back(R, estimate.velocity.angular), gravity_in(R, numbers.gravity)
    for i in range(len(view.arm)):
        position = read_encoder(view.servos[i], view.arm[i].position)
        seen[i] = JointMotion(position, view.memory[i].rate, 0.0)
    for _ in range(int(numbers.steps)):
        advance_twin(view, w, g, numbers.period / numbers.steps)
    for i in range(len(view.arm)):
        now = seen[i]
        mean = (view.memory[i].rate - now.rate) / numbers.period
        seen[i] = JointMotion(now.position, now.rate, mean)
    place(view.place, 0)


FEEDBACK = {
    "twin": encode_twin,
    "truth": encode_truth,
    "command": encode_command,
    "encoder": encode_differences,
}
"""What a law may be told of the arm, by name."""
