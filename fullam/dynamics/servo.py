"""The torque of a position servo, and what its encoder reads, as kernels; see `model.servos`."""

from __future__ import annotations

from typing import NamedTuple

from fullam.numbers.elementary import ROUNDER
from fullam.numbers.kernel import Number, clip, kernel, maximum, minimum, select


class ServoNumbers(NamedTuple):
    """A servo as kernels have it: the attributes of `model.servos.Servos`, of one joint."""

    stiffness: Number
    damping: Number
    stall: Number
    armature: Number
    resolution: Number
    lower: Number
    upper: Number
    stop: Number


@kernel
def servo_torque(servo, goal, position, rate):
    """Torque at a joint: the servo's, on its motor's line, and that of the stops at its limits."""
    asked = clip(servo.stiffness * (goal - position), -servo.stall, servo.stall)
    beyond = minimum(position - servo.lower, 0.0) + maximum(position - servo.upper, 0.0)
    return asked - servo.damping * rate - servo.stop * beyond


@kernel
def read_encoder(servo, position):
    """The position in whole steps of the encoder, or as it is if it has none."""
    stepped = servo.resolution > 0.0
    step = select(stepped, servo.resolution, 1.0)
    return select(stepped, step * ((position / step + ROUNDER) - ROUNDER), position)


@kernel
def shifted_goal(servo, wanted, torque):
    """Goal at which a servo that gives a torque stands where it is wanted, in whole steps."""
    goal = read_encoder(servo, wanted + torque / servo.stiffness)
    return clip(goal, servo.lower - torque_room(servo), servo.upper + torque_room(servo))


@kernel
def torque_room(servo):
    """How far a goal may be beyond a limit: as far as a servo's error counts."""
    return servo.stall / servo.stiffness
