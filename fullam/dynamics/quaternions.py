"""Unit quaternions (x, y, z, w) of attitudes, one or a batch: the algebra that poses need.

All leading axes are samples and broadcast against each other. As matrices they are
`rotations.quaternion_rotation`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.rotations import cross

Array = NDArray[np.float64]


def product(a: Array, b: Array) -> Array:
    """A b, the rotation b followed by a in fixed axes; shapes (..., 4).

    (w_a u_b + w_b u_a + u_a x u_b, w_a w_b - u_a . u_b)
    """
    u_a, u_b, w_a, w_b = a[..., :3], b[..., :3], a[..., 3:], b[..., 3:]
    vector = w_a * u_b + w_b * u_a + cross(u_a, u_b)
    scalar = w_a * w_b - np.sum(u_a * u_b, axis=-1, keepdims=True)
    return np.concatenate([vector, scalar], axis=-1)


def inverse(q: Array) -> Array:
    """The rotation back: (-u, w) of a unit quaternion (u, w), shape (..., 4)."""
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def from_rotation_vector(v: Array) -> Array:
    """(sin(|v|/2) v/|v|, cos(|v|/2)); shape (..., 3) [rad] to (..., 4)."""
    half = 0.5 * np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate([0.5 * np.sinc(half / np.pi) * v, np.cos(half)], axis=-1)


def to_rotation_vector(q: Array) -> Array:
    """2 atan2(|u|, w) u/|u| by the shorter way, at most pi long; (..., 4) to (..., 3) [rad]."""
    q = np.where(q[..., 3:] < 0.0, -q, q)
    length = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    still = length == 0.0
    factor = 2.0 * np.arctan2(length, q[..., 3:]) / np.where(still, 1.0, length)
    return factor * q[..., :3]


def from_euler(euler_xyz: Array) -> Array:
    """The attitude R = Rx(phi) Ry(psi) Rz(gamma) of eq. (2); shape (..., 3) [rad] to (..., 4)."""
    x, y, z = (from_rotation_vector(euler_xyz[..., k, None] * np.eye(3)[k]) for k in range(3))
    return product(product(x, y), z)
