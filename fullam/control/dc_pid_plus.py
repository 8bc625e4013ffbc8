"""dc-PID+: dynamic compensation with a wrench observer in place of integral action.

    u = blkdiag(m_A 1, I_A) u_pd + u_dc - d

with the compensation u_dc of eq. (20) and d the wrench that the nominal model does not explain
(`wrench_observer`). dc-PID cancels the model; what the model has wrong stays as an offset until its
integrator has grown, and the integrator then answers every manoeuvre with an overshoot. The
observer sees the error of the model in the momentum, before it is an error of the pose.

**Lead.** The rotors' lag is made n times shorter by asking for more than is wanted (`lead`).

**Gains.** On a double integrator behind a lag of 30 ms, 10 ms of sampling and 5 ms to spare, with
n = 2, the loop cut at the command has

    position  25, 10, observer 20 rad/s:  phase margin 45 deg, gain margin 4.7, delay margin 37 ms
    attitude  60, 15, observer 18 rad/s:  phase margin 38 deg, gain margin 4.0, delay margin 27 ms

and with a true lag 30 % longer than the nominal one the attitude keeps 31 deg and 4.4;
`fullam check VEHICLE --controller dc-pid-plus` tells the margins on a vehicle. That much speed
needs an estimate like the Kalman filter's, which it flies with unless told otherwise. Behind the
paper's first-order filter, whose velocity has thirty times the noise, `caution` slows the law down,
and it is then about as good as dc-PID.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from fullam.control.caution import (
    CautionMemory,
    CautionNumbers,
    Halves,
    caution_factors,
    caution_numbers,
    felt,
    slowed,
    trusted,
)
from fullam.control.dc_pid import (
    DcPid,
    DcPidNumbers,
    DcPidSettings,
    PidMemory,
    PreviousMemory,
)
from fullam.control.law import KernelLaw, LawKernels
from fullam.control.lead import asked_from_rotors, led
from fullam.control.pid import Gains, Limits, bounded
from fullam.control.signals import Command, Delivery, Estimate, Target
from fullam.control.tunable import tunable
from fullam.control.wrench_observer import (
    ObserverMemory,
    ObserverNumbers,
    asked,
    less,
    nothing_observed,
    observed,
    observer_numbers,
)
from fullam.dynamics.recursion import JointMotion
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import (
    Spatial,
    add_spatial,
    multiply_spatial,
    rotate_spatial_back,
    subtract_spatial,
)
from fullam.model.vehicle import Vehicle
from fullam.numbers.kernel import Number, kernel, select, some, sqrt
from fullam.numbers.records import flat, record
from fullam.numbers.vectors import ZERO, Vector, dot, scale

Array = NDArray[np.float64]
Nominal = TypeVar("Nominal")


@dataclass(frozen=True)
class DcPidPlusSettings(DcPidSettings):
    """Settings of dc-PID+: those of dc-PID, and the observer's.

    Attributes:
        observer_rates: Rate K of the observer, of force and of moment [rad/s]; 0 switches that
            half off.
        actuation_lag: Time constant with which the wrench follows its command [s]; None takes the
            mean lag of the nominal rotors.
        actuation_speedup: How many times shorter the lead makes that lag; 1 leaves it.
        roughness_limits: Roughness of the measured velocity up to which the law keeps its pace,
            linear [m/s^2] and angular [rad/s^2]; see `caution`. The Kalman filter's stay below
            1 and 8, the first-order filter's are 74 and 128 in the paper's noise.
    """

    position_gains: tuple[float, float, float] = tunable(
        (25.0, 0.0, 10.0), low=(2.0, None, 1.0), high=(80.0, None, 20.0)
    )
    attitude_gains: tuple[float, float, float] = tunable(
        (60.0, 0.0, 15.0), low=(5.0, None, 2.0), high=(300.0, None, 60.0)
    )
    observer_rates: tuple[float, float] = tunable((20.0, 18.0), low=(0.5, 0.5), high=(60.0, 60.0))
    actuation_lag: float | None = None
    actuation_speedup: float = 2.0
    roughness_limits: tuple[float, float] = (8.0, 15.0)

    def __post_init__(self) -> None:
        """Check the observer's numbers, then dc-PID's."""
        super().__post_init__()
        for field in ("observer_rates", "roughness_limits"):
            self._become(field, 2)
        if self.actuation_lag is not None and not 0.0 <= self.actuation_lag < np.inf:
            raise self._wrong("actuation_lag", "give a time >= 0, or None")
        if not 1.0 <= self.actuation_speedup < np.inf:
            raise self._wrong("actuation_speedup", "give 1 or more")

    def wrench_lag(self, vehicle: Vehicle) -> float:
        """Time constant with which the wrench follows its command [s]."""
        lag = self.actuation_lag
        return float(vehicle.rotors.lags.mean()) if lag is None else lag


class DcPidPlusNumbers(NamedTuple):
    """dc-PID+ as numbers.

    dc-PID without bounds; bounds of the total; observer and caution; 1 on axes that are controlled;
    what the lead asks for beyond the wrench, per gap; and how far ahead of a command the platform
    will have turned when the rotors follow it [s].
    """

    nominal: DcPidNumbers
    limits: Limits
    observer: ObserverNumbers
    caution: CautionNumbers
    controlled: Spatial
    lead: Spatial
    turn_ahead: Number


class Beside(NamedTuple):
    """What dc-PID+ remembers beside dc-PID.

    Observer and caution; dc-PID's wrench less the total; and how far the platform will have turned
    when the rotors follow, a rotation vector.
    """

    observer: ObserverMemory
    caution: CautionMemory
    difference: Spatial
    turn: Vector


class PlusMemory(NamedTuple, Generic[Nominal]):
    """dc-PID's memory, which depends on its compensation, and what is beside it."""

    nominal: Nominal
    beside: Beside


