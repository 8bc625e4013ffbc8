"""ProxQP as an independent second opinion on the box problem of `box_qp`.

Its settings matter: the defaults return wrong answers marked solved when bounds are active, because
the duality gap is not checked, and the scaling of the unknowns decides whether it converges at all.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ACCURACY = 1e-9
"""Primal, dual and duality-gap tolerance, absolute and relative to the size of the data.

The relative part is for wrenches far out of reach, whose duality gap cannot be resolved to 1e-9 in
double precision: without it one saturated problem in seven ends at any iteration limit.
"""

LARGEST_ITERATIONS = 10_000
"""Outer and inner limit: about 30 ms.

Eight rotors take 10, at most 26. With many more rotors than axes the cost is flat in many
directions, and one saturated problem in a hundred takes over 100, up to 3000 with sixteen.
"""


class ProxQPReferee:
    """One ProxQP object for minimise 1/2 u^T H u + g^T u, 0 <= u <= upper; only g changes.

    It copies and pickles by its data: a ProxQP object itself does not survive that.

    Attributes:
        hessian: H, shape (n, n).
        upper: Upper bounds, shape (n,).
        solution: Copy of the last answer, clipped to the box (ProxQP keeps to it within 1e-9).
        status: What ProxQP said last.
        iterations: Inner iterations of the last solve.
    """

    def __init__(self, hessian: Array, upper: Array) -> None:
        """Keep the data; the ProxQP object is made at the first solve (about 100 us)."""
        self.hessian = hessian
        self.upper = upper
        self.solution = np.zeros(upper.size)
        self.status = "unused"
        self.iterations = 0
        self._qp: Any = None

    def __getstate__(self) -> dict[str, Any]:
        """The data without the ProxQP object."""
        return {**self.__dict__, "_qp": None}

    def solve(self, linear_term: Array) -> bool:
        """Solve for a finite g, shape (n,); True if ProxQP reports SOLVED."""
        if self._qp is None:
            self._qp = self._build(linear_term)
        else:
            self._qp.update(g=linear_term)
        self._qp.solve()
        results = self._qp.results
        self.status = str(results.info.status.name)
        self.iterations = int(results.info.iter)
        np.minimum(np.maximum(results.x, 0.0), self.upper, out=self.solution)
        solved = self.status == "PROXQP_SOLVED"
        if not solved:
            self._qp = None  # what it stopped in would be the next solve's scaling and steps
        return solved

    def _build(self, linear_term: Array) -> Any:
        from proxsuite import proxqp  # slow to import, and most flights never ask it

        n = self.upper.size
        qp = proxqp.dense.QP(n, 0, n)
        settings = qp.settings
        settings.eps_abs = settings.eps_rel = ACCURACY
        settings.check_duality_gap = True
        settings.eps_duality_gap_abs = settings.eps_duality_gap_rel = ACCURACY
        settings.initial_guess = proxqp.InitialGuess.EQUALITY_CONSTRAINED_INITIAL_GUESS
        settings.max_iter = settings.max_iter_in = LARGEST_ITERATIONS
        qp.init(self.hessian, linear_term, None, None, np.eye(n), np.zeros(n), self.upper)
        return qp
