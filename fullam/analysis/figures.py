# mypy: disallow-untyped-defs=False
"""The figures of flights in numbers: what `metrics` defines, as kernels over the track of a flight.

Four stages, each over all rows: deviations; mean, RMS and jitter of every signal; the transient of
every axis; the flight as a whole. What the scenario asks is tabulated once for all flights.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.deviation import AXES, SIGNALS, Follow, follow, put
from fullam.analysis.figure_records import (
    AxisFigures,
    FlightFigures,
    SignalFigures,
    Terms,
    View,
)
from fullam.analysis.high_pass import PADDING, high_pass
from fullam.analysis.response import (
    NEVER,
    excursions,
    mean_and_rms,
    overshoot,
    path_length,
    settle,
    smooth,
)
from fullam.numbers.kernel import absolute, both, kernel, maximum, select, some, sqrt
from fullam.numbers.program import Stage, program
from fullam.numbers.records import Rows

Array = NDArray[np.float64]


@kernel
def judge_signals(view, _):
    """Mean, RMS and jitter of every signal over the steady part, the second half."""
    n = len(view.smoothed)
    for i in range(len(view.signal_figures)):
        signal = view.signals[i]
        jitter = 0.0
        if len(view.terms.filter) > 0:
            high_pass(signal, view.terms.filter, n // 2, view.fast)
            jitter = mean_and_rms(view.fast, PADDING + n // 2, PADDING + n)[1]
        mean, rms = mean_and_rms(signal, n // 2, n)
        view.signal_figures[i] = SignalFigures(mean, rms, jitter)


@kernel
def judge_axes(view, _):
    """Settling and overshoot of every axis, and how far it strayed from the straight line."""
    put(view.excursions, 0, 0, excursions(view.signals, 0, view.terms.paths[0]))
    put(view.excursions, 3, 0, excursions(view.signals, 3, view.terms.paths[1]))
    for i in range(len(view.axis_figures)):
        view.axis_figures[i] = judge_axis(view, i)


@kernel
def judge_axis(view, i):
    """Settling times and overshoots, noise-aware and raw; a held axis has one settling time."""
    terms, axis, flight = view.terms, view.terms.axes[i], view.terms.flight[0]
    raw = view.signals[i]
    error = raw
    if flight.transient < math.inf:
        smooth(raw, int(flight.before), int(flight.after), view.smoothed)
        error = view.smoothed
    ended = view.diverged[0] > 0.0
    two = select(ended, NEVER, settle(terms.t, error, axis.band, terms.enough))
    five, raw_two, peak, raw_peak, share = two, NEVER, NEVER, NEVER, NEVER
    if some(absolute(axis.step) > 0.0):
        five = select(ended, NEVER, settle(terms.t, error, axis.band_5, terms.enough))
        raw_two = select(ended, NEVER, settle(terms.t, raw, axis.band_raw, terms.enough_raw))
        end = select(two >= 0.0, maximum(two + 1.0, flight.transient), math.inf)
        peak = overshoot(terms.t, error, axis.step, end)
        raw_peak = overshoot(terms.t, raw, axis.step, math.inf)
        share = peak * (absolute(axis.step) / axis.setpoint)
    excursion = view.excursions[i][0]
    return AxisFigures(two, five, raw_two, peak, raw_peak, share, excursion)


@kernel
def later(a, b):
    """The later of two times; `NEVER` if either is."""
    return select(a >= b, a, select(b >= a, b, NEVER))


@kernel
def worse(a, b):
    """The larger of two numbers; b if a is NaN or b is larger, a if b is NaN."""
    return select(b > a, b, a)


@kernel
def known(x):
    """The number, or NaN if it is still below 0, where it began."""
    return select(x >= 0.0, x, NEVER)


@kernel
def norms(signals, first, axes, axis):
    """Norms over three signals of mean, RMS and jitter, those of uncontrolled axes left out."""
    means, squares, fast = 0.0, 0.0, 0.0
    for i in range(3):
        figures, weight = signals[first + i], axes[axis + i].controlled
        mean, rms, jitter = figures.steady_error, figures.rms, figures.jitter
        means = means + weight * (mean * mean)
        squares = squares + weight * (rms * rms)
        fast = fast + weight * (jitter * jitter)
    return sqrt(means), sqrt(squares), sqrt(fast)


@kernel
def farthest(axes, terms, first):
    """Largest excursion among three axes, of those controlled."""
    largest = 0.0
    for i in range(first, first + 3):
        largest = maximum(terms[i].controlled * axes[i].max_excursion, largest)
    return largest


@kernel
def slowest(axes, terms):
    """Settling time of the slowest axis: 2 %, 5 %, and raw over the axes that step."""
    two, five, raw = -1.0, -1.0, -1.0
    for i in range(len(axes)):
        counts, axis = terms[i].controlled > 0.0, axes[i]
        steps = both(counts, absolute(terms[i].step) > 0.0)
        two = select(counts, later(two, axis.settling_time_s), two)
        five = select(counts, later(five, axis.settling_time_5_s), five)
        raw = select(steps, later(raw, axis.settling_time_raw_s), raw)
    return known(two), known(five), known(raw)


@kernel
def worst(axes, terms):
    """Overshoot of the worst axis: of its step, raw, of its set point."""
    aware, raw, share = -1.0, -1.0, -1.0
    for i in range(len(axes)):
        counts, axis = terms[i].controlled > 0.0, axes[i]
        aware = select(counts, worse(aware, axis.overshoot_percent), aware)
        raw = select(counts, worse(raw, axis.overshoot_raw_percent), raw)
        share = select(counts, worse(share, axis.overshoot_setpoint_percent), share)
    return known(aware), known(raw), known(share)


@kernel
def means_of_track(track):
    """Share of saturated rows, and mean thrust [N]."""
    saturated, thrust = 0.0, 0.0
    for k in range(len(track)):
        saturated = saturated + track[k].saturated
        thrust = thrust + track[k].thrust
    return saturated / len(track), thrust / len(track)


@kernel
def judge_flight(view, _):
    """The figures of the flight as a whole, from those of its signals and axes."""
    axes, terms, flight = view.axis_figures, view.terms.axes, view.terms.flight[0]
    two, five, raw = slowest(axes, terms)
    aware, raw_peak, share = worst(axes, terms)
    position, rms_position, jitter_position = norms(view.signal_figures, 0, terms, 0)
    attitude, rms_attitude, jitter_attitude = norms(view.signal_figures, 6, terms, 3)
    saturated, thrust = means_of_track(view.track)
    view.flight_figures[0] = FlightFigures(
        two,
        five,
        raw,
        aware,
        raw_peak,
        share,
        rms_position,
        rms_attitude,
        position,
        attitude,
        farthest(axes, terms, 0),
        farthest(axes, terms, 3),
        jitter_position,
        jitter_attitude,
        saturated,
        thrust / flight.weight,
        flight.period * path_length(view.signals, 0),
        flight.period * path_length(view.signals, 6),
    )


class FigureProgram:
    """The stages of the figures over one track, which may be written anew between two runs.

    Belongs to one thread; the machine code is shared by all.

    Attributes:
        view: All that it computes; the figures are in `signal_figures`, `axis_figures` and
            `flight_figures`.
    """

    def __init__(self, terms: Terms, track: Rows, compiled: bool | None = None) -> None:
        """Bind the stages to a track.

        Args:
            terms: How its flights are judged.
            track: `Flown`, the whole flight, in lanes or not.
            compiled: Whether to run machine code; None where that can be had.
        """
        lanes, rows = track.lanes, len(terms.t.array)
        self.view = View(
            track,
            Rows.empty(float, 1, lanes=lanes),
            terms,
            Rows.empty(float, SIGNALS, rows, lanes=lanes),
            Rows.empty(float, rows, lanes=lanes),
            Rows.empty(float, rows + 2 * PADDING, lanes=lanes),
            Rows.empty(float, AXES, 1, lanes=lanes),
            Rows.empty(SignalFigures, SIGNALS, lanes=lanes),
            Rows.empty(AxisFigures, AXES, lanes=lanes),
            Rows.empty(FlightFigures, 1, lanes=lanes),
        )
        stages = [Stage(follow, Follow(track, terms.asked, self.view.signals))]
        stages += [Stage(k, self.view) for k in (judge_signals, judge_axes, judge_flight)]
        self._program = program(stages, compiled)

    def run(self, diverged: Array) -> None:
        """Compute the figures of what the track holds now; diverged of shape (lanes,)."""
        view = self.view
        view.diverged.array[0, 0] = diverged if view.diverged.lanes else diverged[0]
        self._program.run(0, 1)

    @property
    def numbers(self) -> Array:
        """`SignalFigures`, `AxisFigures` and `FlightFigures` of each lane, (lanes, numbers)."""
        view = self.view
        parts = (view.signal_figures, view.axis_figures, view.flight_figures)
        return np.concatenate([rows.array.reshape(-1, rows.lanes or 1) for rows in parts]).T
