"""Facets of the attainable wrenches: all that rotors can do, as a list of half-spaces.

With u the squared speeds over the largest ones, least <= u <= 1, the wrenches B u are a zonotope in
six dimensions: a sum of segments, one a rotor. Each of its faces of dimension 5 is spanned by the
generators (columns of B) orthogonal to the face's normal, so the normals are the vectors orthogonal
to five columns at a time. With c the centre of the zonotope and g_i = (1 - least_i) b_i,

    w is attainable   <=>   |n . (w - c)| <= s(n) = 1/2 sum_i |n . g_i|   for all normals n.

Any n whatsoever with its s(n) is a true bound: a normal that is off by rounding can only admit too
much, never forbid what is attainable. If the columns span fewer than six dimensions, the wrenches
also satisfy N (w - c) = 0; the rows of N, orthonormal, then stand in for the missing columns.

The facets depend on the rotors alone: neither on the arm, nor a payload, nor the centre of mass.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.analysis.atlas.exterior import normal, plane, volume
from fullam.analysis.atlas.machine import available, kernel, machine_code
from fullam.exceptions import VehicleError
from fullam.model.rotors import Rotors
from fullam.model.wrench_axes import RANK_TOLERANCE, full_scale

Array = NDArray[np.float64]

DEGENERATE = 1e-12
"""Columns that span less than this share of the product of their lengths span no face.

Rounding leaves 1e-16 where five columns are dependent; of those in between, better ones exist.
"""

FLAT = 1e-9
"""A generator is parallel to a face if its share along the normal is below this."""

MOST_ROTORS = 62
"""Faces tell their generators by the bits of an integer."""


@dataclass(frozen=True, eq=False)
class Facets:
    """The attainable wrenches of a set of rotors, as pairs of parallel facets.

    Attributes:
        normals: Shape (m, 6) [1/N, 1/(N m)]; of unit length in full-scale units.
        half_widths: s(n), shape (m,): how far either facet is from the centre, along the normal.
        center: c, shape (6,) [N, N m].
        equalities: N, shape (6 - rank, 6), in the units of `normals`; no row for rank 6.
        members: Which rotors' generators span each facet, shape (m, n) bool.
        matrix: B, shape (6, n) [N, N m].
        least: Lower bounds of u, shape (n,); the upper ones are 1, and 0 for failed rotors.
        scale: Full-scale wrench, shape (6,) [N, N m].
    """

    normals: Array
    half_widths: Array
    center: Array
    equalities: Array
    members: NDArray[np.bool_]
    matrix: Array
    least: Array
    scale: Array

    @property
    def rank(self) -> int:
        """Dimension of the set."""
        return 6 - len(self.equalities)

    @property
    def ties(self) -> NDArray[np.bool_]:
        """Facets with more generators than their dimension needs, shape (m,)."""
        found: NDArray[np.bool_] = self.members.sum(axis=1) > self.rank - 1
        return found

    def slacks(self, wrenches: ArrayLike) -> Array:
        """s - |n . (w - c)| for each facet, shape (..., m); negative: out of reach.

        Args:
            wrenches: wrench_A, shape (..., 6) [N, N m].
        """
        along = (np.asarray(wrenches, dtype=float) - self.center) @ self.normals.T
        found: Array = self.half_widths - np.abs(along)
        return found


def facets_of(rotors: Rotors, rank_tolerance: float = RANK_TOLERANCE) -> Facets:
    """The facets of what the rotors attain.

    Args:
        rotors: The rotors; a failed one (largest speed 0) adds nothing.
        rank_tolerance: Directions of the wrench with less than this share of the strongest one
            count as out of reach (see `RANK_TOLERANCE`).

    Raises:
        VehicleError: With more than `MOST_ROTORS` rotors.
    """
    if rotors.count > MOST_ROTORS:
        raise VehicleError(
            rotors.where, "rotors", f"are {rotors.count}", f"facets take up to {MOST_ROTORS}"
        )
    matrix, least, scale = rotors.normalized_coupling, rotors.least_shares, full_scale(rotors)
    generators = np.ascontiguousarray((matrix * (1.0 - least) / scale[:, None]).T)
    vectors, forced = with_complement(generators, rank_tolerance)
    rows, halves, masks = _list_faces(vectors, forced)
    members = (masks[:, None] >> np.arange(rotors.count)) & 1 > 0
    facets = Facets(
        normals=rows / scale,
        half_widths=halves,
        center=matrix @ (0.5 * (least + 1.0)),
        equalities=vectors[:forced] / scale,
        members=members,
        matrix=matrix,
        least=least,
        scale=scale,
    )
    for value in vars(facets).values():
        value.setflags(write=False)
    return facets


def with_complement(generators: Array, rank_tolerance: float) -> tuple[Array, int]:
    """Generators, shape (n, 6), preceded by an orthonormal basis of what they do not span.

    Returns:
        The vectors, shape (6 - rank + n, 6), and 6 - rank.
    """
    vectors = np.empty((6 + len(generators), 6))
    missing = int(machine_code(complement)(generators, rank_tolerance, vectors))
    vectors[missing : missing + len(generators)] = generators
    return vectors[: missing + len(generators)], missing


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


def _list_faces(vectors: Array, forced: int) -> tuple[Array, Array, NDArray[np.int64]]:
    """Normals in full-scale units, half widths and members (as bits) of all facets."""
    if forced == 6:
        return np.empty((0, 6)), np.empty(0), np.empty(0, dtype=np.int64)
    if not available():
        return _list_faces_by_numpy(vectors, forced)
    most = len(_fives(len(vectors), forced))
    rows, halves, masks = np.empty((most, 6)), np.empty(most), np.empty(most, dtype=np.int64)
    found = machine_code(list_faces)(vectors, forced, rows, halves, masks)
    return rows[:found], halves[:found], masks[:found]


@cache
def _fives(total: int, forced: int) -> NDArray[np.intp]:
    """All choices of five vectors with the first `forced` among them, shape (m, 5)."""
    rest = list(combinations(range(forced, total), 5 - forced))
    head = np.tile(np.arange(forced), (len(rest), 1))
    return np.hstack([head, np.array(rest, dtype=np.intp).reshape(len(rest), -1)]).astype(np.intp)


def _list_faces_by_numpy(vectors: Array, forced: int) -> tuple[Array, Array, NDArray[np.int64]]:
    """As `list_faces`, all choices at once."""
    chosen = _fives(len(vectors), forced)
    a, b, c, d, e = np.moveaxis(vectors[chosen], (1, 2), (0, 1))
    rows = np.stack(normal(plane(a, b), volume(plane(c, d), e)), axis=-1)
    lengths = np.linalg.norm(vectors, axis=1)
    size, spanned = np.linalg.norm(rows, axis=1), lengths[chosen].prod(axis=1)
    good = size > DEGENERATE * spanned
    rows, chosen = rows[good] / size[good, None], chosen[good]
    along = np.abs(rows @ vectors[forced:].T)
    halves = 0.5 * along.sum(axis=1)
    flat = along <= FLAT * lengths[forced:]
    flat[np.arange(len(chosen))[:, None], np.maximum(chosen - forced, 0)] |= chosen >= forced
    masks = flat.astype(np.int64) @ (1 << np.arange(flat.shape[1], dtype=np.int64))
    _, first = np.unique(masks, return_index=True)
    first.sort()
    return rows[first], halves[first], masks[first]


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
                            chosen = g == i or g == j or g == k or g == m or g == r
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
