"""What the laws that touch share: dc-PID+ with its observer held at a tare along a normal.

Along the normal n of what is touched an observer that is cancelled would cancel the contact. A law
that touches weighs first: the *tare* is the mean of what the observer sees along n just before the
law engages, and from then on it cancels the tare along n, and all that is seen in other directions.
What lies beyond the tare is the contact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np

from fullam.checks import Checker
from fullam.control.dc_pid_plus import (
    Beside,
    DcPidPlus,
    DcPidPlusSettings,
    Perception,
    answered,
    inform,
    perceived,
    start_beside,
)
from fullam.control.law import LawKernels
from fullam.control.signals import Command, Estimate, Target
from fullam.dynamics.spatial import Spatial
from fullam.exceptions import SettingsError
from fullam.numbers.kernel import Number, both, kernel, select
from fullam.numbers.vectors import Vector, axpy, dot

Kernel = Callable[..., Any]
Nominal = TypeVar("Nominal")
Contact = TypeVar("Contact")


@dataclass(frozen=True)
class TouchingSettings(DcPidPlusSettings):
    """Settings of a law that touches: those of dc-PID+, and where, when and how hard.

    Attributes:
        normal: Into what is touched, world axes, of any length.
        force: f, wanted there [N].
        engage_at: When the law begins to push [s]; before, it is dc-PID+, and takes its tare.
        release_at: When it is dc-PID+ again [s].
        tare: Over how long before engaging the tare is taken [s].
    """

    normal: tuple[float, float, float] = (1.0, 0.0, 0.0)
    force: float = 3.0
    engage_at: float = 3.0
    release_at: float = 1e6
    tare: float = 2.0

    def __post_init__(self) -> None:
        """Check the contact's numbers, then dc-PID+'s."""
        super().__post_init__()
        check = Checker(type(self).__name__, SettingsError)
        object.__setattr__(self, "normal", check.vector("normal", self.normal, 3))
        if not np.linalg.norm(self.normal) > 0.0:
            raise self._wrong("normal", "say which way to push")
        self._above_zero("tare")
        if not self.tare <= self.engage_at <= self.release_at:
            raise self._wrong("engage_at", "engage after the tare, and before the release")

    def _above_zero(self, *names: str) -> None:
        for field in names:
            if not 0.0 < getattr(self, field) < np.inf:
                raise self._wrong(field, "give a number above 0")

    @property
    def unit_normal(self) -> tuple[float, float, float]:
        """The normal, of length 1."""
        x, y, z = (np.array(self.normal) / np.linalg.norm(self.normal)).tolist()
        return x, y, z


class TareNumbers(NamedTuple):
    """Unit normal; control periods of engaging, of the release and of the tare."""

    normal: Vector
    engage: Number
    release: Number
    periods: Number


class TareMemory(NamedTuple):
    """Control periods since take-off, and the tare so far [N]."""

    elapsed: Number
    value: Number


class TouchingMemory(NamedTuple, Generic[Nominal, Contact]):
    """What `PlusMemory` holds, and the contact's memory, which begins with its tare."""

    nominal: Nominal
    beside: Beside
    contact: Contact


def tare_numbers(settings: TouchingSettings, period: float) -> TareNumbers:
    """When to weigh and to push, in control periods [s]."""
    return TareNumbers(
        settings.unit_normal,
        float(round(settings.engage_at / period)),
        float(round(settings.release_at / period)),
        float(round(settings.tare / period)),
    )


@kernel
def engaged(numbers, memory):
    """Whether it is time to push."""
    return both(memory.elapsed >= numbers.engage, memory.elapsed < numbers.release)


@kernel
def weighed(numbers, memory, along):
    """The tare one period on, after the observer has seen a force `along` n."""
    count = memory.elapsed - (numbers.engage - numbers.periods)
    weighing = both(count >= 0.0, memory.elapsed < numbers.engage)
    mean = memory.value + (along - memory.value) / select(weighing, count + 1.0, 1.0)
    return TareMemory(memory.elapsed + 1.0, select(weighing, mean, memory.value))


