"""Rotations as kernels: unit quaternions (x, y, z, w), as in Pinocchio's q, and rotation vectors.

`rotations` has the paper's forms, (14)-(18), for arrays; these are what flies, and tests hold the
ones to the others.
"""

from __future__ import annotations

from fullam.numbers.elementary import arctan2, sincos
from fullam.numbers.kernel import Number, kernel, select, some, sqrt
from fullam.numbers.vectors import axpy, cross, dot, scale

Quaternion = tuple[Number, Number, Number, Number]

SMALL = 1e-2
"""Squared angle below which sine, cosine and arc tangent are taken from series, to rounding.

In a flight nearly all angles (of a step, of noise, of an error) are that small.
"""


@kernel
def rotation_matrix(q):
    """Rotation matrix of a unit quaternion, row by row."""
    x, y, z, w = q
    x2, y2, z2 = 2.0 * x, 2.0 * y, 2.0 * z
    wx, wy, wz = x2 * w, y2 * w, z2 * w
    xx, xy, xz = x2 * x, y2 * x, z2 * x
    yy, yz, zz = y2 * y, z2 * y, z2 * z
    return (
        1.0 - (yy + zz),
        xy - wz,
        xz + wy,
        xy + wz,
        1.0 - (xx + zz),
        yz - wx,
        xz - wy,
        yz + wx,
        1.0 - (xx + yy),
    )


@kernel
def compose(a, b):
    """Product of two quaternions: first b, then a."""
    return (
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    )


@kernel
def exponential(v):
    """Unit quaternion exp(v) of a rotation vector, eq. (16)."""
    square = dot(v, v)
    s = 0.25 * square
    half = 0.5 - s * (1 / 12 - s * (1 / 240 - s * (1 / 10080 - s * (1 / 725760))))
    real = 1.0 - s * (1 / 2 - s * (1 / 24 - s * (1 / 720 - s * (1 / 40320))))
    large = square >= SMALL
    if some(large):
        angle = sqrt(select(large, square, 1.0))
        sine, cosine = sincos(0.5 * angle)
        half, real = select(large, sine / angle, half), select(large, cosine, real)
    return (half * v[0], half * v[1], half * v[2], real)


@kernel
def logarithm(q):
    """Rotation vector of a unit quaternion, of length at most pi, eqs. (17)-(18)."""
    sign = select(q[3] < 0.0, -1.0, 1.0)
    v, w = (sign * q[0], sign * q[1], sign * q[2]), sign * q[3]
    square = dot(v, v)
    large = square >= 0.25 * SMALL
    guarded = select(large, 1.0, w)
    r = square / (guarded * guarded)
    tail = 1 / 7 - r * (1 / 9 - r * (1 / 11 - r * (1 / 13)))
    k = (2.0 / guarded) * (1.0 - r * (1 / 3 - r * (1 / 5 - r * tail)))
    if some(large):
        sine = sqrt(select(large, square, 1.0))
        k = select(large, 2.0 * arctan2(sine, w) / sine, k)
    return scale(k, v)


@kernel
def boxminus(b, a):
    """Rotation vector log(a^-1 b) from a to b, in the axes of a."""
    return logarithm(compose((-a[0], -a[1], -a[2], a[3]), b))


@kernel
def boxplus(q, v):
    """Quaternion q exp(v): on q's side of the double cover, of unit length to rounding."""
    x, y, z, w = compose(q, exponential(v))
    k = 0.5 * (3.0 - (x * x + y * y + z * z + w * w))
    k = select(q[0] * x + q[1] * y + q[2] * z + q[3] * w < 0.0, -k, k)
    return (k * x, k * y, k * z, k * w)


@kernel
def displacement(v, w):
    """How far a motion of constant v and w in body axes moves the origin in unit time.

    V(w) v = v + (1 - cos|w|) / |w|^2 w x v + (|w| - sin|w|) / |w|^3 w x (w x v).
    """
    s = dot(w, w)
    b = 1 / 2 - s * (1 / 24 - s * (1 / 720 - s * (1 / 40320 - s * (1 / 3628800))))
    c = 1 / 6 - s * (1 / 120 - s * (1 / 5040 - s * (1 / 362880 - s * (1 / 39916800))))
    large = s >= SMALL
    if some(large):
        square = select(large, s, 1.0)
        angle = sqrt(square)
        sine, _ = sincos(angle)
        half, _ = sincos(0.5 * angle)
        b = select(large, 2.0 * half * half / square, b)
        c = select(large, (1.0 - sine / angle) / square, c)
    sideways = cross(w, v)
    return axpy(c, cross(w, sideways), axpy(b, sideways, v))
