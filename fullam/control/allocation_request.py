"""What an allocator is asked for: controlled axes, their weights, preferred speeds; checked."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.exceptions import SettingsError
from fullam.model.rotors import Rotors

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

DEFAULT_WEIGHTS = (1.0, 1.0, 1.0, 30.0, 30.0, 30.0)
"""Moment before force: a moment error costs 30 times a force error of the same share of full scale.

A vehicle that lacks force drifts; one that lacks moment tumbles. On octorotors with wrenches half
of which are out of reach, 1:1 leaves 2 N m of moment error on average, 1:10 0.12, 1:30 0.055, and
strict priority 0.047 (what no rotor speeds can avoid), while the force error grows by a third.
"""


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
