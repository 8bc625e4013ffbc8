"""Weighted, regularised least squares in the box [0, u_max], solved by a warm active set.

The problem, with A = W B (6 x n) and d = W w:

    minimise  f(u) = 1/2 ||A u - d||^2 + eps/2 ||u - u_0||^2   subject to  0 <= u <= u_max.

For a given active set (which u are free, which held at a bound) the answer is affine in the
wrench w: a free u_i is an inner product with w plus a constant, and so is the multiplier of a held
one. `ActiveSet` is that map; it is computed once per set and kept, so a wrench that meets the same
bounds as the last one costs one matrix-vector product. Otherwise a primal active-set search
(Nocedal and Wright, Numerical Optimization, section 16.5) runs from a feasible point: move to the
minimiser of the current set, stop at the first bound in the way and hold it, and at a minimiser
free the held unknown with the most negative multiplier. The cost falls from minimiser to minimiser
(the Hessian A^T A + eps 1 is positive definite), so no set can come back, but for rounding; that is
noticed, counted, and ends the search.

Everything works on plain arrays of fixed size, with no solver object behind.
"""

from __future__ import annotations

from math import isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Status = NDArray[np.uint8]

FREE, AT_LOWER, AT_UPPER = 0, 1, 2
"""Status of one unknown in an active set."""

BOUND_TOLERANCE = 1e-10
"""How far a free u may pass a bound before it is held, in u. Rounding in the maps is 1e-13."""

MULTIPLIER_TOLERANCE = 1e-13
"""How negative a scaled multiplier may be before its bound is freed, in u.

Smaller than the multipliers that the regulariser makes, eps / H_ii (1e-9 for the default), so that
preferred speeds are honoured at the bounds too.
"""

NULL_CUTOFF = 1e-14
"""Singular values of A_F below this share of the norm of A are zero: they are rounding."""

FEW_MISFITS = 2
"""With so few bounds that do not fit, the last solution is a good start without asking further."""

LARGEST_STORE = 8192
"""How many active sets are kept; 8 rotors have 6561 at most, a flight meets a few dozen."""


def active_set_map(
    status: Status, A: Array, eps: float, prior: Array, upper: Array
) -> tuple[Array, Array]:
    """Minimiser and multipliers of one active set as a map of d: z = gain @ d + offset.

    With A_F = U diag(s) V^T the columns of the free unknowns and c = A u_held + A_F u_0F:

        u_F     = u_0F + V diag(s / (s^2 + eps)) U^T (d - c)
        A u - d = -U diag(eps / (s^2 + eps)) U^T (d - c)

    Nothing here divides by eps alone, so that u_F carries no rounding magnified in the null space
    of A_F, and multipliers of the size of eps come out in full precision.

    Args:
        status: FREE, AT_LOWER or AT_UPPER for each unknown, shape (n,).
        A: Weighted matrix W B, shape (6, n).
        eps: Regularisation, > 0.
        prior: u_0, shape (n,).
        upper: u_max, shape (n,).

    Returns:
        gain (n, 6) and offset (n,). z_i is u_i where free; where held it is the multiplier over
        H_ii: +(grad f)_i / H_ii at the lower bound, -(grad f)_i / H_ii at the upper one.
    """
    held = status != FREE
    u_held = np.where(status == AT_UPPER, upper, 0.0)
    A_F = np.where(held, 0.0, A)
    c = A @ np.where(held, u_held, prior)
    U, s, Vt = np.linalg.svd(A_F)
    s[s < NULL_CUTOFF * np.sqrt(np.vdot(A, A))] = 0.0
    left = np.ones(6)
    left[: s.size] = eps / (s * s + eps)
    residual = -(U * left) @ U.T
    solution = (Vt[: s.size].T * (s / (s * s + eps))) @ U[:, : s.size].T
    # Outward slope of the cost at a held bound, scaled by the diagonal of the Hessian.
    slope = np.where(status == AT_UPPER, -1.0, 1.0) / (np.einsum("ij,ij->j", A, A) + eps)
    gain = np.where(held[:, None], slope[:, None] * (A.T @ residual), solution)
    offset = np.where(held, slope * eps * (u_held - prior), prior) - gain @ c
    return gain, offset