@kernel
def paced(numbers, factors):
    """dc-PID slowed down: K_d by f^(1/4) and K_p by its square, as if all rates were."""
    gains = numbers.gains
    half = Halves(sqrt(factors.linear), sqrt(factors.angular))
    quarter = Halves(sqrt(half.linear), sqrt(half.angular))
    k_p, k_d = slowed(half, gains.proportional), slowed(quarter, gains.derivative)
    gains = Gains(k_p, k_d, gains.integral, gains.limit)
    return DcPidNumbers(gains, numbers.limits, numbers.gravity, numbers.rounds)


class Perception(NamedTuple):
    """What a period's estimate tells: caution, its factors, the observer; and what to cancel."""

    caution: CautionMemory
    factors: Halves
    observer: ObserverMemory
    cancelled: Spatial


@kernel
def perceived(numbers, chain, estimate, beside):
    """Caution and the observer after this period's estimate; all that is observed is cancelled.

    In the first period they began with this very estimate: it tells them nothing.
    """
    R = rotation_matrix(estimate.pose.attitude)
    body_velocity = rotate_spatial_back(R, estimate.velocity)
    caution = felt(numbers.caution, beside.caution, body_velocity)
    factors = caution_factors(numbers.caution, caution.roughness)
    observer = observed(numbers.observer, factors, chain, estimate, beside.observer)
    return Perception(caution, factors, observer, observer.wrench)


@kernel
def dc_pid_plus(law, delivered, numbers, chain, estimate, target, memory):
    """dc-PID less the observed wrench; arguments and answer as in `answered`."""
    perception = perceived(numbers, chain, estimate, memory.beside)
    return answered(law, delivered, numbers, chain, estimate, target, memory, perception)


@kernel
def answered(law, delivered, numbers, chain, estimate, target, memory, perception):
    """dc-PID less what is to be cancelled, and a lead; see the module's text.

    Args:
        law: The kernel `command` of dc-PID, a function.
        delivered: Its kernel `delivered`.
        numbers: `DcPidPlusNumbers`.
        chain: The nominal vehicle with its arm in motion.
        estimate: What is told of the platform.
        target: Where it should be.
        memory: `PlusMemory`.
        perception: What this period's estimate tells.

    Returns:
        The command, and the two parts of the memory.
    """
    R = rotation_matrix(estimate.pose.attitude)
    caution, factors, observer, cancelled = perception
    of_dc_pid = paced(numbers.nominal, factors)
    command, nominal = law(of_dc_pid, chain, estimate, target, memory.nominal)
    d = multiply_spatial(numbers.controlled, cancelled)
    u = subtract_spatial(command.wrench, d)

    turn = scale(numbers.turn_ahead, target.velocity.angular)
    gain = slowed(factors, numbers.lead)
    u = led(gain, R, u, observer.actual, turn)
    difference = subtract_spatial(command.wrench, u)

    within = bounded(numbers.limits, u)
    missing = subtract_spatial(within, u)
    cut = dot(missing.linear, missing.linear) + dot(missing.angular, missing.angular) > 0.0
    if some(cut):
        delivery = Delivery(add_spatial(within, difference), missing, 1.0)
        after = delivered(of_dc_pid, chain, estimate, nominal, delivery)
        nominal = select(cut, after, nominal)
    observer = asked(observer, asked_from_rotors(R, within, turn))
    beside = Beside(observer, caution, difference, turn)
    return Command(within, command.u_pid, command.u_dc), nominal, beside


@kernel
def inform(delivered, numbers, chain, estimate, memory, delivery):
    """The observer told what the rotors were asked for, and dc-PID what of it was its own."""
    b = memory.beside
    R = rotation_matrix(estimate.pose.attitude)
    observer = asked(b.observer, asked_from_rotors(R, delivery.wrench, b.turn))
    own = add_spatial(delivery.wrench, b.difference)
    share = Delivery(own, delivery.missing, delivery.saturated)
    nominal = delivered(numbers.nominal, chain, estimate, memory.nominal, share)
    return nominal, Beside(observer, b.caution, b.difference, b.turn)


