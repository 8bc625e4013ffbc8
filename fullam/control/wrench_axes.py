"""The six axes of a wrench: which ones the rotors produce, at what scale, with what priority."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.exceptions import NotFullyActuated, SettingsError
from fullam.model.rotors import Rotors

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

AXES = ("force x", "force y", "force z", "moment x", "moment y", "moment z")
"""The six axes of a wrench in {A}, in order."""

DEFAULT_WEIGHTS = (1.0, 1.0, 1.0, 30.0, 30.0, 30.0)
"""Moment before force: a moment error costs 30 times a force error of the same share of full scale.

A vehicle that lacks force drifts; one that lacks moment tumbles. On octorotors with wrenches half
of which are out of reach, 1:1 leaves 2 N m of moment error on average, 1:10 0.12, 1:30 0.055, and
strict priority 0.047 (what no rotor speeds can avoid), while the force error grows by a third.
"""

RANK_TOLERANCE = 1e-4
"""Singular values of B in full-scale units below this share of the largest count as zero.

Angles in URDFs carry about five digits, so parallel rotors come out parallel to 1e-5 only.
"""


def full_scale(rotors: Rotors) -> Array:
    """Full-scale wrench, shape (6,) [N, N m]: what the rotors would give if all pulled one way.

    Three times the sum of the largest thrusts, then three times the sum of the largest moments of
    the single rotors: one number for forces and one for moments, so that an error weighs the same
    in every direction of {A}.
    """
    B = rotors.normalized_coupling
    scale = np.repeat(
        [np.linalg.norm(B[rows], axis=0).sum() for rows in (slice(3), slice(3, 6))], 3
    )
    return np.where(scale > 0, scale, 1.0)


def rank_on(rotors: Rotors, axes: ArrayLike) -> int:
    """Rank of the coupling matrix on the masked axes, shape (6,) bool, in full-scale units."""
    B = rotors.normalized_coupling / full_scale(rotors)[:, None]
    largest = np.linalg.norm(B, 2)
    values = np.linalg.svd(B[np.asarray(axes, dtype=bool)], compute_uv=False)
    return int(np.count_nonzero(values > RANK_TOLERANCE * largest))


def controllable_axes(rotors: Rotors) -> tuple[bool, ...]:
    """Largest mask of axes that the rotors produce independently, shape (6,).

    Axes are admitted in the order force z, moment x, y, z, force x, y: what keeps a vehicle up
    comes first. A quadrotor gets (False, False, True, True, True, True).
    """
    axes = np.zeros(6, dtype=bool)
    for axis in (2, 3, 4, 5, 0, 1):
        axes[axis] = True
        if rank_on(rotors, axes) < np.count_nonzero(axes):
            axes[axis] = False
    return tuple(axes.tolist())


def read_axes(axes: ArrayLike | None) -> Mask:
    """The mask of controlled axes, shape (6,) bool; None is all. Raises SettingsError."""
    mask = np.ones(6, dtype=bool) if axes is None else np.array(axes)
    if mask.shape != (6,) or mask.dtype != np.bool_ or not mask.any():
        raise SettingsError("allocator", "axes", f"is {axes!r}", "give six bools, one of them true")
    return mask


def read_weights(weights: ArrayLike | None, axes: Mask) -> Array:
    """Weights with the least one 1 and 0 off the axes, shape (6,). Raises SettingsError."""
    values = np.array(DEFAULT_WEIGHTS if weights is None else weights, dtype=float)
    if values.shape != (6,) or not np.all(np.isfinite(values)) or not np.all(values[axes] > 0):
        raise SettingsError(
            "allocator", "weights", f"is {weights!r}", "give six positive numbers; mask with axes"
        )
    return np.where(axes, values / values[axes].min(), 0.0)


def read_preferred_speeds(preferred_speeds: ArrayLike | None, rotors: Rotors) -> Array:
    """Preferred speeds [rad/s] as u_0 in [0, 1], shape (n,). Raises SettingsError."""
    if preferred_speeds is None:
        return np.zeros(rotors.count)
    speeds = np.array(preferred_speeds, dtype=float)
    if speeds.shape != (rotors.count,) or not np.all((speeds >= 0) & np.isfinite(speeds)):
        raise SettingsError(
            "allocator",
            "preferred_speeds",
            f"is {preferred_speeds!r}",
            f"give {rotors.count} speeds [rad/s], none negative",
        )
    working = np.where(rotors.max_speeds > 0, rotors.max_speeds, np.inf)
    return np.minimum(np.square(speeds / working), 1.0)


def require_rank(rotors: Rotors, axes: Mask, vehicle_name: str) -> None:
    """Raise NotFullyActuated, naming the axes that would do, if the rank on the axes is short."""
    rank, asked = rank_on(rotors, axes), int(np.count_nonzero(axes))
    if rank < asked:
        possible = controllable_axes(rotors)
        names = ", ".join(name for name, good in zip(AXES, possible, strict=True) if good)
        raise NotFullyActuated(
            vehicle_name, rank, asked, f"pass axes={possible} ({names}) to control what there is"
        )
