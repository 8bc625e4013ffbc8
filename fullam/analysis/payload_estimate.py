"""The mass and the centre of what hangs at the tool, from what the vehicle knows itself.

A body of mass m whose centre is at c from the tool's point, axes of the arm's last link, pulls at
the origin of {A} with the wrench

    f = m (g - a),    tau = (m r + R s) x (g - a),    s = m c,

r the lever from there to the tool, R the attitude of the last link, a the acceleration: linear in
(m, s). The
external wrench (`external_wrench`, "momentum"), d, measures it after the filter's lag, and what the
nominal vehicle has wrong, b, with it. Both are told apart by the rows before the pick-up:

    d = b                    before,
    d = b + A(q) [m; s]      while it hangs,

a weighted least squares in ten unknowns, its information summed row by row, so that there is an
estimate at each time. What never averages out, the rotors' own factors in what they lift more, is
in the weights. The equations hold while nothing turns and little accelerates; rows in which
something does, and those in which the filter remembers it, add nothing: the estimate is frozen.

The weight tells nothing of the centre along the vertical. What links of one attitude leave open is
held by a prior, c about the tool's point within `reach`; its standard deviation says so. b changes
with the arm's posture as long as the nominal masses are wrong: pick up in the posture of the tare,
or give a calibrated vehicle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.signal import lfilter

from fullam.analysis.external_wrench import ExternalWrench, WrenchSettings, external_wrench
from fullam.analysis.measured_motion import MeasuredMotion
from fullam.checks import Checker, from_zero, positive
from fullam.exceptions import SettingsError
from fullam.model.rotors import Rotors
from fullam.model.vehicle import Vehicle
from fullam.simulation.record.run import Run
from fullam.simulation.tool.held import held_tool

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

TARE = 4.0
"""At most so long before the pick-up is the tare [s]."""

SETTLED = 4.0
"""Time constants after which a filter has forgotten what was: 2 % of it are left."""

VAGUE = 1e-6
"""Information that says nothing [1/kg^2, 1/N^2, ...], and keeps matrices regular."""

LIGHTEST = 1e-3
"""For the prior of the first moment, which goes with the mass [kg]."""

RESTLESS = 0.02
"""What is unexplained while a hover settles, though nothing pushes [N, N m]; a still tare does not
know of it. Half a step of the encoders is a tenth of that."""

ENOUGH = 0.3
"""Of quiet rows with the body before anything is told [s]."""


@dataclass(frozen=True)
class PayloadSettings:
    """How a payload is estimated.

    Attributes:
        picked_up: When the gripper closed [s]; None for the scenario's only payload.
        dropped: When it opened [s]; None as above.
        rate: Of the wrench's filter, and of that of the acceleration [rad/s].
        acceleration: Of the platform, above which the estimate is frozen [m/s^2].
        turning: Rate of platform or any joint, above which it is frozen [rad/s]; a joint that
            slides, [m/s].
        reach: Standard deviation of the centre from the tool's point, before anything is known [m].
        rotor_doubt: Standard deviation of each rotor's factor; by default that of even +-10 %.
    """

    picked_up: float | None = None
    dropped: float | None = None
    rate: float = 20.0
    acceleration: float = 0.3
    turning: float = 0.15
    reach: float = 0.1
    rotor_doubt: float = 0.058

    def __post_init__(self) -> None:
        """Check everything."""
        check = Checker("payload estimate", SettingsError)
        for name, numbers in (
            ("rate", positive(1e4, "rad/s")),
            ("acceleration", positive(1e4, "m/s^2")),
            ("turning", positive(1e4, "rad/s")),
            ("reach", positive(100.0, "m")),
            ("rotor_doubt", from_zero(1.0, "")),
        ):
            object.__setattr__(self, name, check.number(name, getattr(self, name), numbers))
        for name in ("picked_up", "dropped"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, check.number(name, value, from_zero(1e6, "s")))
        if self.picked_up is None and self.dropped is not None:
            raise check.refuse("dropped", "is told, and the pick-up is not", "give picked_up [s]")
        if None not in (self.picked_up, self.dropped) and self.dropped <= self.picked_up:  # type: ignore[operator]
            raise check.refuse("dropped", f"is {self.dropped:g} s", "drop it after the pick-up")

    @property
    def lag(self) -> float:
        """For how long the filter remembers [s]."""
        return SETTLED / self.rate


@dataclass(frozen=True, eq=False)
class PayloadEstimate:
    """What hangs at the tool, over time; NaN where nothing hangs or nothing can be told yet.

    Attributes:
        t: Times, shape (M,) [s].
        mass: Shape (M,) [kg].
        mass_deviation: Its standard deviation, shape (M,) [kg].
        center: From the tool's point, axes of the arm's last link, shape (M, 3) [m].
        center_deviation: Of each coordinate, shape (M, 3) [m]; `reach` where only the prior speaks.
        frozen: Whether a row added nothing, shape (M,).
        settings: How it was estimated.
    """

    t: Array
    mass: Array
    mass_deviation: Array
    center: Array
    center_deviation: Array
    frozen: Flags
    settings: PayloadSettings


def estimate_payload(
    run: Run, settings: PayloadSettings | None = None, vehicle: Vehicle | None = None
) -> PayloadEstimate:
    """Mass and centre of what hung at the tool during a flight; see the module's text.

    Args:
        run: The record.
        settings: How; by default between the times of the scenario's only payload.
        vehicle: What is known of the vehicle; the record's nominal one by default.

    Raises:
        SettingsError: Nobody says when it was picked up, or the record holds no tare before.
        ScenarioError: The tool is not on the arm's last link.
    """
    settings = settings or PayloadSettings()
    vehicle = run.vehicle if vehicle is None else vehicle
    begin, end = gripped(run, settings)
    motion = MeasuredMotion.of(run, vehicle.rotors)
    quiet = ~frozen_rows(motion, settings)
    before = (motion.t[1:] > settings.lag) & (motion.t[1:] < begin) & quiet
    before &= motion.t[1:] >= begin - TARE
    if before.sum() < 20:
        raise SettingsError(
            "payload estimate",
            "picked_up",
            f"is {begin:g} s, and before it the record holds {before.sum()} quiet rows",
            "hover for a second or more before the pick-up, to tare",
        )
    tare = float(motion.t[1:][before][0]), begin - 0.5 * motion.period
    wrench = external_wrench(
        run, WrenchSettings("momentum", rate=settings.rate, tare=tare), vehicle
    )
    t = wrench.t
    hangs = (t >= begin) & (t < end)
    told = hangs & (t >= begin + settings.lag) & quiet
    rows = regressors(motion, vehicle, settings.rate)
    rows[~hangs, :, :4] = 0.0
    noise = gusty_noise(wrench, before, motion.period)
    doubts = doubt(rows[np.argmax(hangs)], vehicle.rotors, settings.rotor_doubt)
    mass, first, covariance = solved(
        rows, wrench.wrench, before, told, noise, doubts, settings.reach
    )
    known = hangs & (np.cumsum(told) * motion.period >= ENOUGH)
    with np.errstate(divide="ignore", invalid="ignore"):
        # c = s / m: its deviation to first order, dc = (ds - c dm) / m.
        center = first / mass[:, None]
        to_center = np.zeros((len(t), 3, 4))
        to_center[:, :, 0], to_center[:, :, 1:] = -center, np.eye(3)
        spread = to_center @ covariance @ to_center.swapaxes(1, 2)
        center_deviation = np.sqrt(np.einsum("nii->ni", spread)) / np.abs(mass)[:, None]
    deviation = np.sqrt(covariance[:, 0, 0])
    heavy = known & (mass > 3.0 * deviation)
    return PayloadEstimate(
        t,
        np.where(known, mass, np.nan),
        np.where(known, deviation, np.nan),
        np.where(heavy[:, None], center, np.nan),
        np.where(heavy[:, None], center_deviation, np.nan),
        ~(before | told),
        settings,
    )


def gusty_noise(wrench: ExternalWrench, before: Flags, period: float) -> Array:
    """Variance of a row for sums of many: the tare's with gusts, times its correlation, (6,)."""
    variance = np.var(wrench.wrench[before], axis=0) + RESTLESS**2
    return np.asarray(variance * max(1.0, wrench.correlation / period))