@kernel
def touching(contact, law, delivered, numbers, chain, estimate, target, memory):
    """dc-PID+ that, while it pushes, goes where the contact wants and cancels what it leaves.

    Args:
        contact: The kernel `contact` of a law that touches; see `Touching`.
        law: The kernel `command` of dc-PID, a function.
        delivered: Its kernel `delivered`.
        numbers: dc-PID+'s and the contact's.
        chain: The nominal vehicle with its arm in motion.
        estimate: What is told of the platform.
        target: Where it should be.
        memory: `TouchingMemory`.

    Returns:
        The command, and the three parts of the memory.
    """
    tare = numbers.contact.tare
    seen = perceived(numbers.plus, chain, estimate, memory.beside)
    d = seen.observer.wrench
    along = dot(d.linear, tare.normal)
    pushing = engaged(tare, memory.contact.tare)
    after, aim, change = contact(numbers.contact, memory.contact, along, estimate, target)
    held = select(pushing, axpy(change, tare.normal, d.linear), d.linear)
    answer, nominal, beside = answered(
        law,
        delivered,
        numbers.plus,
        chain,
        estimate,
        select(pushing, aim, target),
        memory,
        Perception(seen.caution, seen.factors, seen.observer, Spatial(held, d.angular)),
    )
    return answer, nominal, beside, after


@cache
def around(dc_pid: LawKernels, contact: Kernel, untouched: Kernel) -> LawKernels:
    """A law that touches around the kernels of dc-PID; for its own two see `Touching`."""
    start_nominal, command_nominal, delivered_nominal = dc_pid[:3]

    @kernel
    def start(numbers, chain, estimate):
        nominal = start_nominal(numbers.plus.nominal, chain, estimate)
        beside = start_beside(numbers.plus, chain, estimate)
        return TouchingMemory(nominal, beside, untouched())

    @kernel
    def command(numbers, chain, estimate, target, memory):
        command, nominal, beside, after = touching(
            contact, command_nominal, delivered_nominal, numbers, chain, estimate, target, memory
        )
        return command, TouchingMemory(nominal, beside, after)

    @kernel
    def delivered(numbers, chain, estimate, memory, delivery):
        plus = numbers.plus
        nominal, beside = inform(delivered_nominal, plus, chain, estimate, memory, delivery)
        return TouchingMemory(nominal, beside, memory.contact)

    return LawKernels(start, command, delivered)


class Touching(DcPidPlus):
    """dc-PID+ that touches along one direction; subclasses say how.

    They give two kernels,

        contact(numbers, memory, along, estimate, target) -> memory, target, change
        untouched() -> memory

    of which `contact` is told what the observer sees along n [N], and answers with the contact's
    memory one period on, the target while the law pushes, and by how much what is cancelled along
    n then differs from what is seen there [N]: it is at the tare with tare - along.

    Attributes:
        contact_memory: Record of what the law remembers of the contact.
        contact_kernels: The kernels `contact` and `untouched`.
    """

    touches = True
    settings: TouchingSettings
    contact_memory: ClassVar[type]
    contact_kernels: ClassVar[tuple[Kernel, Kernel]]

    @property
    def Memory(self) -> Any:  # type: ignore[override]
        """What the law remembers."""
        return TouchingMemory[super(DcPidPlus, self).Memory, self.contact_memory]  # type: ignore[misc]

    @property
    def kernels(self) -> LawKernels:
        """See `KernelLaw`."""
        return around(super(DcPidPlus, self).kernels, *self.contact_kernels)

    @property
    def tare(self) -> float:
        """What the observer saw along the normal before the law engaged [N]."""
        return float(self._memory.contact.tare.value)

    def _command(self, chain: Any, estimate: Estimate, target: Target) -> tuple[Command, Any]:
        def law(numbers: Any, _: Any, estimate: Any, target: Any, memory: Any) -> Any:
            return self.nominal(numbers, chain.of_model, estimate, target, memory)

        of_dc_pid, (contact, _) = super(DcPidPlus, self).kernels.delivered, self.contact_kernels
        command, *memory = touching(
            contact, law, of_dc_pid, self._numbers, chain, estimate, target, self._memory
        )
        return command, TouchingMemory(*memory)
