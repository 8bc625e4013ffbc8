# mypy: disallow-untyped-defs=False
"""The response of a flight to the last jump of its reference, and how to read it.

Pure arithmetic on numbers in mm and deg; what they mean together is in `metrics`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.asked_motion import AskedMotion
from fullam.analysis.deviation import coordinates, deviations
from fullam.numbers.kernel import absolute, both, kernel, maximum, select, sqrt
from fullam.numbers.vectors import Vector, axpy, dot

if TYPE_CHECKING:
    from fullam.simulation.record.run import Run

__all__ = ["Response", "coordinates", "settling_time"]

Array = NDArray[np.float64]

SMOOTHING = 0.2
"""Length of the centred moving average [s]."""

DWELL = 0.5
"""To count as settled an axis stays in its band at least this long without a break [s]."""

JITTER_FREQUENCY = 2.0
"""Motion above this counts as jitter [Hz]; the position loop's own bandwidth is below it."""

NEVER = math.nan
"""A settling time that is none."""


@dataclass(frozen=True, eq=False)
class Response:
    """The part of a run from the last jump of its reference on, in mm and deg.

    Attributes:
        start: Time of the jump [s].
        t: Time since then [s], shape (N,).
        error: [p - p_d, Euler angles minus desired ones], shape (N, 6) [mm, deg].
        rotation: Rotation vector of R R_d^T in world axes, shape (N, 3) [deg].
        step: Jump of the reference, shape (6,) [mm, deg].
        setpoint: Reference at the end, shape (6,) [mm, deg].
        period: Control period [s].
    """

    start: float
    t: Array
    error: Array
    rotation: Array
    step: Array
    setpoint: Array
    period: float

    @classmethod
    def of(cls, run: Run) -> Response:
        """Cut the response out of a run."""
        asked = AskedMotion.of(run.t, run.reference_pose, run.pose[0])
        signals = deviations(run.pose[asked.start :], asked.rows())
        return cls(
            start=float(run.t[asked.start]),
            t=asked.since,
            error=signals[:, :6],
            rotation=signals[:, 6:],
            step=asked.step,
            setpoint=asked.setpoint,
            period=asked.period,
        )

    @property
    def steady(self) -> slice:
        """Rows of the steady part: the second half."""
        return slice(self.t.size // 2, None)


def rows_inside(t: Array, share: float = 1.0) -> Array:
    """How many rows from each row on must be inside the band for it to have settled there.

    A share below 1 is a statistic and needs data: half of the response at least. Where less is
    left no number is enough.

    Args:
        t: Times from the jump on [s], shape (N,).
        share: Of the rest of the response; 1 is the textbook's "for ever".
    """
    left = np.arange(t.size, 0, -1, dtype=float)
    # 95 % of 20 rows are 19, whatever the last bit of 0.95 says.
    return np.where((share < 1.0) & (t > 0.5 * t[-1]), np.inf, np.ceil(share * left - 1e-9))


def settling_time(t: Array, error: Array, band: float, share: float = 1.0) -> float | None:
    """First time from which |error| stays within the band, or None: `settle` of arrays.

    Args:
        t: Times from the jump on [s], shape (N,).
        error: Error, shape (N,).
        band: Half-width of the band, in the error's unit.
        share: Of the rest of the response that is spent inside.
    """
    time = settle(t.tolist(), error.tolist(), band, rows_inside(t, share).tolist())
    return None if math.isnan(time) else float(time)


@kernel
def settle(t, error, band, enough):
    """First time from which |error| stays within the band, or `NEVER`.

    It stays when it is inside for `DWELL` without a break, and in `enough` rows of those from
    there on. The end of the record cuts a dwell short, too.
    """
    n = len(error)
    inside_rows, leaves, settled = 0.0, t[n - 1], NEVER
    for j in range(n):
        k = n - 1 - j
        inside = absolute(error[k]) <= band
        inside_rows = inside_rows + select(inside, 1.0, 0.0)
        leaves = select(inside, leaves, t[k])
        stays = both(leaves - t[k] >= DWELL - 1e-9, inside_rows >= enough[k])
        settled = select(stays, t[k], settled)
    return settled


@kernel
def overshoot(t, error, step, end):
    """Largest error beyond the target until a time, in percent; 0 if it never gets there."""
    sign = select(step < 0.0, -1.0, 1.0)
    peak = 0.0
    for k in range(len(error)):
        beyond = sign * error[k]
        peak = select(both(t[k] <= end, beyond > peak), beyond, peak)
    return 100.0 * peak / absolute(step)


class Path(NamedTuple):
    """Direction d from target to start of a jump, and d / |d|^2; zeros where nothing jumps."""

    direction: Vector
    pull: Vector


def path_numbers(step: Array) -> Array:
    """The numbers of the `Path` of a jump, shape (6,); step of shape (3,)."""
    square = float(step @ step)
    return np.concatenate([step, step / (square or 1.0)])


@kernel
def excursions(signals, first, path):
    """Largest deviations of three signals from the line through target and start of the jump.

    |e - (e.d) d / |d|^2|, signal by signal; the largest plain error where nothing jumps.
    """
    x, y, z = signals[first], signals[first + 1], signals[first + 2]
    a, b, c = 0.0, 0.0, 0.0
    for k in range(len(x)):
        error = (x[k], y[k], z[k])
        off = axpy(-dot(error, path.pull), path.direction, error)
        a, b, c = (
            maximum(absolute(off[0]), a),
            maximum(absolute(off[1]), b),
            maximum(absolute(off[2]), c),
        )
    return (a, b, c)


@kernel
def path_length(signals, first):
    """Sum of the norms of three signals over all rows."""
    x, y, z = signals[first], signals[first + 1], signals[first + 2]
    total = 0.0
    for k in range(len(x)):
        total = total + sqrt(x[k] * x[k] + y[k] * y[k] + z[k] * z[k])
    return total


def window(rows: int, period: float) -> tuple[int, int]:
    """Rows that the moving average takes before and after its own: `SMOOTHING` in all."""
    width = min(rows, 2 * round(0.5 * SMOOTHING / max(period, 1e-9)) + 1)
    return width // 2, width - width // 2 - 1


@kernel
def smooth(signal, before, after, out):
    """Centred moving average; beyond the ends the edge value is repeated."""
    n = len(signal)
    width = before + after + 1.0
    total = 0.0
    for k in range(-before, after + 1):
        total = total + signal[max(0, min(k, n - 1))]
    out[0] = total / width
    for k in range(1, n):
        total = total + (signal[min(k + after, n - 1)] - signal[max(k - 1 - before, 0)])
        out[k] = total / width


@kernel
def mean_and_rms(signal, first, stop):
    """Mean, and root mean square, of the samples first to stop - 1."""
    total, square = 0.0, 0.0
    for k in range(first, stop):
        total = total + signal[k]
        square = square + signal[k] * signal[k]
    return total / (stop - first), sqrt(square / (stop - first))
