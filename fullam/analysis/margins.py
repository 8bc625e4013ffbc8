"""Margins of a law's loops on a vehicle: how much delay, phase and gain each axis has to spare.

With the loop of one axis cut at the command, between law and rotors, and the others closed: a push
v on the command of that axis (`pushed`) is answered by the law with u = T v, so the rotors get
S v = (1 + T) v, and what runs round the loop is

    L(z) = -T(z) / (1 + T(z)),    T(z) = sum_k h_k z^-k,    z = exp(i w T_c),

with the answers h_k to a unit push, faded out over their last third, and the control period T_c.
Vehicle, rotor lag, sampling, delay and estimator are those of the flight. Then

    phase margin   the least |arg(-L)| over the crossovers |L| = 1,
    delay margin   the least arg(-L) / w there, arg from 0 to 2 pi: delay beyond that of the flight,
    gain margin    the least 1/|L| above 1 over the frequencies at which L is real and negative.

A loop whose answer does not die down has no margins: it oscillates by itself.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.pushed import Answers, answers, as_kernels, hover_of
from fullam.analysis.sensing import sensor_warning
from fullam.checks import Checker, from_zero
from fullam.control.controllers import recommended_estimator, suits
from fullam.exceptions import NonFiniteWrench, SettingsError
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.oscillation import NAMES
from fullam.simulation.weather import CALM

Array = NDArray[np.float64]

LOWEST = 1.0
"""Crossovers are looked for from here [rad/s]: the answers are too short for slower ones."""

FREQUENCIES = 4000

RUNAWAY = 0.5
"""What does not come to rest, and swings more slowly than this, runs away [Hz]."""

DIES_DOWN = 0.7
"""In the last quarter of its time an answer is smaller than this share of the second quarter's."""

FAINT = 0.01
"""Or than this share of its largest."""

LEAST_PHASE, LEAST_GAIN = 10.0, 1.25
"""A loop with less phase [deg] or gain is as good as without a margin: +-10 % on the parameters may
use it up."""


@dataclass(frozen=True)
class AxisMargin:
    """Margins of the loop of one axis.

    Attributes:
        axis: 0 to 5, see `NAMES`.
        stable: Whether what is pushed comes to rest.
        crossover: Frequency at which the loop has the least phase to spare [rad/s].
        phase: Phase margin [deg].
        gain: Gain margin; None if no gain within the band is too much.
        delay: Delay margin [s].
        ringing: Frequency of what does not come to rest [Hz]; None if it does.
    """

    axis: int
    stable: bool
    crossover: float | None
    phase: float | None
    gain: float | None
    delay: float | None
    ringing: float | None

    @property
    def name(self) -> str:
        """The axis in words."""
        return NAMES[self.axis]

    @property
    def enough(self) -> bool:
        """Whether there is a margin to speak of."""
        return (
            self.stable
            and (self.phase is None or self.phase >= LEAST_PHASE)
            and (self.gain is None or self.gain >= LEAST_GAIN)
        )

    @property
    def instability(self) -> str:
        """How an unstable axis goes."""
        fast = self.ringing is not None and self.ringing >= RUNAWAY
        return f"is unstable at {self.ringing:.1f} Hz" if fast else "runs away"

    def __str__(self) -> str:
        """In a line."""
        if not self.stable:
            return f"{self.name} {self.instability}"
        if self.phase is None or self.delay is None:
            return f"{self.name} has no crossover"
        return (
            f"{self.name} has {self.phase:.0f} deg of phase and {1e3 * self.delay:.0f} ms of delay "
            f"to spare at {self.crossover:.0f} rad/s"
        )


@dataclass(frozen=True)
class LoopMargins:
    """Margins of a law on a vehicle.

    Attributes:
        controller: The law.
        estimator: What tells it the state.
        axes: The controlled axes.
    """

    controller: str
    estimator: str
    axes: tuple[AxisMargin, ...]

    @property
    def worst(self) -> AxisMargin:
        """An unstable axis if there is one, else the one with the least phase.

        Of unstable ones a rotation comes first: it moves the position along.
        """
        unstable = [axis for axis in self.axes if not axis.stable]
        if unstable:
            return min(unstable, key=lambda axis: (axis.axis < 3, axis.axis))
        return min(self.axes, key=lambda axis: 360.0 if axis.phase is None else axis.phase)

    @property
    def stable(self) -> bool:
        """Whether every axis is."""
        return all(axis.stable for axis in self.axes)

    @property
    def enough(self) -> bool:
        """Whether every axis has a margin to speak of."""
        return all(axis.enough for axis in self.axes)

    @property
    def delay(self) -> float | None:
        """Delay that may be added before an axis becomes unstable [s]; None if one is already."""
        found = [axis.delay for axis in self.axes if axis.delay is not None]
        return min(found) if self.stable and found else None

    def rows(self) -> list[tuple[str, str, str, str, str]]:
        """Rows of a table: axis, phase [deg], gain, delay [ms], crossover [rad/s]."""
        return [
            (a.name, _cell(a.phase, 1.0), _cell(a.gain, 1.0, 1), _cell(a.delay, 1e3),
             _cell(a.crossover, 1.0, 1) if a.stable else a.instability)
            for a in self.axes
        ]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        data: dict[str, Any] = {"controller": self.controller, "estimator": self.estimator}
        data["enough"] = self.enough
        return data | {"axes": {axis.name: asdict(axis) for axis in self.axes}}


def _cell(value: float | None, scale: float, digits: int = 0) -> str:
    return "-" if value is None else f"{scale * value:.{digits}f}"


