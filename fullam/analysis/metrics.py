"""What a flight was worth: settling, overshoot, errors, jitter, saturation, effort.

All figures judge the TRUE pose against the reference that the scenario asked for, in the axes that
the scenario controls, from the last jump of the reference on (the *response*); a reference
without a jump is judged from the start. The *steady part* is the second half of the response.

Settling and overshoot need care under noise. 2 % of a 10 deg step is 0.2 deg, a fifth of the pose
sensor's standard deviation, and a gust once a second moves any vehicle farther than that. So two
readings are given:

- *raw*: the textbook's. The true error against 2 % of the step, over the whole response.
- *noise-aware*, the one without a suffix: the moving average of the error over 0.2 s
  (`response.SMOOTHING`), against 2 % (5 %) of the step but never less than `NOISE_SIGMAS` standard
  deviations of the pose sensor's noise, because no controller can hold what its sensor cannot
  see. Inside means `SHARE_INSIDE` of the time from then on, what two standard deviations
  promise, and at least half of the response must be left to show it. Overshoot is sought in the
  transient only; later peaks are answers to gusts. The rule follows from scenario and weather
  alone, so it is the same for every controller. In weather without noise and gusts both readings
  are the raw one.

An axis that does not step has settled when it is inside `HOLD_BAND`, which is also 2 % of the
paper's 1 m step and close to its noise bounds (25 mm, 3 deg).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.response import (
    STEP_MINIMUM,
    Response,
    high_pass,
    off_path,
    overshoot,
    settling_time,
)
from fullam.simulation.scenario import AXES

if TYPE_CHECKING:
    from fullam.model.vehicle import Vehicle
    from fullam.simulation.run import Run
    from fullam.simulation.weather import Weather

Array = NDArray[np.float64]
Maybe = float | None

NOISE_SIGMAS = 2.0
"""Narrowest settling band in standard deviations of the pose sensor's noise."""

SHARE_INSIDE = 0.95
"""Share of the rest of the response that a settled axis spends in its band, noise-aware."""

HOLD_BAND = (20.0, 2.0)
"""Settling band of an axis that does not step [mm, deg]."""

TRANSIENT = 3.0
"""Overshoot is sought at least this long after the jump, and until 1 s after settling [s]."""


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
        lengths = ("step", "steady_error", "rms", "max_excursion", "jitter")
        values = asdict(self)
        unit = values.pop("unit")
        return {f"{k}_{unit}" if k in lengths else k: v for k, v in values.items()}


