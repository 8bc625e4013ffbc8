"""The box problem and its warm active set; `fullam.control.box_qp` is the reference.

The problem, its primal search and every tolerance are that module's. One start of the search is
not: where few bounds do not fit the reference goes on from the last solution at once (its
FEW_MISFITS), this one asks the clipped minimiser first every time. Both end at the same answer. The
maps of the active sets are computed when first met and kept in a table.
"""

from __future__ import annotations

import math

import numpy as np

from fullam.control.box_qp import (
    AT_LOWER,
    AT_UPPER,
    BOUND_TOLERANCE,
    FREE,
    MULTIPLIER_TOLERANCE,
    NULL_CUTOFF,
)
from fullam.simulation.compiled.jit import compiled

SWEEPS = 30
"""Sweeps of the Jacobi method at most; ten settle it, see the tests."""

GAIN, OFFSET, B, A, PRIOR, UPPER, DIAGONAL, MAX_SPEED, BOX_WIDTH = 0, 6, 7, 13, 19, 20, 21, 22, 23
"""Columns of a row of `box`, one row a rotor: unconstrained minimiser u = K w + k (6 + 1), column
of the normalised coupling (6), column of W B (6), preferred u, upper bound, diagonal of the
Hessian, largest speed [rad/s]."""

WEIGHTS, EPS, TOLERANCE_SQUARED, SCALES = 0, 6, 7, 8
"""Entries of `scales`: diagonal of W (6), regularisation, and the squared weighted error from which
on a wrench counts as out of reach."""

U, SOLUTION, Z, CLIPPED = range(4)
"""Rows of `unknowns`, shape (4, n): answer of the last allocation; answer of the last search;
minimiser or multipliers; clipped minimiser."""

WANTED, RESIDUAL = 0, 1
"""Rows of `sixes`, shape (2, 6): wrench to be allocated, in {A}; weighted residual."""

STATUS, TRIAL = 0, 1
"""Rows of `sets`, shape (2, n): active set of the last search, and on trial."""

EXACT, ACTIVE_SET, CLIP, PIVOTS, CYCLES, UNCONFIRMED, UNSETTLED, ROUNDS, N_COUNTERS = range(9)
"""Entries of `counters`, which nothing but the reader looks at: allocations by rung; changes of the
active set; searches that met a set twice; answers that did not settle or failed their check;
answers about a centre that are no fixed point, and rounds of all of them."""

FORCE_ROWS = 3
"""Rows of a map that give the force."""


@compiled
def inner(rows, i, j, sixes, k):
    """Inner product of entries j to j + 5 of row i with row k of `sixes`."""
    total = rows[i, j] * sixes[k, 0]
    for c in range(1, 6):
        total += rows[i, j + c] * sixes[k, c]
    return total


@compiled
def code_of(sets, row):
    """One number for an active set: two bits an unknown."""
    code = 0
    for i in range(sets.shape[1]):
        code = 4 * code + sets[row, i]
    return code


@compiled
def rows_of(box, scales, keys, maps, sets, row):
    """First row of an active set's map, computed if it is not there; a full table is emptied.

    The last entry of `keys` counts the maps.
    """
    code, slots = code_of(sets, row), keys.size - 1
    slot = (code * 0x9E3779B1 >> 7) % slots
    while keys[slot] != code:
        if keys[slot] < 0:
            if 2 * keys[slots] >= slots:
                for i in range(slots):
                    keys[i] = -1
                keys[slots] = 0
            keys[slots] += 1
            keys[slot] = code
            active_set_map(box, scales, sets, row, maps, slot * (box.shape[0] + FORCE_ROWS))
            break
        slot = (slot + 1) % slots
    return slot * (box.shape[0] + FORCE_ROWS)


