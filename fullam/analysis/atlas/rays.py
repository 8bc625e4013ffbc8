"""How far one can go from a wrench in some direction, and how far it is to the nearest bound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.model.attainable.facets import Facets
from fullam.model.wrench_axes import RANK_TOLERANCE

Array = NDArray[np.float64]

ROUNDING = 1e-11
"""Share of the full scale by which a wrench may miss a bound and still count as on it."""

OUTSIDE = RANK_TOLERANCE
"""Share of a wrench that may point where the rotors have no authority, and count as none.

It is what parallel rotors read from a URDF miss parallelism by."""


def attained(facets: Facets, wrenches: ArrayLike) -> NDArray[np.bool_]:
    """Whether wrenches are within reach, shape (...).

    Args:
        facets: Of the rotors.
        wrenches: wrench_A, shape (..., 6) [N, N m].
    """
    given = np.asarray(wrenches, dtype=float)
    good = np.all(facets.slacks(given) >= -ROUNDING, axis=-1)
    found: NDArray[np.bool_] = good & ~_leaves(facets, given - facets.center, given)
    return found


def _leaves(facets: Facets, offsets: Array, wrenches: Array) -> NDArray[np.bool_]:
    """Whether offsets point out of the span of the rotors' wrenches, by the wrenches' own size."""
    outside = np.abs(offsets @ facets.equalities.T)
    size = np.linalg.norm(wrenches / facets.scale, axis=-1, keepdims=True)
    found: NDArray[np.bool_] = np.any(outside > OUTSIDE * size + ROUNDING, axis=-1)
    return found


def reach(
    facets: Facets, start: ArrayLike, directions: ArrayLike
) -> tuple[Array, NDArray[np.intp]]:
    """Largest t with start + t direction within reach, for each direction.

    t = min over facets of (s - sign(n . d) n . (w - c)) / |n . d|.

    Args:
        facets: Of the rotors.
        start: wrench_A, shape (6,) [N, N m].
        directions: Shape (..., 6).

    Returns:
        t, shape (...), NaN if the start itself is out of reach; and the facet that ends it, -1 if
        the direction leaves the span of the rotors' wrenches.
    """
    w, d = np.asarray(start, dtype=float), np.asarray(directions, dtype=float)
    found = np.full(d.shape[:-1], np.nan)
    last = np.full(d.shape[:-1], -1, dtype=np.intp)
    if not attained(facets, w):
        return found, last
    climb = d @ facets.normals.T
    size = np.linalg.norm(d / facets.scale, axis=-1, keepdims=True)
    moving = np.abs(climb) > ROUNDING * size
    slack = facets.half_widths - np.sign(climb) * ((w - facets.center) @ facets.normals.T)
    steps = np.full(climb.shape, np.inf)
    np.divide(np.maximum(slack, 0.0), np.abs(climb), out=steps, where=moving)
    if facets.rank > 0:
        last[...] = steps.argmin(axis=-1)
        found[...] = steps.min(axis=-1)
    stuck = _leaves(facets, d, d)
    found[stuck], last[stuck] = 0.0, -1
    return found, last


def multiples(facets: Facets, wrench: ArrayLike) -> tuple[float, float] | None:
    """Least and largest t with t wrench within reach; None if there is none.

    The least is 0 unless rotors have a least speed.
    """
    d = np.asarray(wrench, dtype=float)
    if _leaves(facets, d, d):
        d = np.zeros(6)
    climb, middle = facets.normals @ d, facets.normals @ facets.center
    size = float(np.linalg.norm(d / facets.scale))
    still = np.abs(climb) <= ROUNDING * size
    if np.any(np.abs(middle[still]) > facets.half_widths[still] + ROUNDING):
        return None
    ends = np.sort(
        (middle + np.outer([-1.0, 1.0], facets.half_widths))[:, ~still] / climb[~still], 0
    )
    if ends.size == 0:
        return 0.0, 0.0
    low, high = float(ends[0].max()), float(ends[1].min())
    outside = bool(_leaves(facets, low * d - facets.center, low * d)) if facets.rank < 6 else False
    if outside or min(high, high - low) < -ROUNDING:
        return None
    return max(low, 0.0), max(low, high, 0.0)


@dataclass(frozen=True, eq=False)
class Margin:
    """The largest ball around a wrench that stays within reach.

    Attributes:
        value: Its radius [N]: any force f and moment tau with |f|^2 + |tau / length|^2 <= value^2
            can be added. Negative: how far the wrench is outside of the farthest bound. 0 where the
            rotors cannot produce all six axes.
        length: What turns moments into forces [m].
        facet: The bound that it touches; -1 if the rotors cannot produce all six axes.
        side: +1 or -1: which of the pair of facets.
        at_most: Rotors that run at their largest speed where the ball touches.
        at_least: Rotors that run at their least speed, or stand still, there.
    """

    value: float
    length: float
    facet: int
    side: int
    at_most: tuple[int, ...]
    at_least: tuple[int, ...]


def margin(facets: Facets, wrench: ArrayLike, length: float) -> Margin:
    """Largest ball (force, moment / length) around a wrench within reach.

    The ball's support in the direction n is sqrt(|n_f|^2 + length^2 |n_tau|^2), so its radius is
    the least slack over it.

    Args:
        facets: Of the rotors.
        wrench: wrench_A, shape (6,) [N, N m].
        length: What turns moments into forces [m].
    """
    w = np.asarray(wrench, dtype=float)
    along = facets.normals @ (w - facets.center)
    weights = np.array([1.0, 1.0, 1.0, length, length, length])
    radii = (facets.half_widths - np.abs(along)) / np.linalg.norm(facets.normals * weights, axis=1)
    if facets.rank < 6:
        outside = not attained(facets, w)
        worst = float(min(radii.min(initial=0.0), 0.0))
        missing = float(np.linalg.norm(facets.equalities @ (w - facets.center)) * facets.scale[0])
        return Margin(min(worst, -missing) if outside else 0.0, length, -1, 1, (), ())
    facet = int(radii.argmin())
    side = 1 if along[facet] >= 0.0 else -1
    high, low = pinned(facets, facet, side)
    return Margin(float(radii[facet]), length, facet, side, high, low)


def pinned(facets: Facets, facet: int, side: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Rotors at their largest and at their least speed all over a facet; the others are free."""
    climb = side * (facets.normals[facet] @ facets.matrix)
    held = ~facets.members[facet]
    high, low = np.flatnonzero(held & (climb > 0.0)), np.flatnonzero(held & (climb < 0.0))
    return tuple(high.tolist()), tuple(low.tolist())
