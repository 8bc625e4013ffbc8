"""Hybrid force and motion control on dc-PID+: push along a normal, follow the target elsewhere.

Along a normal n (into what is touched) the target's position counts for nothing; the platform is
driven at an approach speed v_a, and where something pushes back, by the force f that is wanted:

    a_n = K_d (v_a - v_n),    u_n += s (f - m K_d v_a),

so that the tool, at rest against a wall (v_n = 0, s = 1), is pushed with f. s rises from 0 to 1
while the observer feels something push back, and falls while it does not: a lost contact is
approached again at v_a. What the observer sees along n is held at its *tare*, the mean before the
law engages: cancelling all of it would cancel the contact. Everything else, friction and the moment
of the force at the tool among it, is rejected in full.

How well f is met is how well the rotors are known: an unknown +-10 % of eight thrust coefficients
is some 2 % of f, and the tare takes off what it does to the weight. `calibrate` for the rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from fullam.checks import Checker
from fullam.control.dc_pid import PidMemory, PreviousMemory
from fullam.control.dc_pid_plus import (
    Beside,
    DcPidPlus,
    DcPidPlusNumbers,
    DcPidPlusSettings,
    Perception,
    answered,
    inform,
    perceived,
    start_beside,
)
from fullam.control.law import LawKernels
from fullam.control.signals import Command, Estimate, Target
from fullam.dynamics.spatial import Pose, Spatial
from fullam.exceptions import SettingsError
from fullam.numbers.kernel import Number, both, clip, kernel, select
from fullam.numbers.vectors import Vector, axpy, dot, subtract


@dataclass(frozen=True)
class HybridForceSettings(DcPidPlusSettings):
    """Settings of the hybrid law: those of dc-PID+, and the contact's.

    Attributes:
        normal: Into what is touched, world axes, of any length.
        force: f, wanted there [N].
        approach_speed: v_a [m/s]; beyond 0.1 a stiff wall is bounced off.
        engage_at: When the law begins to push [s]; before, it is dc-PID+, and takes its tare.
        release_at: When it is dc-PID+ again [s].
        tare: Over how long before engaging the tare is taken [s].
        touch: Force that pushes back at which there is a contact [N].
        rise: In how long s rises to 1 [s].
    """

    normal: tuple[float, float, float] = (1.0, 0.0, 0.0)
    force: float = 3.0
    approach_speed: float = 0.06
    engage_at: float = 3.0
    release_at: float = 1e6
    tare: float = 2.0
    touch: float = 0.7
    rise: float = 0.5

    def __post_init__(self) -> None:
        """Check the contact's numbers, then dc-PID+'s."""
        super().__post_init__()
        check = Checker(type(self).__name__, SettingsError)
        object.__setattr__(self, "normal", check.vector("normal", self.normal, 3))
        if not np.linalg.norm(self.normal) > 0.0:
            raise self._wrong("normal", "say which way to push")
        for field in ("force", "approach_speed", "tare", "touch", "rise"):
            if not 0.0 < getattr(self, field) < np.inf:
                raise self._wrong(field, "give a number above 0")
        if not self.tare <= self.engage_at <= self.release_at:
            raise self._wrong("engage_at", "engage after the tare, and before the release")


class ForceNumbers(NamedTuple):
    """The contact as numbers.

    Unit normal; f - m K_d v_a [N]; v_a; control periods of engaging, of the release and of the
    tare; touch [N]; and by how much s changes in a period.
    """

    normal: Vector
    force: Number
    speed: Number
    engage: Number
    release: Number
    tare: Number
    touch: Number
    rise: Number


class ForceMemory(NamedTuple):
    """Control periods since take-off, the tare so far [N], and s."""

    elapsed: Number
    tare: Number
    share: Number


class HybridNumbers(NamedTuple):
    """dc-PID+'s numbers and the contact's."""

    plus: DcPidPlusNumbers
    contact: ForceNumbers


class HybridMemory(NamedTuple):
    """dc-PID+'s memory and the contact's."""

    nominal: PidMemory
    beside: Beside
    contact: ForceMemory


class HybridPreviousMemory(NamedTuple):
    """The same with "previous_wrench"."""

    nominal: PreviousMemory
    beside: Beside
    contact: ForceMemory


@kernel
def engaged(numbers, memory):
    """Whether it is time to push."""
    return both(memory.elapsed >= numbers.engage, memory.elapsed < numbers.release)


@kernel
def felt_contact(numbers, memory, along):
    """The contact's memory after the observer has seen a force `along` n."""
    pushing = engaged(numbers, memory)
    count = memory.elapsed - (numbers.engage - numbers.tare)
    weighing = both(count >= 0.0, memory.elapsed < numbers.engage)
    mean = memory.tare + (along - memory.tare) / select(weighing, count + 1.0, 1.0)
    touching = both(pushing, memory.tare - along > numbers.touch)
    change = select(touching, numbers.rise, -numbers.rise)
    return ForceMemory(
        memory.elapsed + 1.0,
        select(weighing, mean, memory.tare),
        clip(memory.share + change, 0.0, 1.0),
    )


