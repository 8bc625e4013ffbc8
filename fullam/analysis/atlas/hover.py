"""What it takes to hold a wrench: rotor speeds of least effort, and the least sum of thrusts."""

from __future__ import annotations

from functools import cache
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.atlas.rays import attained
from fullam.model.attainable.facets import Facets

Array = NDArray[np.float64]

ITERATIONS = 50
"""Newton steps tried; a few do where the wrench is well within reach."""

ACCURACY = 1e-10
"""Error of the wrench as a share of the full scale."""


def least_effort(facets: Facets, wrench: Array) -> Array | None:
    """The u within its bounds with B u = w and the least |u|^2, shape (n,); None if there is none.

    The dual of this projection has no constraint: u = clip(B' y) with y such that B clip(B' y) = w,
    found by Newton's method. On the rim of what is within reach, where that stalls, any feasible u
    serves (a linear program).
    """
    B, w = facets.matrix / facets.scale[:, None], wrench / facets.scale
    top = (np.linalg.norm(B, axis=0) > 0.0).astype(float)
    if not top.any():
        return None
    y = np.linalg.lstsq(B @ B.T, w, rcond=1e-8)[0]
    for _ in range(ITERATIONS):
        raw = B.T @ y
        u = np.clip(raw, facets.least, top)
        error = w - B @ u
        if np.abs(error).max() <= ACCURACY:
            return u
        free = B[:, (raw > facets.least) & (raw < top)]
        if free.shape[1] == 0:
            break
        y = y + np.linalg.lstsq(free @ free.T, error, rcond=1e-8)[0]
    from scipy.optimize import linprog

    bounds = list(zip(facets.least, top, strict=True))
    found = linprog(np.ones(len(top)), A_eq=B, b_eq=w, bounds=bounds)
    return np.array(found.x) if found.status == 0 else None


FEW = 1000
"""Up to so many choices of six rotors are tried one by one; beyond, a linear program is faster."""

SINGULAR = 1e-9
"""Six columns whose determinant is below this share of the product of their lengths are skipped."""


def least_total_thrust(facets: Facets, thrusts: Array, wrench: Array) -> float | None:
    """Least sum of the thrusts that hold a wrench [N]; None if none do.

    min f . u  with  B u = w, least <= u <= 1. By duality it is the largest of

        y . w - sum_i max over u_i of u_i (b_i . y - f_i)

    over all y, and the best y is one with b_i . y = f_i for six rotors: all choices are tried.

    Args:
        facets: Of the rotors.
        thrusts: Largest thrusts f, shape (n,) [N].
        wrench: wrench_A, shape (6,) [N, N m].
    """
    B, w = facets.matrix / facets.scale[:, None], wrench / facets.scale
    lengths = np.linalg.norm(B, axis=0)
    working = np.flatnonzero(lengths > 0.0)
    if facets.rank < 6 or comb(len(working), 6) > FEW:
        from scipy.optimize import linprog

        bounds = list(zip(facets.least, (lengths > 0.0).astype(float), strict=True))
        found = linprog(thrusts, A_eq=B, b_eq=w, bounds=bounds)
        return float(found.fun) if found.status == 0 else None
    if not attained(facets, wrench):
        return None
    chosen = working[_sixes(len(working))]
    blocks = np.moveaxis(B[:, chosen], 0, -1)
    sizes = np.linalg.det(blocks)
    good = np.abs(sizes) > SINGULAR * lengths[chosen].prod(axis=1)
    y = np.linalg.solve(blocks[good], thrusts[chosen[good]][..., None])[..., 0]
    gains = y @ B[:, working] - thrusts[working]
    least = facets.least[working]
    return float(
        (y @ w - np.maximum(gains, 0.0).sum(axis=1) - np.minimum(gains, 0.0) @ least).max()
    )


@cache
def _sixes(count: int) -> NDArray[np.intp]:
    """All choices of six out of so many, shape (m, 6)."""
    return np.array(list(combinations(range(count), 6)), dtype=np.intp)
