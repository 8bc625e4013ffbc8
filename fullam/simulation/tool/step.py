"""One instant of differential inverse kinematics of a platform with an arm.

Which rates u = [platform's linear and angular velocity in its own axes, joint rates] take the tool
where it should be? Each task i asks A_i u = b_i with a weight w_i; within bounds on u

    minimise  sum_i w_i |A_i u - b_i|^2,    low <= u <= high.

With strict priorities this is solved level by level: what a level has reached is an equation of
the next. The quadratic programmes are ProxSuite's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ACCURACY = 1e-9
"""Primal, dual and duality-gap tolerance; see `fullam.control.proxqp_referee`."""

MOST_ITERATIONS = 1000

MET, ALIKE = 1e-7, 1e-4
"""Nearer than this to a bound a rate is on it; and how far ProxSuite's answer may be from the one
that the equations give, where levels leave rates almost open."""

LITTLE = 1e-6
"""Weight of every rate beside the mean one, in all levels but the last: they leave some open."""


@dataclass(frozen=True, eq=False)
class RateTask:
    """A u is to be b.

    Attributes:
        A: Shape (m, n).
        b: Shape (m,).
        weight: Of each row, or of all.
        level: 0 comes first; tasks of one level are weighed against each other.
    """

    A: Array
    b: Array
    weight: Array | float
    level: int = 0


class RateSolver:
    """Solves instants of one vehicle; keeps its ProxSuite objects, one for each size."""

    def __init__(self, n: int) -> None:
        """Nothing is made yet.

        Args:
            n: Number of rates.
        """
        self._n = n
        self._programmes: dict[int, Any] = {}

    def solve(self, tasks: Sequence[RateTask], low: Array, high: Array) -> Array | None:
        """The best rates, shape (n,); None if ProxSuite does not solve it.

        Args:
            tasks: What is asked; the last level has a task for every rate.
            low: Least rates, shape (n,), none above 0.
            high: Largest rates, shape (n,), none below 0.
        """
        levels = sorted({task.level for task in tasks})
        fixed: list[tuple[Array, Array]] = []
        u: Array | None = None
        for level in levels:
            own = [task for task in tasks if task.level == level]
            u = self._level(own, fixed, (low, high), 0.0 if level == levels[-1] else LITTLE)
            if u is None:
                return None
            fixed += [(task.A, task.A @ u) for task in own]
        return u

    def _level(
        self,
        tasks: list[RateTask],
        fixed: list[tuple[Array, Array]],
        bounds: tuple[Array, Array],
        little: float,
    ) -> Array | None:
        n, (low, high) = self._n, bounds
        H, g = np.zeros((n, n)), np.zeros(n)
        for task in tasks:
            weighted = task.A.T * task.weight
            H += weighted @ task.A
            g -= weighted @ task.b
        H += little * np.trace(H) / n * np.eye(n)
        A = np.vstack([A for A, _ in fixed]) if fixed else np.zeros((0, n))
        b = np.concatenate([b for _, b in fixed]) if fixed else np.zeros(0)
        qp = self._programme(len(b))
        given = {"H": H, "g": g, "l": low, "u": high}
        if len(b):
            given |= {"A": A, "b": b}
        if qp.is_new:
            nothing = (A, b) if len(b) else (None, None)
            qp.solver.init(given["H"], given["g"], *nothing, np.eye(n), low, high)
            qp.is_new = False
        else:
            qp.solver.update(**given)
        qp.solver.solve()
        if qp.solver.results.info.status.name != "PROXQP_SOLVED":
            del self._programmes[len(b)]
            return None
        return _polished(np.clip(np.array(qp.solver.results.x), low, high), (H, g, A, b), bounds)

    def _programme(self, equations: int) -> Any:
        if equations not in self._programmes:
            from proxsuite import proxqp  # slow to import, and most flights never ask it

            qp = proxqp.dense.QP(self._n, equations, self._n)
            settings = qp.settings
            settings.eps_abs, settings.eps_rel = ACCURACY, 0.0
            settings.check_duality_gap = True
            settings.eps_duality_gap_abs, settings.eps_duality_gap_rel = ACCURACY, 0.0
            settings.initial_guess = proxqp.InitialGuess.EQUALITY_CONSTRAINED_INITIAL_GUESS
            settings.max_iter = settings.max_iter_in = MOST_ITERATIONS
            self._programmes[equations] = _Programme(qp)
        return self._programmes[equations]


def _polished(u: Array, programme: tuple[Array, ...], bounds: tuple[Array, Array]) -> Array:
    """The answer that the equations give, once ProxSuite has told which bounds are met.

    Its own last bits depend on where its memory lies, and a campaign's flights shall not.
    """
    (H, g, A, b), (low, high) = programme, bounds
    is_free = (u > low + MET) & (u < high - MET)
    n, m = int(is_free.sum()), len(b)
    kkt, right = np.zeros((n + m, n + m)), np.zeros(n + m)
    held = np.where(is_free, 0.0, np.where(u - low < high - u, low, high))
    kkt[:n, :n] = H[np.ix_(is_free, is_free)]
    kkt[n:, :n], kkt[:n, n:] = A[:, is_free], A[:, is_free].T
    right[:n], right[n:] = -(g + H @ held)[is_free], b - A @ held
    try:
        held[is_free] = np.linalg.solve(kkt, right)[:n]
    except np.linalg.LinAlgError:  # bounds that are met leave an equation no rate
        return u
    within = np.clip(held, low, high)
    same = np.abs(held - u).max() < ALIKE and np.abs(held - within).max() < MET
    return within if same else u


@dataclass(eq=False)
class _Programme:
    solver: Any
    is_new: bool = True
