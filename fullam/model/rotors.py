"""Rotors and the coupling matrix, eqs. (27)-(35): from squared speeds to a wrench on {A}."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.checks import Checker, shown
from fullam.exceptions import VehicleError

Array = NDArray[np.float64]

UNIT_TOLERANCE = 1e-3
"""How far a thrust axis may be from unit length: published tables carry four digits."""

NORMALIZED = 4.0 * np.finfo(float).eps
"""A normalised axis is this close to unit length."""

COLUMNS = ("positions", "axes", "spins", "k_f", "k_tau", "max_speeds", "lags", "min_speeds")
"""The numeric columns of `Rotors`."""


MOST = (
    ("positions", 1e3, "m"),
    ("k_f", 1e3, "N/(rad/s)^2"),
    ("k_tau", 1e3, "N m/(rad/s)^2"),
    ("max_speeds", 1e6, "rad/s"),
    ("min_speeds", 1e6, "rad/s"),
    ("lags", 1e2, "s"),
)
"""Column, largest size and unit: what is beyond is a typing error, and would overflow."""

MOST_THRUST, LEAST_THRUST = 1e7, 1e-9
"""Largest thrust of a rotor that is none of a typing error [N]."""


def thrust(k_f: ArrayLike, speed: ArrayLike) -> Array:
    """Thrust of a rotor, f = k_f Omega^2, eq. (27).

    Args:
        k_f: Thrust coefficient [N/(rad/s)^2].
        speed: Rotor speed Omega [rad/s].

    Returns:
        Thrust along the rotor's axis [N].
    """
    return np.asarray(k_f, dtype=float) * np.square(np.asarray(speed, dtype=float))


def rotor_forces(axes: Array, k_f: Array, squared_speeds: Array) -> Array:
    """Force of each rotor in {A}, F_i = e_i k_f Omega_i^2, eq. (28).

    Args:
        axes: Thrust axes e^F, shape (n, 3), unit, in {A}.
        k_f: Thrust coefficients, shape (n,) [N/(rad/s)^2].
        squared_speeds: Omega_i^2, shape (n,) [(rad/s)^2].

    Returns:
        Forces, shape (n, 3) [N].
    """
    return axes * (k_f * squared_speeds)[:, None]


def net_force(axes: Array, k_f: Array, squared_speeds: Array) -> Array:
    """Sum of the rotor forces in {A}, F = k_f e^F Omega, eq. (29); shape (3,) [N].

    Arguments as in `rotor_forces`.
    """
    return (axes * k_f[:, None]).T @ squared_speeds


def rotor_moments(
    positions: Array, axes: Array, spins: Array, k_f: Array, k_tau: Array, squared_speeds: Array
) -> Array:
    """Moment of each rotor about the origin of {A}, eq. (30).

    tau_i = r_i x e_i k_f Omega_i^2 + d_i k_tau e_i Omega_i^2: lever arm plus drag torque.

    Args:
        positions: Hubs r_i in {A}, shape (n, 3) [m].
        axes: Thrust axes, shape (n, 3), unit.
        spins: d_i, shape (n,), +1 or -1: sign of the drag torque along the thrust axis.
        k_f: Thrust coefficients, shape (n,) [N/(rad/s)^2].
        k_tau: Drag coefficients, shape (n,) [N m/(rad/s)^2].
        squared_speeds: Omega_i^2, shape (n,) [(rad/s)^2].

    Returns:
        Moments, shape (n, 3) [N m].
    """
    lever = np.cross(positions, axes) * (k_f * squared_speeds)[:, None]
    return lever + axes * (spins * k_tau * squared_speeds)[:, None]


def moment_map(position: Array, spin: ArrayLike, k_f: ArrayLike, k_tau: ArrayLike) -> Array:
    """s_tau(r, d, k_f, k_tau) = s(k_f r) + d k_tau 1, eqs. (31)-(32); shape (..., 3, 3).

    Applied to a thrust axis it gives the moment of that rotor per squared speed. The position has
    shape (..., 3), the others (...).
    """
    r1, r2, r3 = np.multiply(k_f, np.moveaxis(position, -1, 0))
    drag = np.multiply(spin, k_tau)
    entries = [drag, -r3, r2, r3, drag, -r1, -r2, r1, drag]
    return np.stack(entries, axis=-1).reshape(*drag.shape, 3, 3)


def moment_matrix(positions: Array, axes: Array, spins: Array, k_f: Array, k_tau: Array) -> Array:
    """M_tau of eq. (33), one column s_tau(r_i, d_i, k_f, k_tau) e_i per rotor; shape (3, n)."""
    columns: Array = (moment_map(positions, spins, k_f, k_tau) @ axes[..., None])[..., 0]
    return columns.T


def coupling_matrix(positions: Array, axes: Array, spins: Array, k_f: Array, k_tau: Array) -> Array:
    """Coupling matrix [k_f e^F; M_tau] of eq. (34), shape (6, n).

    Maps squared speeds [(rad/s)^2] to the rotor wrench in {A} axes at the origin of {A},
    force [N] then moment [N m].
    """
    force = (axes * k_f[:, None]).T
    return np.vstack([force, moment_matrix(positions, axes, spins, k_f, k_tau)])


def world_wrench(R_WA: Array, wrench_A: Array) -> Array:
    """Turn a wrench from {A} to world axes, blkdiag(R, R) w, eq. (35) with its erratum."""
    return np.concatenate([R_WA @ wrench_A[:3], R_WA @ wrench_A[3:]])


@dataclass(frozen=True, eq=False)
class Rotors:
    """The rotors of a vehicle, as read-only columns; row i is rotor i.

    Attributes:
        names: One name per rotor.
        positions: Hubs in {A}, shape (n, 3) [m].
        axes: Thrust axes in {A}, shape (n, 3); normalised on entry.
        spins: Sign of the drag torque along the thrust axis, shape (n,), +1 or -1.
        k_f: Thrust coefficients, shape (n,) [N/(rad/s)^2].
        k_tau: Drag-torque coefficients, shape (n,) [N m/(rad/s)^2].
        max_speeds: Largest speeds, shape (n,) [rad/s]; 0 is a failed rotor.
        lags: First-order time constants of the speed, shape (n,) [s].
        min_speeds: Least speeds of rotors that must not stop, shape (n,) [rad/s]; 0 by default,
            and disregarded for a failed rotor. What a vehicle can do is worked out with them; the
            allocation does not know them.
        where: What an error message names as the source of the data.
    """

    names: tuple[str, ...]
    positions: Array
    axes: Array
    spins: Array
    k_f: Array
    k_tau: Array
    max_speeds: Array
    lags: Array
    min_speeds: Array = None  # type: ignore[assignment]  # zeros of the right length, on entry
    where: str = "rotors"

    def __post_init__(self) -> None:
        """Check shapes and ranges, normalise the axes, freeze the arrays."""
        check = Checker(self.where, VehicleError)
        if not isinstance(self.names, list | tuple):
            raise check.refuse("names", f"is {shown(self.names)}", "give one name a rotor")
        names = tuple(check.text(f"names[{i}]", name) for i, name in enumerate(self.names))
        object.__setattr__(self, "names", names)
        n = len(names)
        if n == 0:
            raise VehicleError(self.where, "rotors", "there is none", "give at least one rotor")
        if self.min_speeds is None:
            object.__setattr__(self, "min_speeds", np.zeros(n))
        for field in COLUMNS:
            self._own(field, (n, 3) if field in ("positions", "axes") else (n,))
        self._normalise_axes()
        self._check_ranges()
        for field in COLUMNS:
            getattr(self, field).setflags(write=False)

    def _own(self, field: str, shape: tuple[int, ...]) -> None:
        """Copy a column; it holds finite numbers of that shape."""
        try:
            value = np.array(getattr(self, field), dtype=float)
        except (TypeError, ValueError, OverflowError) as cause:
            raise VehicleError(
                self.where,
                field,
                f"is {shown(getattr(self, field))}",
                f"{self.count} rotors need numbers of shape {shape}",
            ) from cause
        if value.shape != shape:
            raise VehicleError(
                self.where, field, f"has shape {value.shape}", f"{self.count} rotors need {shape}"
            )
        if not np.all(np.isfinite(value)):
            raise VehicleError(self.where, field, "is not finite", "give finite numbers")
        object.__setattr__(self, field, value)

    def _normalise_axes(self) -> None:
        with np.errstate(over="ignore"):  # an infinite length is refused with the others
            lengths = np.linalg.norm(self.axes, axis=1)
        error = np.abs(lengths - 1.0)
        if error.max() > UNIT_TOLERANCE:
            worst = int(error.argmax())
            raise VehicleError(
                self.where,
                f"axis of rotor '{self.names[worst]}'",
                f"has length {lengths[worst]:.6g}",
                f"a thrust axis is a unit vector (within {UNIT_TOLERANCE:g})",
            )
        if error.max() > NORMALIZED:  # else a copy would differ in its last bit
            object.__setattr__(self, "axes", self.axes / lengths[:, None])

    def _check_ranges(self) -> None:
        self._require("spins", np.abs(self.spins) == 1.0, "spin is +1 or -1")
        for field, most, unit in MOST:
            good = (np.abs(getattr(self, field)) <= most).reshape(self.count, -1).all(axis=1)
            self._require(field, good, f"give at most {most:g} {unit}")
        self._require("k_f", self.k_f > 0, "a thrust coefficient is positive")
        self._require("k_tau", self.k_tau >= 0, "a drag coefficient is not negative; use the spin")
        self._require("max_speeds", self.max_speeds >= 0, "a largest speed is not negative")
        stopped = self.max_speeds == 0
        possible = (self.min_speeds >= 0) & ((self.min_speeds <= self.max_speeds) | stopped)
        self._require("min_speeds", possible, "a least speed is from 0 to the largest speed")
        self._require("lags", self.lags >= 0, "a lag is not negative")
        thrusts = thrust(self.k_f, self.max_speeds)
        good = (thrusts <= MOST_THRUST) & ((thrusts >= LEAST_THRUST) | stopped)
        self._require(
            "max_speeds",
            good,
            f"k_f max_speed^2 is a thrust, {LEAST_THRUST:g} to {MOST_THRUST:g} N",
        )

    def _require(self, field: str, good: NDArray[np.bool_], remedy: str) -> None:
        if not good.all():
            bad = int(good.argmin())
            value = " ".join(f"{x:g}" for x in np.ravel(getattr(self, field)[bad]))
            raise VehicleError(
                self.where, f"{field} of rotor '{self.names[bad]}'", f"is {value}", remedy
            )

    @property
    def count(self) -> int:
        """Number of rotors."""
        return len(self.names)

    @cached_property
    def coupling_matrix(self) -> Array:
        """Eq. (34): squared speeds [(rad/s)^2] to wrench_A, shape (6, n), read-only."""
        matrix = coupling_matrix(self.positions, self.axes, self.spins, self.k_f, self.k_tau)
        matrix.setflags(write=False)
        return matrix

    @cached_property
    def normalized_coupling(self) -> Array:
        """Columns scaled by the largest squared speeds: u in [0, 1]^n to wrench_A, (6, n)."""
        matrix = self.coupling_matrix * np.square(self.max_speeds)
        matrix.setflags(write=False)
        return matrix

    @property
    def least_shares(self) -> Array:
        """Least squared speeds over the largest, shape (n,): the lower bounds of u.

        0 for a failed rotor: it stands still whatever its least speed was.
        """
        turning = self.max_speeds > 0
        return np.square(
            np.divide(self.min_speeds, self.max_speeds, out=np.zeros(self.count), where=turning)
        )

    @property
    def max_thrusts(self) -> Array:
        """Largest thrust of each rotor, eq. (27), shape (n,) [N]."""
        return thrust(self.k_f, self.max_speeds)

    def wrench(self, speeds: ArrayLike) -> Array:
        """Wrench of the rotors at the given speeds [rad/s], eq. (34), in {A}, shape (6,)."""
        check = Checker(self.where, VehicleError)
        return self.coupling_matrix @ np.square(check.array("speeds", speeds, (self.count,)))

    def with_failed(self, *indices: int) -> Rotors:
        """The same rotors with the given ones stopped: their largest speed becomes 0."""
        check = Checker(self.where, VehicleError)
        rows = [check.whole("index", index, -self.count, self.count - 1) for index in indices]
        max_speeds = self.max_speeds.copy()
        max_speeds[rows] = 0.0
        return replace(self, max_speeds=max_speeds)
