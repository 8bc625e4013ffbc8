"""What a flight was worth: settling, overshoot, errors, jitter, saturation, effort.

All figures judge the TRUE pose against the reference that the scenario asked for, in the axes that
the scenario controls, from the last jump of the reference on (the *response*); a reference
without a jump is judged from the start. The *steady part* is the second half of the response.

Settling and overshoot need care under noise. 2 % of a 10 deg step is 0.2 deg, a fifth of the pose
sensor's standard deviation, and a gust once a second moves any vehicle farther than that. So two
readings are given:

- *raw*: the textbook's. The true error against 2 % of the step, over the whole response.
- *noise-aware*, the one without a suffix: the moving average of the error over 0.2 s
  (`response.SMOOTHING`), against 2 % (5 %) of the step but never less than `judge.NOISE_SIGMAS`
  standard deviations of the pose sensor's noise, because no controller can hold what its sensor
  cannot see. Inside means `judge.SHARE_INSIDE` of the time from then on, what two standard
  deviations promise, and at least half of the response must be left to show it. Overshoot is
  sought in the transient only; later peaks are answers to gusts. The rule follows from scenario
  and weather alone, so it is the same for every controller. In weather without noise and gusts
  both readings are the raw one.

An axis that does not step has settled when it is inside `judge.HOLD_BAND`, which is also 2 %
of the paper's 1 m step and close to its noise bounds (25 mm, 3 deg).

One flight (`measure`) and the flights of a campaign, eight at a time (`judge.TrackJudge`, then
`metrics_of` or `rows_of`), are measured by the same kernels and have the same bits.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, fields
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fullam.analysis import metrics_table
from fullam.analysis.asked_motion import AskedMotion
from fullam.analysis.deviation import track_of
from fullam.analysis.judge import COLUMN, NOISE_SIGMAS, Figures, Judge
from fullam.analysis.tool_error import AskedTool
from fullam.checks import Checker
from fullam.exceptions import RunFileError
from fullam.simulation.record.run import Run
from fullam.simulation.scenarios.scenario import AXES

if TYPE_CHECKING:
    from fullam.model.vehicle import Vehicle
    from fullam.simulation.weather import Weather

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AxisMetrics:
    """Figures of one axis; lengths in `unit`.

    Attributes:
        unit: "mm" or "deg"; attitude axes are x-y-z Euler angles.
        step: Jump of the reference, signed.
        settling_time_s: From the jump until the error stays in the 2 % band, noise-aware; None if
            it never does.
        settling_time_5_s: The same for 5 %.
        settling_time_raw_s: The raw reading of 2 %; None also for a held axis.
        overshoot_percent: Largest error beyond the target, noise-aware, in percent of the step;
            None for a held axis.
        overshoot_raw_percent: The raw reading of it.
        overshoot_setpoint_percent: `overshoot_percent` as a share of the set point's value (the
            paper does not say which it means); None where the set point is 0.
        steady_error: Mean error over the steady part.
        rms: Root mean square error over the steady part.
        max_excursion: Largest deviation from the straight line between the start and the target
            of the jump; for a held axis simply the largest error.
        jitter: RMS of the motion above 2 Hz over the steady part.
    """

    unit: str
    step: float
    settling_time_s: float | None
    settling_time_5_s: float | None
    settling_time_raw_s: float | None
    overshoot_percent: float | None
    overshoot_raw_percent: float | None
    overshoot_setpoint_percent: float | None
    steady_error: float
    rms: float
    max_excursion: float
    jitter: float

    def to_dict(self) -> dict[str, Any]:
        """JSON values; lengths carry their unit in the key, as in `rms_mm`."""
        return {axis_key(name, self.unit): _json(getattr(self, name)) for name in AXIS_FIGURES}


AXIS_FIGURES = tuple(field.name for field in fields(AxisMetrics) if field.name != "unit")
UNITS = ("mm",) * 3 + ("deg",) * 3
LENGTHS = ("step", "steady_error", "rms", "max_excursion", "jitter")


def axis_key(name: str, unit: str) -> str:
    """Key of a figure of an axis in JSON: lengths carry their unit."""
    return f"{name}_{unit}" if name in LENGTHS else name


def _json(value: Any) -> Any:
    """The value; None if it is NaN, which is not JSON."""
    return None if value != value else value


@dataclass(frozen=True, repr=False)
class Metrics:
    """Figures of one flight; see the module's docstring for the rules.

    Attributes:
        settled: Whether every controlled axis settled (2 %), and the flight did not diverge.
        diverged: Whether the flight ended early.
        settling_time_s: Of the slowest controlled axis, 2 %; None if one never settles.
        settling_time_5_s: The same for 5 %.
        settling_time_raw_s: The same for the raw reading, over the axes that step.
        overshoot_percent: Of the worst axis, in percent of its step; None if no axis steps.
        overshoot_raw_percent: The same for the raw reading.
        overshoot_setpoint_percent: The same as a share of the set point's value.
        rms_position_mm: sqrt(mean |p - p_d|^2) over the steady part.
        rms_attitude_deg: The same for the angle of R_d R^T, eqs. (17)-(18).
        steady_position_mm: |mean (p - p_d)| over the steady part.
        steady_attitude_deg: The same for the rotation vector.
        max_excursion_mm: Largest deviation of a position axis from the straight line between start
            and target: for a tilted hover the dip.
        max_excursion_deg: The same for the Euler angles.
        jitter_position_mm: RMS of the position above 2 Hz over the steady part.
        jitter_attitude_deg: RMS of the rotation vector above 2 Hz over the steady part.
        saturated_share: Share of all ticks in which the allocation met a bound, 0 to 1.
        effort: Mean sum of the rotor thrusts over the weight of the nominal vehicle.
        duration_s: Length of the record.
        tool_rms_mm: RMS distance of the tool from the path that the scenario gives it, as long as
            that lasts; None if it gives none.
        axes: Figures of each controlled axis.
    """

    settled: bool
    diverged: bool
    settling_time_s: float | None
    settling_time_5_s: float | None
    settling_time_raw_s: float | None
    overshoot_percent: float | None
    overshoot_raw_percent: float | None
    overshoot_setpoint_percent: float | None
    rms_position_mm: float
    rms_attitude_deg: float
    steady_position_mm: float
    steady_attitude_deg: float
    max_excursion_mm: float
    max_excursion_deg: float
    jitter_position_mm: float
    jitter_attitude_deg: float
    saturated_share: float
    effort: float
    duration_s: float
    tool_rms_mm: float | None
    axes: dict[str, AxisMetrics]

    def __repr__(self) -> str:
        """The figures as tables: axis by axis, and of the whole flight."""
        return metrics_table.as_text(self)

    def _repr_html_(self) -> str:
        """The same tables in a notebook."""
        return metrics_table.as_html(self)

    def to_dict(self) -> dict[str, Any]:
        """JSON values; the axes are nested under "axes", what could not be measured is None."""
        values: dict[str, Any] = {name: _json(getattr(self, name)) for name in FLIGHT_FIGURES}
        values["axes"] = {name: axis.to_dict() for name, axis in self.axes.items()}
        return values


FLIGHT_FIGURES = tuple(field.name for field in fields(Metrics) if field.name != "axes")
OPTIONAL = {
    field.name for kind in (Metrics, AxisMetrics) for field in fields(kind) if "None" in field.type
}
"""Figures that may be None."""


def measure(run: Run, vehicle: Vehicle | None = None) -> Metrics:
    """All figures of a flight.

    A diverged flight is measured up to its end and has not settled.

    Args:
        run: The record.
        vehicle: The nominal vehicle, if at hand; else it is rebuilt from the record.

    Returns:
        The figures; only the axes that the scenario controls count.

    Raises:
        RunFileError: It is no record.
    """
    Checker("measure", RunFileError).instance("run", run, Run)
    controlled = np.array(run.scenario.axes_mask)
    if len(run) == 0:
        nothing = Figures.unknown(controlled, np.array([run.diverged]))
        return metrics_of(nothing)[0]
    vehicle = vehicle or run.vehicle
    asked = AskedMotion.of(run.t, run.reference_pose, run.pose[0])
    weight = vehicle.mass * vehicle.gravity
    tool = AskedTool.of(run.scenario, vehicle, run.t, run.arm)
    judge = Judge(asked, controlled, noise_floors(run.weather), weight, tool)
    thrust = np.square(run.rotor_speeds) @ vehicle.rotors.k_f
    track = track_of(run.pose, run.saturated, thrust)
    return metrics_of(judge.over(track).figures([len(run)], [run.diverged]))[0]


def noise_floors(weather: Weather) -> tuple[float, float] | None:
    """Narrowest settling bands [mm, deg]; None in weather without noise and gusts."""
    noise = (1e3 * weather.position_noise, weather.attitude_noise_deg)
    if not any((*noise, weather.force_disturbance, weather.moment_disturbance)):
        return None
    return (NOISE_SIGMAS * noise[0], NOISE_SIGMAS * noise[1])


def metrics_of(figures: Figures) -> list[Metrics]:
    """The figures of flights, one object each."""
    controlled = np.flatnonzero(figures.controlled).tolist()
    found = []
    for measured, row in zip(figures.measured, _cells(figures, OPTIONAL), strict=True):
        cells = iter(row)
        whole = dict(zip(FLIGHT_FIGURES, islice(cells, len(FLIGHT_FIGURES)), strict=True))
        axes = {
            AXES[i]: AxisMetrics(UNITS[i], *islice(cells, len(AXIS_FIGURES))) for i in controlled
        }
        found.append(Metrics(**whole, axes=axes if measured else {}))
    return found


def rows_of(figures: Figures) -> list[dict[str, Any]]:
    """The figures of flights, one flat dictionary each, as `campaign_store.flatten` makes them."""
    keys = list(FLIGHT_FIGURES)
    for i in np.flatnonzero(figures.controlled):
        keys += [f"{AXES[i]}_{axis_key(name, UNITS[i])}" for name in AXIS_FIGURES]
    rows = [dict(zip(keys, cells, strict=True)) for cells in _cells(figures)]
    for k in np.flatnonzero(~figures.measured):
        rows[k] = {name: rows[k][name] for name in FLIGHT_FIGURES}
    return rows


def _cells(figures: Figures, optional: Container[str] | None = None) -> list[list[Any]]:
    """Values of each flight: `FLIGHT_FIGURES`, then `AXIS_FIGURES` of each controlled axis.

    Args:
        figures: The numbers.
        optional: Figures for which None stands in the place of NaN; all of them by default.
    """
    names = [(name, name) for name in FLIGHT_FIGURES]
    for i in np.flatnonzero(figures.controlled):
        names += [(name, f"{AXES[i]}_{name}") for name in AXIS_FIGURES]
    values = figures.numbers[:, [COLUMN[column] for _, column in names]]
    none = np.isnan(values)
    if optional is not None:
        none &= [name in optional for name, _ in names]
    cells = values.astype(object)
    cells[none] = None
    cells[:, :2] = values[:, :2] > 0.0  # settled and diverged
    rows: list[list[Any]] = cells.tolist()
    return rows
