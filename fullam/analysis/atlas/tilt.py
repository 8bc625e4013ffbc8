"""Hover tilt: how far, and where to, a vehicle can lean and still hold its weight.

Holding still with the up vector u (seen from {A}) takes the wrench m g [u; c x u] + extra. A facet
n . (w - c_0) <= s therefore allows  q . u <= d  with  q = m g (n_f + n_tau x c)  and
d = s - n . (extra - c_0): all attitudes but a spherical cap about q. Along an azimuth

    u = (sin t cos a, sin t sin a, cos t),    q_z cos t + q_h sin t <= d,

a quadratic in x = tan(t / 2), and the worst azimuth of a cap is the one towards it,

    t = angle(q, e_z) - arccos(d / |q|).

The tilt along an azimuth is the FIRST exit from level; beyond it there may be attitudes that can be
held again (`tilt_intervals`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.analysis.atlas.loads import Load
from fullam.analysis.atlas.rays import OUTSIDE, ROUNDING, attained
from fullam.model.attainable.facets import Facets

Array = NDArray[np.float64]

DIRECTIONS = 360
"""Azimuths at which the facets that matter for the best one are looked for."""


@dataclass(frozen=True, eq=False)
class AttitudeBounds:
    """What the facets say of attitudes: directions . u <= limits.

    Attributes:
        directions: q, shape (2 m, 3): first one side of all facets, then the other.
        limits: d, shape (2 m,).
        locked: What leaving level asks for that the rotors cannot give at all, shape (k, 2); no
            row for rotors that produce all six axes, and rows of zeros if it does not matter.
        level: Whether the vehicle can hover level.
    """

    directions: Array
    limits: Array
    locked: Array
    level: bool


def attitude_bounds(facets: Facets, load: Load) -> AttitudeBounds:
    """The facets as bounds of the up vector."""
    turn = load.map
    q = facets.normals @ turn
    offset = facets.normals @ (load.extra - facets.center)
    locked = facets.equalities @ turn[:, :2]
    locked[np.abs(locked) <= OUTSIDE * np.linalg.norm(turn / facets.scale[:, None], 2)] = 0.0
    return AttitudeBounds(
        directions=np.vstack([q, -q]),
        limits=np.concatenate([facets.half_widths - offset, facets.half_widths + offset]),
        locked=locked,
        level=bool(attained(facets, load.wrench())),
    )


def half_tangents(q_z: Array, q_h: Array, d: Array) -> Array:
    """tan(t / 2) at the first t > 0 with q_z cos t + q_h sin t = d, which holds at 0; inf if none.

    The roots of (d + q_z) x^2 - 2 q_h x + (d - q_z) = 0, each in the form that cancels nothing.
    """
    rise = np.maximum(d - q_z, 0.0)
    square = q_h * q_h + q_z * q_z - d * d
    root = np.sqrt(np.maximum(square, 0.0))
    found = np.full(np.broadcast(q_h, rise).shape, np.inf)
    towards = (q_h > 0.0) & (square >= 0.0)
    np.divide(rise, q_h + root, out=found, where=towards)
    beyond = (q_h <= 0.0) & (d + q_z < 0.0)
    np.divide(q_h - root, d + q_z, out=found, where=beyond)
    return found


def tilt_rose(bounds: AttitudeBounds, azimuths: ArrayLike) -> tuple[Array, NDArray[np.intp]]:
    """First exits from level along azimuths of {A} [rad].

    Args:
        bounds: Of the vehicle.
        azimuths: Where the up vector leans to, seen from {A}, shape (k,) [rad].

    Returns:
        Tilts, shape (k,) [rad]: pi if every attitude on the way can be held, NaN if not even level
        can; and the row of `bounds` that ends each, -1 if none does.
    """
    a = np.atleast_1d(np.asarray(azimuths, dtype=float))
    last = np.full(a.shape, -1, dtype=np.intp)
    if not bounds.level:
        return np.full(a.shape, np.nan), last
    heading = np.stack([np.cos(a), np.sin(a)])
    q_h = bounds.directions[:, :2] @ heading
    x = half_tangents(bounds.directions[:, 2, None], q_h, bounds.limits[:, None])
    tilts = np.full(a.shape, np.pi)
    if len(x):
        last = np.where(np.isfinite(x.min(axis=0)), x.argmin(axis=0), -1)
        tilts = 2.0 * np.arctan(x.min(axis=0))
    stuck = np.any(np.abs(bounds.locked @ heading) > ROUNDING, axis=0)
    tilts[stuck], last[stuck] = 0.0, -1
    return tilts, last


def worst_tilt(bounds: AttitudeBounds) -> tuple[float, float, int] | None:
    """The least first exit over all azimuths, exactly; None if the vehicle cannot hover level.

    Returns:
        Tilt [rad], its azimuth [rad], and the row of `bounds` (-1: the rotors lack an axis, or
        every attitude can be held).
    """
    if not bounds.level:
        return None
    if np.any(bounds.locked):
        row = bounds.locked[np.linalg.norm(bounds.locked, axis=1).argmax()]
        return 0.0, float(np.arctan2(row[1], row[0])), -1
    gaps = cap_distances(bounds)
    if not np.isfinite(gaps.min(initial=np.inf)):
        return float(np.pi), 0.0, -1
    row = int(gaps.argmin())
    x, y = bounds.directions[row, :2]
    return float(max(gaps[row], 0.0)), float(np.arctan2(y, x)), row


def cap_distances(bounds: AttitudeBounds) -> Array:
    """Angle between e_z and the cap that each bound forbids, shape (2 m,); inf for an empty cap."""
    q, d = bounds.directions, bounds.limits
    size = np.linalg.norm(q, axis=1)
    found = np.full(size.shape, np.inf)
    cut = d < size
    away = np.arctan2(np.hypot(q[cut, 0], q[cut, 1]), q[cut, 2])
    found[cut] = away - np.arccos(np.maximum(d[cut] / size[cut], -1.0))
    return found


def best_tilt(bounds: AttitudeBounds) -> tuple[float, float] | None:
    """The largest first exit over all azimuths and its azimuth [rad]; None if it cannot hover.

    The first exit, as a function of the azimuth, has its peaks where two caps meet, at the edge of
    a cap seen from level, or opposite to a cap's centre. These azimuths are in closed form; they
    are tried for all caps that end the rose at one of `DIRECTIONS` azimuths.
    """
    if not bounds.level:
        return None
    azimuths = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
    if np.any(bounds.locked):
        _, _, rows = np.linalg.svd(bounds.locked)
        free = rows[-1]
        azimuths = np.arctan2(free[1], free[0]) + np.array([0.0, np.pi])
        if np.abs(bounds.locked @ free).max() > ROUNDING:  # locked in both directions
            return 0.0, float(azimuths[0])
        locked = AttitudeBounds(bounds.directions, bounds.limits, np.zeros((0, 2)), True)
        tilts, _ = tilt_rose(locked, azimuths)
        return float(tilts.max()), float(azimuths[tilts.argmax()])
    tilts, last = tilt_rose(bounds, azimuths)
    rows = np.unique(last[last >= 0])
    candidates = np.concatenate([azimuths, _peaks(bounds.directions[rows], bounds.limits[rows])])
    tilts, _ = tilt_rose(bounds, candidates)
    return float(tilts.max()), float(candidates[tilts.argmax()])


def _peaks(q: Array, d: Array) -> Array:
    """Azimuths at which caps meet, end, or are farthest."""
    center = np.arctan2(q[:, 1], q[:, 0])
    across = np.hypot(q[:, 0], q[:, 1])
    # Seen from level, a cap ends where q_h^2 = d^2 - q_z^2.
    edge = np.sqrt(np.maximum(d * d - q[:, 2] ** 2, 0.0)) / np.maximum(across, 1e-300)
    width = np.arccos(np.clip(edge, 0.0, 1.0)) * (1.0 - 1e-12)
    i, j = np.triu_indices(len(q), 1)
    line = np.cross(q[i], q[j])
    square = np.sum(line * line, axis=1)
    solid = square > (ROUNDING * np.linalg.norm(q[i], axis=1) * np.linalg.norm(q[j], axis=1)) ** 2
    i, j, line, square = i[solid], j[solid], line[solid], square[solid, None]
    # u = the point of both planes nearest to 0, plus or minus a step along their common line.
    base = np.cross(d[i, None] * q[j] - d[j, None] * q[i], line) / square
    step = np.sqrt(np.maximum(1.0 - np.sum(base * base, axis=1, keepdims=True), 0.0) / square)
    points = np.vstack([base + step * line, base - step * line])
    meet = np.arctan2(points[:, 1], points[:, 0])
    return np.concatenate([center, center + np.pi, center + width, center - width, meet])


def tilt_intervals(bounds: AttitudeBounds, azimuth: float) -> list[tuple[float, float]]:
    """All tilts along an azimuth [rad] that can be held, as intervals within [0, pi] [rad].

    The first one starts at 0 if the vehicle can hover level. Where the rotors lack an axis, only
    level itself is told.
    """
    heading = np.array([np.cos(azimuth), np.sin(azimuth)])
    if np.any(np.abs(bounds.locked @ heading) > ROUNDING):
        return [(0.0, 0.0)] if bounds.level else []
    q_h, q_z, d = bounds.directions[:, :2] @ heading, bounds.directions[:, 2], bounds.limits
    size = np.hypot(q_h, q_z)
    cut = d < size
    middle = np.arctan2(q_h[cut], q_z[cut])
    half = np.arccos(np.maximum(d[cut] / np.maximum(size[cut], 1e-300), -1.0))
    starts = (middle - half + 2.0 * np.pi * np.array([[-1.0], [0.0], [1.0]])).ravel()
    ends = (middle + half + 2.0 * np.pi * np.array([[-1.0], [0.0], [1.0]])).ravel()
    order = np.argsort(starts)
    allowed, low = [], 0.0
    for start, end in zip(starts[order], ends[order], strict=True):
        if end <= 0.0 or start >= np.pi:
            continue
        if start >= low - ROUNDING and (start > low or (low == 0.0 and bounds.level)):
            allowed.append((low, max(float(start), low)))
        low = max(low, float(end))
    if low <= np.pi:
        allowed.append((low, float(np.pi)))
    return allowed
