"""Dynamic-compensation PID, eqs. (19), (20) and (26): the paper's controller.

    u = blkdiag(m_A 1, I_A) u_pid + u_dc,

where u_dc cancels the platform's gyroscopic moment and weight and the wrench (f_1, tau_1) that the
arm puts on the platform through joint 1. `dc_pid` is the law, line by line. It takes the
compensation as a function: in Python that reads Pinocchio's joint 1 or solves the paper's matrix
system (`compensation`), in machine code it is the paper's recursion.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

from fullam.control.compensation import MODELS, Model, compensation_model
from fullam.control.law import LawKernels
from fullam.control.pid import (
    Gains,
    Limits,
    PidBase,
    PidMemory,
    PidSettings,
    delivered,
    drained,
    integrated,
    pid,
    pose_error,
    released,
    start,
    within_bounds,
)
from fullam.control.signals import Command, Estimate, Target
from fullam.dynamics.recursion import compensation as recursive_compensation
from fullam.dynamics.recursion import composite_body, platform_wrench, solve_body
from fullam.dynamics.recursion import platform_acceleration as recursive_acceleration
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import (
    Spatial,
    add_spatial,
    rotate_spatial,
    rotate_spatial_back,
    subtract_spatial,
)
from fullam.numbers.kernel import Number, kernel, select
from fullam.numbers.vectors import ZERO

COMPENSATIONS = ("desired_acceleration", "previous_wrench")

MOST_ROUNDS = 100
"""More solutions a period than any iteration that settles needs."""


@dataclass(frozen=True)
class DcPidSettings(PidSettings):
    """Settings of dc-PID: those of the PID, and how the compensation is had.

    Attributes:
        compensation: How the algebraic loop of eqs. (20)-(22) is cut. "desired_acceleration" puts
            u_pid in the platform's rows: exact, no loop. "previous_wrench" solves eq. (21) with
            the wrench at hand, which is the one applied last with its u_pid renewed (the paper's
            text): a fixed-point iteration over the periods that contracts by the arm's share of
            mass and inertia. Where that share is near one (hextilt: a heavy arm under a light
            platform) it settles slower than the flight moves; choose the first there.
        rounds: Solutions of eq. (21) per period with "previous_wrench"; the paper has one.
        model: What yields f_1, tau_1 where Python flies: Pinocchio's joint 1 ("pinocchio"), the
            paper's matrix system ("newton-euler") or its recursion ("recursion"). Machine code
            always flies the recursion; all three agree to rounding.
    """

    compensation: Literal["desired_acceleration", "previous_wrench"] = "desired_acceleration"
    model: Literal["pinocchio", "newton-euler", "recursion"] = "pinocchio"
    rounds: int = 3

    def __post_init__(self) -> None:
        """Check the choices, then the PID's own settings."""
        super().__post_init__()
        if not (isinstance(self.rounds, int) and 1 <= self.rounds <= MOST_ROUNDS):
            raise self._wrong("rounds", f"give a whole number, 1 to {MOST_ROUNDS}")
        for field, known in (("compensation", COMPENSATIONS), ("model", tuple(MODELS))):
            if getattr(self, field) not in known:
                raise self._wrong(field, f"give one of {', '.join(known)}")


class DcPidNumbers(NamedTuple):
    """dc-PID as numbers: gains, limits, gravity, and solutions of eq. (21) a period."""

    gains: Gains
    limits: Limits
    gravity: Number
    rounds: Number


class PreviousMemory(NamedTuple):
    """Memory of "previous_wrench".

    The integrator; the wrench applied last, and the share that its u_pid had in it, {A} axes; and
    1 once there is one, else 0.
    """

    integral: Spatial
    at_hand: Spatial
    inertial: Spatial
    has_hand: Number


@kernel
def dc_pid(compensation, numbers, chain, estimate, target, memory):
    """Eq. (26) with u_pid in the platform's rows of (20): exact, no algebraic loop.

    Args:
        compensation: u_dc of eq. (20), a function; see `fullam.control.compensation`.
        numbers: `DcPidNumbers`.
        chain: The nominal vehicle with its arm in motion.
        estimate: What is told of the platform.
        target: Where it should be.
        memory: `PidMemory`.
    """
    R = rotation_matrix(estimate.pose.attitude)
    e, de = pose_error(estimate, target)
    w, g = estimate.velocity.angular, numbers.gravity
    u_pid = pid(numbers.gains, e, de, memory.integral, target.acceleration)  # (19)
    u_dc = compensation(chain, R, w, u_pid, g)  # (20)
    u = add_spatial(platform_wrench(chain, R, u_pid), u_dc)  # (26)
    integral = integrated(numbers.gains, memory.integral, e)
    u, integral = within_bounds(numbers.limits, R, u, integral)
    return Command(u, u_pid, u_dc), PidMemory(integral)


