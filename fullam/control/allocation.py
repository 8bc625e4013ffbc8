"""Allocation: from a wrench to rotor speeds within their bounds, and how good the answer is.

`ladder` says what is minimised, and holds the kernels that do it. The `Allocator` asks them one
wrench after another, has ProxQP as its referee, and answers with an `Allocation` that can prove
itself. For flights, in machine code and in lanes, it gives the ladder's problem and memory.
"""

from __future__ import annotations

from math import isfinite
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.control.active_set_map import inner
from fullam.control.active_set_search import weighted_residual
from fullam.control.allocation_answer import SNAP, Allocation, Counters, Method, SharedProblem
from fullam.control.allocation_request import read_axes, read_preferred_speeds, read_weights
from fullam.control.box_qp import STORE, BoxLeastSquares, search_memory, six
from fullam.control.ladder import (
    ACTIVE_SET,
    CLIP,
    PROXQP,
    AllocationMemory,
    AllocationProblem,
    Answer,
    Counts,
    RotorColumn,
    conclude,
    confirm,
    count_exact,
    cut,
    exact,
    finite,
    search_at_origin,
)
from fullam.control.moment_about import (
    LARGEST_ROUNDS,
    SETTLED_MOMENT,
    Tried,
    corrected,
    search_about,
)
from fullam.control.proxqp_referee import ProxQPReferee
from fullam.dynamics.spatial import Spatial
from fullam.exceptions import AllocationFailed, NonFiniteCenter, NonFiniteWrench, SettingsError
from fullam.model.rotors import Rotors
from fullam.model.wrench_axes import full_scale, require_rank
from fullam.numbers.program import Lists
from fullam.numbers.records import Rows, flat
from fullam.numbers.vectors import ZERO, Vector

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
RUNGS: tuple[Method, ...] = ("exact", "active-set", "proxqp", "clip")
"""Names of the rungs, by number; see `ladder`."""

DEFAULT_REGULARIZATION = 1e-8
"""Weight of ||u - u_0||^2: picks one of the many speeds that give the same wrench.

It costs less than 1e-6 of the wrench, and is still well above rounding.
"""

SATURATION_TOLERANCE = 1e-6
"""Weighted wrench error, as a share of full scale, above which active bounds cost wrench."""