@dataclass(frozen=True)
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
    axes: dict[str, AxisMetrics]

    def to_dict(self) -> dict[str, Any]:
        """JSON values; the axes are nested under "axes", what could not be measured is None."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        values = {k: None if v != v else v for k, v in values.items()}  # NaN is not JSON
        values["axes"] = {name: axis.to_dict() for name, axis in self.axes.items()}
        return values


def measure(run: Run, vehicle: Vehicle | None = None) -> Metrics:
    """All figures of a flight.

    A diverged flight is measured up to its end and has not settled.

    Args:
        run: The record.
        vehicle: The nominal vehicle, if at hand; else it is rebuilt from the record.

    Returns:
        The figures; only the axes that the scenario controls count.
    """
    if len(run) == 0:
        return _unmeasured(run)
    response, scenario, floors = Response.of(run), run.scenario, noise_floors(run.weather)
    steady = response.steady
    mask = np.array(scenario.axes_mask)
    excursion = np.max(np.abs(off_path(response.error, response.step, mask)), axis=0)
    position = np.where(mask[:3], response.error[:, :3], 0.0)
    rotation = np.where(mask[3:], response.rotation, 0.0)
    everything = np.hstack([response.error, position, rotation])
    fast = high_pass(everything, response.period)[steady]
    jitter = _rms(fast[:, :6])
    axes = {}
    for i in np.flatnonzero(mask):
        floor = None if floors is None else floors[i // 3]
        settling, overshoots = _transient(response, int(i), floor, run.diverged)
        error = response.error[steady, i]
        axes[AXES[i]] = AxisMetrics(
            "mm" if i < 3 else "deg",
            float(response.step[i]),
            *settling,
            *overshoots,
            steady_error=float(np.mean(error)),
            rms=float(_rms(error)),
            max_excursion=float(excursion[i]),
            jitter=float(jitter[i]),
        )
    stepping = [axis for axis in axes.values() if axis.step]
    slowest = _latest([axis.settling_time_s for axis in axes.values()])
    vehicle = vehicle or run.vehicle
    thrusts = np.square(run.rotor_speeds) @ vehicle.rotors.k_f
    return Metrics(
        settled=slowest is not None,
        diverged=run.diverged,
        settling_time_s=slowest,
        settling_time_5_s=_latest([axis.settling_time_5_s for axis in axes.values()]),
        settling_time_raw_s=_latest([axis.settling_time_raw_s for axis in stepping]),
        overshoot_percent=_worst([axis.overshoot_percent for axis in stepping]),
        overshoot_raw_percent=_worst([axis.overshoot_raw_percent for axis in stepping]),
        overshoot_setpoint_percent=_worst([axis.overshoot_setpoint_percent for axis in stepping]),
        rms_position_mm=_rms_norm(position[steady]),
        rms_attitude_deg=_rms_norm(rotation[steady]),
        steady_position_mm=float(np.linalg.norm(np.mean(position[steady], axis=0))),
        steady_attitude_deg=float(np.linalg.norm(np.mean(rotation[steady], axis=0))),
        max_excursion_mm=float(np.max(excursion[:3], where=mask[:3], initial=0.0)),
        max_excursion_deg=float(np.max(excursion[3:], where=mask[3:], initial=0.0)),
        jitter_position_mm=_rms_norm(fast[:, 6:9]),
        jitter_attitude_deg=_rms_norm(fast[:, 9:]),
        saturated_share=float(np.mean(run.saturated)),
        effort=float(np.mean(thrusts)) / (vehicle.mass * vehicle.gravity),
        duration_s=float(run.t[-1]),
        axes=axes,
    )


def noise_floors(weather: Weather) -> tuple[float, float] | None:
    """Narrowest settling bands [mm, deg]; None in weather without noise and gusts."""
    noise = (1e3 * weather.position_noise, weather.attitude_noise_deg)
    if not any((*noise, weather.force_disturbance, weather.moment_disturbance)):
        return None
    return (NOISE_SIGMAS * noise[0], NOISE_SIGMAS * noise[1])


def _transient(
    response: Response, i: int, floor: Maybe, diverged: bool
) -> tuple[tuple[Maybe, Maybe, Maybe], tuple[Maybe, Maybe, Maybe]]:
    """Settling times (2 %, 5 %, raw) and overshoots (step, raw, set point) of axis i."""
    t, raw, step = response.t, response.error[:, i], float(response.step[i])
    error = raw if floor is None else response.smoothed[:, i]
    share = 1.0 if floor is None else SHARE_INSIDE

    def settling(band: float) -> Maybe:
        return None if diverged else settling_time(t, error, band, share)

    if not step:
        held = settling(HOLD_BAND[i // 3])
        return (held, held, None), (None, None, None)
    two, five = (settling(max(s * abs(step), floor or 0.0)) for s in (0.02, 0.05))
    end = np.inf if floor is None or two is None else max(TRANSIENT, two + 1.0)
    peak = overshoot(error[t <= end], step)
    setpoint = abs(float(response.setpoint[i]))
    of_setpoint = peak * abs(step) / setpoint if setpoint > STEP_MINIMUM[i // 3] else None
    raw_two = None if diverged else settling_time(t, raw, 0.02 * abs(step))
    return (two, five, raw_two), (peak, overshoot(raw, step), of_setpoint)


def _unmeasured(run: Run) -> Metrics:
    """Figures of a flight that ended before its first tick: nothing but its outcome."""
    unknown: dict[str, Any] = {
        field.name: None if "None" in str(field.type) else np.nan for field in fields(Metrics)
    }
    return Metrics(**unknown | {"settled": False, "diverged": run.diverged, "axes": {}})


def _rms(x: Array) -> Array:
    return np.sqrt(np.mean(np.square(x), axis=0))


def _rms_norm(x: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(x), axis=1))))


def _latest(times: list[Maybe]) -> Maybe:
    """The largest; None if one is None or there is none."""
    known = [time for time in times if time is not None]
    return max(known) if known and len(known) == len(times) else None


def _worst(values: list[Maybe]) -> Maybe:
    """The largest of those that are not None."""
    return max((value for value in values if value is not None), default=None)
