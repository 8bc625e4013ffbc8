"""Does a flight swing: the one line in the spectrum of its error that it should not have.

A flight that ends may still be a bad one: a loop without a margin swings about its target for as
long as it flies. It is told by its *steady part*, the second half of what follows the last jump of
the reference. There, of each controlled axis, the error of the position [m] or the rotation vector
of R R_d^T [rad], e(t) less its mean, is looked at under Hann's window w:

    E(f) = sum_k w_k e_k exp(-2 pi i f t_k),    f_0 = argmax |E|,
    amplitude of the line  a = sqrt(4 / (N sum_k w_k^2) sum |E|^2)    over f_0 +- 2 bins.

An axis *swings* if all of this is true:

- a is above `BANDS`: what gusts and noise do to a law that holds is below them (and
  `GUSTY` times above them at the gusts' own rate and its multiples: gusts come in step, and a few
  of one sign swing any vehicle at it);
- the line holds `SHARE` of the error's energy: gusts and noise are broad;
- the line has `CYCLES` periods or more in the steady part: a drift is no oscillation;
- it does not decay, and is not thrown up by a gust or two: in every quarter of the steady part its
  root mean square is `LASTING` of that in the quarter before, or more;
- nobody asked for it: neither the reference nor the arm moves at that frequency.

A flight that leaves the bounds of sense has diverged, whatever it did before; `swing` names the
axis and the frequency of that one as well, from the last `LAST` seconds that it flew.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics import quaternions
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.motions.jumps import last_jump
from fullam.simulation.motions.references import ReferenceTable

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

BANDS = (0.1, float(np.radians(7.0)))
"""Amplitude above which a line is a swing: position [m], attitude [rad]."""

GUSTY = 1.5
"""The bands are so many times wider at multiples of the rate at which gusts come."""

SHARE, CYCLES, LASTING = 0.5, 3, 0.5
"""See the module's first lines."""

FORCED_SHARE = 0.1
"""A motion that was asked for moves at every frequency at which its spectrum is this much of its
largest."""

LAST = 2.0
"""Before a divergence this much of the flight is looked at [s]."""

LEAST_ROWS = 32
"""In fewer rows nothing is seen."""

UNITS = np.repeat([1e3, np.degrees(1.0)], 3)
"""From [m, rad] to [mm, deg]."""

NAMES = ("x", "y", "z", "rotation about x", "rotation about y", "rotation about z")


@dataclass(frozen=True)
class Swing:
    """The largest swing of a flight.

    Attributes:
        axis: Which of `NAMES`, 0 to 5.
        frequency: [Hz].
        amplitude: [m] or [rad].
    """

    axis: int
    frequency: float
    amplitude: float

    def __str__(self) -> str:
        """Axis, amplitude, frequency."""
        large = (
            f"{1e3 * self.amplitude:.0f} mm"
            if self.axis < 3
            else f"{np.degrees(self.amplitude):.1f} deg"
        )
        return f"{NAMES[self.axis]} swings by {large} at {self.frequency:.2f} Hz"


def errors(pose: Array, asked: Array) -> Array:
    """[p - p_d; rotation vector of R R_d^T], world axes, shape (N, 6) [m, rad].

    Args:
        pose: [p, quaternion xyzw], shape (N, 7).
        asked: Poses asked for, shape (N, 7).
    """
    turned = quaternions.product(pose[:, 3:], quaternions.inverse(asked[:, 3:]))
    return np.hstack([pose[:, :3] - asked[:, :3], quaternions.to_rotation_vector(turned)])