@kernel
def freed(numbers, estimate, target):
    """The target without a say along n, but for the approach speed."""
    n = numbers.normal
    gap = dot(subtract(estimate.pose.position, target.pose.position), n)
    position = axpy(gap, n, target.pose.position)
    v, a = target.velocity, target.acceleration
    velocity = axpy(numbers.speed - dot(v.linear, n), n, v.linear)
    acceleration = axpy(-dot(a.linear, n), n, a.linear)
    return Target(
        Pose(position, target.pose.attitude),
        Spatial(velocity, v.angular),
        Spatial(acceleration, a.angular),
    )


@kernel
def hybrid(law, delivered, numbers, chain, estimate, target, memory):
    """The command and the three parts of the memory; arguments as in `dc_pid_plus`."""
    contact, n = numbers.contact, numbers.contact.normal
    seen = perceived(numbers.plus, chain, estimate, memory.beside)
    d = seen.observer.wrench
    along = dot(d.linear, n)
    pushing = engaged(contact, memory.contact)
    after = felt_contact(contact, memory.contact, along)
    held = axpy(after.tare - along - after.share * contact.force, n, d.linear)
    cancelled = Spatial(select(pushing, held, d.linear), d.angular)
    answer, nominal, beside = answered(
        law,
        delivered,
        numbers.plus,
        chain,
        estimate,
        select(pushing, freed(contact, estimate, target), target),
        memory,
        Perception(seen.caution, seen.factors, seen.observer, cancelled),
    )
    return answer, nominal, beside, after


@cache
def around(dc_pid: LawKernels, Memory: type) -> LawKernels:
    """The hybrid law around the kernels of dc-PID; as `dc_pid_plus.around`."""
    start_nominal, command_nominal, delivered_nominal = dc_pid

    @kernel
    def start(numbers, chain, estimate):
        nominal = start_nominal(numbers.plus.nominal, chain, estimate)
        beside = start_beside(numbers.plus, chain, estimate)
        return Memory(nominal, beside, ForceMemory(0.0, 0.0, 0.0))

    @kernel
    def command(numbers, chain, estimate, target, memory):
        answer, nominal, beside, contact = hybrid(
            command_nominal, delivered_nominal, numbers, chain, estimate, target, memory
        )
        return answer, Memory(nominal, beside, contact)

    @kernel
    def delivered(numbers, chain, estimate, memory, delivery):
        plus = numbers.plus
        nominal, beside = inform(delivered_nominal, plus, chain, estimate, memory, delivery)
        return Memory(nominal, beside, memory.contact)

    return LawKernels(start, command, delivered)


class HybridForce(DcPidPlus):
    """dc-PID+ that pushes along one direction and follows its target in all others."""

    name = "hybrid-force"
    Settings = HybridForceSettings
    touches = True
    settings: HybridForceSettings

    @property
    def Memory(self) -> type:  # type: ignore[override]
        """What the law remembers."""
        return HybridPreviousMemory if self.previous else HybridMemory

    @property
    def kernels(self) -> LawKernels:
        """See `KernelLaw`."""
        return around(super(DcPidPlus, self).kernels, self.Memory)

    def numbers(self) -> Any:
        """See `HybridNumbers`."""
        plus, s, period = super().numbers(), self.settings, self.period
        normal = np.array(s.normal) / np.linalg.norm(s.normal)
        damping = np.array(plus.nominal.gains.derivative.linear) @ normal**2
        contact = ForceNumbers(
            tuple(normal.tolist()),
            float(s.force - self.vehicle.mass * damping * s.approach_speed),
            s.approach_speed,
            float(round(s.engage_at / period)),
            float(round(s.release_at / period)),
            float(round(s.tare / period)),
            s.touch,
            period / s.rise,
        )
        return HybridNumbers(plus, contact)

    @property
    def tare(self) -> float:
        """What the observer saw along the normal before the law engaged [N]."""
        return float(self._memory.contact.tare)

    def _command(self, chain: Any, estimate: Estimate, target: Target) -> tuple[Command, Any]:
        def law(numbers: Any, _: Any, estimate: Any, target: Any, memory: Any) -> Any:
            return self.nominal(numbers, chain.of_model, estimate, target, memory)

        of_dc_pid = super(DcPidPlus, self).kernels.delivered
        answer, *memory = hybrid(
            law, of_dc_pid, self._numbers, chain, estimate, target, self._memory
        )
        return answer, self.Memory(*memory)