def loop_margins(plan: FlightPlan, spare: float = 0.0) -> LoopMargins:
    """Margins of a flight's law on its nominal vehicle, in level hover with the arm as it starts.

    Args:
        plan: The flight; its weather's noise is kept, gusts and errors of the parameters are not.
        spare: Delay that is added to the loop before its margins are read [s].

    Raises:
        NonFiniteWrench: The law returned NaN or infinity in hover.
        NotFullyActuated, ScenarioError: As for a flight.
        SettingsError: It is no plan, or the delay makes no sense.
    """
    check = Checker("loop_margins", SettingsError)
    check.instance("plan", plan, FlightPlan)
    spare = check.number("spare", spare, from_zero(100.0, "s"))
    found = answers(hover_of(plan))
    axes = tuple(axis_margin(found, i, spare) for i in range(len(found.axes)))
    return LoopMargins(plan.controller, str(plan.simulation.estimator), axes)


def axis_margin(found: Answers, i: int, spare: float = 0.0) -> AxisMargin:
    """The margins of the i-th axis that was pushed."""
    h, axis = found.commands[:, i], found.axes[i]
    if not dies_down(h):
        return AxisMargin(axis, False, None, None, None, None, ringing_of(h, found.period))
    w: Array = np.geomspace(LOWEST, 0.999 * np.pi / found.period, FREQUENCIES)
    L = open_loop(h, w * found.period) * np.exp(-1j * w * spare)
    turn, size = np.angle(-L), np.abs(L)
    at = np.flatnonzero((size[:-1] - 1.0) * (size[1:] - 1.0) < 0.0)
    real = np.flatnonzero((L.imag[:-1] * L.imag[1:] < 0.0) & (L.real[:-1] < 0.0))
    gains = [1.0 / size[k] for k in real if size[k] < 1.0]
    gain = float(min(gains)) if gains else None
    if not at.size:
        return AxisMargin(axis, True, None, None, gain, None, None)
    least = at[np.abs(turn[at]).argmin()]
    delay = float(np.min((turn[at] % (2.0 * np.pi)) / w[at]))
    phase = float(np.degrees(abs(turn[least])))
    return AxisMargin(axis, True, float(w[least]), phase, gain, delay, None)


def open_loop(h: Array, angles: Array) -> NDArray[np.complex128]:
    """L at z = exp(i angle), from the answers of the closed loop.

    Args:
        h: Answers to a unit push, shape (N,).
        angles: w T_c [rad], shape (M,).
    """
    fade = np.ones(len(h))
    last = len(h) // 3
    fade[-last:] = 0.5 * (1.0 + np.cos(np.pi * np.arange(last) / last))
    # sum_k h_k z^-k by Horner's rule: a table of all powers would fill the memory at 1 kHz.
    T: NDArray[np.complex128] = np.zeros(len(angles), dtype=complex)
    back = np.exp(-1j * angles)
    for value in (h * fade)[::-1]:
        T = T * back + value
    loop: NDArray[np.complex128] = -T / (1.0 + T)
    return loop


def dies_down(h: Array) -> bool:
    """Whether an answer comes to rest."""
    if not np.isfinite(h).all():
        return False
    quarters = [np.abs(part).max() for part in np.array_split(h, 4)]
    return bool(quarters[3] < max(DIES_DOWN * quarters[1], FAINT * max(quarters)))


def ringing_of(h: Array, period: float) -> float:
    """Frequency of what does not come to rest [Hz]; 0 for one that runs away."""
    rest = h[len(h) // 2 :]
    rest = rest[np.isfinite(rest)]
    if len(rest) < 2:
        return 0.0
    time = np.arange(len(rest))
    level = np.abs(rest).max()
    rest = rest - np.polyval(np.polyfit(time, rest, 1), time)
    if np.abs(rest).max() <= 1e-6 * level:
        return 0.0
    bins = 8 * len(rest)
    spectrum = np.abs(np.fft.rfft(rest * np.hanning(len(rest)), bins))
    return float(spectrum.argmax() / (bins * period))


def flight_margins(plan: FlightPlan) -> LoopMargins:
    """Margins of a flight as it will be flown: in its noise, or with exact sensors if that is more.

    Noise makes a cautious law slower, and rotors meet their bounds in it, where no loop is linear.
    """
    noisy = loop_margins(plan)
    if noisy.enough or not plan.weather.noise_scale.any():
        return noisy
    still = loop_margins(replace(plan, weather=CALM))
    return still if still.enough else noisy


def margin_warning(plan: FlightPlan) -> str | None:
    """Why a flight's loop has no margin, in a line; None if it has one, or if only Python flies it.

    Args:
        plan: The flight.
    """
    if not as_kernels(plan):
        return None  # by Python it takes longer than the flight
    try:
        found = flight_margins(plan)
    except NonFiniteWrench as error:
        return f"{plan.controller} with {plan.simulation.estimator}: {error}"
    if found.enough:
        return None
    law = f"{plan.controller} with the estimator {found.estimator} on {plan.nominal.name}"
    return f"no margin: {law}: {found.worst}"


def estimator_cost(plan: FlightPlan) -> str | None:
    """What flying with another estimator than the law's own costs, in a line; None with its own.

    Nor is it worth a word where the own one does not bear the sensors of this weather.
    """
    own, flown = recommended_estimator(plan.controller), str(plan.simulation.estimator)
    if suits(plan.controller, flown):
        return None
    if sensor_warning(plan.weather, own) and not sensor_warning(plan.weather, flown):
        return None
    line = f"{plan.controller} is made for the estimator {own}"
    if not as_kernels(plan):
        return line
    simulation = replace(plan.simulation, estimator=own, estimator_settings={})
    try:
        found = loop_margins(plan), loop_margins(replace(plan, simulation=simulation))
    except NonFiniteWrench:
        return line
    told = "; ".join(f"with {margins.estimator} {margins.worst}" for margins in found)
    return f"{line}: {told}"
