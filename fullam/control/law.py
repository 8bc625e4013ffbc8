"""Laws written as kernels: flown by Python, by machine code, and eight flights at a time.

A law of this kind is three kernels and two records. What it knows is a record of `numbers` (gains,
limits, the nominal vehicle's constants); what it remembers from period to period is a record
`Memory`:

    start(numbers, chain, estimate) -> memory
    command(numbers, chain, estimate, target, memory) -> command, memory
    delivered(numbers, chain, estimate, memory, delivery) -> memory

with

    numbers     what `numbers()` of the class returned, a NamedTuple of numbers, vectors, records
    chain       the nominal vehicle with its arm in motion, for `dynamics.recursion`: `root_wrench`
                (inverse dynamics), `compensation` (u_dc), `platform_wrench`, ...
    estimate    `Estimate`: pose, and velocity [dp, w], world axes
    target      `Target`: pose, velocity and acceleration, world axes
    command     `Command`: wrench at the origin of {A}, u_pid and u_dc, world axes
    delivery    `Delivery`: what was achieved, and by how much it falls short
    memory      a NamedTuple of the law's own

`start` is called before the first period, `command` every period, `delivered` only where bounds of
the rotors kept a command from being delivered. A fourth kernel may be left out,

    relieved(numbers, chain, estimate, memory, wrench) -> memory

called after each period of a flight that learns what hangs at the tool: of what the memory holds
for a disturbance, `wrench` (at the origin of {A}, world axes, mostly zero) acts on the law for the
last time, since others take care of it from then on; see `fullam.control.payload_observer`.

A kernel has no branch on data (both sides are computed and `select` takes one), no strings or
objects inside, and its constants are numbers; `fullam.numbers` says more, and
`fullam new controller my_law.py --kernel` writes a law that flies.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.checks import shown
from fullam.control.controller import ALL_AXES, Controller, Measurement, ReferencePoint
from fullam.control.signals import Command, Delivery, Estimate, Target
from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.recursion import Chain, JointMotion, place_joints
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial, rotate_spatial
from fullam.exceptions import KernelError, SettingsError
from fullam.model.chain import LinkChain
from fullam.model.vehicle import Vehicle
from fullam.numbers.kernel import kernel, select, some
from fullam.numbers.records import Rows, flat, record, same_shape
from fullam.numbers.vectors import ZERO

Array = NDArray[np.float64]
Function = Callable[..., Any]


class LawKernels(NamedTuple):
    """The kernels of a law; see the module's first lines."""

    start: Function
    command: Function
    delivered: Function
    relieved: Function | None = None


