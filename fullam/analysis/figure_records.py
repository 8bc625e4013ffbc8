"""What the kernels of the figures are shown and what they answer, as records of numbers."""

from __future__ import annotations

from typing import NamedTuple

from fullam.numbers.kernel import Number
from fullam.numbers.records import Rows


class AxisTerms(NamedTuple):
    """How an axis is judged, in mm or deg.

    1 if the scenario controls it, else 0; signed step, 0 for a held axis; settling bands: 2 % and
    5 %, raw 2 %; |set point|, NaN if it is too small to take a share of.
    """

    controlled: Number
    step: Number
    band: Number
    band_5: Number
    band_raw: Number
    setpoint: Number


class FlightTerms(NamedTuple):
    """How a flight is judged.

    Rows before and after its own that the moving average takes; until when overshoot is sought at
    least, infinite for the raw reading [s]; weight of the nominal vehicle [N]; period [s].
    """

    before: Number
    after: Number
    transient: Number
    weight: Number
    period: Number


class Terms(NamedTuple):
    """How flights are judged, the same for all of them.

    Attributes:
        asked: `Asked` from the jump on.
        t: Times from the jump on [s].
        enough: `rows_inside` of the noise-aware reading, and `enough_raw` of the raw one.
        axes: Six `AxisTerms`.
        paths: `Path` of position and of Euler angles.
        flight: One `FlightTerms`.
        filter: `Section`s of the high-pass.
    """

    asked: Rows
    t: Rows
    enough: Rows
    enough_raw: Rows
    axes: Rows
    paths: Rows
    flight: Rows
    filter: Rows


class SignalFigures(NamedTuple):
    """Mean, root mean square and motion above 2 Hz of a signal over the steady part."""

    steady_error: Number
    rms: Number
    jitter: Number


class AxisFigures(NamedTuple):
    """What `metrics.AxisMetrics` has beside these; NaN for None."""

    settling_time_s: Number
    settling_time_5_s: Number
    settling_time_raw_s: Number
    overshoot_percent: Number
    overshoot_raw_percent: Number
    overshoot_setpoint_percent: Number
    max_excursion: Number


class FlightFigures(NamedTuple):
    """What `metrics.Metrics` has of numbers, NaN for None; and two integrals of the response.

    The integrals are those of |p - p_d| [mm s] and of the angle of R R_d^T [deg s].
    """

    settling_time_s: Number
    settling_time_5_s: Number
    settling_time_raw_s: Number
    overshoot_percent: Number
    overshoot_raw_percent: Number
    overshoot_setpoint_percent: Number
    rms_position_mm: Number
    rms_attitude_deg: Number
    steady_position_mm: Number
    steady_attitude_deg: Number
    max_excursion_mm: Number
    max_excursion_deg: Number
    jitter_position_mm: Number
    jitter_attitude_deg: Number
    saturated_share: Number
    effort: Number
    integral_position: Number
    integral_attitude: Number


class View(NamedTuple):
    """What the stages of the figures are shown.

    Attributes:
        track: `Flown`, the whole flight.
        diverged: 1 for a flight that ended early, else 0.
        terms: How it is judged.
        signals: `deviation` from the jump on, [signal][period].
        smoothed: Scratch for a signal.
        fast: The same, and `PADDING` at both ends.
        excursions: Largest excursion of each axis, one row each.
        signal_figures: `SignalFigures`, nine.
        axis_figures: `AxisFigures`, six.
        flight_figures: `FlightFigures`, one.
    """

    track: Rows
    diverged: Rows
    terms: Terms
    signals: Rows
    smoothed: Rows
    fast: Rows
    excursions: Rows
    signal_figures: Rows
    axis_figures: Rows
    flight_figures: Rows
