"""Why a flight went wrong, from its record: what was in its way, and what to change.

`diagnose` looks at what was asked (tilt beyond what the vehicle holds), at the sensors (biased, and
believed), at the loop (margins, delay, a swing), at the rotors (at their bounds, for how long, on
which side), at the gusts (beyond the reserve of the rotors) and at the governor (tilt that it took
back), and tells what it finds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.atlas.loads import load_of
from fullam.analysis.atlas.rays import attained
from fullam.analysis.foresight import reach_warning
from fullam.analysis.margins import LoopMargins, flight_margins
from fullam.analysis.metrics import measure
from fullam.analysis.pushed import as_kernels
from fullam.analysis.sensing import sensor_warning
from fullam.analysis.touching import contact_of, unsettled_axes
from fullam.checks import Checker
from fullam.control.controllers import recommended_estimator, suits
from fullam.dynamics.rotations import quaternion_rotation
from fullam.exceptions import FullamError, RunFileError
from fullam.model.attainable.facets import facets_of
from fullam.model.vehicle import Vehicle
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.oscillation import LAST, errors, swing
from fullam.simulation.record.refly import plan_of
from fullam.simulation.record.run import Run

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

AT_BOUND = 1e-3
"""A squared speed this close to its bound, as a share of the largest, is at it."""

LEAST_SHARE, LEAST_TIME = 0.02, 0.1
"""Rotors at a bound for less than this share of the flight, and nowhere for so long [s], are not
worth a word; nor is a shorter gust, whose impulse is over before the platform has moved."""

GIVEN_UP = 0.05
"""Share of the tilt that the governor may take back without a word."""


@dataclass(frozen=True)
class Finding:
    """Something that was in a flight's way.

    Attributes:
        kind: "sensors", "margin", "estimator", "delay", "swing", "reach", "failure", "saturation",
            "gusts", "governor", or "contact" or "unsettled" where there is nothing else.
        what: What was found.
        remedy: What to change.
    """

    kind: str
    what: str
    remedy: str

    def __str__(self) -> str:
        """Both."""
        return f"{self.what}: {self.remedy}"

    def to_dict(self) -> dict[str, str]:
        """JSON values."""
        return asdict(self)


def diagnose(run: Run) -> list[Finding]:
    """What was in the way of a flight, the likeliest cause first; empty if nothing was.

    Args:
        run: The record; nothing else is needed.

    Raises:
        RunFileError: It is no record.
    """
    Checker("diagnose", RunFileError).instance("run", run, Run)
    if not len(run):
        return []
    vehicle = run.vehicle
    found = [finding for look in LOOKS for finding in look(run, vehicle)]
    return found or _unsettled(run, vehicle)


def _reach(run: Run, vehicle: Vehicle) -> list[Finding]:
    """A tilt that cannot be held at rest; or how it hovered without rotors that have failed."""
    trim = run.trim
    if trim is not None:
        return [Finding("failure", str(trim["says"]), "repair it, or land")]
    beyond = reach_warning(run.scenario, vehicle)
    if beyond is None or beyond.t > run.t[-1]:
        return []
    held = "" if beyond.held is None else f" {np.degrees(beyond.held):.1f} deg or less, or"
    remedy = f"ask for{held} more thrust, less weight or another azimuth"
    return [Finding("reach", f"the target is out of reach: {beyond}", remedy)]


def _sensors(run: Run, vehicle: Vehicle) -> list[Finding]:
    """Sensors that the estimator should not have believed."""
    try:
        warning = sensor_warning(run.weather, str(run.simulation.estimator))
    except FullamError:
        return []  # an estimator that is not registered here
    if warning is None:
        return []
    what, _, remedy = warning.partition(": ")
    return [Finding("sensors", what, remedy)]


def _loop(run: Run, vehicle: Vehicle) -> list[Finding]:
    """A loop without a margin, and whether that is for the delay or the estimator."""
    try:
        plan = plan_of(run)
    except FullamError:
        return []  # a law that is not registered here, or takes other settings
    found = _margins(plan)
    delay, own = plan.simulation.delay, recommended_estimator(run.controller)
    right = f"fly it with the estimator it is made for, {own}"
    if found is None or found.enough:
        flown = str(plan.simulation.estimator)
        what = f"{run.controller} flew with the estimator {flown}"
        return [] if suits(run.controller, flown) else [Finding("estimator", what, right)]
    if delay > 0.0 and not found.stable:
        prompt = _margins(replace(plan, simulation=replace(plan.simulation, delay=0.0)))
        if prompt is not None and prompt.delay is not None and prompt.enough:
            return [
                Finding(
                    "delay",
                    f"the pose arrives {1e3 * delay:.0f} ms late and the loop bears "
                    f"{1e3 * prompt.delay:.0f} ms: {found.worst}",
                    "a faster sensor, lower gains, or an estimator that makes up for it (kalman)",
                )
            ]
    remedy = "lower its gains, make rotors or control faster, or fly a law that knows the arm"
    if not suits(run.controller, found.estimator):
        remedy = right
    what = f"{found.controller} with {found.estimator} has no margin on {vehicle.name}"
    return [Finding("margin", f"{what}: {found.worst}", remedy)]


def _margins(plan: FlightPlan) -> LoopMargins | None:
    """Margins of a flight, where machine code tells them and the vehicle can hover."""
    try:
        return flight_margins(plan) if as_kernels(plan) else None
    except FullamError:
        return None


def _swing(run: Run, vehicle: Vehicle) -> list[Finding]:
    """A swing while it flew, or before it diverged."""
    flown = f"--controller {run.controller} --estimator {run.simulation.estimator}"
    remedy = f"look at the margins, fullam check {vehicle.name} {flown}"
    if run.oscillating:
        return [Finding("swing", str(run.metadata["reason"]), remedy)]
    if not run.diverged:
        return []
    period = run.simulation.control_period
    part = slice(max(0, len(run) - round(LAST / period)), None)
    asked = np.hstack([run.reference_pose[part], run.arm[part]])
    e = errors(run.pose[part], run.reference_pose[part])
    found = swing(e, period, np.array(run.scenario.axes_mask), asked, steady=False)
    if found is None:
        return []
    return [Finding("swing", f"before it diverged the {found}", remedy)]


def _saturation(run: Run, vehicle: Vehicle) -> list[Finding]:
    """Rotors at their bounds while that cost wrench."""
    period, rotors = run.simulation.control_period, vehicle.rotors
    longest = _longest(run.saturated) * period
    if run.saturated.mean() < LEAST_SHARE and longest < LEAST_TIME:
        return []
    largest = np.where(rotors.max_speeds > 0.0, rotors.max_speeds, np.nan)  # failed: at no bound
    square = np.square(run.rotor_commands[run.saturated] / largest)
    parts = []
    for side, at in (
        ("largest", square > 1.0 - AT_BOUND),
        ("least", square < rotors.least_shares + AT_BOUND),
    ):
        time = at.sum(axis=0) * period
        often = np.flatnonzero(time >= max(0.5 * time.max(), 0.05 * run.saturated.sum() * period))
        if often.size:
            names = ", ".join(rotors.names[i] for i in often)
            where = _side(rotors.positions[often])
            parts.append(
                f"{names} ({where}) at the {side} speed for up to {time[often].max():.2f} s"
            )
    what = (
        f"bounds of the rotors cost wrench for {run.saturated.sum() * period:.2f} s of "
        f"{len(run) * period:.2f} s, {longest:.2f} s at a stretch from "
        f"{run.t[_start(run.saturated)]:.2f} s on"
    )
    remedy = "ask for less tilt or acceleration (--shape), calm the law, or give it more thrust"
    return [Finding("saturation", "; ".join([what, *parts]), remedy)]


def _gusts(run: Run, vehicle: Vehicle) -> list[Finding]:
    """Gusts that are more than the rotors have left beside the weight, for longer than a kick."""
    gusty = np.any(run.disturbance != 0.0, axis=1)
    if not gusty.any() or vehicle.gravity <= 0.0 or not all(run.scenario.axes_mask):
        return []
    period, rows = run.simulation.control_period, np.flatnonzero(gusty)
    load, R = load_of(vehicle, run.arm[0]), quaternion_rotation(run.reference_pose[rows, 3:])
    gust = run.disturbance[rows].reshape(-1, 2, 3)
    against = -np.einsum("nji,nkj->nki", R, gust).reshape(-1, 6)
    holding = R[:, 2, :] @ load.map.T
    facets = facets_of(vehicle.rotors)
    beyond = np.zeros(len(run), dtype=bool)
    beyond[rows] = attained(facets, holding) & ~attained(facets, holding + against)
    longest = _longest(beyond) * period
    if longest < LEAST_TIME:
        return []
    force, moment = np.linalg.norm(run.disturbance[beyond].reshape(-1, 2, 3), axis=2).max(axis=0)
    return [
        Finding(
            "gusts",
            f"gusts of up to {force:.1f} N and {moment:.2f} N m are beyond the reserve of the "
            f"rotors, {longest:.2f} s at a stretch from {run.t[_start(beyond)]:.2f} s on",
            "less wind, less tilt, or more thrust: fullam check VEHICLE tells the reserve",
        )
    ]


def _governor(run: Run, vehicle: Vehicle) -> list[Finding]:
    """Tilt that the governor took back."""
    if run.given_up.max() < GIVEN_UP:
        return []
    up = quaternion_rotation(run.reference_pose[:, 3:])[:, 2, 2]
    lost = np.degrees(np.arccos(np.clip(up, -1.0, 1.0))) * run.given_up
    period = run.simulation.control_period
    if lost.max() < 1.0:
        return []
    return [
        Finding(
            "governor",
            f"the governor took back up to {lost.max():.1f} deg of tilt, for "
            f"{np.sum(run.given_up > GIVEN_UP) * period:.2f} s, since force was short",
            "ask for less tilt or more slowly (--shape), or --governor off to insist on it",
        )
    ]


def _unsettled(run: Run, vehicle: Vehicle) -> list[Finding]:
    """Nothing was in its way, and yet an axis does not settle."""
    metrics = measure(run, vehicle)
    late = [(name, metrics.axes[name]) for name in unsettled_axes(run, metrics)]
    if not late:
        return []
    told = ", ".join(f"{name} ({axis.rms:.2g} {axis.unit} RMS)" for name, axis in late)
    if contact_of(run) is not None:
        remedy = "target what is free, or push with a law that touches (hybrid-force, admittance)"
        return [Finding("contact", f"{told} is off its target, and the tool touches", remedy)]
    own = recommended_estimator("dc-pid-plus")
    remedy = f"see it --calm; a longer flight, or less noise to the law (dc-pid-plus with {own})"
    return [Finding("unsettled", f"{told} does not stay in its band", remedy)]


LOOKS: tuple[Callable[[Run, Vehicle], list[Finding]], ...] = (
    *(_reach, _sensors, _loop, _swing, _saturation, _gusts, _governor),
)
"""What is looked at, in the order of the findings."""


def _longest(flags: Flags) -> int:
    """Rows of the longest stretch."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return int(np.diff(edges)[::2].max(initial=0))


def _start(flags: Flags) -> int:
    """First row of the longest stretch."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return int(edges[::2][np.diff(edges)[::2].argmax()])


def _side(positions: Array) -> str:
    """Where some rotors sit, seen from the platform's origin."""
    center = positions[:, :2].mean(axis=0)
    if np.linalg.norm(center) < 0.25 * np.linalg.norm(positions[:, :2], axis=1).mean():
        return "all round"
    azimuth = np.degrees(np.arctan2(center[1], center[0]))
    sides = ("+x", "+x+y", "+y", "-x+y", "-x", "-x-y", "-y", "+x-y")
    return f"on the {sides[round(azimuth / 45.0) % 8]} side"