@compiled
def orthogonalise(M, V, null):
    """One-sided Jacobi: M V with orthogonal columns, in place; V, shape (6, 6), starts as 1.

    With M = A^T the columns of V are the left singular vectors of A, all six of them, those of the
    columns of M V are its singular values, and their directions its right ones. Two columns are
    orthogonal at a cosine of 1e-15: asked for 1e-16, which is rounding, some pairs never are.

    Args:
        M: Shape (n, 6).
        V: Shape (6, 6).
        null: Square below which a column is rounding. Such columns are left alone, since turning
            rounding against rounding comes to no end.

    Returns:
        Sweeps taken.
    """
    for sweep in range(SWEEPS):
        turned = False
        for i in range(5):
            for j in range(i + 1, 6):
                a = b = c = 0.0
                for k in range(M.shape[0]):
                    a += M[k, i] * M[k, i]
                    b += M[k, j] * M[k, j]
                    c += M[k, i] * M[k, j]
                if a <= null or b <= null or c * c <= 1e-30 * a * b:
                    continue
                turned = True
                ratio = (b - a) / (2.0 * c)
                tangent = 1.0 / (abs(ratio) + math.sqrt(1.0 + ratio * ratio))
                if ratio < 0.0:
                    tangent = -tangent
                cosine = 1.0 / math.sqrt(1.0 + tangent * tangent)
                sine = cosine * tangent
                for k in range(M.shape[0]):
                    x, y = M[k, i], M[k, j]
                    M[k, i], M[k, j] = cosine * x - sine * y, sine * x + cosine * y
                for k in range(6):
                    x, y = V[k, i], V[k, j]
                    V[k, i], V[k, j] = cosine * x - sine * y, sine * x + cosine * y
        if not turned:
            return sweep + 1
    return SWEEPS


@compiled
def active_set_map(box, scales, sets, row, maps, start):
    """Write the map of an active set to `maps`, from row `start` on.

    See `fullam.control.box_qp.active_set_map`; the weights go into the gain, as there.

    Returns:
        Sweeps that its singular values took.
    """
    eps, n, square = scales[EPS], box.shape[0], 0.0
    M, V, c = np.zeros((n, 6)), np.zeros((6, 6)), np.zeros(6)
    for k in range(6):
        V[k, k] = 1.0
        for i in range(n):
            a, status = box[i, A + k], sets[row, i]
            square += a * a
            if status == FREE:
                M[i, k] = a
                c[k] += a * box[i, PRIOR]
            elif status == AT_UPPER:
                c[k] += a * box[i, UPPER]
    cutoff = NULL_CUTOFF * NULL_CUTOFF * square
    sweeps = orthogonalise(M, V, cutoff)
    left, right = np.ones(6), np.zeros(6)
    for k in range(6):
        square = 0.0
        for i in range(n):
            square += M[i, k] * M[i, k]
        if square >= cutoff:
            left[k], right[k] = eps / (square + eps), 1.0 / (square + eps)
    for i in range(n):
        status, offset = sets[row, i], box[i, PRIOR]
        slope = 0.0
        if status != FREE:
            # Outward slope of the cost at a held bound, scaled by the diagonal of the Hessian.
            slope = (-1.0 if status == AT_UPPER else 1.0) / box[i, DIAGONAL]
            held = box[i, UPPER] if status == AT_UPPER else 0.0
            offset = slope * eps * (held - box[i, PRIOR])
        for j in range(6):
            gain = 0.0
            for k in range(6):
                if status == FREE:
                    gain += M[i, k] * right[k] * V[j, k]
                else:
                    along = 0.0
                    for m in range(6):
                        along += box[i, A + m] * V[m, k]
                    gain -= slope * along * left[k] * V[j, k]
            offset -= gain * c[j]
            maps[start + i, j] = gain * scales[WEIGHTS + j]
        maps[start + i, 6] = offset
    for k in range(FORCE_ROWS):
        for j in range(7):
            maps[start + n + k, j] = -1.0 if j == k else 0.0
        for i in range(n):
            if sets[row, i] == FREE:
                for j in range(7):
                    maps[start + n + k, j] += box[i, B + k] * maps[start + i, j]
            elif sets[row, i] == AT_UPPER:
                maps[start + n + k, 6] += box[i, B + k] * box[i, UPPER]
    return sweeps


@compiled
def weighted_residual(box, scales, unknowns, row, sixes):
    """Write A u - W w to `sixes`; returns its square. u is a row of `unknowns`."""
    square = 0.0
    for j in range(6):
        total = 0.0
        for i in range(box.shape[0]):
            total += box[i, A + j] * unknowns[row, i]
        total -= scales[WEIGHTS + j] * sixes[WANTED, j]
        sixes[RESIDUAL, j] = total
        square += total * total
    return square


@compiled
def objective(box, scales, unknowns, row, sixes):
    """The cost f(u)."""
    pull = 0.0
    for i in range(box.shape[0]):
        pull += (unknowns[row, i] - box[i, PRIOR]) ** 2
    square = weighted_residual(box, scales, unknowns, row, sixes)
    return 0.5 * square + 0.5 * scales[EPS] * pull


