"""Motions as rows: what a record keeps of a motion that is an object of one's own.

Nobody who reads a record has that object. So a plan replaces it by the very rows that fly, which
fly again to the last bit; on another grid they are interpolated.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, Range
from fullam.exceptions import ScenarioError
from fullam.simulation.motions.arm_table import ArmTable
from fullam.simulation.motions.reference_table import WIDTHS, ReferenceTable

Array = NDArray[np.float64]

MOST_PACKED = 24 << 20
"""Most characters of packed rows: three minutes or so of an arm of four joints, all in motion."""

MOST_UNPACKED = 512 << 20
"""Most bytes of rows that a record may unpack to."""

ON_GRID = 1e-9
"""Rows whose times differ by less are of one grid [s]."""


def pack(rows: Array) -> str:
    """Numbers as text: their bytes, those of equal weight together, deflated, in base 64."""
    data = np.ascontiguousarray(rows, dtype="<f8").view(np.uint8).reshape(-1, 8).T.tobytes()
    return base64.b64encode(zlib.compress(data, 1)).decode("ascii")


def unpack(text: str, width: int, check: Checker) -> Array:
    """The inverse of `pack`, shape (N, width).

    Raises:
        InvalidInput: It is no such text, or one of too many numbers.
    """
    try:
        inflate = zlib.decompressobj()
        data = inflate.decompress(base64.b64decode(text, validate=True), MOST_UNPACKED)
    except (binascii.Error, zlib.error, ValueError) as error:
        raise check.refuse("packed", f"cannot be read ({error})", "save the run again") from error
    if not data or len(data) % (8 * max(1, width)) or inflate.unconsumed_tail:
        raise check.refuse("packed", "holds no rows", f"give rows of {width} numbers")
    columns = np.frombuffer(data, np.uint8).reshape(8, -1)
    rows = np.ascontiguousarray(columns.T).view("<f8").reshape(-1, width)
    if not np.isfinite(rows).all():
        raise check.refuse("packed", "holds numbers that are not finite", "save the run again")
    return rows


@dataclass(frozen=True)
class _Rows:
    """Rows at equal steps from time 0 on.

    Attributes:
        period: Time between rows [s].
        packed: The rows; see `pack`.
        made_by: What made them.
    """

    period: float
    packed: str = field(repr=False)
    made_by: str = ""

    def __post_init__(self) -> None:
        """Check that they can be flown and kept."""
        check = self._check
        object.__setattr__(
            self, "period", check.number("period", self.period, Range(1e-7, 1e4, "s"))
        )
        check.text("packed", self.packed)
        check.text("made_by", self.made_by, prose=True)
        if len(self.packed) > MOST_PACKED:
            raise check.refuse(
                "rows",
                f"take {len(self.packed) >> 20} MiB in a record",
                f"at most {MOST_PACKED >> 20} fit: fly shorter, or give a Trajectory "
                "(JointTrajectory) made from arrays",
            )

    @property
    def _check(self) -> Checker:
        return Checker(f"motion of '{self.made_by}'", ScenarioError)

    def _at(self, rows: Array, t: Array, quaternion: slice = slice(0)) -> Array:
        """Rows at times t: themselves on their own grid, else between them; the last one stands."""
        whole = np.round(t / self.period).astype(np.intp)
        if np.abs(whole * self.period - t).max(initial=0.0) < ON_GRID:
            return rows[np.minimum(whole, len(rows) - 1)]
        grid = np.arange(len(rows)) * self.period
        between = np.stack([np.interp(t, grid, column) for column in rows.T], axis=1)
        between[:, quaternion] /= np.linalg.norm(between[:, quaternion], axis=1, keepdims=True)
        return between


@dataclass(frozen=True)
class ReferenceRows(_Rows):
    """A reference as rows [pose, velocity, acceleration], 19 numbers each."""

    kind: ClassVar[str] = "reference-rows"

    @classmethod
    def of(cls, table: ReferenceTable, made_by: str) -> ReferenceRows:
        """The rows of a table on the control grid."""
        period = float(table.t[1] - table.t[0]) if table.t.size > 1 else 1.0
        return cls(period, pack(np.hstack([getattr(table, name) for name in WIDTHS])), made_by)

    @cached_property
    def rows(self) -> Array:
        """The rows, shape (N, 19)."""
        rows = unpack(self.packed, sum(WIDTHS.values()), self._check)
        lengths = np.linalg.norm(rows[:, 3:7], axis=1)
        if np.abs(lengths - 1.0).max() > 1e-3:
            raise self._check.refuse("packed", "holds no unit quaternions", "save the run again")
        return rows

    def tabulate(self, t: Array, initial_pose: Array) -> ReferenceTable:
        """The reference on the grid t, shape (N,)."""
        rows = self._at(self.rows, t, slice(3, 7))
        return ReferenceTable(t, *np.split(rows, np.cumsum(list(WIDTHS.values()))[:-1], axis=1))


@dataclass(frozen=True)
class ArmRows(_Rows):
    """An arm motion as rows [positions, rates, accelerations], on the plant's half steps."""

    kind: ClassVar[str] = "arm-rows"

    @classmethod
    def of(cls, table: ArmTable, period: float, made_by: str) -> ArmRows:
        """The rows of a table at equal steps."""
        rows = np.hstack([table.theta, table.dtheta, table.ddtheta])
        return cls(period, pack(rows), made_by)

    def tabulate(self, t: Array, initial: Array) -> ArmTable:
        """The motion on the grid t [s]; it begins where its first row says."""
        if not initial.size:
            return ArmTable(*np.zeros((3, t.size, 0)))
        rows = self._at(unpack(self.packed, 3 * initial.size, self._check), t)
        return ArmTable(*np.split(rows, 3, axis=1))