@kernel
def start_beside(numbers, chain, estimate):
    """Nothing unexplained, nothing against the estimate."""
    R = rotation_matrix(estimate.pose.attitude)
    observer = nothing_observed(numbers.observer, chain, estimate)
    caution = trusted(rotate_spatial_back(R, estimate.velocity))
    return Beside(observer, caution, Spatial(ZERO, ZERO), ZERO)


@cache
def around(dc_pid: LawKernels) -> LawKernels:
    """dc-PID+ around the kernels of dc-PID, for either way to cut the algebraic loop."""
    start_nominal, command_nominal, delivered_nominal = dc_pid[:3]

    @kernel
    def start(numbers, chain, estimate):
        nominal = start_nominal(numbers.nominal, chain, estimate)
        return PlusMemory(nominal, start_beside(numbers, chain, estimate))

    @kernel
    def command(numbers, chain, estimate, target, memory):
        answer, nominal, beside = dc_pid_plus(
            command_nominal, delivered_nominal, numbers, chain, estimate, target, memory
        )
        return answer, PlusMemory(nominal, beside)

    @kernel
    def delivered(numbers, chain, estimate, memory, delivery):
        nominal, beside = inform(delivered_nominal, numbers, chain, estimate, memory, delivery)
        return PlusMemory(nominal, beside)

    @kernel
    def relieved(numbers, chain, estimate, memory, wrench):
        b = memory.beside
        observer = less(numbers.observer, b.observer, wrench)
        return PlusMemory(memory.nominal, Beside(observer, b.caution, b.difference, b.turn))

    return LawKernels(start, command, delivered, relieved)


class BothChains(NamedTuple):
    """The nominal vehicle as the observer's recursion and as dc-PID's model want to see it."""

    links: Any
    joints: Any
    of_model: Any


class DcPidPlus(DcPid):
    """dc-PID with a wrench observer in place of integral action, and a lead on the rotors."""

    name = "dc-pid-plus"
    Settings = DcPidPlusSettings
    estimator = "kalman"
    settings: DcPidPlusSettings

    @property
    def Memory(self) -> type:  # type: ignore[override]
        """What the law remembers."""
        return PlusMemory[PreviousMemory] if self.previous else PlusMemory[PidMemory]

    @property
    def kernels(self) -> LawKernels:
        """See `KernelLaw`."""
        return around(super().kernels)

    def numbers(self) -> Any:
        """See `DcPidPlusNumbers`."""
        s, period = self.settings, self.period
        nominal = super().numbers()
        total = nominal.limits
        # What is bounded is the wrench less the observed one, not dc-PID's share of it.
        without = record(Spatial, np.full(6, np.inf))
        below = record(Spatial, np.full(6, -np.inf))
        controlled = np.asarray(self.axes, dtype=float)
        return DcPidPlusNumbers(
            nominal._replace(limits=total._replace(lower=below, upper=without)),
            total,
            observer_numbers(self.vehicle, period, s.observer_rates, self.wrench_lag()),
            caution_numbers(period, s.roughness_limits),
            record(Spatial, controlled),
            record(Spatial, controlled * (s.actuation_speedup - 1.0)),
            self.thrust_lag() + 0.5 * period if self.anticipated else 0.0,
        )

    def wrench_lag(self) -> float:
        """Time constant with which the wrench follows its command [s]."""
        return self.settings.wrench_lag(self.vehicle)

    def thrust_lag(self) -> float:
        """The same as the lead makes it appear; see `Controller.thrust_lag`."""
        return self.wrench_lag() / self.settings.actuation_speedup

    @property
    def observed_wrench(self) -> Array:
        """The observed wrench d of the last period, world axes, shape (6,) [N, N m]."""
        return np.array(flat(self._memory.beside.observer.wrench))

    def chain(self, motions: Sequence[JointMotion]) -> Any:
        """The nominal vehicle, as the observer and as dc-PID's model want to see it."""
        placed = KernelLaw.chain(self, motions)
        return BothChains(placed.links, placed.joints, self.model.chain(motions))

    def _command(self, chain: Any, estimate: Estimate, target: Target) -> tuple[Command, Any]:
        def law(numbers: Any, _: Any, estimate: Any, target: Any, memory: Any) -> Any:
            return self.nominal(numbers, chain.of_model, estimate, target, memory)

        of_dc_pid = super().kernels.delivered
        answer, *memory = dc_pid_plus(
            law, of_dc_pid, self._numbers, chain, estimate, target, self._memory
        )
        return answer, PlusMemory(*memory)
