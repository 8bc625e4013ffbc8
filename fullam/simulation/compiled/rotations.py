"""3-vectors, rotation matrices and quaternions as tuples of floats, which live in registers.

A matrix is a tuple of nine, row by row; a quaternion is x, y, z, w, as in Pinocchio's q.
"""

from __future__ import annotations

import math

from fullam.simulation.compiled.jit import compiled

SMALL = 1e-2
"""Squared angle below which sine, cosine and arc tangent are taken from their series.

The terms that are left out are below rounding. In a flight nearly all angles (of a step, of noise,
of an error) are that small, and the functions themselves take ten times as long.
"""


@compiled
def three(rows, i, j):
    """Entries j to j + 2 of row i."""
    return (rows[i, j], rows[i, j + 1], rows[i, j + 2])


@compiled
def four(rows, i, j):
    """Entries j to j + 3 of row i."""
    return (rows[i, j], rows[i, j + 1], rows[i, j + 2], rows[i, j + 3])


@compiled
def six(rows, i, j):
    """Entries j to j + 5 of row i."""
    return (
        rows[i, j],
        rows[i, j + 1],
        rows[i, j + 2],
        rows[i, j + 3],
        rows[i, j + 4],
        rows[i, j + 5],
    )


@compiled
def write(rows, i, j, values):
    """Write three numbers to row i, from entry j on."""
    rows[i, j], rows[i, j + 1], rows[i, j + 2] = values[0], values[1], values[2]


@compiled
def write_four(rows, i, j, values):
    """Write four numbers to row i, from entry j on."""
    rows[i, j], rows[i, j + 1] = values[0], values[1]
    rows[i, j + 2], rows[i, j + 3] = values[2], values[3]


@compiled
def copy_row(source, i, target, j, width):
    """Copy the first entries of row i of one array to row j of another."""
    for k in range(width):
        target[j, k] = source[i, k]


@compiled
def add(a, b):
    """Sum a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@compiled
def subtract(a, b):
    """Difference a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@compiled
def scale(s, a):
    """Multiple s a."""
    return (s * a[0], s * a[1], s * a[2])


@compiled
def along(a, s, b):
    """Sum a + s b."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2])


@compiled
def dot(a, b):
    """Inner product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a, b):
    """Cross product a x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def turn(R, a):
    """Product R a."""
    return (
        R[0] * a[0] + R[1] * a[1] + R[2] * a[2],
        R[3] * a[0] + R[4] * a[1] + R[5] * a[2],
        R[6] * a[0] + R[7] * a[1] + R[8] * a[2],
    )


@compiled
def turn_back(R, a):
    """Product R^T a."""
    return (
        R[0] * a[0] + R[3] * a[1] + R[6] * a[2],
        R[1] * a[0] + R[4] * a[1] + R[7] * a[2],
        R[2] * a[0] + R[5] * a[1] + R[8] * a[2],
    )


@compiled
def symmetric(J, a):
    """Product J a for a symmetric J given as (xx, xy, xz, yy, yz, zz)."""
    return (
        J[0] * a[0] + J[1] * a[1] + J[2] * a[2],
        J[1] * a[0] + J[3] * a[1] + J[4] * a[2],
        J[2] * a[0] + J[4] * a[1] + J[5] * a[2],
    )


@compiled
def solve_symmetric(J, b):
    """Solution of J x = b by cofactors, for a positive definite J given as in `symmetric`."""
    xx, xy, xz, yy, yz, zz = J
    c0, c1, c2 = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    d = 1.0 / (xx * c0 + xy * c1 + xz * c2)
    return (
        d * (c0 * b[0] + c1 * b[1] + c2 * b[2]),
        d * (c1 * b[0] + (xx * zz - xz * xz) * b[1] + (xy * xz - xx * yz) * b[2]),
        d * (c2 * b[0] + (xy * xz - xx * yz) * b[1] + (xx * yy - xy * xy) * b[2]),
    )


@compiled
def matrix(q):
    """Rotation matrix of a unit quaternion."""
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


@compiled
def multiply(a, b):
    """Quaternion product a b."""
    return (
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    )


@compiled
def exponential(w):
    """Unit quaternion of the rotation vector w."""
    square = dot(w, w)
    if square > SMALL:
        angle = math.sqrt(square)
        half, real = math.sin(0.5 * angle) / angle, math.cos(0.5 * angle)
    else:
        s = 0.25 * square
        half = 0.5 - s * (1 / 12 - s * (1 / 240 - s * (1 / 10080 - s * (1 / 725760))))
        real = 1.0 - s * (1 / 2 - s * (1 / 24 - s * (1 / 720 - s * (1 / 40320))))
    return (half * w[0], half * w[1], half * w[2], real)


@compiled
def logarithm(q):
    """Rotation vector of a unit quaternion, of length at most pi."""
    x, y, z, w = q
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    square = x * x + y * y + z * z
    if square > 0.25 * SMALL:
        sine = math.sqrt(square)
        k = 2.0 * math.atan2(sine, w) / sine
    else:
        r = square / (w * w)
        tail = 1 / 7 - r * (1 / 9 - r * (1 / 11 - r * (1 / 13)))
        k = (2.0 / w) * (1.0 - r * (1 / 3 - r * (1 / 5 - r * tail)))
    return (k * x, k * y, k * z)


@compiled
def difference(a, b):
    """Rotation vector log(a^{-1} b), in the axes of a."""
    return logarithm(multiply((-a[0], -a[1], -a[2], a[3]), b))


@compiled
def turned(q, w):
    """Product q exp(w), on q's side of the double cover and of unit length to rounding."""
    x, y, z, s = multiply(q, exponential(w))
    k = 0.5 * (3.0 - (x * x + y * y + z * z + s * s))
    if q[0] * x + q[1] * y + q[2] * z + q[3] * s < 0.0:
        k = -k
    return (k * x, k * y, k * z, k * s)


@compiled
def carried(v, w):
    """Vector V(w) v: how far a motion of constant v and w in body axes carries the origin."""
    square = dot(w, w)
    if square > SMALL:
        angle = math.sqrt(square)
        half = math.sin(0.5 * angle)
        b = 2.0 * half * half / square
        c = (1.0 - math.sin(angle) / angle) / square
    else:
        s = square
        b = 1 / 2 - s * (1 / 24 - s * (1 / 720 - s * (1 / 40320 - s * (1 / 3628800))))
        c = 1 / 6 - s * (1 / 120 - s * (1 / 5040 - s * (1 / 362880 - s * (1 / 39916800))))
    sideways = cross(w, v)
    return along(along(v, b, sideways), c, cross(w, sideways))
