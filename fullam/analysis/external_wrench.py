"""The external wrench on a vehicle, from what it knows itself: a momentum balance, filtered.

Over a period T the momentum about a fixed point, computed from the estimated velocity and the
nominal masses, changes by more than the rotors and gravity bring:

    x = (h+ - h) / T - U - g,

the unexplained wrench: what pushes, gusts, and whatever masses, inertias and thrust coefficients
have wrong, which a tare in hover takes off (calibrate, for the rest). Three ways to filter it:

- "momentum": d+ = d + a (x - d), a = 1 - exp(-K T): the classical observer of rate K.
- "acceleration": twice the same, one behind the other, as one filters a differentiated velocity.
- "kalman": momentum and wrench as states, the wrench a random walk; the momentum is measured with
  white noise and driven by another, of variances that the tare shows. In the steady state

      i = x - d - g,  g+ = (l_1 - 1) i,  d+ = d + l_2 i,

  of which the momentum observer is the case l_1 = 1.

The arm is known as the law knows it (`control.arm_feedback`). While it swings by 50 deg in 0.45 s
on its servos, in the paper's noise, the momentum observer of 20 rad/s is 0.15 N and 0.06 N m off
with the servos' twin, 0.45 N and 0.21 N m with differences of encoder readings, and 0.10 N and
0.012 N m where the joints are known exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are
from scipy.signal import lfilter
from scipy.stats import chi2

from fullam.analysis.measured_motion import MeasuredMotion, about_start
from fullam.checks import Checker, from_zero, positive
from fullam.exceptions import SettingsError, UnknownName
from fullam.model.vehicle import Vehicle
from fullam.simulation.record.run import Run

Array = NDArray[np.float64]

METHODS = ("momentum", "acceleration", "kalman")
PLACES = ("platform", "tool")

ROBUST = 1.4826
"""Standard deviation over median absolute deviation of normal numbers; gusts move it little."""

HOUR = 3600.0


@dataclass(frozen=True)
class WrenchSettings:
    """How the wrench is estimated.

    Attributes:
        method: One of `METHODS`.
        at: Where the wrench is taken to act: at the origin of the "platform", or at the "tool".
        rate: K of "momentum" and "acceleration" [rad/s].
        agility: How fast an external force may change, for "kalman" [N/sqrt(s)]; a moment by
            `lever` times as much.
        lever: What turns forces into moments [m].
        tare: Begin and end of a stretch without contact, whose mean is taken off and whose spread
            tells the noise [s].
    """

    method: str = "kalman"
    at: str = "platform"
    rate: float = 20.0
    agility: float = 10.0
    lever: float = 0.2
    tare: tuple[float, float] = (1.0, 4.0)

    def __post_init__(self) -> None:
        """Check everything."""
        check = Checker("external wrench", SettingsError)
        for field, choices in (("method", METHODS), ("at", PLACES)):
            chosen = check.text(field, getattr(self, field))
            if chosen not in choices:
                raise UnknownName("place" if field == "at" else field, chosen, choices)
        for name, unit in (("rate", "rad/s"), ("agility", "N/sqrt(s)"), ("lever", "m")):
            value = check.number(name, getattr(self, name), positive(1e4, unit))
            object.__setattr__(self, name, value)
        tare = check.vector("tare", self.tare, 2, from_zero(1e6, "s"))
        if tare[1] <= tare[0]:
            raise check.refuse("tare", f"is {tare}", "give begin and end [s]")
        object.__setattr__(self, "tare", tare)


@dataclass(frozen=True, eq=False)
class ExternalWrench:
    """An external wrench over time.

    Attributes:
        t: Times, shape (M,) [s].
        wrench: [force; moment] in world axes at the place, shape (M, 6) [N, N m].
        covariance: Of one row while nothing pushes, shape (6, 6), gusts left out.
        correlation: Time over which its noise is correlated [s].
        settings: How it was estimated.
    """

    t: Array
    wrench: Array
    covariance: Array
    correlation: float
    settings: WrenchSettings

    def __str__(self) -> str:
        """In a line."""
        force = np.linalg.norm(self.wrench[:, :3], axis=1)
        return (
            f"external wrench at the {self.settings.at}, {len(self.t)} rows to {self.t[-1]:g} s: "
            f"force {force[-1]:.2f} N at the end, {force.max():.2f} N at most"
        )

    @property
    def surprise(self) -> Array:
        """f^T C^-1 f of the force, shape (M,): chi-squared of three while nothing pushes."""
        force = self.wrench[:, :3]
        scaled = np.linalg.solve(self.covariance[:3, :3], force.T).T
        return np.einsum("ni,ni->n", force, scaled)

    def threshold(self, false_alarms: float = 1.0) -> float:
        """Of the surprise, which normal noise passes at most so many times an hour.

        Every row counts as a look of its own, which is an upper bound; and the covariance, known
        from n independent looks of the tare, may be two deviations sqrt(2 / n) too small.
        """
        check = Checker("threshold", SettingsError)
        false_alarms = check.number("false_alarms", false_alarms, positive(1e6, "per hour"))
        looks = HOUR / (self.t[1] - self.t[0])
        tare = self.settings.tare[1] - self.settings.tare[0]
        doubt = 1.0 + 2.0 * np.sqrt(2.0 * min(1.0, self.correlation / tare))
        return float(doubt * chi2.isf(min(1.0, false_alarms / looks), 3))

    def detect(self, false_alarms: float = 1.0, persistence: float = 0.0) -> Array:
        """When something begins to push [s], looked for from the end of the tare on.

        Args:
            false_alarms: That normal noise may give in an hour.
            persistence: For how long the surprise has to stay above the threshold, the force
                pointing one way [s]: longer than a gust echoes in the filter. The time of a
                detection includes it.
        """
        check = Checker("detect", SettingsError)
        false_alarms = check.number("false_alarms", false_alarms, positive(1e6, "per hour"))
        persistence = check.number("persistence", persistence, from_zero(1e3, "s"))
        above = (self.surprise > self.threshold(false_alarms)) & (self.t > self.settings.tare[1])
        force = self.wrench[:, :3]
        same_way = np.einsum("ni,ni->n", force[1:], force[:-1]) > 0.0
        above[1:] &= same_way | ~above[:-1]
        count = max(1, round(persistence / (self.t[1] - self.t[0])) + 1)
        run = np.convolve(above, np.ones(count), mode="full")[: above.size] > count - 0.5
        return np.array(self.t[np.flatnonzero(run & ~np.r_[False, run[:-1]])])


def external_wrench(
    run: Run, settings: WrenchSettings | None = None, vehicle: Vehicle | None = None
) -> ExternalWrench:
    """What pushed on a vehicle during a flight; see the module's text.

    Args:
        run: The record.
        settings: How; by default by Kalman filter, at the platform.
        vehicle: What is known of the vehicle; the record's nominal one by default. A calibrated one
            needs no tare.

    Raises:
        SettingsError: The record holds no whole tare, or something is no record, vehicle or
            settings.
        UnknownName: No such method or place.
    """
    check = Checker("external wrench", SettingsError)
    check.instance("run", run, Run)
    settings = WrenchSettings() if settings is None else settings
    check.instance("settings", settings, WrenchSettings)
    vehicle = run.vehicle if vehicle is None else vehicle
    check.instance("vehicle", vehicle, Vehicle)
    if len(run) < 2:
        raise check.refuse("run", f"has {len(run)} rows", "give the record of a whole flight")
    motion = MeasuredMotion.of(run, vehicle.rotors)
    t = motion.t[1:]
    quiet = (t >= settings.tare[0]) & (t <= settings.tare[1])
    if quiet.sum() < 20:
        raise SettingsError(
            "external wrench",
            "tare",
            f"{settings.tare} s holds {quiet.sum()} rows of the record",
            "name a stretch of the flight in which nothing pushes, a second or more",
        )
    raw = unexplained(motion, vehicle)
    raw -= np.median(raw[quiet], axis=0)
    wrench = filtered(raw, quiet, motion.period, settings)
    wrench = wrench - wrench[quiet].mean(axis=0)
    if settings.at == "tool":
        moment = np.cross(tool_levers(motion, vehicle), wrench[:, :3])
        wrench = np.hstack([wrench[:, :3], wrench[:, 3:] - moment])
    noise = wrench[quiet]
    spread = ROBUST * np.median(np.abs(noise), axis=0) + 1e-12
    within = np.clip(noise, -3.0 * spread, 3.0 * spread)
    covariance = within.T @ within / len(within)
    neighbours = np.einsum("ni,ni->i", within[1:], within[:-1])[:3]
    alike = float(
        np.clip(np.mean(neighbours / np.einsum("ni,ni->i", within, within)[:3]), 0, 0.999)
    )
    correlation = motion.period * (1.0 + alike) / (1.0 - alike)
    return ExternalWrench(t, wrench, covariance, correlation, settings)


def unexplained(motion: MeasuredMotion, vehicle: Vehicle) -> Array:
    """The x of each period, at the origin of {A} in world axes, shape (N - 1, 6) [N, N m]."""
    model, data, start = vehicle.model, vehicle.create_data(), motion.pose[0, :3]
    h, center = np.empty((len(motion.q), 6)), np.empty((len(motion.q), 3))
    for k, (q, v) in enumerate(zip(motion.q, motion.v, strict=True)):
        momentum = pin.computeCentroidalMomentum(model, data, q, v)
        center[k] = data.com[0] - start
        h[k, :3], h[k, 3:] = momentum.linear, momentum.angular
    h[:, 3:] += np.cross(center, h[:, :3])
    weight = vehicle.mass * np.array(model.gravity.linear)
    moment = np.cross(0.5 * (center[1:] + center[:-1]), weight)
    rotors = about_start(motion.squares[:-1] @ vehicle.rotors.coupling_matrix.T, motion)
    x = np.diff(h, axis=0) / motion.period - rotors
    x[:, :3] -= weight
    x[:, 3:] -= moment + np.cross(motion.lever, x[:, :3])
    return np.array(x)


def filtered(x: Array, quiet: NDArray[np.bool_], period: float, settings: WrenchSettings) -> Array:
    """The unexplained wrench, filtered by the method; shape (M, 6)."""
    if settings.method == "kalman":
        sizes = [settings.agility] * 3 + [settings.agility * settings.lever] * 3
        gains = [
            kalman_gains(*noises(column[quiet]), size**2 * period)
            for column, size in zip(x.T, sizes, strict=True)
        ]
        return np.stack(
            [followed(column, *gain) for column, gain in zip(x.T, gains, strict=True)], axis=1
        )
    a = 1.0 - np.exp(-settings.rate * period)
    for _ in range(1 if settings.method == "momentum" else 2):
        x = lfilter([a], [1.0, a - 1.0], x, axis=0)
    return x


def noises(x: Array) -> tuple[float, float]:
    """Variances of the white noise of h / T as it is measured, and as it is driven.

    x is then e+ - e + w: minus the covariance of neighbours is the first, and what is left of the
    variance the second. Gusts, which are rare and large, are cut to three deviations.
    """
    spread = ROBUST * float(np.median(np.abs(x))) + 1e-12
    x = np.clip(x, -3.0 * spread, 3.0 * spread)
    variance = float(np.mean(x**2))
    white = max(-float(np.mean(x[1:] * x[:-1])), 1e-4 * variance)
    return white, max(variance - 2.0 * white, 1e-4 * variance)


def kalman_gains(white: float, driven: float, walk: float) -> tuple[float, float]:
    """l_1 and l_2 in the steady state, of h / T and d with variances a period."""
    A, H = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    P = solve_discrete_are(A.T, H.T, np.diag([driven, walk]), np.array([[white]]))
    gain = P[:, 0] / (P[0, 0] + white)
    return float(gain[0]), float(gain[1])


def followed(x: Array, l_1: float, l_2: float) -> Array:
    """The Kalman filter's wrench, i = x - d - g, as one linear filter of second order."""
    # With i+ = x+ - d+ - g+: i+ - (2 - l_1 - l_2) i + (1 - l_1) i- = x+ - x, and d+ = d + l_2 i.
    return lfilter([l_2], [1.0, l_1 + l_2 - 2.0, 1.0 - l_1], x)


def tool_levers(motion: MeasuredMotion, vehicle: Vehicle) -> Array:
    """From the origin of {A} to the tool at each time from the second on, world axes (M, 3) [m]."""
    model, data = vehicle.model, vehicle.create_data()
    frame, levers = model.getFrameId(vehicle.tool), []
    for q in motion.q[1:]:
        pin.forwardKinematics(model, data, q)
        place = pin.updateFramePlacement(model, data, frame).translation
        levers.append(place - q[:3])
    return np.array(levers)