def swing(
    e: Array,
    period: float,
    controlled: Array,
    asked: Array,
    gust_interval: float | None = None,
    steady: bool = True,
) -> Swing | None:
    """The largest swing in a steady part; None if no axis swings.

    Args:
        e: Errors of the steady part, as `errors` gives them, shape (N, 6).
        period: Time between rows [s].
        controlled: Axes that count, shape (6,).
        asked: What was asked to move meanwhile: reference, arm; one column each, shape (N, k).
        gust_interval: Time from one gust to the next [s]; None if there are none.
        steady: Whether what decays is no swing; not so before a divergence.
    """
    if len(e) < LEAST_ROWS:
        return None
    may: Flags = controlled & [may_swing(e[:, i : i + 1], BANDS[i // 3])[0] for i in range(6)]
    if not may.any():
        return None
    centred = e - e.mean(axis=0)
    frequencies = np.fft.rfftfreq(len(e), period)
    spacing = frequencies[1]
    power, window = spectrum(e)
    forced = forced_bins(asked)
    scale = 4.0 / (len(e) * np.sum(window**2))
    quarters = np.array_split(centred, 4)
    size = np.sqrt([np.mean(quarter**2, axis=0) for quarter in quarters])
    lasts: Flags = np.all(size[1:] >= LASTING * size[:-1], axis=0)
    worst: tuple[float, Swing] | None = None
    for axis in np.flatnonzero(may):
        peak = int(power[:, axis].argmax())
        line = slice(max(0, peak - 2), peak + 3)
        energy = float(power[line, axis].sum())
        found = Swing(int(axis), float(frequencies[peak]), float(np.sqrt(scale * energy)))
        band = BANDS[axis // 3]
        if gust_interval is not None:
            nth = max(1, round(found.frequency * gust_interval))
            near = abs(found.frequency - nth / gust_interval) < 0.75 * spacing
            band *= GUSTY if near else 1.0
        excess = found.amplitude / band
        swings = (
            excess > 1.0
            and peak >= CYCLES
            and energy > SHARE * power[:, axis].sum()
            and (lasts[axis] or not steady)
            and not forced[line].any()
        )
        if swings and (worst is None or excess > worst[0]):
            worst = excess, found
    return None if worst is None else worst[1]


def may_swing(e: Array, band: float) -> Flags:
    """Whether an axis can swing at all, which spares most flights their spectrum.

    By Parseval no line below half the rate of the rows is larger than the error under the window,

        a^2 <= 2 sum_k w_k^2 (e_k - mean e)^2 / sum_k w_k^2.

    Args:
        e: Errors of the axis over the steady part of some flights, shape (N, flights).
        band: Its entry of `BANDS`, in the unit of the errors.

    Returns:
        Shape (flights,).
    """
    # Products of matrices alone, which take a tenth of the time of sums along columns.
    weights = window_weights(len(e))
    mean, first = weights @ e
    _, second = weights @ (e * e)
    may: Flags = 2.0 * (second + mean * (mean - 2.0 * first)) > band**2
    return may


@lru_cache(maxsize=8)
def window_weights(rows: int) -> Array:
    """What makes the mean, and the mean under Hann's window squared, shape (2, rows)."""
    w2 = np.hanning(rows) ** 2
    weights = np.stack([np.full(rows, 1.0 / rows), w2 / w2.sum()])
    weights.setflags(write=False)
    return weights


def flight_swing(plan: FlightPlan, pose: Array) -> Swing | None:
    """The swing of a flight that has come to its end; None if it does not swing.

    Args:
        plan: The plan under the flight's seed.
        pose: True poses, one a control period, shape (N, 7).
    """
    rows = len(pose)
    part = steady_part(plan, rows)
    asked = plan.asked.pose[part]
    arm = plan.arm.theta[:: plan.arm_row(1)][:rows][part]
    return swing(
        errors(pose[part], asked),
        plan.simulation.control_period,
        np.array(plan.scenario.axes_mask),
        np.hstack([asked, arm]),
        plan.weather.gust_interval if plan.weather.gust_scale.any() else None,
    )


def steady_part(plan: FlightPlan, rows: int) -> slice:
    """Rows of the second half of what follows the last jump of the reference."""
    jump = jump_of(plan.asked, tuple(plan.scenario.initial_pose))
    return slice(jump + (rows - jump) // 2, rows)


@lru_cache(maxsize=8)
def jump_of(asked: ReferenceTable, start_pose: tuple[float, ...]) -> int:
    """Row of the last jump of what is asked, the same for all seeds of a plan."""
    before = np.vstack([start_pose, asked.pose[:-1]])
    return last_jump(UNITS * errors(asked.pose, before))


def spectrum(e: Array) -> tuple[Array, Array]:
    """|E(f)|^2 of each column, shape (bins, k), and the window, shape (N,)."""
    window = np.hanning(len(e))
    return np.abs(np.fft.rfft((e - e.mean(axis=0)) * window[:, None], axis=0)) ** 2, window


def forced_bins(asked: Array) -> Flags:
    """Bins at which something moves that was asked to, but for drifts, shape (bins,)."""
    power, _ = spectrum(asked)
    power[:CYCLES] = 0.0
    most = power.max(axis=0)
    moves = np.ptp(asked, axis=0) > 1e-6
    forced: Flags = (moves & (power > FORCED_SHARE * most)).any(axis=1)
    return forced
