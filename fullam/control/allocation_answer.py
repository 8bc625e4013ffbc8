"""The answer to one wrench: rotor speeds, and how good they are; and counts of such answers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fullam.control.box_qp import BoxLeastSquares
from fullam.model.rotors import Rotors

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Method = Literal["exact", "active-set", "proxqp", "clip"]

SNAP = 1e-6
"""A u this close to 0 or 1 is at its bound: ProxQP leaves 1e-7 and less."""


@dataclass(slots=True)
class Counters:
    """How many solves each rung answered, and what the active set had to do.

    Attributes:
        exact: Unconstrained minimiser within the bounds.
        active_set: Warm active set.
        proxqp: Referee.
        clip: Nothing solved it; clipped and flagged.
        refused: Non-finite wrenches.
        unconfirmed: Answers of the active set that did not settle or failed their KKT check.
        unsettled: Answers about a centre, optimal for a moment that is not the one to ask for.
        rounds: Allocations that the answers about a centre took.
        pivots: Changes of the active set.
        returns: How often an active set came back in a search, which raises its tolerances.
    """

    exact: int = 0
    active_set: int = 0
    proxqp: int = 0
    clip: int = 0
    refused: int = 0
    unconfirmed: int = 0
    unsettled: int = 0
    rounds: int = field(default=0, compare=False)
    pivots: int = field(default=0, compare=False)
    returns: int = field(default=0, compare=False)


class SharedProblem:
    """What the allocations of one allocator share."""

    __slots__ = ("B", "box", "max_speeds")

    def __init__(self, rotors: Rotors, box: BoxLeastSquares) -> None:
        """Keep them."""
        self.B, self.max_speeds, self.box = rotors.normalized_coupling, rotors.max_speeds, box


class Allocation:
    """Rotor speeds for one wrench, with what they achieve. Owns its arrays.

    Attributes:
        asked: The wrench asked for in {A}, shape (6,) [N, N m].
        squared: u = Omega^2 / Omega_max^2 in [0, 1], shape (n,); 0 for a failed rotor.
        method: Rung that answered: "exact", "active-set", "proxqp" or "clip".
        saturated: Some rotor is at a bound, and the wrench suffers: the weighted error
            ||W (B u - w)|| on the controlled axes exceeds SATURATION_TOLERANCE of full scale (or,
            if that is larger, ten times what the regulariser may cost). A rotor at its bound
            while the others make up for it does not saturate.
    """

    __slots__ = (
        "_problem",
        "_residual",
        "_speeds",
        "_wrench",
        "asked",
        "method",
        "saturated",
        "squared",
    )

    def __init__(
        self, problem: SharedProblem, asked: Array, squared: Array, method: Method, saturated: bool
    ) -> None:
        """Take ownership of the arrays; the rest is computed when asked for."""
        self._problem = problem
        self.asked = asked
        self.squared = squared
        self.method: Method = method
        self.saturated = saturated
        self._speeds: Array | None = None
        self._wrench: Array | None = None
        self._residual: Array | None = None

    @property
    def speeds(self) -> Array:
        """Rotor speeds Omega = sqrt(u) Omega_max, shape (n,) [rad/s]."""
        if self._speeds is None:
            self._speeds = np.sqrt(self.squared)
            self._speeds *= self._problem.max_speeds
        return self._speeds

    @property
    def wrench(self) -> Array:
        """Wrench achieved, B u, in {A}, shape (6,) [N, N m]."""
        if self._wrench is None:
            self._wrench = self._problem.B.dot(self.squared)
        return self._wrench

    @property
    def residual(self) -> Array:
        """Wrench achieved minus wrench asked, in {A}, shape (6,) [N, N m], masked axes included."""
        if self._residual is None:
            self._residual = self.wrench - self.asked
        return self._residual

    @property
    def lower_active(self) -> Mask:
        """Rotors standing still, shape (n,); failed ones among them."""
        return self.squared <= SNAP

    @property
    def upper_active(self) -> Mask:
        """Rotors at full speed, shape (n,)."""
        return self.squared >= 1.0 - SNAP

    def kkt_residual(self) -> float:
        """How far the answer is from optimal, as a share of a rotor's largest squared speed.

        max_i |u_i - clip(u_i - g_i / H_ii, 0, 1)| with g = B^T W^2 (B u - w) + eps (u - u_0) and
        H_ii = |W B_i|^2 + eps: how far one rotor alone would still move to lower the cost. It is 0
        at the minimiser and nowhere else (stationarity, complementarity, feasibility in one), and
        a rotor wrongly clipped shows as the share of full scale it is off. Differences that leave
        the wrench as it is count with the weight of the regulariser only.
        """
        return self._problem.box.kkt_residual(self.squared, self.asked)

    def __repr__(self) -> str:
        """Speeds, residual and flags in one line."""
        return (
            f"Allocation(speeds={np.round(self.speeds, 1).tolist()}, "
            f"residual={np.round(self.residual, 6).tolist()}, method='{self.method}', "
            f"saturated={self.saturated})"
        )
