"""How the arm moves: prescribed joint motions as data (the servos are position controlled).

Positions are in rad of a revolute joint and in m of a prismatic one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, Range, within
from fullam.exceptions import ScenarioError
from fullam.model.joints import ArmJoints
from fullam.simulation.excitation import ArmExcitation
from fullam.simulation.motions.arm_table import ArmTable
from fullam.simulation.motions.joint_trajectory import JointTrajectory
from fullam.simulation.motions.motion_rows import ArmRows
from fullam.simulation.motions.reference_table import name_of, rows_in
from fullam.simulation.tool.follows import FollowsTool

__all__ = [
    "KINDS",
    "ArmMotion",
    "ArmTable",
    "HoldArm",
    "JointTrajectory",
    "SineRate",
    "tabulate",
    "tabulate_within_limits",
]

Array = NDArray[np.float64]

PARTS = ("theta", "dtheta", "ddtheta")
"""Parts of a table."""


class ArmMotion(Protocol):
    """How the arm moves: whoever has this method can be flown.

    A class of one's own needs nothing else. It is asked once, before take-off; its table goes into
    the record, which flies again without the class.
    """

    def tabulate(self, t: Array, initial: Array) -> ArmTable:
        """The motion on the half steps of the plant.

        Args:
            t: Times, shape (N,), from 0 on in equal steps [s].
            initial: Positions at the start, shape (n,) [rad, or m of a prismatic joint].

        Returns:
            Positions, rates and accelerations, each of shape (N, n); the first position is the
            initial one, and each is the derivative of the one before it.
        """
        ...


@dataclass(frozen=True)
class HoldArm:
    """The arm stays in its initial configuration."""

    kind: ClassVar[str] = "hold"

    def tabulate(self, t: Array, initial: Array) -> ArmTable:
        """The motion on the grid t [s], from the initial positions [rad or m]."""
        still = np.zeros((t.size, initial.size))
        return ArmTable(still + initial, still, still)


@dataclass(frozen=True)
class SineRate:
    """One joint moves at the rate a sin(w t): theta = theta_0 + a (1 - cos w t) / w.

    With the paper's tasks: joint 3, a = 0.5 rad/s, w = 1 rad/s.

    Attributes:
        joint: Number of the joint, 1 for the first.
        rate: Amplitude a of the rate [rad/s, or m/s of a prismatic joint].
        frequency: w [rad/s].
    """

    kind: ClassVar[str] = "sine-rate"
    joint: int = 3
    rate: float = 0.5
    frequency: float = 1.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        check = Checker("arm motion", ScenarioError)
        object.__setattr__(self, "joint", check.whole("joint", self.joint, 1, 1000))
        object.__setattr__(self, "rate", check.number("rate", self.rate, within(1e3, "rad/s")))
        frequency = check.number("frequency", self.frequency, Range(1e-6, 1e4, "rad/s"))
        object.__setattr__(self, "frequency", frequency)

    def tabulate(self, t: Array, initial: Array) -> ArmTable:
        """The motion on the grid t [s], from the initial positions [rad or m]."""
        if self.joint > initial.size:
            raise ScenarioError(
                "arm motion",
                "joint",
                f"is {self.joint}, the arm has {initial.size}",
                f"give 1 to {initial.size}",
            )
        theta = np.zeros((t.size, initial.size)) + initial
        dtheta, ddtheta = np.zeros_like(theta), np.zeros_like(theta)
        j, w = self.joint - 1, self.frequency
        theta[:, j] += self.rate * (1.0 - np.cos(w * t)) / w
        dtheta[:, j] = self.rate * np.sin(w * t)
        ddtheta[:, j] = self.rate * w * np.cos(w * t)
        return ArmTable(theta, dtheta, ddtheta)


def tabulate_within_limits(motion: Any, t: Array, initial: Array, joints: ArmJoints) -> ArmTable:
    """The motion on a time grid, held to the limits that the URDF gives its joints.

    Args:
        motion: The motion.
        t: Times, shape (N,) [s].
        initial: Positions at the start, shape (n,) [rad or m].
        joints: The arm's joints.

    Raises:
        ScenarioError: A joint goes beyond its limits, or faster than it can; or the motion does
            not fit the arm, or is not finite.
    """
    table = tabulate(motion, t, initial, joints)
    problem = joints.position_problem(table.theta, t) or joints.rate_problem(table.dtheta, t)
    if problem is not None:
        raise ScenarioError(
            "arm motion",
            name_of(motion),
            problem,
            "start elsewhere, move less or slower, or widen the <limit> in the URDF",
        )
    return table


def tabulate(motion: Any, t: Array, initial: Array, joints: ArmJoints) -> ArmTable:
    """The motion on a time grid, whatever its limits.

    Raises:
        ScenarioError: What it gives is no table on this grid, or some entry is NaN or infinite;
            the message says which joint, and when.
    """
    if isinstance(motion, JointTrajectory):
        return motion.tabulate(t, initial, joints)
    where = f"arm motion '{name_of(motion)}'"
    table = motion.tabulate(t, initial)
    for field in PARTS:
        rows = rows_in(where, table, field, (t.size, initial.size))
        for row, column in np.argwhere(~np.isfinite(rows))[:1]:
            raise ScenarioError(
                where,
                f"{field} of joint '{joints.names[column]}' at t = {t[row]:g} s",
                "is not finite",
                "a motion gives finite positions, rates and accelerations at every time",
            )
    return ArmTable(*(np.asarray(getattr(table, field), float) for field in PARTS))


KINDS: dict[str, Any] = {
    c.kind: c for c in (HoldArm, SineRate, JointTrajectory, ArmExcitation, ArmRows, FollowsTool)
} | {
    "minimum-snap": JointTrajectory.minimum_snap,
    "b-spline": JointTrajectory.b_spline,
}
"""What a scenario's table may name, and what makes an arm motion of its other entries."""