@compiled
def kkt_residual(box, scales, unknowns, row, sixes):
    """Largest entry of u - clip(u - grad f / diag H, 0, u_max); fills the weighted residual.

    NaN if any entry is: `max` would drop it, and the answer would be believed.
    """
    weighted_residual(box, scales, unknowns, row, sixes)
    worst = 0.0
    for i in range(box.shape[0]):
        u = unknowns[row, i]
        slope = scales[EPS] * (u - box[i, PRIOR]) + inner(box, i, A, sixes, RESIDUAL)
        moved = min(max(u - slope / box[i, DIAGONAL], 0.0), box[i, UPPER])
        step = abs(u - moved)
        if not step <= worst:
            worst = step
            if math.isnan(worst):
                break
    return worst


@compiled
def solve_box(box, scales, keys, maps, unknowns, sixes, sets, minimisers, counters):
    """Find the minimiser, into row SOLUTION; see `BoxLeastSquares.solve`. True if it holds it."""
    n = box.shape[0]
    start, fits = rows_of(box, scales, keys, maps, sets, STATUS), True
    for i in range(n):
        z, status = inner(maps, start + i, 0, sixes, WANTED) + maps[start + i, 6], sets[STATUS, i]
        unknowns[Z, i] = z
        if status == FREE:
            fits = fits and -BOUND_TOLERANCE <= z <= box[i, UPPER] + BOUND_TOLERANCE
        else:
            fits = fits and z >= -MULTIPLIER_TOLERANCE
    if fits:
        for i in range(n):
            status = sets[STATUS, i]
            if status == FREE:
                unknowns[SOLUTION, i] = min(max(unknowns[Z, i], 0.0), box[i, UPPER])
            else:
                unknowns[SOLUTION, i] = box[i, UPPER] if status == AT_UPPER else 0.0
        return True
    for i in range(n):
        unknowns[Z, i] = inner(box, i, GAIN, sixes, WANTED) + box[i, OFFSET]
        unknowns[CLIPPED, i] = min(max(unknowns[Z, i], 0.0), box[i, UPPER])
    clipped = objective(box, scales, unknowns, CLIPPED, sixes)
    if clipped < objective(box, scales, unknowns, SOLUTION, sixes):
        for i in range(n):
            z = unknowns[Z, i]
            sets[TRIAL, i] = AT_LOWER if z < 0.0 else AT_UPPER if z > box[i, UPPER] else FREE
            unknowns[SOLUTION, i] = unknowns[CLIPPED, i]
    else:
        for i in range(n):
            sets[TRIAL, i] = sets[STATUS, i]
    settled = pivot(box, scales, keys, maps, unknowns, sixes, sets, minimisers, counters)
    for i in range(n):
        sets[STATUS, i] = sets[TRIAL, i]
    return settled


@compiled
def pivot(box, scales, keys, maps, unknowns, sixes, sets, minimisers, counters):
    """Primal active set from a feasible point; see `BoxLeastSquares._search`."""
    n, known = box.shape[0], 0
    for _ in range(minimisers.size):
        start = rows_of(box, scales, keys, maps, sets, TRIAL)
        share, blocking, worst, leaving = 1.0, -1, -MULTIPLIER_TOLERANCE, -1
        for i in range(n):
            z, u = (
                inner(maps, start + i, 0, sixes, WANTED) + maps[start + i, 6],
                unknowns[SOLUTION, i],
            )
            unknowns[Z, i] = z
            if sets[TRIAL, i] != FREE:
                if z < worst:
                    worst, leaving = z, i
            elif z < -BOUND_TOLERANCE or z > box[i, UPPER] + BOUND_TOLERANCE:
                reached = ((0.0 if z < 0.0 else box[i, UPPER]) - u) / (z - u)
                if reached < share:
                    share, blocking = reached, i
        for i in range(n):
            if sets[TRIAL, i] == FREE:
                moved = unknowns[SOLUTION, i] + share * (unknowns[Z, i] - unknowns[SOLUTION, i])
                unknowns[SOLUTION, i] = min(max(moved, 0.0), box[i, UPPER])
        if blocking >= 0:
            counters[PIVOTS] += 1
            lower = unknowns[Z, blocking] < 0.0
            sets[TRIAL, blocking] = AT_LOWER if lower else AT_UPPER
            unknowns[SOLUTION, blocking] = 0.0 if lower else box[blocking, UPPER]
            continue
        if leaving < 0:
            return True
        counters[PIVOTS] += 1
        code = code_of(sets, TRIAL)
        for j in range(known):
            if minimisers[j] == code:
                counters[CYCLES] += 1
                return False
        minimisers[known] = code
        known += 1
        sets[TRIAL, leaving] = FREE
    return False
