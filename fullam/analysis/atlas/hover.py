"""The rotor speeds that hold a wrench with the least effort."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from fullam.analysis.atlas.facets import Facets

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
    bounds = list(zip(facets.least, top, strict=True))
    found = linprog(np.ones(len(top)), A_eq=B, b_eq=w, bounds=bounds)
    return np.array(found.x) if found.status == 0 else None
