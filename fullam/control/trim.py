"""Trim after a failure: the attitude at which the rotors that are left have most to spare.

With the up vector u seen from {A}, hovering takes the wrench w(u) = m g [u; c x u]. A facet
n . (w - w_0) <= s of the attainable wrenches, and a ball (F, M / length) of disturbances with
radius r around w(u), give

    m g (n_f + n_tau x c) . u + r |(n_f, length n_tau)|  <=  s + n . w_0,

so that the margin r(u) is the least of functions linear in u: q . u <= d - r.

Canted rotors on a ring, alternating, all turn in hover. Without rotor k, level hover takes the one
opposite to it down to nothing: what the two give differently, a moment about an axis across them
and a force along it, is then to be had in one direction only. The margin is 0. Tilted about the
axis that passes through the two, the weight itself has a part along that force, and the opposite
rotor turns again: all six axes are back. No axis has to be given up but the tilt, which is then
not for the target to choose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.rotations import skew
from fullam.model.attainable.facets import Facets

Array = NDArray[np.float64]

SEARCHED = np.sin(np.radians(75.0))
"""Attitudes up to this sine of the tilt are looked at."""

COARSE, FINE, ROUNDS = 101, 9, 24
"""Points across the first grid and the later ones, each half as wide: to 1e-8 in the end."""

WORTH_KEEPING = 0.75
"""A target whose margin is at least this share of the largest one is kept as it is."""


@dataclass(frozen=True, eq=False)
class HoverMargins:
    """Margins of hover attitudes, for one arm pose or the least over several.

    Attributes:
        q: Shape (k, 3); margins are the least of d - m g q . u.
        d: Shape (k,) [N].
        weight: m g [N].
    """

    q: Array
    d: Array
    weight: float

    @classmethod
    def of(cls, facets: Facets, weight: float, centers: Array, length: float) -> HoverMargins:
        """Of what rotors attain.

        Args:
            facets: Of the rotors; disturbances are those that they can answer.
            weight: m g [N].
            centers: Centres of mass in {A}, shape (k, 3) or (3,) [m].
            length: What turns moments into forces [m].
        """
        force, moment = facets.normals[:, :3], facets.normals[:, 3:]
        scale = np.array([1.0, 1.0, 1.0, length, length, length])
        balls, lacking = facets.normals * scale, facets.equalities * scale
        if len(lacking):
            balls = balls - balls @ np.linalg.pinv(lacking) @ lacking
        size = np.linalg.norm(balls, axis=1)
        rows = [force + np.cross(moment, c) for c in np.atleast_2d(centers)]
        q = np.vstack([side * row / size[:, None] for row in rows for side in (1.0, -1.0)])
        offset = facets.normals @ facets.center
        sides = [(facets.half_widths + side * offset) / size for side in (1.0, -1.0)]
        return cls(q, np.concatenate(sides * len(rows)), weight)

    def at(self, up_A: Array) -> Array:
        """Margins r of up vectors, shape (..., 3) to (...) [N]; negative: it cannot be held."""
        found: Array = (self.d - self.weight * (up_A @ self.q.T)).min(axis=-1)
        return found

    def best(self) -> tuple[Array, float]:
        """The up vector with the largest margin, shape (3,), and the margin [N]."""
        middle, half, points = np.zeros(2), SEARCHED, COARSE
        for _ in range(ROUNDS):
            steps = np.linspace(-half, half, points)
            ups = _ups(middle + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2))
            margins = self.at(ups)
            up = ups[margins.argmax()]
            middle, points = up[:2], FINE
            half = min(0.5 * half, 4.0 * (steps[1] - steps[0]))
        return up, float(margins.max())


def _ups(xy: Array) -> Array:
    """Unit vectors above these points of the horizontal plane, those within `SEARCHED`."""
    xy = xy[np.sum(xy * xy, axis=1) <= SEARCHED**2]
    z = np.sqrt(1.0 - np.sum(xy * xy, axis=1, keepdims=True))
    return np.hstack([xy, z])


def rotation_between(a: Array, b: Array) -> Array:
    """The smallest rotation that takes a unit vector to another, not opposite one; (3, 3)."""
    v = np.cross(a, b)
    K = skew(v)
    found: Array = np.eye(3) + K + K @ K / (1.0 + a @ b)
    return found


@dataclass(frozen=True, eq=False)
class Trim:
    """How a vehicle with failed rotors hovers.

    Attributes:
        failed: Names of the rotors that stand still.
        up: Up vector of the trim attitude, seen from {A}, shape (3,).
        margin: Its margin: any force f and moment M with |f|^2 + |M / length|^2 up to its square
            can be added [N]. Not above 0: no attitude can be held.
        level: The margin of the level attitude [N].
        asked: The least margin of the attitudes that are asked for [N]; None if nobody knows them
            yet, as in a flight under somebody's hands.
        length: What turns moments into forces [m].
    """

    failed: tuple[str, ...]
    up: Array
    margin: float
    level: float
    asked: float | None
    length: float

    @property
    def tilt(self) -> float:
        """Tilt of the trim attitude [rad]."""
        return float(np.arccos(min(self.up[2], 1.0)))

    @property
    def rotation(self) -> Array:
        """The trim attitude R_WA that is nearest to level, shape (3, 3)."""
        return rotation_between(self.up, np.array([0.0, 0.0, 1.0]))

    @property
    def holds(self) -> bool:
        """Whether an attitude can be held."""
        return self.margin > 0.0

    @property
    def is_needed(self) -> bool:
        """Whether the attitudes that are asked for are given up for the trim attitude."""
        return self.asked is None or self.asked < WORTH_KEEPING * self.margin

    def __str__(self) -> str:
        """What is held and what is given up, in a line."""
        dead = f"{' and '.join(self.failed)} stopped"
        spare = f"{self.margin:.1f} N to spare"
        if not self.holds:
            return (
                f"{dead}: no attitude can be held; it sinks, tilted by "
                f"{np.degrees(self.tilt):.0f} deg, where {-self.margin:.1f} N are lacking "
                f"(level {-self.level:.1f} N): moment comes before force"
            )
        if not self.is_needed:
            return f"{dead}: position and attitude are held, with {self.asked:.1f} N to spare"
        asked = "" if self.asked is None else f", as asked {self.asked:.1f} N"
        return (
            f"{dead}: position and heading are held, tilted by {np.degrees(self.tilt):.0f} deg, "
            f"with {spare} (level {self.level:.1f} N{asked}); the tilt asked for is given up"
        )

    def to_dict(self) -> dict[str, object]:
        """JSON values."""
        return {
            "failed": list(self.failed),
            "up_A": self.up.tolist(),
            "tilt_deg": float(np.degrees(self.tilt)),
            "margin_N": self.margin,
            "margin_level_N": self.level,
            "margin_asked_N": self.asked,
            "margin_length_m": self.length,
            "holds": self.holds,
            "gives_up_tilt": self.is_needed,
            "says": str(self),
        }