def gripped(run: Run, settings: PayloadSettings) -> tuple[float, float]:
    """From when to when something hangs [s]: as told, or as the scenario's gripper moves.

    Raises:
        SettingsError: Not told, and the scenario has not exactly one payload.
    """
    end = float(run.t[-1]) + 1.0
    if settings.picked_up is not None:
        return settings.picked_up, end if settings.dropped is None else settings.dropped
    payloads = run.scenario.payloads
    if len(payloads) != 1:
        raise SettingsError(
            "payload estimate",
            "picked_up",
            f"is not told, and the scenario has {len(payloads)} payloads",
            "give picked_up and dropped [s]",
        )
    return payloads[0].picked_up, payloads[0].dropped


def smoothed(x: Array, rate: float, period: float) -> Array:
    """Rows behind the filter of `external_wrench`'s "momentum"."""
    a = 1.0 - np.exp(-rate * period)
    return np.asarray(lfilter([a], [1.0, a - 1.0], x, axis=0))


def accelerations(motion: MeasuredMotion, rate: float) -> Array:
    """Of the platform, world axes, filtered as the wrench is, shape (N - 1, 3) [m/s^2]."""
    world = np.einsum("nij,nj->ni", motion.attitude, motion.v[:, :3])
    return smoothed(np.diff(world, axis=0) / motion.period, rate, motion.period)