class KernelLaw(Controller):
    """A law as kernels, with the face of a `Controller`.

    Subclasses give `Memory`, `kernels` and `numbers`; that is all it takes to fly everywhere.

    Attributes:
        Memory: Record of what the law remembers.
        link_rows: The nominal chain as rows.
    """

    Memory: type

    def __init__(
        self,
        vehicle: Vehicle,
        settings: Any = None,
        period: float = 0.01,
        axes: tuple[bool, ...] = ALL_AXES,
        anticipated: bool = True,
    ) -> None:
        """Bind the law; see `Controller`."""
        super().__init__(vehicle, settings, period, axes, anticipated)
        self.link_rows: Rows = LinkRows.of(LinkChain.from_model(vehicle.model)).rows
        self._numbers = self.numbers()
        self._memory: Any = None
        self._chain: Any = None
        self._estimate: Estimate | None = None

    @cached_property
    def links(self) -> list[Any]:
        """The nominal chain as records, platform first."""
        links: list[Any] = self.link_rows.to_list()
        return links

    @property
    @abstractmethod
    def kernels(self) -> LawKernels:
        """The kernels that machine code flies with these settings."""

    @abstractmethod
    def numbers(self) -> Any:
        """Settings and nominal vehicle as a record of numbers."""

    # What Python flies. A law may know another way to its model than the kernels' recursion.

    def chain(self, motions: Sequence[JointMotion]) -> Any:
        """The nominal vehicle with its arm in motion."""
        joints: list[Any] = [None] * len(motions)
        place_joints(self.links, motions, joints)
        return Chain(self.links, joints)

    def command(self, chain: Any, estimate: Estimate, target: Target) -> Command:
        """One period: the command, and the memory one period on."""
        begins = self._memory is None
        if begins:
            self._memory = self.kernels.start(self._numbers, chain, estimate)
        answer = self._command(chain, estimate, target)
        if begins:  # as it answers first it answers always: kernels have no branches
            like = Command(*[Spatial(ZERO, ZERO)] * 3), self._memory
            self._check_answer("command", answer, like, "give command and memory, in this order")
        command, self._memory = answer
        self._chain, self._estimate = chain, estimate
        return command

    def _command(self, chain: Any, estimate: Estimate, target: Target) -> tuple[Command, Any]:
        answer: tuple[Command, Any] = self.kernels.command(
            self._numbers, chain, estimate, target, self._memory
        )
        return answer

    def inform(self, delivery: Delivery) -> None:
        """Learn what became of the last command, if bounds kept it from being delivered."""
        memory = self.kernels.delivered(
            self._numbers, self._chain, self._estimate, self._memory, delivery
        )
        self._check_answer("delivered", memory, self._memory, "give the memory")
        self._memory = memory

    def _check_answer(self, kernel: str, answer: Any, like: Any, remedy: str) -> None:
        if not same_shape(answer, like):
            name = getattr(type(self), "name", type(self).__name__)
            raise KernelError(
                f"law '{name}'", f"kernel {kernel}", f"answers {shown(answer)}", remedy
            )

    def relieve(self, chain: Any, estimate: Estimate, wrench: Spatial) -> None:
        """Learn that a part of a disturbance is gone, if the law cares; see the module."""
        relieved = self.kernels.relieved
        if relieved is not None and self._memory is not None:
            self._memory = relieved(self._numbers, chain, estimate, self._memory, wrench)

    def forget(self) -> None:
        """Begin anew at the next command."""
        self._memory = None

    # The face of a controller.

    def reset(self, measurement: Measurement, reference: ReferencePoint) -> None:
        """Forget the past; filters start at the measurement."""
        chain = self.chain(motions_of(measurement))
        self._memory = self.kernels.start(self._numbers, chain, estimate_of(measurement))

    def wrench(self, t: float, measurement: Measurement, reference: ReferencePoint) -> Array:
        """Wrench wanted from the rotors, world axes, shape (6,); see `Controller.wrench`."""
        chain = self.chain(motions_of(measurement))
        command = self.command(chain, estimate_of(measurement), target_of(reference))
        self.u_pid[:] = flat(command.u_pid)
        self.u_dc[:] = flat(command.u_dc)
        return np.array(flat(command.wrench))

    def delivered(self, wrench_W: Array, missing_W: Array) -> None:
        """Learn what the allocation achieved; see `Controller.delivered`."""
        self.inform(Delivery(record(Spatial, wrench_W), record(Spatial, missing_W), 1.0))


def estimate_of(measurement: Measurement) -> Estimate:
    """A measurement as a record, its velocity turned to world axes."""
    pose = record(Pose, measurement.q[:7])
    v = record(Spatial, measurement.v[:6])
    return Estimate(pose, rotate_spatial(rotation_matrix(pose.attitude), v))


def motions_of(measurement: Measurement) -> list[JointMotion]:
    """The arm's motion as records."""
    motions = measurement.q[7:], measurement.v[6:], measurement.arm_acceleration
    return [JointMotion(*motion) for motion in zip(*(m.tolist() for m in motions), strict=True)]


def target_of(reference: ReferencePoint) -> Target:
    """A reference point as a record."""
    parts = reference.pose, reference.velocity, reference.acceleration
    return record(Target, np.concatenate(parts))


