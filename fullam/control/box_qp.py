"""The box problem, packed for kernels, and its solver for a sequence of wrenches.

    minimise  f(u) = 1/2 ||A u - d||^2 + eps/2 ||u - u_0||^2   subject to  0 <= u <= u_max,

with A = W B (6 x n) and d = W w. `active_set_search` solves it, `active_set_map` is its algebra.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fullam.control.active_set_map import (
    FREE,
    NULL_CUTOFF,
    ROOM,
    Affine,
    Scales,
    Unknown,
    active_set_map,
)
from fullam.control.active_set_search import (
    Box,
    Held,
    Last,
    Search,
    Slot,
    cost,
    kkt_residual,
    solve_box,
)
from fullam.dynamics.spatial import Spatial
from fullam.exceptions import SettingsError
from fullam.numbers.program import Lists
from fullam.numbers.records import Rows, flat
from fullam.numbers.vectors import ZERO

Array = NDArray[np.float64]

STORE = 4001
"""Slots of the store of maps, a prime; half of them are used. A flight meets a few dozen sets, one
that saturates all the time two hundred; eight of them in lanes share a store, and a map that has to
be computed again costs more than twenty answers."""

SMALL_STORE = 251
"""As above, for one flight in Python, where filling in lists takes longer than a map."""

MOST_UNKNOWNS = 50
"""So that sums of 2^i are exact."""

NOTHING = Spatial(ZERO, ZERO)


def pack_box(
    coupling: Array, weights: Array, eps: float, prior: Array, upper: Array
) -> tuple[Rows, Rows]:
    """Rows of `Unknown` and of `Scales`; arguments as those of `BoxLeastSquares`."""
    n = coupling.shape[1]
    if n > MOST_UNKNOWNS:
        raise SettingsError(
            "box problem", "unknowns", f"are {n}", f"use at most {MOST_UNKNOWNS}: sums of 2^i"
        )
    A = weights[:, None] * np.where(upper > 0, coupling, 0.0)
    norms, null = np.einsum("ij,ij->j", A, A), NULL_CUTOFF**2 * float(np.vdot(A, A))
    bits = 2.0 ** np.arange(n)
    prior = np.minimum(prior, upper)
    rows = np.column_stack([np.zeros((n, 7)), A.T, prior, upper, norms + eps, bits])
    unknowns, scales = Rows(Unknown, rows), Rows(Scales, [[*weights, eps, null]])
    # The unconstrained minimiser is the map of the empty set.
    box = box_lists(unknowns, scales, 1)
    active_set_map(box.unknowns, box.scales[0], [FREE] * n, box.columns, box.maps[0])
    unknowns.array[:, :7] = [list(flat(row)) for row in box.maps[0]]
    return unknowns, scales


def box_rows(unknowns: Rows, scales: Rows, slots: int = STORE) -> Box:
    """A packed box problem with a store of its own, empty, and space to work in, as `Rows`."""
    n = len(unknowns.array)
    return Box(
        unknowns=unknowns,
        scales=scales,
        slots=Rows.empty(Slot, slots),
        maps=Rows.empty(Affine, slots, n),
        used=Rows.empty(float, 1),
        goal=Rows.empty(float, n),
        columns=Rows.empty(float, 6, n + ROOM),
        reached=Rows.empty(Held, limit(n)),
    )


def box_lists(unknowns: Rows, scales: Rows, slots: int = SMALL_STORE) -> Box:
    """The same as Python reads it: lists, whose empty entries are one and the same."""
    n, nobody = len(unknowns.array), Held(0.0, 0.0)
    return Box(
        unknowns=unknowns.to_list(),
        scales=scales.to_list(),
        slots=[Slot(nobody, 0.0)] * slots,
        maps=[[Affine(NOTHING, 0.0)] * n for _ in range(slots)],
        used=[0.0],
        goal=[0.0] * n,
        columns=[[0.0] * (n + ROOM) for _ in range(6)],
        reached=[nobody] * limit(n),
    )


def limit(n: int) -> int:
    """Changes of the active set after which a search gives up; random problems took 4 n at most."""
    return 100 + 20 * n


def search_memory(n: int, lanes: int = 0) -> Search:
    """The memory of a search before the first, as `Rows`."""
    return Search(
        solution=Rows.empty(float, n, lanes=lanes),
        status=Rows.empty(float, n, lanes=lanes),
        last=Rows.empty(Last, 1, lanes=lanes),
    )


def six(wrench: Array) -> Spatial:
    """A wrench, shape (6,), as a record."""
    a, b, c, d, e, f = wrench.tolist()
    return Spatial((a, b, c), (d, e, f))


class BoxLeastSquares:
    """Solver of the box problem for a sequence of wrenches, warm-started with the last answer.

    Attributes:
        A: Weighted matrix W B, shape (6, n).
        weights: Diagonal of W, shape (6,).
        eps: Regularisation, > 0.
        prior: u_0, where the regulariser pulls, shape (n,).
        upper: u_max, shape (n,).
        box: The problem as lists, with its store of maps.
        search: Memory of the last search, as lists.
        pivots: Changes of the active set so far.
        returns: How often an active set came back.
    """

    def __init__(self, B: Array, weights: Array, eps: float, prior: Array, upper: Array) -> None:
        """Keep the data and compute the unconstrained map.

        Args:
            B: Matrix from u to the wrench, shape (6, n).
            weights: Diagonal of W, shape (6,), not negative.
            eps: Regularisation, > 0.
            prior: u_0, shape (n,), within the box.
            upper: u_max, shape (n,); 0 pins an unknown at 0.

        Raises:
            SettingsError: More unknowns than `MOST_UNKNOWNS`.
        """
        self._packed = unknowns, scales = pack_box(B, weights, eps, prior, upper)
        self.weights, self.eps, self.upper = weights, eps, upper
        self.A: Array = np.ascontiguousarray(unknowns["column"].T)
        self.prior: Array = unknowns["prior"][:, 0]
        self.box = box_lists(unknowns, scales)
        self.search: Search = Lists().of(search_memory(upper.size))
        self.pivots = self.returns = 0
        self._residual = NOTHING

    def packed(self, slots: int = STORE) -> Box:
        """The problem as `Rows`, with a store of its own."""
        return box_rows(*self._packed, slots)

    def reset(self) -> None:
        """Forget the warm start, so that the next answer depends on its wrench alone."""
        self.search.last[0] = Last(Held(0.0, 0.0), 0.0)

    @property
    def solution(self) -> Array:
        """Answer of the last search, shape (n,)."""
        return np.array(self.search.solution)

    @property
    def status(self) -> Array:
        """Active set of the last search, FREE, AT_LOWER or AT_UPPER, shape (n,)."""
        return np.array(self.search.status)

    def solve(self, wrench: Array) -> bool:
        """Find the minimiser for a finite wrench, shape (6,); True if `solution` holds it.

        False means that rounding kept the search from settling; `solution` is then feasible and
        the best point found.
        """
        settled, pivots, returns = solve_box(self.box, self.search, six(wrench))
        self.pivots += int(pivots)
        self.returns += int(returns)
        return bool(settled)

    def kkt_residual(self, u: Array, wrench: Array) -> float:
        """How far u, shape (n,), is from optimal, in u; see the kernel `kkt_residual`."""
        worst, self._residual = kkt_residual(self.box, u.tolist(), six(wrench))
        return float(worst)

    @property
    def weighted_residual(self) -> Array:
        """A u - W w of the last `kkt_residual`, shape (6,)."""
        return np.array(list(flat(self._residual)))

    def objective(self, u: Array, wrench: Array) -> float:
        """The cost f(u)."""
        return float(cost(self.box, u.tolist(), six(wrench)))

    def linear_term(self, wrench: Array) -> Array:
        """The g of the cost 1/2 u^T H u + g^T u, shape (n,)."""
        linear: Array = self.A.T @ (self.weights * wrench)
        return -linear - self.eps * self.prior

    def hessian(self) -> Array:
        """H = A^T A + eps 1, shape (n, n)."""
        H: Array = self.A.T @ self.A + self.eps * np.eye(self.prior.size)
        return H
