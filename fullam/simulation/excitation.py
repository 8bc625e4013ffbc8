"""Motions that excite everything: every axis and every joint swings at frequencies of its own.

A coordinate x swings about its start as

    x(t) = x_0 + a / 2 (cos(2 pi m t / T) - cos(2 pi n t / T)),

within +-a, from rest, and, as m and n are whole numbers, back to its start and to rest after T.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, Range, within
from fullam.dynamics.pose_space import pose_from_euler
from fullam.dynamics.rotations import angular_motion
from fullam.exceptions import ScenarioError
from fullam.simulation.motions.arm_table import ArmTable
from fullam.simulation.motions.reference_table import ReferenceTable

Array = NDArray[np.float64]

POSITION_ROUNDS = ((3, 6), (4, 7), (5, 8))
EULER_ROUNDS = ((2, 5), (3, 7), (4, 6))
JOINT_ROUNDS = ((1, 3), (2, 4), (1, 4), (2, 5))
"""m and n of the axes, and of the joints in turn; no two alike, so that nothing looks like
something else."""


def swing(t: Array, period: float, amplitude: Array, rounds: Array) -> tuple[Array, Array, Array]:
    """Displacement x - x_0 and its two derivatives, each (N, axes); see the module's formula.

    Args:
        t: Times, shape (N,) [s].
        period: T [s].
        amplitude: a of each axis, shape (axes,).
        rounds: m and n of each axis, shape (axes, 2).
    """
    rates = 2.0 * np.pi * rounds.T / period
    phase = t[:, None, None] * rates
    sign, half = np.array([1.0, -1.0])[:, None], 0.5 * amplitude
    cos, sin = sign * np.cos(phase), sign * np.sin(phase)
    return (
        half * cos.sum(axis=1),
        -half * (rates * sin).sum(axis=1),
        -half * (rates**2 * cos).sum(axis=1),
    )


@dataclass(frozen=True)
class Excitation:
    """The platform swings about its start, on all six axes.

    Attributes:
        position: Amplitudes [m].
        euler_deg: Amplitudes of the x-y-z Euler angles [deg].
        period: T, after which it is back [s].
    """

    kind: ClassVar[str] = "excitation"
    position: tuple[float, float, float] = (0.3, 0.3, 0.3)
    euler_deg: tuple[float, float, float] = (15.0, 15.0, 15.0)
    period: float = 20.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        check = Checker("excitation", ScenarioError)
        position = check.vector("position", self.position, 3, within(1e3, "m"))
        euler_deg = check.vector("euler_deg", self.euler_deg, 3, within(80.0, "deg"))
        period = check.number("period", self.period, Range(1e-1, 1e6, "s"))
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "euler_deg", euler_deg)
        object.__setattr__(self, "period", period)

    @property
    def final_pose(self) -> None:
        """It ends nowhere else than it began."""
        return None

    def tabulate(self, t: Array, initial_pose: Array) -> ReferenceTable:
        """The reference on the grid t, shape (N,), about the initial pose, which is level."""
        p, dp, ddp = swing(t, self.period, np.array(self.position), np.array(POSITION_ROUNDS))
        angles = np.radians(self.euler_deg)
        euler, rate, acceleration = swing(t, self.period, angles, np.array(EULER_ROUNDS))
        w, dw = angular_motion(euler, rate, acceleration)
        pose = pose_from_euler(initial_pose[:3] + p, euler)
        return ReferenceTable(t, pose, np.hstack([dp, w]), np.hstack([ddp, dw]))


@dataclass(frozen=True)
class ArmExcitation:
    """Every joint swings about its start.

    Attributes:
        amplitudes: Of each joint [rad; m of a prismatic joint].
        period: T, after which they are back [s].
    """

    kind: ClassVar[str] = "arm-excitation"
    amplitudes: tuple[float, ...]
    period: float = 20.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        check = Checker("arm excitation", ScenarioError)
        amplitudes = check.vector("amplitudes", self.amplitudes, None, within(1e3, "rad"))
        object.__setattr__(self, "amplitudes", amplitudes)
        period = check.number("period", self.period, Range(1e-1, 1e6, "s"))
        object.__setattr__(self, "period", period)

    def tabulate(self, t: Array, initial: Array) -> ArmTable:
        """The motion on the grid t [s], from the initial positions [rad or m]."""
        if len(self.amplitudes) != initial.size:
            raise ScenarioError(
                "arm excitation",
                "amplitudes",
                f"has {len(self.amplitudes)} entries",
                f"the arm has {initial.size} joints",
            )
        rounds = np.array([JOINT_ROUNDS[i % len(JOINT_ROUNDS)] for i in range(initial.size)])
        theta, rate, acceleration = swing(
            t, self.period, np.array(self.amplitudes), rounds.reshape(-1, 2)
        )
        return ArmTable(initial + theta, rate, acceleration)