class ActiveSet:
    """The map of one active set, ready for wrenches: z = gain @ w + offset.

    The set is the optimal one if and only if 0 <= z, and z <= u_max where free.

    Attributes:
        status: FREE, AT_LOWER or AT_UPPER for each unknown.
        gain: Shape (n, 6), per newton and newton-metre.
        offset: Shape (n,).
        low: Least z accepted, one per unknown.
        high: Largest z accepted, one per unknown.
        least: Smallest u: 0 where free, the bound where held, shape (n,).
        most: Largest u: u_max where free, the bound where held, shape (n,).
        free_ones: Which are free.
        held_ones: Which are held.
    """

    __slots__ = (
        "free_ones",
        "gain",
        "held_ones",
        "high",
        "least",
        "low",
        "most",
        "offset",
        "status",
    )

    def __init__(
        self, status: bytes, A: Array, weights: Array, eps: float, prior: Array, upper: Array
    ) -> None:
        """Compute the map; arguments as in `active_set_map`, weights the diagonal of W."""
        codes = np.frombuffer(status, dtype=np.uint8)
        gain, self.offset = active_set_map(codes, A, eps, prior, upper)
        free = codes == FREE
        self.status = status
        self.gain: Array = np.ascontiguousarray(gain * weights)
        self.low = tuple(np.where(free, -BOUND_TOLERANCE, -MULTIPLIER_TOLERANCE).tolist())
        self.high = tuple(np.where(free, upper + BOUND_TOLERANCE, np.inf).tolist())
        self.free_ones = tuple(np.flatnonzero(free).tolist())
        self.held_ones = tuple(np.flatnonzero(~free).tolist())
        self.least = np.where(codes == AT_UPPER, upper, 0.0)
        self.most = np.where(codes == AT_LOWER, 0.0, upper)


