"""One control period without sensors: law, turn to {A}, allocation, rotor speeds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.control.allocation import Allocator, allocation_memory
from fullam.control.controller import Controller, Measurement, ReferencePoint
from fullam.control.delivery import AllocateView, allocate_command
from fullam.control.law import (
    CommandView,
    InformView,
    command_stage,
    flies_as_kernels,
    inform_stage,
    kernel_law,
    numbers_of,
)
from fullam.control.law_stage import LawStage
from fullam.control.signals import (
    FOREVER,
    Ahead,
    Command,
    Delivery,
    Estimate,
    Status,
    Target,
)
from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.placing import PlaceView, place
from fullam.dynamics.recursion import Joint, JointMotion
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial, rotate_spatial
from fullam.exceptions import NonFiniteCenter, NonFiniteWrench
from fullam.model.chain import LinkChain
from fullam.numbers.kernel import kernel
from fullam.numbers.machine_code import available
from fullam.numbers.program import CompiledProgram, Lists, Stage
from fullam.numbers.records import Rows, columns, rows_of, size
from fullam.numbers.vectors import Vector

Array = NDArray[np.float64]

Run = Callable[[int, int], None]

ROWS = 2
"""Rows of what has one a period: a law starts in period 0, and all others are period 1."""


class TakeView(NamedTuple):
    """What `take` is shown: a measurement in its parts, and where it goes."""

    pose: Any
    twist: Any
    positions: Any
    rates: Any
    accelerations: Any
    estimate: Any
    motions: Any


@kernel
def take(view, k):
    """A measurement as estimate and motion of the arm; velocities come in {A} axes."""
    pose = view.pose[0]
    velocity = rotate_spatial(rotation_matrix(pose.attitude), view.twist[0])
    view.estimate[0] = Estimate(pose, velocity)
    for i in range(len(view.positions)):
        motion = JointMotion(view.positions[i], view.rates[i], view.accelerations[i])
        view.motions[k][i] = motion


class ControlTick:
    """A controller and its allocation: from measurement and reference to rotor speeds.

    This is what runs on a flight computer, and what a simulated flight does once a period. A law
    written as kernels runs as machine code where that can be had. A wrench out of reach is
    allocated about the vehicle's centre of mass, and the law is told what it got. Copies and
    pickles begin afresh, as those of a controller do.

    Attributes:
        controller: The law.
        compiled: Whether machine code runs.
    """

    def __init__(
        self, controller: Controller, allocator: Allocator, compiled: bool | None = None
    ) -> None:
        """Bind the two.

        Args:
            controller: The law.
            allocator: The allocation.
            compiled: Whether machine code shall run; None where it can be had and the law is
                written as kernels.
        """
        self.controller, self.allocator = controller, allocator
        self._asked = compiled
        if compiled is None:
            compiled = available() and flies_as_kernels(type(controller))
        self.compiled = compiled
        vehicle = controller.vehicle
        n = vehicle.n_arm
        self._law: LawStage | None = None
        self._inputs = np.zeros(7 + n + 6 + 2 * n + size(Target))
        pose, positions, twist, rates, accelerations, target = np.split(
            self._inputs, np.cumsum([7, n, 6, n, n])
        )
        self._estimate, motions = Rows.empty(Estimate, 1), Rows.empty(JointMotion, ROWS, n)
        taken = TakeView(
            Rows(Pose, pose[None]),
            Rows(Spatial, twist[None]),
            Rows(float, positions[:, None]),
            Rows(float, rates[:, None]),
            Rows(float, accelerations[:, None]),
            self._estimate,
            motions,
        )
        self._target, self._ahead = Rows(Target, target[None]), Rows.empty(Ahead, ROWS)
        self._command, self._delivery = Rows.empty(Command, 1), Rows.empty(Delivery, 1)
        self._residual, self._status = Rows.empty(Spatial, 1), Rows(Status, [[FOREVER, 0.0]])
        self._memory = allocation_memory(vehicle.rotors.count)
        self._speeds: Array = self._memory.speeds.array[:, 0]
        self._centers, self._joint_rows = Rows.empty(Vector, ROWS), Rows(float, [[1.0]])
        links = LinkRows.of(LinkChain.from_model(vehicle.model)).rows
        joints = Rows.empty(Joint, ROWS, n)
        stages = [
            Stage(take, taken),
            Stage(place, PlaceView(links, motions, joints, self._centers)),
            Stage(allocate_command, self._allocate_view()),
        ]
        self._run = (
            self._machine(stages, links, joints) if compiled else self._python(stages, motions)
        )
        self._is_first, self._is_turned = True, False

    def __reduce__(self) -> tuple[Any, ...]:
        """Made anew around the two: arrays that are views of each other would be copied apart."""
        return type(self), (self.controller, self.allocator, self._asked)

    def _allocate_view(self) -> AllocateView:
        return AllocateView(
            self.allocator.problem(),
            self._memory,
            self._estimate,
            self._ahead,
            self._command,
            self._centers,
            self._joint_rows,
            self._status,
            self._delivery,
            self._residual,
        )

    def _machine(self, stages: list[Stage], links: Rows, joints: Rows) -> Run:
        """All stages as machine code."""
        law = kernel_law(self.controller)
        memory, numbers = Rows.empty(law.Memory, 1), numbers_of(law)
        common = numbers, links, joints, self._joint_rows
        asking = CommandView(*common, self._target, self._estimate, memory, self._command)
        telling = InformView(*common, self._estimate, memory, self._delivery)
        *before, allocating = stages
        command = Stage(command_stage(law.kernels), asking)
        inform = Stage(inform_stage(law.kernels), telling)
        return CompiledProgram([*before, command, allocating, inform]).run

    def _python(self, stages: list[Stage], motions: Rows) -> Run:
        """The same by Python, with the law as it is."""
        self._law, look, t = LawStage(self.controller), Lists(), self._joint_rows
        look.live(*rows_of(stages[0].view), self._target, self._ahead, self._centers)
        look.live(self._command, self._delivery, self._residual, self._status)
        look.live(self._memory.speeds, self._memory.counts)
        asking = CommandView(
            None, None, motions, t, self._target, self._estimate, None, self._command
        )
        taking, placing, allocating = ((s.kernel, look.of(s.view)) for s in stages)
        order = [
            taking,
            placing,
            (self._law.command, look.of(asking)),
            allocating,
            (self._law.inform, look.of(self._delivery)),
        ]

        def run(start: int, stop: int) -> None:
            for stage, view in order:
                stage(view, start)

        return run

    def speeds(
        self,
        t: float,
        measurement: Measurement,
        reference: ReferencePoint,
        turn: Array | None = None,
    ) -> Array:
        """Rotor speeds, shape (n_r,), live [rad/s].

        Args:
            t: Time [s].
            measurement: The measurement.
            reference: The reference.
            turn: What the platform turns until the rotors have followed, a rotation vector in {A}
                axes, shape (3,) [rad]; nothing if None.

        Raises:
            NonFiniteWrench: The law returned NaN or infinity, or (`NonFiniteCenter`) an angle of
                the arm is not finite.
        """
        m, ref = measurement, reference
        row = 0 if self._is_first else 1
        np.concatenate(
            (m.q, m.v, m.arm_acceleration, ref.pose, ref.velocity, ref.acceleration),
            out=self._inputs,
        )
        if turn is not None or self._is_turned:
            self._ahead.array[:, 12:] = 0.0 if turn is None else turn
            self._is_turned = turn is not None
        if self._law is not None:
            self._law.t = t
        self._run(row, row + 1)
        self._is_first = False
        if self._status.array[0, 0] < FOREVER:
            self._refuse(row)
        return self._speeds

    def reset(self) -> None:
        """Begin a law anew: the next period is its first."""
        self._is_first = True

    def _refuse(self, row: int) -> None:
        self._status.array[0] = FOREVER, 0.0
        center = self._centers.array[row]
        if not np.isfinite(center).all():
            raise NonFiniteCenter(self.command, center.copy())
        raise NonFiniteWrench(self.command)

    @property
    def command(self) -> Array:
        """The law's wrench, world axes, shape (6,) [N, N m]."""
        return self._command["wrench"][0].copy()

    @property
    def u_pid(self) -> Array:
        """Commanded acceleration, world axes, shape (6,) [m/s^2, rad/s^2]."""
        return self._command["u_pid"][0].copy()

    @property
    def u_dc(self) -> Array:
        """Compensation, world axes, shape (6,) [N, N m]."""
        return self._command["u_dc"][0].copy()

    @property
    def residual(self) -> Array:
        """Achieved minus asked in {A}, shape (6,) [N, N m]; zero unless saturated."""
        return self._residual.array[0].copy()

    @property
    def saturated(self) -> bool:
        """Whether bounds kept the last wrench from being delivered."""
        return bool(self._delivery.array[0, -1] > 0.0)

    @property
    def counts(self) -> dict[str, int]:
        """How many wrenches each rung of the ladder answered, and what the active set had to do."""
        counts = self._memory.counts
        return {name: int(counts[name][0, 0]) for name in columns(counts.record)}
