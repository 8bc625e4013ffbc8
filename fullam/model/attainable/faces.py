"""The faces of a zonotope in six dimensions, one by one: kernels on flat arrays.

`facets` tells what they mean, and has the same by numpy for where there is no machine code.
"""

from __future__ import annotations

import numpy as np

from fullam.model.attainable.exterior import normal, plane, volume
from fullam.model.attainable.machine import kernel

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
def row_lengths(vectors):  # type: ignore[no-untyped-def]
    """Lengths of the rows, shape (n,)."""
    found = np.empty(len(vectors))
    for k in range(len(vectors)):
        square = 0.0
        for i in range(6):
            square += vectors[k, i] * vectors[k, i]
        found[k] = square**0.5
    return found


@kernel
def all_planes(vectors):  # type: ignore[no-untyped-def]
    """The planes of all pairs i < j, shape (n, n, 15)."""
    total = len(vectors)
    found = np.empty((total, total, 15))
    for i in range(total):
        for j in range(i + 1, total):
            p = plane(vectors[i], vectors[j])
            for m in range(15):
                found[i, j, m] = p[m]
    return found


@kernel
def support(vectors, lengths, forced, five, n):  # type: ignore[no-untyped-def]
    """Half width along a unit normal, the generators that are flat on it as bits, their number."""
    width, mask, members = 0.0, 0, 0
    for g in range(forced, len(vectors)):
        along = abs(
            n[0] * vectors[g, 0] + n[1] * vectors[g, 1] + n[2] * vectors[g, 2]
            + n[3] * vectors[g, 3] + n[4] * vectors[g, 4] + n[5] * vectors[g, 5]
        )  # fmt: skip
        width += along
        chosen = g == five[0] or g == five[1] or g == five[2] or g == five[3] or g == five[4]
        if chosen or along <= FLAT * lengths[g]:
            mask |= 1 << (g - forced)
            members += 1
    return 0.5 * width, mask, members


@kernel
def is_known(masks, count, mask):  # type: ignore[no-untyped-def]
    """Whether a mask is among the first `count`."""
    known = False
    for f in range(count):
        known |= masks[f] == mask
    return known


@kernel
def add_face(vectors, lengths, forced, five, n, faces, found):  # type: ignore[no-untyped-def]
    """Write the face of five vectors with the normal n, unless it is known; returns the count."""
    size = (
        n[0] * n[0] + n[1] * n[1] + n[2] * n[2] + n[3] * n[3] + n[4] * n[4] + n[5] * n[5]
    ) ** 0.5
    spanned = 1.0
    for m in range(5):
        spanned *= lengths[five[m]]
    if not size > DEGENERATE * spanned:
        return found
    scale = 1.0 / size
    unit = (n[0] * scale, n[1] * scale, n[2] * scale, n[3] * scale, n[4] * scale, n[5] * scale)
    half, mask, members = support(vectors, lengths, forced, five, unit)
    rows, halves, masks = faces
    # With more generators than needed, others of its choices give the same face.
    if members > 5 - forced and is_known(masks, found, mask):
        return found
    for m in range(6):
        rows[found, m] = unit[m]
    halves[found], masks[found] = half, mask
    return found + 1


@kernel
def list_faces(vectors, forced, rows, halves, masks):  # type: ignore[no-untyped-def]
    """Write every face once into `rows` (m, 6), `halves` and `masks` (m,); returns their number.

    Args:
        vectors: Shape (forced + n, 6); the first `forced` belong to every choice of five.
        forced: How many.
        rows: Unit normals.
        halves: Half widths.
        masks: Bit i tells that generator i lies in the face.
    """
    total, faces = len(vectors), (rows, halves, masks)
    lengths, planes = row_lengths(vectors), all_planes(vectors)
    ends = np.full(5, total)
    for m in range(forced):
        ends[m] = m + 1
    found = 0
    for i in range(ends[0]):
        for j in range(i + 1, ends[1]):
            for k in range(j + 1, ends[2]):
                t = volume(planes[i, j], vectors[k])
                for m in range(k + 1, ends[3]):
                    for r in range(m + 1, ends[4]):
                        n = normal(planes[m, r], t)
                        five = (i, j, k, m, r)
                        found = add_face(vectors, lengths, forced, five, n, faces, found)
    return found