class BoxLeastSquares:
    """Solver of the box problem for a sequence of wrenches, warm-started with the last answer.

    Attributes:
        A: Weighted matrix W B, shape (6, n).
        weights: Diagonal of W, shape (6,).
        eps: Regularisation, > 0.
        prior: u_0, where the regulariser pulls, shape (n,).
        upper: u_max, shape (n,).
        gain: Unconstrained minimiser, u = gain @ w + offset, shape (n, 6).
        offset: Shape (n,).
        solution: Live buffer with the answer of the last search, shape (n,).
        active: Active set of the last search.
        pivots: Changes of the active set so far.
        cycles: How many searches met an active set twice.
    """

    def __init__(self, B: Array, weights: Array, eps: float, prior: Array, upper: Array) -> None:
        """Keep the data and compute the unconstrained map.

        Args:
            B: Matrix from u to the wrench, shape (6, n).
            weights: Diagonal of W, shape (6,), not negative.
            eps: Regularisation, > 0.
            prior: u_0, shape (n,), within the box.
            upper: u_max, shape (n,); 0 pins an unknown at 0.
        """
        n = B.shape[1]
        self.weights = weights
        self.A: Array = np.ascontiguousarray(weights[:, None] * np.where(upper > 0, B, 0.0))
        self.eps = eps
        self.prior = np.minimum(prior, upper)
        self.upper = upper
        self.pivots = 0
        self.cycles = 0
        self._largest_pivots = 100 + 20 * n
        self._is_warm = False
        self._sets: dict[bytes, ActiveSet] = {}
        self._start = self.active = self._set(bytes(n))
        self.gain, self.offset = self._start.gain, self._start.offset
        self._AT = np.ascontiguousarray(self.A.T)
        self._diagonal = np.einsum("ij,ij->j", self.A, self.A) + eps
        # [A u - d; gradient over the diagonal of the Hessian] = check @ [u; w] - pull.
        error = np.hstack([self.A, -np.diag(weights)])
        gradient = self._AT @ error
        gradient[:, :n] += eps * np.eye(n)
        self._check = np.vstack([error, gradient / self._diagonal[:, None]])
        self._pull = np.concatenate([np.zeros(6), eps * self.prior / self._diagonal])
        self._has_prior = bool(self.prior.any())
        self._checked = np.zeros(6 + n)
        self._u_and_w = np.zeros(n + 6)
        self._bounds: list[float] = upper.tolist()
        self._lower = np.zeros(n)
        self._z = np.empty(n)
        self.solution = self.prior.copy()

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles carry the warm start, but compute the store of maps anew."""
        return {**self.__dict__, "_sets": {}}

    def reset(self) -> None:
        """Forget the warm start, so that the next answer depends on its wrench alone."""
        self.active = self._start
        self._is_warm = False
        self.solution[:] = self.prior

    @property
    def status(self) -> Status:
        """Active set of the last search, shape (n,)."""
        return np.frombuffer(self.active.status, dtype=np.uint8)

    def solve(self, wrench: Array) -> bool:
        """Find the minimiser for a finite wrench, shape (6,); True if `solution` holds it.

        The last active set is tried first. If more than a few of its bounds do not fit, the search
        starts from the last solution or from the clipped unconstrained minimiser, whichever costs
        less; else from the last solution. False means that rounding kept the search from settling:
        a set came back, or the limit of changes was reached; `solution` is then feasible and the
        best point found.
        """
        active, u = self.active, self.solution
        z = active.gain.dot(wrench, self._z)
        z += active.offset
        goal = z.tolist()
        misfits = 0
        for value, low, high in zip(goal, active.low, active.high, strict=True):
            if not low <= value <= high:
                misfits += 1
        if misfits == 0:
            # Held ones to their bounds, free ones into the box: what the tolerance let through.
            np.minimum(np.maximum(z, active.least, out=u), active.most, out=u)
            return True
        if misfits <= FEW_MISFITS and self._is_warm:
            return self._search(wrench, active, goal, u.tolist())
        self._is_warm = True
        np.add(self.gain.dot(wrench, z), self.offset, out=z)
        clipped = np.minimum(np.maximum(z, self._lower), self.upper)
        if self.objective(clipped, wrench) < self.objective(u, wrench):
            status = bytes(
                AT_LOWER if value < 0.0 else AT_UPPER if value > bound else FREE
                for value, bound in zip(z.tolist(), self._bounds, strict=True)
            )
            active, u = self._set(status), clipped
            goal = self._goal(active, wrench)
        return self._search(wrench, active, goal, u.tolist())

    def _goal(self, active: ActiveSet, wrench: Array) -> list[float]:
        """Minimiser and multipliers z of an active set."""
        z = active.gain.dot(wrench, self._z)
        z += active.offset
        goal: list[float] = z.tolist()
        return goal

    def _search(self, wrench: Array, active: ActiveSet, goal: list[float], u: list[float]) -> bool:
        """Primal active set from a feasible u; see the module's first lines.

        Args:
            wrench: Shape (6,).
            active: An active set whose held unknowns are at their bounds in u.
            goal: Its z.
            u: Where to start; moved.
        """
        bounds, settled = self._bounds, False
        minimisers: set[bytes] = set()
        for _ in range(self._largest_pivots):
            share, blocking, worst, leaving = 1.0, -1, -MULTIPLIER_TOLERANCE, -1
            for i in active.held_ones:
                if goal[i] < worst:
                    worst, leaving = goal[i], i
            for i in active.free_ones:
                aim = goal[i]
                if aim < -BOUND_TOLERANCE or aim > bounds[i] + BOUND_TOLERANCE:
                    reached = ((0.0 if aim < 0.0 else bounds[i]) - u[i]) / (aim - u[i])
                    if reached < share:
                        share, blocking = reached, i
            for i in active.free_ones:
                moved = u[i] + share * (goal[i] - u[i])
                u[i] = 0.0 if moved < 0.0 else bounds[i] if moved > bounds[i] else moved
            status = bytearray(active.status)
            if blocking >= 0:
                lower = goal[blocking] < 0.0
                status[blocking] = AT_LOWER if lower else AT_UPPER
                u[blocking] = 0.0 if lower else bounds[blocking]
            elif leaving >= 0:
                if active.status in minimisers:
                    self.cycles += 1
                    break
                minimisers.add(active.status)
                status[leaving] = FREE
            else:
                settled = True
                break
            self.pivots += 1
            active = self._set(bytes(status))
            goal = self._goal(active, wrench)
        self.solution[:] = u
        self.active = active
        return settled

    def kkt_residual(self, u: Array, wrench: Array) -> float:
        """Largest entry of |u - clip(u - grad f(u) / diag H, 0, u_max)|, in u.

        Entry i is how far u_i alone would still move towards lower cost. All vanish exactly at the
        minimiser: stationarity, complementarity and feasibility in one number.
        """
        checked = self._check.dot(np.concatenate((u, wrench), out=self._u_and_w), self._checked)
        if self._has_prior:
            checked -= self._pull
        worst = 0.0
        for value, slope, bound in zip(u.tolist(), checked[6:].tolist(), self._bounds, strict=True):
            moved = value - slope
            step = value - (0.0 if moved < 0.0 else bound if moved > bound else moved)
            if not -worst <= step <= worst:
                worst = abs(step)
                if isnan(worst):
                    break
        return worst

    @property
    def weighted_residual(self) -> Array:
        """A u - d of the last `kkt_residual`, shape (6,), live."""
        return self._checked[:6]

    def objective(self, u: Array, wrench: Array) -> float:
        """The cost f(u)."""
        residual = self.A.dot(u)
        residual -= self.weights * wrench
        pull = u - self.prior
        return 0.5 * float(residual.dot(residual)) + 0.5 * self.eps * float(pull.dot(pull))

    def linear_term(self, wrench: Array) -> Array:
        """The g of the cost 1/2 u^T H u + g^T u, shape (n,)."""
        linear: Array = self._AT @ (self.weights * wrench)
        return -linear - self.eps * self.prior

    def hessian(self) -> Array:
        """H = A^T A + eps 1, shape (n, n)."""
        H: Array = self._AT @ self.A + self.eps * np.eye(self.prior.size)
        return H

    def _set(self, status: bytes) -> ActiveSet:
        """The map of an active set, from the store or computed."""
        found = self._sets.get(status)
        if found is None:
            if len(self._sets) >= LARGEST_STORE:
                self._sets.clear()
            found = ActiveSet(status, self.A, self.weights, self.eps, self.prior, self.upper)
            self._sets[status] = found
        return found
