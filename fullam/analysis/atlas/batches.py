"""Hover tilt for many arm poses at once: the facets are the same, only the centre of mass moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.analysis.atlas.loads import Load
from fullam.analysis.atlas.rays import ROUNDING
from fullam.analysis.atlas.tilt import (
    attitude_bounds,
    cap_distances,
    half_tangents,
    tilt_rose,
    worst_tilt,
)
from fullam.model.attainable.facets import Facets
from fullam.model.attainable.machine import available, kernel, machine_code

Array = NDArray[np.float64]

CHUNK = 4_000_000
"""Numbers held at once without machine code: azimuths times facets times poses."""


def tilt_roses(facets: Facets, load: Load, centers: ArrayLike, azimuths: ArrayLike) -> Array:
    """First exits from level for many centres of mass and azimuths, shape (p, k) [rad].

    Args:
        facets: Of the rotors.
        load: Mass, gravity and extra wrench; its centre of mass is not used.
        centers: Centres of mass in {A}, shape (p, 3) [m] (see `centers_of`).
        azimuths: Shape (k,) [rad].

    Returns:
        As `tilt_rose`: pi if there is no exit, NaN where the vehicle cannot hover level.
    """
    c, a = np.atleast_2d(np.asarray(centers, dtype=float)), np.atleast_1d(azimuths).astype(float)
    if facets.rank < 6:
        return np.array(
            [tilt_rose(attitude_bounds(facets, replace(load, center=row)), a)[0] for row in c]
        ).reshape(len(c), len(a))
    offsets = facets.normals @ (load.extra - facets.center)
    out = np.empty((len(c), len(a)))
    if available():
        normals = np.ascontiguousarray(facets.normals)
        machine_code(fill_roses)(
            normals, facets.half_widths, offsets, load.weight, c, np.cos(a), np.sin(a), out
        )
        return out
    heading = np.stack([np.cos(a), np.sin(a)])
    step = max(1, CHUNK // (2 * len(offsets) * len(a)))
    for first in range(0, len(c), step):
        q, d = _bounds(facets, load, c[first : first + step], offsets)
        x = half_tangents(q[:, :, 2, None], q[:, :, :2] @ heading, d[None, :, None]).min(axis=1)
        out[first : first + step] = 2.0 * np.arctan(x)
        out[first : first + step][np.any(q[:, :, 2] > d + ROUNDING, axis=1)] = np.nan
    return out


def worst_tilts(facets: Facets, load: Load, centers: ArrayLike) -> Array:
    """Least first exit over all azimuths, exactly, for many centres of mass, shape (p,) [rad].

    Arguments as in `tilt_roses`; NaN where the vehicle cannot hover level.
    """
    c = np.atleast_2d(np.asarray(centers, dtype=float))
    if facets.rank < 6:
        found = [worst_tilt(attitude_bounds(facets, replace(load, center=row))) for row in c]
        return np.array([np.nan if each is None else each[0] for each in found])
    offsets = facets.normals @ (load.extra - facets.center)
    out = np.empty(len(c))
    if available():
        normals = np.ascontiguousarray(facets.normals)
        machine_code(fill_worst)(normals, facets.half_widths, offsets, load.weight, c, out)
        return out
    for row, center in enumerate(c):
        bounds = attitude_bounds(facets, replace(load, center=center))
        least = min(float(cap_distances(bounds).min(initial=np.pi)), np.pi)
        out[row] = max(least, 0.0) if bounds.level else np.nan
    return out


def _bounds(facets: Facets, load: Load, centers: Array, offsets: Array) -> tuple[Array, Array]:
    """As `attitude_bounds`: q, shape (p, 2 m, 3), and d, shape (2 m,)."""
    force, moment = facets.normals[:, :3], facets.normals[:, 3:]
    q = load.weight * (force + np.cross(moment, centers[:, None, :]))
    widths = facets.half_widths
    return np.concatenate([q, -q], axis=1), np.concatenate([widths - offsets, widths + offsets])


@kernel
def half_tangent(q_z, q_h, d):  # type: ignore[no-untyped-def]
    """`half_tangents` of three numbers."""
    square = q_h * q_h + q_z * q_z - d * d
    if q_h > 0.0:
        if square < 0.0:
            return np.inf
        return max(d - q_z, 0.0) / (q_h + square**0.5)
    if d + q_z < 0.0:
        return (q_h - max(square, 0.0) ** 0.5) / (d + q_z)
    return np.inf


@kernel
def fill_roses(normals, widths, offsets, weight, centers, cosines, sines, out):  # type: ignore[no-untyped-def]
    """First exits of every centre of mass along every azimuth, into `out` (p, k)."""
    count = len(widths)
    q = np.empty((count, 3))
    for row in range(len(centers)):
        x, y, z = centers[row, 0], centers[row, 1], centers[row, 2]
        level = True
        for f in range(count):
            n = normals[f]
            q[f, 0] = weight * (n[0] + n[4] * z - n[5] * y)
            q[f, 1] = weight * (n[1] + n[5] * x - n[3] * z)
            q[f, 2] = weight * (n[2] + n[3] * y - n[4] * x)
            if abs(q[f, 2] + offsets[f]) > widths[f] + ROUNDING:
                level = False
        for k in range(len(cosines)):
            c, s, least = cosines[k], sines[k], np.inf
            for f in range(count):
                q_h, q_z = q[f, 0] * c + q[f, 1] * s, q[f, 2]
                least = min(least, half_tangent(q_z, q_h, widths[f] - offsets[f]))
                least = min(least, half_tangent(-q_z, -q_h, widths[f] + offsets[f]))
            out[row, k] = 2.0 * np.arctan(least) if level else np.nan


@kernel
def fill_worst(normals, widths, offsets, weight, centers, out):  # type: ignore[no-untyped-def]
    """Least distance from level to a forbidden cap for every centre of mass, into `out` (p,)."""
    for row in range(len(centers)):
        x, y, z = centers[row, 0], centers[row, 1], centers[row, 2]
        level, least = True, np.pi
        for f in range(len(widths)):
            n = normals[f]
            q_x = weight * (n[0] + n[4] * z - n[5] * y)
            q_y = weight * (n[1] + n[5] * x - n[3] * z)
            q_z = weight * (n[2] + n[3] * y - n[4] * x)
            if abs(q_z + offsets[f]) > widths[f] + ROUNDING:
                level = False
            size = (q_x * q_x + q_y * q_y + q_z * q_z) ** 0.5
            across = (q_x * q_x + q_y * q_y) ** 0.5
            for side in range(2):
                d = widths[f] - offsets[f] if side == 0 else widths[f] + offsets[f]
                if d < size:
                    height = q_z if side == 0 else -q_z
                    gap = np.arctan2(across, height) - np.arccos(max(d / size, -1.0))
                    least = min(least, gap)
        out[row] = max(least, 0.0) if level else np.nan
