"""The response of a flight to the last jump of its reference, and how to read it.

Pure arithmetic on arrays in mm and deg; what the numbers mean together is in `metrics`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics import quaternions
from fullam.dynamics.pose_space import euler_from_pose

if TYPE_CHECKING:
    from fullam.simulation.run import Run

Array = NDArray[np.float64]

SMOOTHING = 0.2
"""Length of the centred moving average [s]."""

STEP_MINIMUM = (10.0, 1.0)
"""A jump below this is no step: 2 % of it would be 0.2 mm or 0.02 deg [mm, deg]."""

DWELL = 0.5
"""To count as settled an axis stays in its band at least this long without a break [s]."""

JITTER_FREQUENCY = 2.0
"""Motion above this counts as jitter [Hz]; the position loop's own bandwidth is below it."""


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
        reference, pose = coordinates(run.reference_pose), coordinates(run.pose)
        # Before the first row the reference stood where the vehicle starts.
        change = _wrapped(np.diff(reference, axis=0, prepend=pose[:1]))
        start = last_jump(change)
        error = _wrapped(pose - reference)[start:]
        back = quaternions.inverse(run.reference_pose[start:, 3:])
        off = quaternions.to_rotation_vector(quaternions.product(run.pose[start:, 3:], back))
        jumped = np.abs(change[start]) > np.repeat(STEP_MINIMUM, 3)
        return cls(
            start=float(run.t[start]),
            t=run.t[start:] - run.t[start],
            error=error,
            rotation=np.degrees(off),
            step=np.where(jumped, change[start], 0.0),
            setpoint=reference[-1],
            period=float(run.t[1] - run.t[0]) if len(run) > 1 else 0.0,
        )

    @property
    def steady(self) -> slice:
        """Rows of the steady part: the second half."""
        return slice(self.t.size // 2, None)

    @cached_property
    def smoothed(self) -> Array:
        """Centred moving average of the error; at the ends the edge value is repeated."""
        from scipy.ndimage import uniform_filter1d  # slow to import

        window = min(self.t.size, 2 * round(0.5 * SMOOTHING / max(self.period, 1e-9)) + 1)
        return uniform_filter1d(self.error, window, axis=0, mode="nearest")


def coordinates(pose: Array) -> Array:
    """[position [mm], x-y-z Euler angles [deg]] of poses, (N, 7) to (N, 6)."""
    return np.hstack([1e3 * pose[:, :3], np.degrees(euler_from_pose(pose))])


def last_jump(change: Array) -> int:
    """Row of the last jump of a reference, 0 if it has none.

    A jump is an isolated increment: more than three times both its neighbours, in position or in
    attitude. Ramps and smooth trajectories have none, however fast they are.

    Args:
        change: Increments of the reference, row k from row k-1 to k, shape (N, 6) [mm, deg].
    """
    latest = 0
    for half in (change[:, :3], change[:, 3:]):
        size = np.pad(np.linalg.norm(half, axis=1), 1)
        neighbours = np.maximum(size[:-2], size[2:])
        rows = np.flatnonzero(size[1:-1] > 3.0 * neighbours + 1e-6)
        latest = max(latest, int(rows[-1]) if rows.size else 0)
    return latest


def settling_time(t: Array, error: Array, band: float, share: float = 1.0) -> float | None:
    """First time from which |error| stays within the band, or None.

    It stays when it is inside for `DWELL` without a break, and for the given share of the rest of
    the response. A share below 1 is a statistic and needs data: half of the response at least.

    Args:
        t: Times from the jump on [s], shape (N,).
        error: Error, shape (N,).
        band: Half-width of the band, in the error's unit.
        share: 1 is the textbook's "for ever".
    """
    inside = np.abs(error) <= band
    left = np.arange(t.size, 0, -1)
    share_left = np.cumsum(inside[::-1])[::-1] / left
    # The next row outside, seen from each row; the end of the record cuts a dwell short, too.
    next_outside = np.minimum.accumulate(np.where(inside, t[-1], t)[::-1])[::-1]
    dwells = next_outside - t >= DWELL - 1e-9
    proven = t <= (0.5 * t[-1] if share < 1.0 else t[-1])
    settled = np.flatnonzero(inside & dwells & proven & (share_left >= share))
    return float(t[settled[0]]) if settled.size else None


def overshoot(error: Array, step: float) -> float:
    """Largest error beyond the target, in percent of the step; 0 if it never gets there."""
    return 100.0 * max(0.0, float(np.max(error * np.sign(step)))) / abs(step)


def off_path(error: Array, step: Array, mask: NDArray[np.bool_]) -> Array:
    """Deviation from the line through target and start of the jump, shape (N, 6) [mm, deg].

    e - (e.d) d / |d|^2, for position and Euler angles apart; the plain error where nothing jumps.
    """
    result = np.where(mask, error, 0.0)
    for half in (slice(0, 3), slice(3, 6)):
        d = np.where(mask[half], step[half], 0.0)
        if square := float(d @ d):
            e = result[:, half]
            result[:, half] = e - (e @ d)[:, None] * d / square
    return result


def high_pass(signal: Array, period: float) -> Array:
    """What is above `JITTER_FREQUENCY`: Butterworth of order 4, run forth and back, (N, k)."""
    if period <= 0.0 or 0.5 / period <= JITTER_FREQUENCY or len(signal) <= 1.0 / period:
        return np.zeros_like(signal)  # too short to tell jitter from the transient
    from scipy.signal import butter, sosfiltfilt  # slow to import

    sos = butter(4, JITTER_FREQUENCY, "highpass", fs=1.0 / period, output="sos")
    return np.asarray(sosfiltfilt(sos, signal, axis=0))


def _wrapped(change: Array) -> Array:
    """Angle differences (columns 3 on) brought to [-180, 180) deg; shape (N, 6)."""
    change[:, 3:] = (change[:, 3:] + 180.0) % 360.0 - 180.0
    return change