def frozen_rows(motion: MeasuredMotion, settings: PayloadSettings) -> Flags:
    """Where something moves too fast, or did within the filter's lag; shape (N - 1,)."""
    rate, period = settings.rate, motion.period
    # Twice: a velocity's noise, differentiated, would freeze a hover.
    acceleration = smoothed(accelerations(motion, rate), rate, period)
    rates = np.abs(smoothed(motion.v[1:, 3:], rate, period))
    fast = np.linalg.norm(acceleration, axis=1) > settings.acceleration
    fast |= np.linalg.norm(rates[:, :3], axis=1) > settings.turning
    fast |= np.any(rates[:, 3:] > settings.turning, axis=1)
    # As long after: whether any of the last `count` rows was fast.
    count = round(settings.lag / period) + 1
    heard = np.convolve(fast, np.ones(count))[: len(fast)]
    return np.asarray(heard > 0.5)


def regressors(motion: MeasuredMotion, vehicle: Vehicle, rate: float) -> Array:
    """[A, 1] of each row from the second on: of m, s and b, shape (N - 1, 6, 10)."""
    point, _ = held_tool(vehicle, "tell what hangs at it")
    model, data = vehicle.model, vehicle.create_data()
    pulls = np.array(model.gravity.linear) - accelerations(motion, rate)
    rows = np.zeros((len(pulls), 6, 10))
    rows[:, :, 4:] = np.eye(6)
    rows[:, :3, 0] = pulls
    for row, q, pull in zip(rows, motion.q[1:], pulls, strict=True):
        pin.forwardKinematics(model, data, q)
        last, across = data.oMi[model.njoints - 1], -pin.skew(pull)  # x -> x cross pull
        row[3:, 0] = across @ (last.act(point) - q[:3])
        row[3:, 1:4] = across @ last.rotation
    return rows


def doubt(row: Array, rotors: Rotors, deviation: float) -> Array:
    """Variance of the wrench that is blamed on each kilogram, as rotors lift it; shape (6,).

    To carry a kilogram at the tool the rotors add the squares u = B^+ w; each one's thrust is wrong
    by its own factor, so that B diag(u)^2 B^T deviation^2 of what is seen is theirs.

    Args:
        row: [A, 1] of a row, the platform about level, shape (6, 10).
        rotors: Their coupling matrix is B, shape (6, n).
        deviation: Of a rotor's factor.
    """
    B = rotors.coupling_matrix
    u = np.linalg.pinv(B) @ -row[:, 0]
    return np.asarray(deviation**2 * B**2 @ u**2)


def solved(
    rows: Array,
    wrench: Array,
    before: Flags,
    told: Flags,
    noise: Array,
    doubts: Array,
    reach: float,
) -> tuple[Array, Array, Array]:
    """The least squares after each row, from all that count up to it, each component for itself.

    Args:
        rows: [A, 1], shape (M, 6, 10).
        wrench: d, shape (M, 6).
        before: Rows of the tare, shape (M,).
        told: Rows with the body, shape (M,).
        noise: Variance of a row, enlarged by the correlation of neighbours, shape (6,).
        doubts: Variance a kg^2 of what never averages out once the body hangs, shape (6,).
        reach: Of the prior [m].

    Returns:
        m (M,), s (M, 3) and their covariance (M, 4, 4).
    """
    squares = np.einsum("nci,ncj->ncij", rows, rows)
    products = rows * wrench[:, :, None]
    tare, body = (
        np.cumsum(np.where(f[:, None, None, None], squares, 0.0), 0) for f in (before, told)
    )
    tare_d, body_d = (
        np.cumsum(np.where(f[:, None, None], products, 0.0), 0) for f in (before, told)
    )

    def least(weights: Array, prior: Array) -> tuple[Array, Array]:
        information = np.einsum("c,ncij->nij", 1.0 / noise, tare)
        information += np.einsum("nc,ncij->nij", weights, body) + prior[:, :, None] * np.eye(10)
        vector = np.einsum("c,nci->ni", 1.0 / noise, tare_d)
        vector += np.einsum("nc,nci->ni", weights, body_d)
        covariance = np.linalg.inv(information)
        return np.einsum("nij,nj->ni", covariance, vector), covariance

    prior = np.full((len(rows), 10), VAGUE)
    # First the mass, the centre at the tool's point: it says how wide doubt and prior are.
    prior[:, 1:4] = 1.0 / (reach * LIGHTEST) ** 2
    found, _ = least(np.broadcast_to(1.0 / noise, wrench.shape), prior)
    mass = np.maximum(np.abs(found[:, :1]), LIGHTEST)
    prior[:, 1:4] = 1.0 / (reach * mass) ** 2
    # n rows of noise v and of a common error D weigh together 1 / (v / n + D).
    found, covariance = least(1.0 / (noise + np.cumsum(told)[:, None] * doubts * mass**2), prior)
    return found[:, 0], found[:, 1:4], covariance[:, :4, :4]
