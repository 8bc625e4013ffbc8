"""Minimiser and multipliers of one active set, as an affine map of the wrench.

Of the box problem (see `box_qp`) with A = W B (6 x n) and d = W w,

    minimise  f(u) = 1/2 ||A u - d||^2 + eps/2 ||u - u_0||^2   subject to  0 <= u <= u_max,

some unknowns are free, the others held at a bound. With A_F the columns of the free ones (zero for
the others), c = A u_held + A_F u_0F, and the singular value decomposition A_F = V diag(s) U^T,

    u_F     = u_0F + U diag(s / (s^2 + eps)) V^T (d - c)
    A u - d = -V diag(eps / (s^2 + eps)) V^T (d - c)

Nothing here divides by eps alone, so that u_F carries no rounding magnified in the null space of
A_F, and multipliers of the size of eps come out in full precision.

The decomposition is a one-sided Jacobi: plane rotations V make the six columns of A_F^T V = U
diag(s) orthogonal, pair by pair. It needs + - * / and square roots alone, so that Python and
machine code give the same bits, and small singular values come out as precise as large ones.
"""

from __future__ import annotations

from typing import NamedTuple

from fullam.dynamics.spatial import Spatial, axpy_spatial, multiply_spatial
from fullam.numbers.kernel import Number, absolute, kernel, select, sqrt, subroutine
from fullam.numbers.vectors import ZERO, dot

FREE, AT_LOWER, AT_UPPER = 0.0, -1.0, 1.0
"""Status of one unknown in an active set."""

NULL_CUTOFF = 1e-14
"""Singular values of A_F below this share of the norm of A are zero: they are rounding."""

SWEEPS = 30
"""Sweeps of the Jacobi method at most; ten settle it, see the tests."""

ORTHOGONAL = 1e-30
"""Squared cosine of two orthogonal columns: asked for 1e-32, rounding, some pairs never are."""

ROOM = 8
"""Entries of a column of the Jacobi method beside A_F^T: six of V, and the two factors of s."""


class Unknown(NamedTuple):
    """One unknown u_i of a box problem.

    Its unconstrained minimiser gain . w + offset; column of A; u_0 and u_max; diagonal of the
    Hessian, |A_i|^2 + eps; 2^i, by which it is named in an active set.
    """

    gain: Spatial
    offset: Number
    column: Spatial
    prior: Number
    upper: Number
    diagonal: Number
    bit: Number


class Scales(NamedTuple):
    """Diagonal of W; eps; square of the least singular value that is none of rounding's."""

    weights: Spatial
    eps: Number
    null: Number


class Affine(NamedTuple):
    """An affine function of the wrench: gain . w + offset."""

    gain: Spatial
    offset: Number


@kernel
def inner(a, b):
    """Inner product of two sixes."""
    return dot(a.linear, b.linear) + dot(a.angular, b.angular)


@kernel
def value(function, wrench):
    """Value of an affine function; `function` is anything with gain and offset."""
    return inner(function.gain, wrench) + function.offset


@subroutine
def active_set_map(unknowns, scales, status, columns, rows):
    """Write the map of an active set.

    Args:
        unknowns: The n unknowns.
        scales: `Scales`.
        status: FREE, AT_LOWER or AT_UPPER for each unknown.
        columns: Space to work in, six rows of n + ROOM floats.
        rows: Where to write n of `Affine`. Where an unknown is free it is u_i; where it is held it
            is the multiplier over H_ii: +(grad f)_i / H_ii at the lower bound, -(grad f)_i / H_ii
            at the upper one.

    Returns:
        Sweeps that the decomposition took.
    """
    eps, weights = scales.eps, scales.weights
    free, c = 0, Spatial(ZERO, ZERO)
    for i in range(len(unknowns)):
        unknown = unknowns[i]
        a = unknown.column
        if status[i] == FREE:
            columns[0][free], columns[1][free], columns[2][free] = a.linear
            columns[3][free], columns[4][free], columns[5][free] = a.angular
            c = axpy_spatial(unknown.prior, a, c)
            free += 1
        elif status[i] == AT_UPPER:
            c = axpy_spatial(unknown.upper, a, c)
    sweeps = orthogonalise(columns, free, scales.null)
    for k in range(6):
        column, square = columns[k], 0.0
        for f in range(free):
            square += column[f] * column[f]
        solid = square >= scales.null
        column[free + 6] = select(solid, eps / (square + eps), 1.0)
        column[free + 7] = select(solid, 1.0 / (square + eps), 0.0)
    f = 0
    for i in range(len(unknowns)):
        unknown = unknowns[i]
        gain, offset = Spatial(ZERO, ZERO), unknown.prior
        if status[i] == FREE:
            for k in range(6):
                gain = axpy_spatial(
                    columns[k][f] * columns[k][free + 7], axis(columns[k], free), gain
                )
            f += 1
        else:
            # Outward slope of the cost at a held bound, scaled by the diagonal of the Hessian.
            slope = select(status[i] == AT_UPPER, -1.0, 1.0) / unknown.diagonal
            held = select(status[i] == AT_UPPER, unknown.upper, 0.0)
            offset = slope * eps * (held - unknown.prior)
            for k in range(6):
                v = axis(columns[k], free)
                gain = axpy_spatial(
                    -slope * inner(unknown.column, v) * columns[k][free + 6], v, gain
                )
        rows[i] = Affine(multiply_spatial(gain, weights), offset - inner(gain, c))
    return sweeps


@kernel
def axis(column, start):
    """A column of V, which stands behind one of A_F^T V."""
    return Spatial(
        (column[start], column[start + 1], column[start + 2]),
        (column[start + 3], column[start + 4], column[start + 5]),
    )


@subroutine
def orthogonalise(columns, length, null):
    """One-sided Jacobi: turn the six columns, in place, until they are orthogonal.

    Args:
        columns: Their first `length` entries are A_F^T and become A_F^T V; the six behind become V.
        length: Number of free unknowns.
        null: Square below which a column is rounding. Such columns are left alone, since turning
            rounding against rounding comes to no end.

    Returns:
        Sweeps taken.
    """
    for i in range(6):
        for k in range(6):
            columns[i][length + k] = select(i == k, 1.0, 0.0)
    for sweep in range(SWEEPS):
        turned = False
        for i in range(5):
            for j in range(i + 1, 6):
                x, y = columns[i], columns[j]
                a = b = c = 0.0
                for k in range(length):
                    p, q = x[k], y[k]
                    a += p * p
                    b += q * q
                    c += p * q
                if a > null and b > null and c * c > ORTHOGONAL * a * b:
                    turned = True
                    ratio = (b - a) / (2.0 * c)
                    tangent = 1.0 / (absolute(ratio) + sqrt(1.0 + ratio * ratio))
                    tangent = select(ratio < 0.0, -tangent, tangent)
                    cosine = 1.0 / sqrt(1.0 + tangent * tangent)
                    sine = cosine * tangent
                    for k in range(length + 6):
                        p, q = x[k], y[k]
                        x[k] = cosine * p - sine * q
                        y[k] = sine * p + cosine * q
        if not turned:
            return sweep + 1
    return SWEEPS
