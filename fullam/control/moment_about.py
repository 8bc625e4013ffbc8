"""The moment to ask for at the origin of {A} so that it comes out right about another point.

A vehicle turns about its centre of mass, at c from the origin of {A}. A force that falls short by
f - F also lacks the moment -c x (f - F) about c. The moment asked for is therefore corrected to

    m = M + c x (B_f u(F, m) - F),                                                             (C1)

where u(F, m) is the allocation, which gives up force before moment. While its active set stays the
same, u is affine and B_f u = P F + Q m + r, so that (C1) is three linear equations:

    (1 - [c]x Q) m = M + [c]x ((P - 1) F + r).                                                 (C2)

Semi-smooth Newton: solve (C2) for the last active set, allocate (F, m), and repeat with the active
set of that, until it is the one which m was solved with. In flight the first round does it in most
periods, since the set rarely changes.

The right side of (C1) is bounded and continuous, so a solution exists, and (its degree being one)
one with det(1 - [c]x Q) > 0 where it is regular. From an active set whose determinant is not
positive Newton comes back to where it was; there, and when two sets take turns, the plain step of
(C1) is taken instead. That settles all but one in thousands (see the tests); what is left ends
with a bounded answer for the last (F, m), and says so.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fullam.control.box_qp import FREE, LARGEST_STORE, ActiveSet, BoxLeastSquares

Array = NDArray[np.float64]
Triple = tuple[float, float, float]
Response = tuple[float, ...]

LARGEST_ROUNDS = 10
"""Allocations at most; two are enough from any set far away, ten leave one in thousands."""

SETTLED_MOMENT = 1e-3
"""Change of m [N m] at which plain steps alone end."""

LEAST_DETERMINANT = 0.01
"""Least det(1 - [c]x Q) with which (C2) is solved; it is 1 for c = 0."""


class MomentAbout:
    """Solver of (C1) on a box problem.

    Attributes:
        rounds: Allocations that the last answer took.
        settled: Whether the last answer satisfies (C1).
    """

    def __init__(self, coupling: Array) -> None:
        """Keep B_f, the first three rows of `coupling`, shape (6, n)."""
        self.rounds = 0
        self.settled = True
        self._B_force = np.ascontiguousarray(coupling[:3])
        self._responses: dict[bytes, Response] = {}

    def solve(
        self, box: BoxLeastSquares, wrench: list[float], center: list[float], asked: Array
    ) -> bool:
        """Find m and allocate (F, m).

        Args:
            box: The allocation; starts at, and leaves, its last answer.
            wrench: F and M at the origin of {A} [N, N m].
            center: c in {A} [m].
            asked: Where to write (F, m), shape (6,); F stands there already.

        Returns:
            What the last `box.solve` returned.
        """
        active = box.active
        last: ActiveSet | None = None
        before: ActiveSet | None = None
        self.settled = False
        for self.rounds in range(1, LARGEST_ROUNDS + 1):
            m = None if active is before else newton_step(self._response(active), wrench, center)
            is_newton = m is not None
            asked[3], asked[4], asked[5] = m or self.corrected(box.solution, wrench, center)
            if not box.solve(asked):
                return False
            if box.active is active and is_newton:
                self.settled = True
                break
            before, last, active = last, active, box.active
        return True

    def repeat(
        self,
        allocate: Callable[[Array], Array],
        wrench: list[float],
        center: list[float],
        asked: Array,
    ) -> Array:
        """Find m by the plain step of (C1) alone, whatever allocates; returns the last answer.

        `asked` ends as the (F, m) which that answer gives, and differs from the one it was asked
        for by less than `SETTLED_MOMENT` if `settled`.
        """
        self.settled = False
        for self.rounds in range(1, LARGEST_ROUNDS + 1):
            before = asked[3:].tolist()
            u = allocate(asked)
            asked[3:] = after = self.corrected(u, wrench, center)
            if max(abs(x - y) for x, y in zip(before, after, strict=True)) < SETTLED_MOMENT:
                self.settled = True
                break
        return u

    def corrected(self, u: Array, wrench: list[float], center: list[float]) -> Triple:
        """M + c x (B_f u - F)."""
        c1, c2, c3 = center
        F1, F2, F3, M1, M2, M3 = wrench
        f1, f2, f3 = self._B_force.dot(u).tolist()
        f1, f2, f3 = f1 - F1, f2 - F2, f3 - F3
        return M1 + (c2 * f3 - c3 * f2), M2 + (c3 * f1 - c1 * f3), M3 + (c1 * f2 - c2 * f1)

    def _response(self, active: ActiveSet) -> Response:
        """P - 1 and Q row by row, and r, of an active set: 21 numbers."""
        found = self._responses.get(active.status)
        if found is None:
            free = np.frombuffer(active.status, dtype=np.uint8) == FREE
            slopes = self._B_force @ np.where(free[:, None], active.gain, 0.0)
            constant = self._B_force @ np.where(free, active.offset, active.least)
            found = (
                *(slopes[:, :3] - np.eye(3)).ravel().tolist(),
                *slopes[:, 3:].ravel().tolist(),
                *constant.tolist(),
            )
            if len(self._responses) >= LARGEST_STORE:
                self._responses.clear()
            self._responses[active.status] = found
        return found


def newton_step(response: Response, wrench: list[float], center: list[float]) -> Triple | None:
    """Solution m of (C2); None where its determinant is too small. Numbers beat arrays of three."""
    p11, p12, p13, p21, p22, p23, p31, p32, p33 = response[:9]
    q11, q12, q13, q21, q22, q23, q31, q32, q33, r1, r2, r3 = response[9:]
    F1, F2, F3, M1, M2, M3 = wrench
    c1, c2, c3 = center
    # Columns of 1 - [c]x Q, and its adjugate.
    a11, a21, a31 = 1.0 - c2 * q31 + c3 * q21, c1 * q31 - c3 * q11, c2 * q11 - c1 * q21
    a12, a22, a32 = c3 * q22 - c2 * q32, 1.0 - c3 * q12 + c1 * q32, c2 * q12 - c1 * q22
    a13, a23, a33 = c3 * q23 - c2 * q33, c1 * q33 - c3 * q13, 1.0 - c1 * q23 + c2 * q13
    k1, k2, k3 = a22 * a33 - a23 * a32, a23 * a31 - a21 * a33, a21 * a32 - a22 * a31
    determinant = a11 * k1 + a12 * k2 + a13 * k3
    if not determinant >= LEAST_DETERMINANT:
        return None
    # Force that this active set leaves out for the moment 0, and the right side.
    d1 = p11 * F1 + p12 * F2 + p13 * F3 + r1
    d2 = p21 * F1 + p22 * F2 + p23 * F3 + r2
    d3 = p31 * F1 + p32 * F2 + p33 * F3 + r3
    b1, b2, b3 = M1 + c2 * d3 - c3 * d2, M2 + c3 * d1 - c1 * d3, M3 + c1 * d2 - c2 * d1
    return (
        (b1 * k1 + b2 * (a13 * a32 - a12 * a33) + b3 * (a12 * a23 - a13 * a22)) / determinant,
        (b1 * k2 + b2 * (a11 * a33 - a13 * a31) + b3 * (a13 * a21 - a11 * a23)) / determinant,
        (b1 * k3 + b2 * (a12 * a31 - a11 * a32) + b3 * (a11 * a22 - a12 * a21)) / determinant,
    )
