"""What the vehicle senses of itself: late, slow and noisy poses, and inertial readings.

A pose is taken every few control periods and arrives some periods later, unless it is missing; so
the last true poses are kept in a ring, as many as one is old plus one. Nothing here knows of a log.
"""

from __future__ import annotations

from fullam.control.estimator import Inertial
from fullam.dynamics.so3 import boxplus, rotation_matrix
from fullam.dynamics.spatial import Pose
from fullam.numbers.kernel import kernel
from fullam.numbers.vectors import add, axpy, cross, multiply


@kernel
def keep_pose(ring, pose, k):
    """Put the true pose of control period k into the ring; all periods, in turn."""
    ring[k % len(ring)] = pose


@kernel
def sense_pose(ring, noise, last, every, k):
    """The pose at hand in control period k.

    Args:
        ring: The last true poses, that of period k included; its length is the age of a reading
            in control periods, plus one. Before the first one is old enough, all show the start.
        noise: Of this period: position (world) and attitude (tangent at {A}).
        last: The reading of the period before.
        every: Control periods between two readings.
        k: The control period.
    """
    if k % int(every) != 0:
        return last
    span = len(ring)
    pose = ring[max(0, k - span + 1) % span]
    return Pose(add(pose.position, noise.linear), boxplus(pose.attitude, noise.angular))


@kernel
def sense_inertial(attitude, velocity, acceleration, gravity, gains, noise):
    """Gyroscope w and accelerometer R^T (ddp_A - g) = a + w x v - R^T g, in {A} axes.

    Each entry is multiplied by its gain, and what is off is added.

    Args:
        attitude: True attitude.
        velocity: True [v_A, w_A], {A} axes.
        acceleration: Its derivative [dv_A, dw_A], {A} axes, as in Pinocchio.
        gravity: [m/s^2], along -z of {W}.
        gains: What the sensors make of 1, `Inertial`.
        noise: Of this period, with bias and drift, `Inertial`.
    """
    R, w = rotation_matrix(attitude), velocity.angular
    felt = axpy(gravity, R[6:9], add(acceleration.linear, cross(w, velocity.linear)))
    return Inertial(
        add(multiply(gains.gyroscope, w), noise.gyroscope),
        add(multiply(gains.accelerometer, felt), noise.accelerometer),
    )
