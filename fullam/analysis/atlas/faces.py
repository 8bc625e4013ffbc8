"""The faces of a zonotope in six dimensions, one by one: kernels on flat arrays.

`facets` tells what they mean, and has the same by numpy for where there is no machine code.
"""

from __future__ import annotations

import numpy as np

from fullam.analysis.atlas.exterior import normal, plane, volume
from fullam.analysis.atlas.machine import kernel

DEGENERATE = 1e-12
"""Columns that span less than this share of the product of their lengths span no face.

Rounding leaves 1e-16 where five columns are dependent; of those in between, better ones exist.
"""

FLAT = 1e-9
"""A generator is parallel to a face if its share along the normal is below this."""


@kernel
def longest(rows, low, high):  # type: ignore[no-untyped-def]
    """Index (-1 if all are 0) and length of the longest of the rows low to high."""
    best, most = -1, 0.0
    for k in range(low, high):
        square = 0.0
        for i in range(6):
            square += rows[k, i] * rows[k, i]
        if square > most:
            best, most = k, square
    return best, most**0.5


@kernel
def remove(rows, axis):  # type: ignore[no-untyped-def]
    """Take the part along a unit vector out of every row; twice, so that rounding goes too."""
    for _ in range(2):
        for k in range(len(rows)):
            along = 0.0
            for i in range(6):
                along += axis[i] * rows[k, i]
            for i in range(6):
                rows[k, i] -= along * axis[i]


@kernel
def complement(generators, tolerance, out):  # type: ignore[no-untyped-def]
    """Fill the first rows of `out` with an orthonormal basis of what is not spanned.

    Pivoted Gram-Schmidt: the longest remainder first, until none is longer than the tolerance times
    the longest generator; then the same with the six unit vectors.

    Returns:
        The number of rows, 6 - rank.
    """
    count = len(generators)
    rest = np.zeros((count + 6, 6))
    rest[:count] = generators
    for i in range(6):
        rest[count + i, i] = 1.0
    rank = 0
    best, length = longest(rest, 0, count)
    shortest = tolerance * length
    while rank < 6 and best >= 0 and length > shortest:
        remove(rest, rest[best] / length)
        rank += 1
        best, length = longest(rest, 0, count)
    for row in range(6 - rank):
        best, length = longest(rest, count, count + 6)
        out[row] = rest[best] / length
        remove(rest, out[row])
    return 6 - rank


@kernel
def list_faces(vectors, forced, rows, halves, masks):  # type: ignore[no-untyped-def]
    """Write every facet once into `rows` (m, 6), `halves` and `masks` (m,); returns their number.

    Args:
        vectors: Shape (forced + n, 6); the first `forced` belong to every choice of five.
        forced: How many.
        rows: Unit normals.
        halves: Half widths.
        masks: Bit i tells that generator i lies in the facet.
    """
    total = len(vectors)
    lengths = np.empty(total)
    for k in range(total):
        square = 0.0
        for i in range(6):
            square += vectors[k, i] * vectors[k, i]
        lengths[k] = square**0.5
    planes = np.empty((total, total, 15))
    for i in range(total):
        for j in range(i + 1, total):
            p = plane(vectors[i], vectors[j])
            for m in range(15):
                planes[i, j, m] = p[m]
    needed = 5 - forced
    found = 0
    for i in range(0, 1 if forced > 0 else total):
        for j in range(i + 1, 2 if forced > 1 else total):
            if lengths[i] * lengths[j] == 0.0:
                continue
            for k in range(j + 1, 3 if forced > 2 else total):
                t = volume(planes[i, j], vectors[k])
                three = lengths[i] * lengths[j] * lengths[k]
                if three == 0.0:
                    continue
                for m in range(k + 1, 4 if forced > 3 else total):
                    four = three * lengths[m]
                    for r in range(m + 1, 5 if forced > 4 else total):
                        n = normal(planes[m, r], t)
                        size = (
                            n[0] * n[0] + n[1] * n[1] + n[2] * n[2]
                            + n[3] * n[3] + n[4] * n[4] + n[5] * n[5]
                        ) ** 0.5  # fmt: skip
                        if not size > DEGENERATE * four * lengths[r]:
                            continue
                        scale = 1.0 / size
                        n0, n1, n2 = n[0] * scale, n[1] * scale, n[2] * scale
                        n3, n4, n5 = n[3] * scale, n[4] * scale, n[5] * scale
                        width, mask, members = 0.0, 0, 0
                        for g in range(forced, total):
                            along = abs(
                                n0 * vectors[g, 0] + n1 * vectors[g, 1] + n2 * vectors[g, 2]
                                + n3 * vectors[g, 3] + n4 * vectors[g, 4] + n5 * vectors[g, 5]
                            )  # fmt: skip
                            width += along
                            chosen = g in (i, j, k, m, r)
                            if chosen or along <= FLAT * lengths[g]:
                                mask |= 1 << (g - forced)
                                members += 1
                        known = False
                        if members > needed:  # others of its generators give the same facet
                            for f in range(found):
                                if masks[f] == mask:
                                    known = True
                                    break
                        if known:
                            continue
                        rows[found, 0], rows[found, 1], rows[found, 2] = n0, n1, n2
                        rows[found, 3], rows[found, 4], rows[found, 5] = n3, n4, n5
                        halves[found] = 0.5 * width
                        masks[found] = mask
                        found += 1
    return found
