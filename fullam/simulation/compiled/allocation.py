"""Allocation within rotor bounds: exact map, warm active set, flagged clip.

`fullam.control.allocation` is the reference. ProxQP is no part of this: an answer that its KKT
residual does not confirm is clipped, flagged and counted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.control.allocation import KKT_TOLERANCE
from fullam.control.box_qp import FREE
from fullam.simulation.compiled.box_qp import (
    ACTIVE_SET,
    CLIP,
    EXACT,
    GAIN,
    OFFSET,
    PRIOR,
    RESIDUAL,
    SOLUTION,
    STATUS,
    TOLERANCE_SQUARED,
    UNCONFIRMED,
    UPPER,
    WANTED,
    B,
    U,
    inner,
    kkt_residual,
    solve_box,
    weighted_residual,
)
from fullam.simulation.compiled.jit import compiled, merged

Array = NDArray[np.float64]


class Allotment(NamedTuple):
    """The allocation problem, its table of maps and its memory.

    Attributes:
        box: Shape (n, BOX_WIDTH).
        scales: Shape (SCALES,).
        keys: Code of the active set in each slot of the table, -1 when empty, and how many there
            are, shape (slots + 1,).
        maps: Map of each slot, shape (slots (n + 3), 7): minimiser or multipliers, z = gain w +
            offset, and below them B_f u - F in the same way, as in `fullam.control.moment_about`.
        unknowns: Shape (4, n).
        sixes: Shape (2, 6).
        sets: Shape (2, n).
        minimisers: Codes of the sets whose minimiser a search has reached, shape (limit,).
        counters: Shape (N_COUNTERS,).
    """

    box: Array
    scales: Array
    keys: NDArray[np.int64]
    maps: Array
    unknowns: Array
    sixes: Array
    sets: NDArray[np.int64]
    minimisers: NDArray[np.int64]
    counters: NDArray[np.int64]


@merged
def exact(box, unknowns, sixes, counters):
    """The first rung alone: True if row U of `unknowns` holds the exact answer."""
    within = True
    for i in range(box.shape[0]):
        u = inner(box, i, GAIN, sixes, WANTED) + box[i, OFFSET]
        unknowns[U, i] = u
        within = within and 0.0 <= u <= 1.0
    if within:
        counters[EXACT] += 1
    return within


@compiled
def confirm(box, scales, unknowns, sixes, sets, counters, settled):
    """Believe the answer of a search if its KKT residual agrees, else clip; into row U.

    An answer that is not believed is no start for the next search either.

    Returns:
        Whether bounds cost wrench, and whether the answer was believed.
    """
    if settled:
        error = kkt_residual(box, scales, unknowns, SOLUTION, sixes)
        settled = error <= KKT_TOLERANCE
    if settled:
        for i in range(box.shape[0]):
            unknowns[U, i] = unknowns[SOLUTION, i]
        counters[ACTIVE_SET] += 1
    else:
        for i in range(box.shape[0]):
            u = inner(box, i, GAIN, sixes, WANTED) + box[i, OFFSET]
            unknowns[U, i] = min(max(u, 0.0), box[i, UPPER])
            unknowns[SOLUTION, i] = box[i, PRIOR]
            sets[STATUS, i] = FREE
        weighted_residual(box, scales, unknowns, U, sixes)
        counters[UNCONFIRMED] += 1
        counters[CLIP] += 1
    square = 0.0
    for j in range(6):
        square += sixes[RESIDUAL, j] * sixes[RESIDUAL, j]
    return not square <= scales[TOLERANCE_SQUARED], settled


@compiled
def allocate(box, scales, keys, maps, unknowns, sixes, sets, minimisers, counters):
    """Allocate the finite wrench in row WANTED of `sixes`; True if bounds cost wrench.

    The answer is row U of `unknowns`: squared speeds as shares of the largest.
    """
    if exact(box, unknowns, sixes, counters):
        return False
    settled = solve_box(box, scales, keys, maps, unknowns, sixes, sets, minimisers, counters)
    return confirm(box, scales, unknowns, sixes, sets, counters, settled)[0]


@merged
def achieved(box, unknowns):
    """Force and moment of the allocated speeds in {A} axes."""
    a0 = a1 = a2 = a3 = a4 = a5 = 0.0
    for i in range(box.shape[0]):
        u = unknowns[U, i]
        a0 += box[i, B] * u
        a1 += box[i, B + 1] * u
        a2 += box[i, B + 2] * u
        a3 += box[i, B + 3] * u
        a4 += box[i, B + 4] * u
        a5 += box[i, B + 5] * u
    return (a0, a1, a2), (a3, a4, a5)
