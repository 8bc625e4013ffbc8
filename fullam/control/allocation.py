"""Allocation: from a wrench to rotor speeds within their bounds, and how good the answer is.

The unknowns are u_i = Omega_i^2 / Omega_max,i^2 in [0, 1]; the rotors give the wrench B u, with B
the coupling matrix of eq. (34) scaled by the largest squared speeds. The allocator solves

    minimise  1/2 ||W (B u - w)||^2 + eps/2 ||u - u_0||^2   subject to  0 <= u <= 1

by a ladder, each rung tried when the one above does not apply:

1. "exact": the unconstrained minimiser u = K w + k, if it is within the bounds;
2. "active-set": the warm active set of `box_qp`, if its KKT residual confirms it;
3. "proxqp": the referee;
4. "clip": K w + k cut to the bounds. A vehicle in flight must be told something, so the ladder
   returns this flagged instead of raising; with method="proxqp" a failure is an AllocationFailed.

A wrench that rung 1 does not reach may cost force. `moment_about` says which moment to ask for
then, so that the vehicle turns about its centre of mass as it should.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Any, Literal, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.control.allocation_request import read_axes, read_preferred_speeds, read_weights
from fullam.control.box_qp import BoxLeastSquares
from fullam.control.moment_about import MomentAbout
from fullam.control.proxqp_referee import ProxQPReferee
from fullam.exceptions import AllocationFailed, NonFiniteCenter, NonFiniteWrench, SettingsError
from fullam.model.rotors import Rotors
from fullam.model.wrench_axes import full_scale, require_rank

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Method = Literal["exact", "active-set", "proxqp", "clip"]

DEFAULT_REGULARIZATION = 1e-8
"""Weight of ||u - u_0||^2: picks one of the many speeds that give the same wrench.

It costs less than 1e-6 of the wrench, and is still well above rounding.
"""

SATURATION_TOLERANCE = 1e-6
"""Weighted wrench error, as a share of full scale, above which active bounds cost wrench."""

KKT_TOLERANCE = 1e-8
"""Largest KKT residual with which the active set's answer is believed; it leaves 1e-13."""

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
    """

    exact: int = 0
    active_set: int = 0
    proxqp: int = 0
    clip: int = 0
    refused: int = 0
    unconfirmed: int = 0
    unsettled: int = 0


class _Problem:
    """What the allocations of one allocator share."""

    __slots__ = ("B", "box", "max_speeds")

    def __init__(self, rotors: Rotors, box: BoxLeastSquares) -> None:
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
        self, problem: _Problem, asked: Array, squared: Array, method: Method, saturated: bool
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
        self.counters = Counters()
        self._box = BoxLeastSquares(
            rotors.normalized_coupling,
            row_weights,
            float(regularization),
            prior,
            working.astype(float),
        )
        self._referee = ProxQPReferee(self._box.hessian(), self._box.upper)
        self._problem = _Problem(rotors, self._box)
        weakest = np.linalg.svd(self._box.A[self.axes], compute_uv=False)[-1]
        self._tolerance_squared = (
            max(SATURATION_TOLERANCE, 10.0 * float(regularization) / weakest**2) ** 2
        )
        self._K, self._k = self._box.gain, self._box.offset
        self._has_offset = bool(self._k.any())
        self.moment = MomentAbout(rotors.normalized_coupling)
        self._ladder = method == "ladder"
        self.squared: Array = np.zeros(rotors.count)
        self.asked: Array = np.zeros(6)
        self.rung: Method = "exact"
        self.saturated = False

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
        return Allocation(
            self._problem, wrench, self.allocate(wrench).copy(), self.rung, self.saturated
        )

    def allocate(self, wrench_A: Array) -> Array:
        """As `solve`, for a control loop: returns the live buffer `squared`, shape (n,).

        `rung` and `saturated` tell the rest; no array is made when the wrench is within reach.
        wrench_A must be an array of six floats. Raises as `solve`.
        """
        u = self.exact(wrench_A)
        if u is not None:
            return u
        if not self._ladder:
            return self._refereed(wrench_A)
        return self._confirm(wrench_A, self._box.solve(wrench_A))

    def exact(self, wrench_A: Array) -> Array | None:
        """The first rung alone: the live `squared` if it holds the exact answer, else None.

        Raises:
            NonFiniteWrench: NaN or infinity, before any solver is touched.
        """
        if not isfinite(sum(wrench_A.tolist())):
            self._refuse(NonFiniteWrench(wrench_A))
        if self._ladder:
            u = self._K.dot(wrench_A, self.squared)
            if self._has_offset:
                u += self._k
            if u[u.argmin()] >= 0.0 and u[u.argmax()] <= 1.0:
                self.counters.exact += 1
                self.rung = "exact"
                self.saturated = False
                return u
        return None

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
        wrench, point, moment, asked = wrench_A.tolist(), center.tolist(), self.moment, self.asked
        if not isfinite(sum(wrench)):
            self._refuse(NonFiniteWrench(wrench_A))
        if not isfinite(sum(point)):
            self._refuse(NonFiniteCenter(wrench_A, center))
        np.copyto(asked, wrench_A)
        if self._ladder:
            u = self._confirm(asked, moment.solve(self._box, wrench, point, asked))
            if not (moment.settled and self.rung == "active-set"):
                asked[3:] = moment.corrected(u, wrench, point)
                self.counters.unsettled += 1
        else:
            u = moment.repeat(self._refereed, wrench, point, asked)
            self.counters.unsettled += not moment.settled
        return u

    def _refuse(self, error: NonFiniteWrench) -> NoReturn:
        self.counters.refused += 1
        raise error

    def _confirm(self, wrench: Array, settled: bool) -> Array:
        """Believe the active set if its KKT residual agrees; else go down the ladder."""
        box, u = self._box, self.squared
        if settled and box.kkt_residual(box.solution, wrench) <= KKT_TOLERANCE:
            np.copyto(u, box.solution)
            self.counters.active_set += 1
            return self._finish("active-set")
        self.counters.unconfirmed += 1
        box.reset()  # nor is it a start for the next search
        if self._referee.solve(box.linear_term(wrench)):
            return self._accept_referee(wrench)
        np.clip(self._K.dot(wrench, u) + self._k, 0.0, box.upper, out=u)
        self.counters.clip += 1
        box.kkt_residual(u, wrench)
        return self._finish("clip")

    def _refereed(self, wrench: Array) -> Array:
        linear = self._box.linear_term(wrench)
        if not self._referee.solve(linear):
            raise AllocationFailed(wrench.copy(), self._referee.status, self._evidence(linear))
        return self._accept_referee(wrench)

    def _accept_referee(self, wrench: Array) -> Array:
        np.copyto(self.squared, self._referee.solution)
        self.counters.proxqp += 1
        self._box.kkt_residual(self.squared, wrench)
        return self._finish("proxqp")

    def _finish(self, rung: Method) -> Array:
        u, error = self.squared, self._box.weighted_residual
        self.rung = rung
        short = float(error.dot(error)) > self._tolerance_squared
        self.saturated = short and (rung != "proxqp" or self._at_bound(u))
        return u

    def _at_bound(self, u: Array) -> bool:
        working = u[self._box.upper > 0]
        return bool(working.min() <= SNAP or working.max() >= 1.0 - SNAP)

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
