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

from fullam.exceptions import VehicleError
from fullam.model.attainable.exterior import normal, plane, volume
from fullam.model.attainable.faces import DEGENERATE, FLAT, complement, list_faces
from fullam.model.attainable.machine import available, machine_code
from fullam.model.rotors import Rotors
from fullam.model.wrench_axes import RANK_TOLERANCE, full_scale

Array = NDArray[np.float64]

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
        """Slack s - |n . (w - c)| for each facet, shape (..., m); negative: out of reach.

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
    return facets_of_columns(
        rotors.normalized_coupling, rotors.least_shares, full_scale(rotors), rank_tolerance
    )


def facets_of_columns(
    matrix: Array, least: Array, scale: Array, rank_tolerance: float = RANK_TOLERANCE
) -> Facets:
    """As `facets_of`, from the coupling matrix B (6, n), the least shares (n,) and the scale (6,).

    A column of zeros is a failed rotor.
    """
    generators = np.ascontiguousarray((matrix * (1.0 - least) / scale[:, None]).T)
    vectors, forced = with_complement(generators, rank_tolerance)
    rows, halves, masks = _list_faces(vectors, forced)
    members = (masks[:, None] >> np.arange(matrix.shape[1])) & 1 > 0
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