@kernel
def dc_pid_previous(compensation, acceleration, numbers, chain, estimate, target, memory):
    """Eq. (26) as the paper has it: (21) solved with the wrench at hand, `rounds` times.

    At hand is the wrench applied last with this period's u_pid in the place of the last one's; the
    first period has none and uses u_pid. Arguments as in `dc_pid`, and `acceleration`, eq. (21).
    """
    R = rotation_matrix(estimate.pose.attitude)
    e, de = pose_error(estimate, target)
    w, g = estimate.velocity.angular, numbers.gravity
    u_pid = pid(numbers.gains, e, de, memory.integral, target.acceleration)  # (19)
    inertial = platform_wrench(chain, R, u_pid)
    kept = rotate_spatial(R, subtract_spatial(memory.at_hand, memory.inertial))
    known = memory.has_hand > 0.0
    given = select(known, acceleration(chain, R, w, add_spatial(kept, inertial), g), u_pid)  # (21)
    u_dc = compensation(chain, R, w, given, g)  # (20)
    for _ in range(1, int(numbers.rounds)):
        again = acceleration(chain, R, w, add_spatial(inertial, u_dc), g)
        u_dc = compensation(chain, R, w, select(known, again, u_pid), g)
    u = add_spatial(inertial, u_dc)  # (26)
    integral = integrated(numbers.gains, memory.integral, e)
    u, integral = within_bounds(numbers.limits, R, u, integral)
    at_hand, share = rotate_spatial_back(R, u), rotate_spatial_back(R, inertial)
    has_hand = 0.0 * memory.has_hand + 1.0  # of one kind with what it replaces: lanes, if those
    return Command(u, u_pid, u_dc), PreviousMemory(integral, at_hand, share, has_hand)


@kernel
def start_previous(numbers, chain, estimate):
    """An empty integrator, and no wrench at hand."""
    none = Spatial(ZERO, ZERO)
    return PreviousMemory(none, none, none, 0.0)


@kernel
def delivered_previous(numbers, chain, estimate, memory, delivery):
    """Anti-windup, and the wrench that (21) will be solved with."""
    R = rotation_matrix(estimate.pose.attitude)
    integral = drained(numbers.limits, memory.integral, R, delivery.missing)
    at_hand = rotate_spatial_back(R, delivery.wrench)
    return PreviousMemory(integral, at_hand, memory.inertial, memory.has_hand)


@kernel
def eased(chain, estimate, integral, wrench):
    """The integrator less what of it holds a wrench, and never past zero.

    What it has not learned of the wrench yet cannot be taken out of it, and of an axis without
    integral action nothing.
    """
    R = rotation_matrix(estimate.pose.attitude)
    a = solve_body(composite_body(chain), rotate_spatial_back(R, wrench))
    a = rotate_spatial(R, a)
    i, j, a, b = integral.linear, integral.angular, a.linear, a.angular
    return Spatial(
        (released(i[0], a[0], 1.0), released(i[1], a[1], 1.0), released(i[2], a[2], 1.0)),
        (released(j[0], b[0], 1.0), released(j[1], b[1], 1.0), released(j[2], b[2], 1.0)),
    )


@kernel
def relieved(numbers, chain, estimate, memory, wrench):
    """The memory once somebody else takes care of a wrench; see `law`."""
    return PidMemory(eased(chain, estimate, memory.integral, wrench))


@kernel
def relieved_previous(numbers, chain, estimate, memory, wrench):
    """The same with "previous_wrench"."""
    integral = eased(chain, estimate, memory.integral, wrench)
    return PreviousMemory(integral, memory.at_hand, memory.inertial, memory.has_hand)


# What machine code flies: the same on the recursion (6)-(13).


@kernel
def command(numbers, chain, estimate, target, memory):
    """`dc_pid` on the recursion."""
    return dc_pid(recursive_compensation, numbers, chain, estimate, target, memory)


@kernel
def command_previous(numbers, chain, estimate, target, memory):
    """`dc_pid_previous` on the recursion."""
    return dc_pid_previous(
        recursive_compensation,
        recursive_acceleration,
        numbers,
        chain,
        estimate,
        target,
        memory,
    )


class DcPid(PidBase):
    """The paper's dc-PID, eq. (26): PID and the arm's wrench fed forward."""

    name = "dc-pid"
    Settings = DcPidSettings
    settings: DcPidSettings

    @cached_property
    def model(self) -> Model:
        """What yields u_dc where Python flies; made when it does."""
        return compensation_model(self.settings.model, self.vehicle, self.links)

    @property
    def previous(self) -> bool:
        """Whether (21) is solved with the wrench applied last."""
        return self.settings.compensation == "previous_wrench"

    @property
    def Memory(self) -> type:  # type: ignore[override]
        """What the law remembers."""
        return PreviousMemory if self.previous else PidMemory

    @property
    def kernels(self) -> LawKernels:
        """See `KernelLaw`."""
        if self.previous:
            return LawKernels(
                start_previous, command_previous, delivered_previous, relieved_previous
            )
        return LawKernels(start, command, delivered, relieved)

    def numbers(self) -> Any:
        """See `DcPidNumbers`."""
        rounds = float(self.settings.rounds)
        return DcPidNumbers(self.gains(), self.limits(), self.vehicle.gravity, rounds)

    def chain(self, motions: Any) -> Any:
        """The nominal vehicle as the model wants to see it."""
        return self.model.chain(motions)

    def _command(self, chain: Any, estimate: Estimate, target: Target) -> tuple[Command, Any]:
        return self.nominal(self._numbers, chain, estimate, target, self._memory)

    def nominal(
        self, numbers: Any, chain: Any, estimate: Estimate, target: Target, memory: Any
    ) -> tuple[Command, Any]:
        """Eq. (26) on this law's model; arguments as in `dc_pid`."""
        answer: tuple[Command, Any]
        compensation, acceleration = self.model.compensation, self.model.acceleration
        if self.previous:
            answer = dc_pid_previous(
                compensation, acceleration, numbers, chain, estimate, target, memory
            )
        else:
            answer = dc_pid(compensation, numbers, chain, estimate, target, memory)
        return answer
