"""What a vehicle can do before anyone flies it: axes, lift, hover speeds, hover tilt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linprog

from fullam.control.allocation import Allocator
from fullam.control.box_qp import BoxLeastSquares
from fullam.exceptions import FullamError, VehicleError
from fullam.model.joints import ArmJoints
from fullam.model.rotors import Rotors
from fullam.model.vehicle import Vehicle
from fullam.model.wrench_axes import AXES, RANK_TOLERANCE, controllable_axes, full_scale

Array = NDArray[np.float64]

SUPPORT_TOLERANCE = 1e-4
"""Wrench error, as a share of the weight, up to which a wrench counts as delivered.

It is what parallel rotors read from a URDF miss parallelism by, and costs 0.006 deg of tilt.
"""

TILT_STEP = 5.0
"""Step of the first search for the largest tilt [deg].

Forces within reach form a convex set: between two tilts 5 deg apart that can be held, at most
0.1 % of the weight can be missing, so no limit is stepped over.
"""

TILT_RESOLUTION = 0.01
"""Where the bisection of the largest tilt stops [deg]."""

DIRECTIONS = 72
"""Tilt directions tried, evenly about the vertical."""

Row = tuple[str, str, str]


@dataclass(frozen=True, eq=False)
class Capability:
    """What the rotors of a vehicle can do for it, with the arm at rest in one pose.

    Attributes:
        vehicle: Name.
        n_rotors: Number of rotors.
        mass: Mass of the whole vehicle [kg].
        arm: Arm pose theta, shape (n_arm,) [rad or m].
        joints: The arm's joints.
        singular_values: Of B W^-1, shape (6,): B maps u = Omega^2 / Omega_max^2 to the wrench
            about the origin of {A}, W is `full_scale`: 1 is all rotors pulling one way.
        rank: Number of wrench axes the rotors produce independently.
        condition_number: Largest over least singular value that is not zero.
        axes: Axes that can be controlled independently, six bools, force then moment.
        limits: What cannot be done, one sentence each; empty for a vehicle that can do it all.
        thrust_to_weight: Largest force straight up while level and in balance, over the weight.
        total_thrust_to_weight: Sum of the rotors' largest thrusts over the weight.
        hover_wrench: Rotor wrench that holds the vehicle level, in {A}, shape (6,) [N, N m].
        can_hover: Whether the rotors deliver it.
        hover_speeds: Rotor speeds for it, shape (n,) [rad/s].
        hover_shares: The same as shares of the largest speeds, shape (n,); 0 for failed rotors.
        tilt_directions: Azimuth of the body's up vector seen from {A}, shape (m,) [rad].
        hover_tilts: Largest tilt at which it still hovers, per direction, shape (m,) [rad].
    """

    vehicle: str
    n_rotors: int
    mass: float
    arm: Array
    joints: ArmJoints
    singular_values: Array
    rank: int
    condition_number: float
    axes: tuple[bool, ...]
    limits: tuple[str, ...]
    thrust_to_weight: float
    total_thrust_to_weight: float
    hover_wrench: Array
    can_hover: bool
    hover_speeds: Array
    hover_shares: Array
    tilt_directions: Array
    hover_tilts: Array

    @property
    def worst_hover_tilt(self) -> float:
        """Largest tilt that it can hold in every direction [rad]."""
        return float(self.hover_tilts.min())

    @property
    def best_hover_tilt(self) -> float:
        """Largest tilt that it can hold in the most favourable direction [rad]."""
        return float(self.hover_tilts.max())

    def rows(self) -> list[Row]:
        """The report, as (label, value, unit)."""
        worst = np.rad2deg(self.tilt_directions[self.hover_tilts.argmin()])
        values = " ".join(f"{value:.3f}" for value in self.singular_values)
        speeds, shares = self.hover_speeds, 100.0 * self.hover_shares
        rows: list[Row] = [
            ("mass", f"{self.mass:.3f}", "kg"),
            ("rotors", str(self.n_rotors), ""),
            self._arm_row(),
            ("rank of the coupling matrix", f"{self.rank} of 6", ""),
            ("fully actuated", "yes" if self.rank == 6 else "no", ""),
            ("singular values", values, "full scale"),
            ("condition number", f"{self.condition_number:.1f}", ""),
            ("thrust to weight, straight up", f"{self.thrust_to_weight:.2f}", ""),
            ("thrust to weight, sum of rotors", f"{self.total_thrust_to_weight:.2f}", ""),
            ("hovers level", "yes" if self.can_hover else "NO", ""),
            ("hover rotor speeds", f"{speeds.min():.0f} to {speeds.max():.0f}", "rad/s"),
            ("share of the largest speeds", f"{shares.min():.0f} to {shares.max():.0f}", "%"),
            ("hover tilt, every direction", f"{np.rad2deg(self.worst_hover_tilt):.1f}", "deg"),
            ("hover tilt, best direction", f"{np.rad2deg(self.best_hover_tilt):.1f}", "deg"),
        ]
        if self.best_hover_tilt - self.worst_hover_tilt > np.deg2rad(0.1):
            rows.insert(-1, ("  least towards azimuth", f"{worst:.0f}", "deg"))
        return rows + [("note" if self.can_hover else "problem", text, "") for text in self.limits]

    def _arm_row(self) -> Row:
        typed, units = self.joints.to_typed(self.arm), self.joints.units
        if "m" not in units:
            return ("arm pose", " ".join(f"{value:.1f}" for value in typed), "deg")
        values = [
            f"{x:.3f} m" if u == "m" else f"{x:.1f} deg" for x, u in zip(typed, units, strict=True)
        ]
        return ("arm pose", ", ".join(values), "")

    def to_dict(self) -> dict[str, object]:
        """Every figure under its name and unit, for machines."""
        return {
            "vehicle": self.vehicle,
            "rotors": self.n_rotors,
            "mass_kg": self.mass,
            "arm": self.joints.to_typed(self.arm).tolist(),
            "arm_units": list(self.joints.units),
            "rank": self.rank,
            "singular_values": self.singular_values.tolist(),
            "condition_number": self.condition_number,
            "controllable_axes": list(self.axes),
            "limits": list(self.limits),
            "thrust_to_weight": self.thrust_to_weight,
            "total_thrust_to_weight": self.total_thrust_to_weight,
            "can_hover": self.can_hover,
            "hover_wrench_A": self.hover_wrench.tolist(),
            "hover_speeds_rad_s": self.hover_speeds.tolist(),
            "hover_shares": self.hover_shares.tolist(),
            "worst_hover_tilt_deg": float(np.rad2deg(self.worst_hover_tilt)),
            "best_hover_tilt_deg": float(np.rad2deg(self.best_hover_tilt)),
        }


def gravity_wrench(vehicle: Vehicle, theta: ArrayLike | None = None) -> tuple[Array, Array]:
    """Rotor wrench that holds the vehicle level and at rest, and its centre of mass.

    Args:
        vehicle: The vehicle.
        theta: Arm pose, shape (n_arm,) [rad or m]; at rest by default.

    Returns:
        wrench_A about the origin of {A}, shape (6,) [N, N m], and the centre of mass of the whole
        vehicle in {A}, shape (3,) [m].
    """
    q, data = vehicle.neutral(theta), vehicle.create_data()
    wrench = np.array(pin.computeGeneralizedGravity(vehicle.model, data, q)[:6])
    return wrench, np.array(pin.centerOfMass(vehicle.model, data, q))


def largest_multiple(rotors: Rotors, wrench_A: Array, axes: ArrayLike | None = None) -> float:
    """Largest t with t wrench_A within reach: max t s.t. B u = t w, 0 <= u <= 1 (a linear program).

    Args:
        rotors: The rotors.
        wrench_A: Direction w, shape (6,), not zero.
        axes: Mask of the axes that must match; all by default.
    """
    mask = np.ones(6, dtype=bool) if axes is None else np.asarray(axes, dtype=bool)
    scale = full_scale(rotors)
    system = np.column_stack([rotors.normalized_coupling, -wrench_A]) / scale[:, None]
    cost = np.zeros(rotors.count + 1)
    cost[-1] = -1.0
    bounds = [(0.0, 1.0)] * rotors.count + [(0.0, None)]
    found = linprog(cost, A_eq=system[mask], b_eq=np.zeros(int(mask.sum())), bounds=bounds)
    if found.status != 0:  # u = 0, t = 0 is feasible, and t is bounded if w is not zero
        raise FullamError(f"largest multiple of wrench {wrench_A.tolist()}: {found.message}")
    return float(found.x[-1])


class Support:
    """Whether the rotors can hold a weight whose up vector points anywhere in {A}.

    Holding it takes the force m g up_A through the centre of mass: wrench_A = [f, c x f].
    """

    def __init__(self, rotors: Rotors, weight: float, center_of_mass: Array) -> None:
        """Prepare for one vehicle and arm pose; weight m g [N], centre of mass in {A} [m]."""
        scale = full_scale(rotors)
        self._box = BoxLeastSquares(
            rotors.normalized_coupling,
            1.0 / scale,
            eps=1e-10,
            prior=np.zeros(rotors.count),
            upper=(rotors.max_speeds > 0).astype(float),
        )
        self._map = weight * np.vstack([np.eye(3), pin.skew(center_of_mass)])
        self._tolerance = SUPPORT_TOLERANCE * weight / float(scale[0])

    def holds(self, up_A: Array) -> bool:
        """Whether the vehicle can hover with this unit vector of {A} pointing up."""
        wrench = self._map @ up_A
        self._box.solve(wrench)
        self._box.kkt_residual(self._box.solution, wrench)
        return float(np.linalg.norm(self._box.weighted_residual)) <= self._tolerance

    def largest_tilt(self, azimuth: float) -> float:
        """Largest tilt [rad] up to which every tilt towards an azimuth of {A} [rad] is held.

        0 if it cannot hover level, pi if it hovers in any attitude on the way.
        """

        def holds_at(tilt: float) -> bool:
            lateral = np.sin(tilt)
            up = np.array([lateral * np.cos(azimuth), lateral * np.sin(azimuth), np.cos(tilt)])
            return self.holds(up)

        if not holds_at(0.0):
            return 0.0
        low = 0.0
        for high in np.deg2rad(np.arange(TILT_STEP, 180.0 + TILT_STEP, TILT_STEP)):
            if not holds_at(float(high)):
                break
            low = float(high)
        else:
            return float(np.pi)
        top = low + float(np.deg2rad(TILT_STEP))
        while top - low > np.deg2rad(TILT_RESOLUTION):
            middle = 0.5 * (low + top)
            low, top = (middle, top) if holds_at(middle) else (low, middle)
        return low


def assess(vehicle: Vehicle, theta: ArrayLike | None = None) -> Capability:
    """Work out what a vehicle can do with its arm at rest in one pose.

    Args:
        vehicle: The vehicle.
        theta: Arm pose, shape (n_arm,) [rad or m]; at rest by default.

    Raises:
        VehicleError: If `theta` has not one entry per arm joint, or without gravity.
    """
    if vehicle.gravity <= 0.0:
        raise VehicleError(
            f"vehicle '{vehicle.name}'",
            "gravity",
            f"is {vehicle.gravity:g}",
            "hovering needs a weight; give a positive one",
        )
    rotors = vehicle.rotors
    wrench, center = gravity_wrench(vehicle, theta)
    weight = vehicle.mass * vehicle.gravity
    scaled = rotors.normalized_coupling / full_scale(rotors)[:, None]
    values = np.zeros(6)
    found = np.linalg.svd(scaled, compute_uv=False)
    values[: found.size] = found
    solid = values[values > RANK_TOLERANCE * values[0]]
    axes = controllable_axes(rotors)
    support = Support(rotors, weight, center)
    azimuths = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
    tilts = np.array([support.largest_tilt(float(azimuth)) for azimuth in azimuths])
    can_hover = support.holds(np.array([0.0, 0.0, 1.0]))
    speeds = np.zeros(rotors.count)
    if any(axes):
        speeds = Allocator(rotors, axes=axes, vehicle_name=vehicle.name).solve(wrench).speeds
    ratio = largest_multiple(rotors, wrench, axes) if axes[2] else 0.0
    return Capability(
        vehicle=vehicle.name,
        n_rotors=rotors.count,
        mass=vehicle.mass,
        arm=_frozen(vehicle.neutral(theta)[7:]),
        joints=vehicle.joints,
        singular_values=_frozen(values),
        rank=int(solid.size),
        condition_number=float(solid[0] / solid[-1]) if solid.size else float("inf"),
        axes=axes,
        limits=_limits(axes, can_hover, ratio),
        thrust_to_weight=ratio,
        total_thrust_to_weight=float(rotors.max_thrusts.sum()) / weight,
        hover_wrench=_frozen(wrench),
        can_hover=can_hover,
        hover_speeds=_frozen(speeds),
        hover_shares=_frozen(speeds / np.where(rotors.max_speeds > 0, rotors.max_speeds, 1.0)),
        tilt_directions=_frozen(azimuths),
        hover_tilts=_frozen(tilts),
    )


def _frozen(values: ArrayLike) -> Array:
    owned = np.array(values, dtype=float)
    owned.setflags(write=False)
    return owned


def _limits(axes: tuple[bool, ...], can_hover: bool, ratio: float) -> tuple[str, ...]:
    limits = []
    missing = [name for name, good in zip(AXES, axes, strict=True) if not good]
    if not can_hover:
        why = f"it lifts {ratio:.2f} of its weight" if ratio < 1.0 else "its moments do not balance"
        limits.append(f"cannot hover level: {why}")
    if "force x" in missing and "force y" in missing:
        limits.append("no lateral force: it must tilt to move sideways")
        missing = missing[2:]
    limits += [f"no {name} independent of the other axes" for name in missing]
    return tuple(limits)
