"""What a vehicle can do before anyone flies it: axes, lift, hover speeds, hover tilt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.atlas.failures import Atlas
from fullam.analysis.atlas.rays import multiples
from fullam.model.joints import ArmJoints
from fullam.model.vehicle import Vehicle
from fullam.model.wrench_axes import AXES, RANK_TOLERANCE, controllable_axes, full_scale

Array = NDArray[np.float64]

DIRECTIONS = 72
"""Azimuths of the tilt rose that the report carries; worst and best are exact without it."""

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
        hover_speeds: Rotor speeds for it, shape (n,) [rad/s]; NaN if they cannot.
        hover_shares: The same as shares of the largest speeds, shape (n,); 0 for failed rotors.
        hover_efficiency: Weight over the least sum of thrusts that hold it.
        tilt_directions: Azimuth of the body's up vector seen from {A}, shape (m,) [rad].
        hover_tilts: First exit from level per direction, shape (m,) [rad]; NaN without hover.
        worst_hover_tilt: The tilt that it can hold in every direction [rad], exactly; None if it
            cannot hover level.
        worst_azimuth: Where to it can lean no farther [rad].
        best_hover_tilt: The tilt that it can hold in the most favourable direction [rad].
        level_force: Horizontal force in any direction while level [N].
        push: Force of the tool in any direction while level [N].
        moment: Moment about any axis while level [N m].
        margin: Radius of the ball of wrenches about level hover [N], moments over
            `margin_length`.
        margin_length: What turns moments into forces there [m].
        payload: Mass at the tool with which hover ends [kg].
        failed_tilts: The worst tilt with rotor 1, 2, ... stopped; None where it cannot hover.
        failed_margins: Margin of its trim attitude with rotor 1, 2, ... stopped [N], not above 0
            where no attitude can be held; None where an axis is lacking.
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
    hover_efficiency: float
    tilt_directions: Array
    hover_tilts: Array
    worst_hover_tilt: float | None
    worst_azimuth: float | None
    best_hover_tilt: float | None
    level_force: float
    push: float
    moment: float
    margin: float
    margin_length: float
    payload: float
    failed_tilts: tuple[float | None, ...]
    failed_margins: tuple[float | None, ...]

    def rows(self) -> list[Row]:
        """The report, as (label, value, unit)."""
        values = " ".join(f"{value:.3f}" for value in self.singular_values)
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
        ]
        if self.can_hover:
            rows += self._hover_rows()
        return rows + [("note" if self.can_hover else "problem", text, "") for text in self.limits]

    def _hover_rows(self) -> list[Row]:
        worst, best = self.worst_hover_tilt or 0.0, self.best_hover_tilt or 0.0
        speeds, shares = self.hover_speeds, 100.0 * self.hover_shares
        rows: list[Row] = [
            ("hover rotor speeds", f"{speeds.min():.0f} to {speeds.max():.0f}", "rad/s"),
            ("share of the largest speeds", f"{shares.min():.0f} to {shares.max():.0f}", "%"),
            ("hover efficiency", f"{self.hover_efficiency:.3f}", "weight over thrusts"),
            ("hover tilt, every direction", f"{np.rad2deg(worst):.1f}", "deg"),
            ("hover tilt, best direction", f"{np.rad2deg(best):.1f}", "deg"),
            ("level force, every direction", f"{self.level_force:.1f}", "N"),
            ("tool push, every direction", f"{self.push:.1f}", "N"),
            ("moment, every axis", f"{self.moment:.2f}", "N m"),
            ("margin about hover", f"{self.margin:.2f}", f"N, or per {self.margin_length:.2f} m"),
            ("payload at which hover ends", f"{self.payload:.2f}", "kg"),
        ]
        if best - worst > np.deg2rad(0.1):
            azimuth = np.rad2deg(self.worst_azimuth or 0.0) % 360.0
            rows.insert(-5, ("  least towards azimuth", f"{azimuth:.0f}", "deg"))
        held = [tilt for tilt in self.failed_tilts if tilt is not None]
        rows.append(("hovers level, a rotor stopped", f"{len(held)} of {self.n_rotors}", ""))
        margins = [m for m in self.failed_margins if m is not None and m > 0.0]
        least = f"at least {min(margins):.2f} N to spare" if margins else ""
        rows.append(
            ("hovers trimmed, a rotor stopped", f"{len(margins)} of {self.n_rotors}", least)
        )
        return rows

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
            "hover_efficiency": self.hover_efficiency,
            "worst_hover_tilt_deg": _degrees(self.worst_hover_tilt),
            "worst_azimuth_deg": _degrees(self.worst_azimuth),
            "best_hover_tilt_deg": _degrees(self.best_hover_tilt),
            "level_force_N": self.level_force,
            "push_N": self.push,
            "moment_Nm": self.moment,
            "margin_N": self.margin,
            "margin_length_m": self.margin_length,
            "payload_kg": self.payload,
            "failed_tilts_deg": [_degrees(tilt) for tilt in self.failed_tilts],
            "failed_margins_N": list(self.failed_margins),
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


def assess(vehicle: Vehicle, theta: ArrayLike | None = None) -> Capability:
    """Work out what a vehicle can do with its arm at rest in one pose.

    Args:
        vehicle: The vehicle.
        theta: Arm pose, shape (n_arm,) [rad or m]; at rest by default.

    Raises:
        VehicleError: If `theta` has not one entry per arm joint, or without gravity.
    """
    rotors, atlas = vehicle.rotors, Atlas(vehicle)
    envelope = atlas.envelope(theta)
    wrench, _ = gravity_wrench(vehicle, theta)
    scaled = rotors.normalized_coupling / full_scale(rotors)[:, None]
    values = np.zeros(6)
    found = np.linalg.svd(scaled, compute_uv=False)
    values[: found.size] = found
    solid = values[values > RANK_TOLERANCE * values[0]]
    axes = controllable_axes(rotors)
    azimuths = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
    shares = np.full(rotors.count, np.nan)
    if envelope.hover_shares is not None:
        shares = np.sqrt(envelope.hover_shares)
    worst, best = envelope.worst_tilt, envelope.best_tilt
    failures = atlas.after_failures(theta)
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
        limits=_limits(axes, envelope),
        thrust_to_weight=envelope.thrust_to_weight,
        total_thrust_to_weight=float(rotors.max_thrusts.sum()) / envelope.load.weight,
        hover_wrench=_frozen(wrench),
        can_hover=envelope.can_hover,
        hover_speeds=_frozen(shares * rotors.max_speeds),
        hover_shares=_frozen(shares),
        hover_efficiency=envelope.hover_efficiency,
        tilt_directions=_frozen(azimuths),
        hover_tilts=_frozen(envelope.rose(azimuths)),
        worst_hover_tilt=None if worst is None else worst[0],
        worst_azimuth=None if worst is None else worst[1],
        best_hover_tilt=None if best is None else best[0],
        level_force=envelope.least_level_force,
        push=envelope.least_push,
        moment=envelope.least_moment,
        margin=envelope.margin.value,
        margin_length=envelope.length,
        payload=envelope.payload,
        failed_tilts=tuple(
            None if each.worst_tilt is None else each.worst_tilt[0] for each in failures
        ),
        failed_margins=tuple(each.trim_margin for each in failures),
    )


def _frozen(values: ArrayLike) -> Array:
    owned = np.array(values, dtype=float)
    owned.setflags(write=False)
    return owned


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else float(np.rad2deg(angle))


def _limits(axes: tuple[bool, ...], envelope: Envelope) -> tuple[str, ...]:
    limits = []
    missing = [name for name, good in zip(AXES, axes, strict=True) if not good]
    if not envelope.can_hover:
        lifts = multiples(envelope.facets, envelope.hover_wrench)
        why = "its forces and moments do not balance"
        if lifts is not None and lifts[0] > 1.0:
            why = f"at its least speeds it lifts {lifts[0]:.2f} of its weight"
        elif lifts is not None and lifts[1] > 0.0:
            why = f"it lifts {lifts[1]:.2f} of its weight"
        limits.append(f"cannot hover level: {why}")
    if "force x" in missing and "force y" in missing:
        limits.append("no lateral force: it must tilt to move sideways")
        missing = missing[2:]
    limits += [f"no {name} independent of the other axes" for name in missing]
    return tuple(limits)
