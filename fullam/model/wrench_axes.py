"""The six axes of a wrench: which of them the rotors produce, and at what scale."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.checks import Checker, shown
from fullam.exceptions import NotFullyActuated, VehicleError
from fullam.model.rotors import Rotors

Array = NDArray[np.float64]

AXES = ("force x", "force y", "force z", "moment x", "moment y", "moment z")
"""The six axes of a wrench in {A}, in order."""

RANK_TOLERANCE = 1e-4
"""Singular values of B in full-scale units below this share of the largest count as zero.

Angles in URDFs carry about five digits (1.5708), so parallel rotors come out parallel to 1e-5 only;
and an axis reached with a ten-thousandth of the authority of another cannot be flown.
"""


def full_scale(rotors: Rotors) -> Array:
    """Full-scale wrench, shape (6,) [N, N m]: what the rotors would give if all pulled one way.

    The sum of the largest thrusts of the single rotors, once for each of the three force axes; then
    the sum of their largest moments, once for each of the three moment axes. One number for forces
    and one for moments, so that an error weighs the same in every direction of {A}.
    """
    B = rotors.normalized_coupling
    scale = np.repeat(
        [np.linalg.norm(B[rows], axis=0).sum() for rows in (slice(3), slice(3, 6))], 3
    )
    return np.where(scale > 0, scale, 1.0)


def rank_on(rotors: Rotors, axes: ArrayLike | None = None) -> int:
    """Rank of the coupling matrix (34) on some axes, in full-scale units.

    Args:
        rotors: The rotors.
        axes: Mask, shape (6,) bool, or indices of the axes; None is all.
    """
    Checker("wrench", VehicleError).instance("rotors", rotors, Rotors)
    B = rotors.normalized_coupling / full_scale(rotors)[:, None]
    largest = np.linalg.norm(B, 2)
    values = np.linalg.svd(B[_rows(axes)], compute_uv=False)
    return int(np.count_nonzero(values > RANK_TOLERANCE * largest))


def _rows(axes: ArrayLike | None) -> NDArray[np.intp]:
    if axes is None:
        return np.arange(6)
    try:
        chosen = np.atleast_1d(np.asarray(axes, dtype=None if np.size(axes) else int))
    except (TypeError, ValueError) as error:
        raise VehicleError(
            "wrench", "axes", f"is {shown(axes)}", "give a mask of six, or indices"
        ) from error
    is_mask = chosen.dtype == bool and chosen.shape == (6,)
    is_list = chosen.dtype.kind in "iu" and chosen.ndim == 1 and (np.abs(chosen + 0.5) < 6.5).all()
    if not (is_mask or is_list):
        raise VehicleError("wrench", "axes", f"is {shown(axes)}", "give a mask of six, or indices")
    return np.arange(6)[chosen]


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


def require_rank(rotors: Rotors, axes: ArrayLike | None, vehicle_name: str) -> None:
    """Refuse to control axes that the rotors cannot produce independently.

    Args:
        rotors: The rotors.
        axes: As in `rank_on`.
        vehicle_name: For the error.

    Raises:
        NotFullyActuated: The rank on the axes is below their number; the message says which axes
            would do.
    """
    rank, asked = rank_on(rotors, axes), _rows(axes).size
    if rank < asked:
        possible = controllable_axes(rotors)
        names = ", ".join(name for name, good in zip(AXES, possible, strict=True) if good)
        remedy = "tilt the rotors"
        if not rotors.max_speeds.all():
            remedy = "see what is left by `fullam check VEHICLE --failed R`"
        raise NotFullyActuated(
            vehicle_name, rank, asked, f"{remedy}, or pass axes={possible} ({names})"
        )
