"""What is left of a vehicle without some of its rotors: which axes, and at which attitude.

With six axes left it hovers in its trim attitude (see `fullam.control.trim`). With fewer, the rows
of N being the directions of the wrench that are lacking, it can be at rest only where

    N (w(u) - w_0) = 0,    w(u) = m g [u; c x u]:

with five axes on a circle of up vectors u, with four at two points. There the margin counts the
disturbances within what the rotors span; along N nothing answers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.analysis.atlas.loads import Load, load_of
from fullam.analysis.atlas.rays import OUTSIDE
from fullam.control.trim import SEARCHED, HoverMargins, Trim
from fullam.model.attainable.facets import Facets, facets_of
from fullam.model.vehicle import Vehicle
from fullam.model.wrench_axes import AXES, controllable_axes
from fullam.simulation.trimmed import trim_of

Array = NDArray[np.float64]

POINTS = 7201
"""Attitudes on the circle that are looked at: every 0.05 deg."""

COUNTS = ("no", "one", "two", "three", "four", "five", "six")


@dataclass(frozen=True, eq=False)
class Remaining:
    """What is left.

    Attributes:
        failed: Names of the rotors that stand still.
        rank: Axes that are left.
        lacking: Names of axes that are not independent of the others any more.
        trim: How it hovers, with six axes left.
        rest_tilt: Tilt at which it rests with the largest margin, with fewer [rad]; None if there
            is no such attitude.
        rest_margin: That margin [N].
    """

    failed: tuple[str, ...]
    rank: int
    lacking: tuple[str, ...]
    trim: Trim | None
    rest_tilt: float | None
    rest_margin: float | None

    @property
    def holds(self) -> bool:
        """Whether position and an attitude are held."""
        return self.trim is not None and self.trim.holds

    def __str__(self) -> str:
        """What is left, in a line."""
        if self.trim is not None:
            return str(self.trim)
        dead = f"{' and '.join(self.failed)} stopped"
        left = f"{COUNTS[self.rank]} of six axes are left (no {', no '.join(self.lacking)} "
        left += "independent of the others)"
        if self.rest_tilt is None or self.rest_margin is None or self.rest_margin <= 0.0:
            return f"{dead}: {left}, and there is no attitude in which it can be at rest"
        return (
            f"{dead}: {left}; it can be at rest tilted by {np.degrees(self.rest_tilt):.0f} deg, "
            f"with {self.rest_margin:.1f} N to spare on these axes, and its position is not held"
        )

    def to_dict(self) -> dict[str, object]:
        """JSON values."""
        return {
            "failed": list(self.failed),
            "rank": self.rank,
            "lacking": list(self.lacking),
            "trim": None if self.trim is None else self.trim.to_dict(),
            "rest_tilt_deg": None if self.rest_tilt is None else float(np.degrees(self.rest_tilt)),
            "rest_margin_N": self.rest_margin,
            "holds": self.holds,
            "says": str(self),
        }


def remaining(vehicle: Vehicle, theta: ArrayLike | None = None) -> Remaining:
    """What is left of a vehicle with failed rotors, its arm in one pose.

    Args:
        vehicle: The vehicle; see `Vehicle.with_failed`.
        theta: Arm pose, shape (n_arm,) [rad or m]; at rest by default.

    Raises:
        VehicleError: If `theta` has not one entry per arm joint, or without gravity.
    """
    load, facets = load_of(vehicle, theta), facets_of(vehicle.rotors)
    arm = vehicle.neutral(theta)[None, 7:]
    failed = np.flatnonzero(vehicle.rotors.max_speeds == 0.0)
    axes = controllable_axes(vehicle.rotors)
    tilt = margin = None
    ups = _at_rest(facets, load)
    if facets.rank < 6 and len(ups):
        length = float(np.linalg.norm(vehicle.rotors.positions, axis=1).mean()) or 1.0
        margins = HoverMargins.of(facets, load.weight, load.center, length).at(ups)
        tilt, margin = float(np.arccos(min(ups[margins.argmax(), 2], 1.0))), float(margins.max())
    return Remaining(
        failed=tuple(vehicle.rotors.names[i] for i in failed),
        rank=facets.rank,
        lacking=tuple(name for name, good in zip(AXES, axes, strict=True) if not good),
        trim=trim_of(vehicle, arm),
        rest_tilt=tilt,
        rest_margin=margin,
    )


def _at_rest(facets: Facets, load: Load) -> Array:
    """Up vectors with which nothing is lacking at rest, shape (k, 3): A u = b, |u| = 1, u_z > 0.

    A point, two, or some of a circle; all that are searched if the rotors lack nothing that any
    attitude asks for.
    """
    A, b = facets.equalities @ load.map, facets.equalities @ facets.center
    _, sizes, axes = np.linalg.svd(A)
    rank = int(np.sum(sizes > OUTSIDE * np.linalg.norm(load.map / facets.scale[:, None], 2)))
    foot = np.linalg.pinv(A, OUTSIDE) @ b if rank else np.zeros(3)
    free, square = axes[rank:], 1.0 - float(foot @ foot)
    if np.abs(A @ foot - b).max(initial=0.0) > OUTSIDE or square < -OUTSIDE or len(free) == 3:
        return np.empty((0, 3))
    if len(free) == 0:
        steps = np.zeros((1 if square < OUTSIDE else 0, 3))
    elif len(free) == 1:
        steps = np.vstack([free, -free])
    else:
        angle = np.linspace(0.0, 2.0 * np.pi, POINTS)[:, None]
        steps = np.cos(angle) * free[0] + np.sin(angle) * free[1]
    ups = foot + np.sqrt(max(square, 0.0)) * steps
    found: Array = ups[ups[:, 2] >= np.sqrt(1.0 - SEARCHED**2)]
    return found
