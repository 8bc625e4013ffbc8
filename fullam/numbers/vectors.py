"""3-vectors and 3 x 3 matrices as tuples of numbers.

A matrix is a tuple of nine, row by row; a symmetric one of six: xx, xy, xz, yy, yz, zz.
"""

from __future__ import annotations

from fullam.numbers.kernel import Number, clip, kernel

Vector = tuple[Number, Number, Number]
Symmetric = tuple[Number, Number, Number, Number, Number, Number]
Matrix = tuple[Number, Number, Number, Number, Number, Number, Number, Number, Number]

ZERO = (0.0, 0.0, 0.0)
IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@kernel
def add(a, b):
    """Sum a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def subtract(a, b):
    """Difference a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def scale(s, a):
    """Multiple s a."""
    return (s * a[0], s * a[1], s * a[2])


@kernel
def multiply(a, b):
    """Product entry by entry."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


@kernel
def axpy(s, a, b):
    """Sum s a + b."""
    return (b[0] + s * a[0], b[1] + s * a[1], b[2] + s * a[2])


@kernel
def dot(a, b):
    """Inner product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a, b):
    """Cross product a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@kernel
def clip_vector(a, low, high):
    """Each entry within its bounds."""
    return (
        clip(a[0], low[0], high[0]),
        clip(a[1], low[1], high[1]),
        clip(a[2], low[2], high[2]),
    )


@kernel
def rotate(R, a):
    """Product R a."""
    return (
        R[0] * a[0] + R[1] * a[1] + R[2] * a[2],
        R[3] * a[0] + R[4] * a[1] + R[5] * a[2],
        R[6] * a[0] + R[7] * a[1] + R[8] * a[2],
    )


@kernel
def rotate_back(R, a):
    """Product R^T a."""
    return (
        R[0] * a[0] + R[3] * a[1] + R[6] * a[2],
        R[1] * a[0] + R[4] * a[1] + R[7] * a[2],
        R[2] * a[0] + R[5] * a[1] + R[8] * a[2],
    )


@kernel
def apply_symmetric(J, a):
    """Product J a of a symmetric matrix."""
    return (
        J[0] * a[0] + J[1] * a[1] + J[2] * a[2],
        J[1] * a[0] + J[3] * a[1] + J[4] * a[2],
        J[2] * a[0] + J[4] * a[1] + J[5] * a[2],
    )


@kernel
def add_symmetric(a, b):
    """Sum of two symmetric matrices."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])


@kernel
def solve_symmetric(J, b):
    """Solution of J x = b by cofactors, for a positive definite symmetric matrix."""
    xx, xy, xz, yy, yz, zz = J
    c0, c1, c2 = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    d = 1.0 / (xx * c0 + xy * c1 + xz * c2)
    e, f, g = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    return (
        d * (c0 * b[0] + c1 * b[1] + c2 * b[2]),
        d * (c1 * b[0] + e * b[1] + f * b[2]),
        d * (c2 * b[0] + f * b[1] + g * b[2]),
    )