class Allocator:
    """Rotor speeds for wrenches, one control period after another; never sees the arm.

    Copies and pickles carry counters and warm start along.

    Attributes:
        rotors: The rotors.
        axes: Controlled axes, shape (6,) bool.
        weights: Weights relative to full scale, normalised to 1 for the least one, shape (6,).
        method: "ladder" or "proxqp".
        counters: Solves by rung.
        squared: Live solution of the last allocation, u in [0, 1], shape (n,).
        asked: Live, after `allocate_about`: the wrench, its moment corrected, shape (6,). What u
            gives less this is the shortfall with its moment about the centre.
        moment: Solver of `allocate_about`; tells how many rounds the last one took.
        rung: Method that answered last.
        saturated: Whether bounds cost wrench in the last answer, as in `Allocation`; after
            `allocate_about` with the moment about the centre.
    """

    def __init__(
        self,
        rotors: Rotors,
        weights: ArrayLike | None = None,
        axes: ArrayLike | None = None,
        regularization: float = DEFAULT_REGULARIZATION,
        preferred_speeds: ArrayLike | None = None,
        method: str = "ladder",
        vehicle_name: str = "unnamed",
    ) -> None:
        """Check the request and prepare the exact map.

        Args:
            rotors: The rotors; one with max_speed 0 has failed and stands still.
            weights: Six positive numbers, relative to `full_scale`; only their ratios count.
                Default `allocation_request.DEFAULT_WEIGHTS`: moment before force.
            axes: Controlled axes, six bools; the others get weight 0. Default all.
            regularization: eps, for weights whose least is 1.
            preferred_speeds: Where the regulariser pulls, shape (n,) [rad/s]. Default 0: the least
                sum of squared thrusts.
            method: "ladder", or "proxqp" for the referee every time.
            vehicle_name: For the error.

        Raises:
            NotFullyActuated: The coupling matrix has deficient rank on the axes.
            SettingsError: A value of the wrong shape or range.
        """
        if method not in ("ladder", "proxqp"):
            raise SettingsError("allocator", "method", f"is '{method}'", "use 'ladder' or 'proxqp'")
        if not (isfinite(regularization) and regularization > 0):
            raise SettingsError(
                "allocator", "regularization", f"is {regularization}", "use a small positive number"
            )
        self.rotors = rotors
        self.method = method
        self.axes = read_axes(axes)
        require_rank(rotors, self.axes, vehicle_name)
        self.weights = read_weights(weights, self.axes)
        row_weights = np.where(self.axes, self.weights / full_scale(rotors), 0.0)
        working = rotors.max_speeds > 0
        prior = read_preferred_speeds(preferred_speeds, rotors)
        self._box = box = BoxLeastSquares(
            rotors.normalized_coupling,
            row_weights,
            float(regularization),
            prior,
            working.astype(float),
        )
        self._referee = ProxQPReferee(box.hessian(), box.upper)
        self._shared = SharedProblem(rotors, box)
        weakest = np.linalg.svd(box.A[self.axes], compute_uv=False)[-1]
        self._tolerance_squared = (
            max(SATURATION_TOLERANCE, 10.0 * float(regularization) / weakest**2) ** 2
        )
        lists = Lists().of(self.problem(1))
        self._problem = lists._replace(box=box.box)
        self._memory = Lists().of(allocation_memory(rotors.count))._replace(search=box.search)
        self._ladder = method == "ladder"
        self.squared: Array = np.zeros(rotors.count)
        self.asked: Array = np.zeros(6)
        self.rung: Method = "exact"
        self.saturated = False
        self.rounds = 0
        self.settled = True

    def problem(self, slots: int = STORE) -> AllocationProblem:
        """The problem for the flights of one thread, as `Rows`, with a store of maps of its own.

        Args:
            slots: Size of the store, a prime; `box_qp.SMALL_STORE` for flights in Python.
        """
        B, speeds = self.rotors.normalized_coupling, self.rotors.max_speeds
        return AllocationProblem(
            box=self._box.packed(slots),
            rotors=Rows(RotorColumn, np.vstack([B, speeds]).T),
            tolerance=Rows(float, [[self._tolerance_squared]]),
        )

    @property
    def counters(self) -> Counters:
        """Solves by rung, and what the active set had to do."""
        return Counters(*map(int, self._memory.counts[0]))

    @property
    def is_cold(self) -> bool:
        """Whether the next search starts from nothing."""
        return self._box.search.last[0].is_warm == 0.0

    def reset(self) -> None:
        """Forget the warm start, so that a flight can be flown again bit for bit."""
        self._box.reset()

    def solve(self, wrench_A: Array) -> Allocation:
        """Allocate a wrench in {A} about its origin, shape (6,) [N, N m].

        Raises:
            NonFiniteWrench: NaN or infinity, before any solver is touched.
            AllocationFailed: With method="proxqp", when ProxQP does not report SOLVED.
        """
        wrench = np.array(wrench_A, dtype=float)
        squared = self.allocate(wrench).copy()
        return Allocation(self._shared, wrench, squared, self.rung, self.saturated)

    def allocate(self, wrench_A: Array) -> Array:
        """As `solve`, for a control loop: returns the live buffer `squared`, shape (n,).

        `rung` and `saturated` tell the rest. wrench_A must be an array of six floats. Raises as
        `solve`.
        """
        u = self.exact(wrench_A)
        if u is not None:
            return u
        if not self._ladder:
            return self._refereed(wrench_A)
        wrench = six(wrench_A)
        return self._descend(search_at_origin(self._problem, self._memory, wrench), wrench, ZERO)

    def exact(self, wrench_A: Array) -> Array | None:
        """The first rung alone: the live `squared` if it holds the exact answer, else None.

        Raises:
            NonFiniteWrench: NaN or infinity, before any solver is touched.
        """
        wrench, memory = six(wrench_A), self._memory
        if not finite(wrench, ZERO):
            self._refuse(NonFiniteWrench(wrench_A))
        if not self._ladder or exact(self._problem, wrench, memory.shares):
            return None
        count_exact(memory, True)
        self.squared[:] = memory.shares
        self.rung, self.saturated = "exact", False
        return self.squared

    def allocate_about(self, wrench_A: Array, center: Array) -> Array:
        """Allocate a wrench that `exact` does not reach, its moment taken about another point.

        The weights put moment before force; what comes first is here the moment about `center`,
        see `moment_about`. With method="proxqp" its plain step is repeated.

        Args:
            wrench_A: The wrench in {A} at its origin, shape (6,).
            center: The vehicle's centre of mass in {A}, shape (3,) [m].

        Returns:
            The live buffer `squared`, shape (n,).

        Raises:
            NonFiniteWrench: NaN or infinity; `NonFiniteCenter` if the centre is the culprit.
            AllocationFailed: As `solve`.
        """
        wrench, (x, y, z) = six(wrench_A), center.tolist()
        if not finite(wrench, ZERO):
            self._refuse(NonFiniteWrench(wrench_A))
        if not finite(wrench, (x, y, z)):
            self._refuse(NonFiniteCenter(wrench_A, center))
        if not self._ladder:
            return self._repeat(wrench, (x, y, z))
        problem, memory = self._problem, self._memory
        tried = search_about(problem.box, problem.rotors, memory.search, wrench, (x, y, z))
        return self._descend(tried, wrench, (x, y, z))

    def _count(self, name: str) -> None:
        """One more of a counter."""
        counts = self._memory.counts[0]
        self._memory.counts[0] = counts._replace(**{name: getattr(counts, name) + 1.0})

    def _refuse(self, error: NonFiniteWrench) -> NoReturn:
        self._count("refused")
        raise error

    def _descend(self, tried: Tried, wrench: Spatial, center: Vector) -> Array:
        """The ladder from the active set on, the referee before the clip."""
        problem, memory, rung, at_bound = self._problem, self._memory, ACTIVE_SET, True
        believed, error = confirm(problem, memory, tried.asked, tried.is_solved)
        if not believed:
            self._box.reset()  # nor is it a start for the next search
            asked = np.array(list(flat(tried.asked)))
            if self._referee.solve(self._box.linear_term(asked)):
                rung, error, at_bound = PROXQP, *self._take_referee(tried.asked)
            else:
                rung, error = CLIP, cut(problem, memory, tried.asked)
        short = at_bound and not error <= self._tolerance_squared
        conclude(problem, memory, tried, wrench, center, rung, float(short))
        return self._finish(rung, short)

    def _take_referee(self, asked: Spatial) -> tuple[float, bool]:
        """Take the referee's answer; its squared weighted error, and whether a rotor is at a bound.

        ProxQP leaves a little error where bounds have no part in it.
        """
        box, memory, u = self._box, self._memory, self._referee.solution
        memory.shares[:] = u.tolist()
        residual = weighted_residual(box.box, memory.shares, asked)
        working = u[box.upper > 0]
        return inner(residual, residual), bool(working.min() <= SNAP or working.max() >= 1.0 - SNAP)

    def _finish(self, rung: float, short: bool) -> Array:
        answer = self._memory.answer[0]
        self.squared[:], self.asked[:] = self._memory.shares, list(flat(answer.asked))
        self.rung, self.saturated = RUNGS[int(rung)], short
        self.rounds, self.settled = int(answer.rounds), answer.is_settled > 0.0
        return self.squared

    def _refereed(self, wrench_A: Array) -> Array:
        """The answer of ProxQP alone."""
        linear = self._box.linear_term(wrench_A)
        if not self._referee.solve(linear):
            raise AllocationFailed(wrench_A.copy(), self._referee.status, self._evidence(linear))
        error, at_bound = self._take_referee(six(wrench_A))
        self._count("proxqp")
        self.squared[:] = self._memory.shares
        self.rung, self.saturated = "proxqp", at_bound and error > self._tolerance_squared
        return self.squared

    def _repeat(self, wrench: Spatial, center: Vector) -> Array:
        """Find m by the plain step of (C1) alone.

        `asked` ends as the (F, m) which the last answer gives, and differs from the one it was
        asked for by less than `SETTLED_MOMENT` if `settled`.
        """
        self.settled, self.asked[:] = False, list(flat(wrench))
        for self.rounds in range(1, LARGEST_ROUNDS + 1):
            before = self.asked[3:].copy()
            u = self._refereed(self.asked)
            self.asked[3:] = corrected(self._problem.rotors, self._memory.shares, wrench, center)
            if np.abs(self.asked[3:] - before).max() < SETTLED_MOMENT:
                self.settled = True
                return u
        self._count("unsettled")
        return u

    def _evidence(self, linear: Array) -> dict[str, Any]:
        box = self._box
        return {
            "H": box.hessian(),
            "g": linear,
            "lower": np.zeros(box.upper.size),
            "upper": box.upper,
            "coupling": self.rotors.normalized_coupling,
            "weights": box.weights,
            "regularization": box.eps,
            "prior": box.prior,
        }


def allocation_memory(n: int, lanes: int = 0) -> AllocationMemory:
    """The memory of a flight's allocation at take-off, n rotors, as `Rows`."""

    def rows(record: Any, length: int = 1) -> Rows:
        return Rows.empty(record, length, lanes=lanes)

    return AllocationMemory(
        search=search_memory(n, lanes),
        shares=rows(float, n),
        speeds=rows(float, n),
        wrench=rows(Spatial),
        center=rows(Vector),
        answer=rows(Answer),
        counts=rows(Counts),
    )
