"""Rotations of the paper: Euler angles (2)(7), inertia (14), skew (15), exponential (16)-(18).

Every function takes one value or a batch: the last one or two axes are the vector or matrix,
all leading axes are samples and broadcast against each other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def cross(a: Array, b: Array) -> Array:
    """Cross product a x b over the last axis, batched; much faster than `np.cross` when small."""
    a_x, a_y, a_z = a[..., 0], a[..., 1], a[..., 2]
    b_x, b_y, b_z = b[..., 0], b[..., 1], b[..., 2]
    x = a_y * b_z - a_z * b_y
    result = np.empty((*x.shape, 3))
    result[..., 0] = x
    result[..., 1] = a_z * b_x - a_x * b_z
    result[..., 2] = a_x * b_y - a_y * b_x
    return result


def turn(R: Array, x: Array) -> Array:
    """Matrix times vector, R x, batched: shapes (..., 3, 3) and (..., 3)."""
    return np.matmul(R, x[..., None])[..., 0]


def skew(v: Array) -> Array:
    """Skew matrix s(v) with s(v) x = v x x, eq. (15); shape (..., 3) to (..., 3, 3)."""
    s = np.zeros((*v.shape, 3))
    s[..., 0, 1], s[..., 0, 2], s[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    s[..., 1, 0], s[..., 2, 0], s[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return s


def exponential(v: Array, angle: ArrayLike) -> Array:
    """Rotation by an angle about a unit axis, eq. (16).

    R = 1 + s(v) sin(angle) + s(v)^2 (1 - cos(angle)).

    Args:
        v: Unit axis, shape (..., 3).
        angle: Angle [rad], shape (...).

    Returns:
        Rotation matrices, shape (..., 3, 3).
    """
    angle = np.asarray(angle, dtype=float)[..., None, None]
    s = skew(v)
    # 1 - cos as 2 sin^2(angle/2): no cancellation for small angles.
    return np.eye(3) + s * np.sin(angle) + (s @ s) * (2.0 * np.square(np.sin(0.5 * angle)))


def quaternion_rotation(xyzw: Array) -> Array:
    """Attitude of a unit quaternion (x, y, z, w), R = 1 + 2 w s(u) + 2 s(u)^2; (..., 3, 3)."""
    s = skew(xyzw[..., :3])
    return np.eye(3) + 2.0 * (xyzw[..., 3, None, None] * s + s @ s)


def euler_rotation(euler_xyz: Array) -> Array:
    """Attitude from the paper's Euler angles, R_WA = Rx(phi) Ry(psi) Rz(gamma), eq. (2).

    Not roll-pitch-yaw: that is Rz Ry Rx.

    Args:
        euler_xyz: (phi, psi, gamma) [rad], shape (..., 3).

    Returns:
        R_WA, shape (..., 3, 3).
    """
    R_x, R_y, R_z = (exponential(np.eye(3)[k], euler_xyz[..., k]) for k in range(3))
    return R_x @ R_y @ R_z


def euler_angles(R_WA: Array) -> Array:
    """Euler angles (phi, psi, gamma) of an attitude, the inverse of eq. (2).

    psi is in [-pi/2, pi/2]. At psi = +-pi/2 only phi +- gamma is determined; the answer is then
    one of the many right ones.

    Args:
        R_WA: Rotation matrices, shape (..., 3, 3).

    Returns:
        Angles [rad], shape (..., 3).
    """
    phi = np.arctan2(-R_WA[..., 1, 2], R_WA[..., 2, 2])
    psi = np.arctan2(R_WA[..., 0, 2], np.hypot(R_WA[..., 0, 0], R_WA[..., 0, 1]))
    # gamma from the remaining rotation Rx(phi)^T R, which stays right at the singularity.
    c, s = np.cos(phi), np.sin(phi)
    gamma = np.arctan2(
        c * R_WA[..., 1, 0] + s * R_WA[..., 2, 0], c * R_WA[..., 1, 1] + s * R_WA[..., 2, 1]
    )
    return np.stack([phi, psi, gamma], axis=-1)


def euler_rates(euler_xyz: Array, w_W: Array) -> Array:
    """Rates of the Euler angles from the WORLD angular velocity, eq. (7).

    Grows without bound towards psi = +-pi/2, where the angles are singular.

    Args:
        euler_xyz: (phi, psi, gamma) [rad], shape (..., 3).
        w_W: Angular velocity in world axes [rad/s], shape (..., 3).

    Returns:
        (dphi, dpsi, dgamma) [rad/s], shape (..., 3).
    """
    phi, psi = euler_xyz[..., 0], euler_xyz[..., 1]
    s, c = np.sin(phi), np.cos(phi)
    in_plane = s * w_W[..., 1] - c * w_W[..., 2]
    dphi = w_W[..., 0] + np.tan(psi) * in_plane
    dpsi = c * w_W[..., 1] + s * w_W[..., 2]
    dgamma = -in_plane / np.cos(psi)
    return np.stack([dphi, dpsi, dgamma], axis=-1)


def angular_motion(euler_xyz: Array, rates: Array, accelerations: Array) -> tuple[Array, Array]:
    """Angular velocity and acceleration of a motion given in x-y-z Euler angles, world axes.

    With the axes e_x, a = Rx e_y and b = Rx Ry e_z of the three turns of eq. (2),

        w = phi' e_x + psi' a + gamma' b,
        dw = phi'' e_x + psi'' a + gamma'' b
             + psi' (phi' e_x x a) + gamma' ((phi' e_x + psi' a) x b).

    Args:
        euler_xyz: (phi, psi, gamma), shape (N, 3) [rad].
        rates: Their derivatives, shape (N, 3) [rad/s].
        accelerations: Their second derivatives, shape (N, 3) [rad/s^2].

    Returns:
        w [rad/s] and dw [rad/s^2], each of shape (N, 3).
    """
    (phi, psi, _), zero = euler_xyz.T, np.zeros(len(euler_xyz))
    x = np.stack([zero + 1.0, zero, zero], axis=-1)
    a = np.stack([zero, np.cos(phi), np.sin(phi)], axis=-1)
    b = np.stack([np.sin(psi), -np.sin(phi) * np.cos(psi), np.cos(phi) * np.cos(psi)], axis=-1)
    first, second, third = (rates[:, i, None] for i in range(3))
    turn_a = np.cross(first * x, a)
    turn_b = np.cross(first * x + second * a, b)
    w = first * x + second * a + third * b
    dw = accelerations[:, 0, None] * x + accelerations[:, 1, None] * a
    dw += accelerations[:, 2, None] * b + second * turn_a + third * turn_b
    return w, dw


def world_inertia(R: Array, inertia: Array) -> Array:
    """Inertia tensor turned to world axes, R I R^T, eq. (14) and the first line of eq. (25).

    Args:
        R: Attitude of the body, shape (..., 3, 3).
        inertia: Tensor in body axes, shape (..., 3, 3) [kg m^2].

    Returns:
        Tensor in world axes, shape (..., 3, 3) [kg m^2].
    """
    return R @ inertia @ np.swapaxes(R, -1, -2)


def relative_rotation(R_d: Array, R_c: Array) -> Array:
    """Rotation still to be made, in world axes: R_e = R_d R_c^T, eq. (17); (..., 3, 3)."""
    return R_d @ np.swapaxes(R_c, -1, -2)


def logarithm(R: Array) -> Array:
    """Rotation vector theta v of a rotation, eq. (18), exact to rounding at every angle.

    The printed form (arccos of the trace, division by the sine) is NaN near the identity and
    wrong near pi. Here R gives a unit quaternion (w, u) from its largest component, and
    theta v = 2 atan2(|u|, w) u / |u|. At theta = pi either of the two axes is right.

    Args:
        R: Rotation matrices, shape (..., 3, 3).

    Returns:
        Rotation vectors of length theta in [0, pi], shape (..., 3) [rad].
    """
    # Four multiples of the same quaternion (w, x, y, z), each divided by another component of it.
    d = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    multiples = np.empty((*R.shape[:-2], 4, 4))
    diagonal = (
        1.0 + d[0] + d[1] + d[2],
        1.0 + d[0] - d[1] - d[2],
        1.0 - d[0] + d[1] - d[2],
        1.0 - d[0] - d[1] + d[2],
    )
    for k in range(4):
        multiples[..., k, k] = diagonal[k]
    off = (
        (0, 1, R[..., 2, 1] - R[..., 1, 2]),
        (0, 2, R[..., 0, 2] - R[..., 2, 0]),
        (0, 3, R[..., 1, 0] - R[..., 0, 1]),
        (1, 2, R[..., 0, 1] + R[..., 1, 0]),
        (1, 3, R[..., 0, 2] + R[..., 2, 0]),
        (2, 3, R[..., 1, 2] + R[..., 2, 1]),
    )
    for j, k, value in off:
        multiples[..., j, k] = value
        multiples[..., k, j] = value
    largest = np.argmax(np.stack(diagonal, axis=-1), axis=-1)
    quaternion = np.take_along_axis(multiples, largest[..., None, None], axis=-2)[..., 0, :]
    quaternion = np.where(quaternion[..., :1] < 0.0, -quaternion, quaternion)
    w, u = quaternion[..., 0], quaternion[..., 1:]
    length = np.sqrt(np.sum(np.square(u), axis=-1))
    at_identity = length == 0.0
    factor = 2.0 * np.arctan2(length, w) / np.where(at_identity, 1.0, length)
    return factor[..., None] * u


def attitude_error(R_d: Array, R_c: Array) -> Array:
    """e_tau = theta_e v_e: the rotation vector from R_c to R_d in world axes, eqs. (17)-(18)."""
    return logarithm(relative_rotation(R_d, R_c))