def numbers_of(part: Any) -> Rows:
    """What a law, or anything else that tells its `numbers()`, knows: one row.

    Raises:
        SettingsError: They are no record of numbers.
    """
    numbers = part.numbers()
    try:
        return Rows.of(type(numbers), [numbers])
    except (TypeError, ValueError) as error:
        where, remedy = f"class {type(part).__name__}", "return a NamedTuple of numbers"
        raise SettingsError(where, "numbers()", f"is no record ({error})", remedy) from error


FACE = ("reset", "wrench", "delivered", "command", "inform")
"""What Python calls. A subclass of a law that overrides one of these is no longer its kernels."""


def flies_as_kernels(law: type[Controller]) -> bool:
    """Whether the kernels of a law say all that its class does."""
    return issubclass(law, KernelLaw) and all(
        getattr(law, name) is getattr(KernelLaw, name) for name in FACE
    )


def kernel_law(law: Controller) -> KernelLaw:
    """The law, if it is written as kernels.

    Raises:
        SettingsError: It is a class of its own.
    """
    if isinstance(law, KernelLaw) and flies_as_kernels(type(law)):
        return law
    raise not_fused("controller", law.name, "KernelLaw")


def not_fused(field: str, name: str, base: str) -> SettingsError:
    """The error for a class that machine code cannot fly."""
    return SettingsError(
        "driver 'fused'",
        field,
        f"'{name}' is not written as kernels",
        f"fly it with driver='python', or derive it from {base} and override its kernels alone",
    )


# The stages of a flight that belong to the law.


class CommandView(NamedTuple):
    """What the command stage is shown: rows, and the arm's rows in a control period (one row)."""

    numbers: Any
    links: Any
    joints: Any
    joint_rows: Any
    target: Any
    estimate: Any
    memory: Any
    command: Any


class InformView(NamedTuple):
    """What the inform stage is shown."""

    numbers: Any
    links: Any
    joints: Any
    joint_rows: Any
    estimate: Any
    memory: Any
    delivery: Any


class RelieveView(NamedTuple):
    """What the stage is shown that relieves a law of a `wrench`, one row."""

    numbers: Any
    links: Any
    joints: Any
    joint_rows: Any
    estimate: Any
    memory: Any
    wrench: Any


@kernel
def chain_at(view, k):
    """The nominal chain in period k."""
    return Chain(view.links, view.joints[k * int(view.joint_rows[0])])


@cache
def command_stage(kernels: LawKernels) -> Function:
    """The stage that asks the law for a wrench."""
    start, command = kernels.start, kernels.command

    @kernel
    def command_of_law(view, k):
        numbers, chain, estimate = view.numbers[0], chain_at(view, k), view.estimate[0]
        if k == 0:
            view.memory[0] = start(numbers, chain, estimate)
        answer, memory = command(numbers, chain, estimate, view.target[0], view.memory[0])
        view.command[0], view.memory[0] = answer, memory

    return command_of_law


@cache
def inform_stage(kernels: LawKernels) -> Function:
    """The stage that tells the law what it did not get."""
    delivered = kernels.delivered

    @kernel
    def inform_law(view, k):
        delivery = view.delivery[0]
        saturated = delivery.saturated > 0.0
        if some(saturated):
            numbers, memory = view.numbers[0], view.memory[0]
            after = delivered(numbers, chain_at(view, k), view.estimate[0], memory, delivery)
            view.memory[0] = select(saturated, after, memory)

    return inform_law


@cache
def relieve_stage(kernels: LawKernels) -> Function:
    """The stage that tells the law of what somebody else has taken over."""
    relieved = kernels.relieved
    assert relieved is not None, "who has none is not told"

    @kernel
    def relieve(view, k):
        view.memory[0] = relieved(
            view.numbers[0], chain_at(view, k), view.estimate[0], view.memory[0], view.wrench[0]
        )

    return relieve
