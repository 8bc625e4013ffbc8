"""Vehicles from parameters: a ring of tilted rotors, a Craig chain, masses -> URDF -> `Vehicle`.

The parameters are the [design] table of a vehicle's TOML. The committed URDFs are written from
them by `write_designs`, and a variant (six rotors, 30 deg) is one call of `design_vehicle`.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker
from fullam.exceptions import VehicleError
from fullam.files import atomic_path
from fullam.model import definition as read
from fullam.model.craig import craig_transform, homogeneous
from fullam.model.design_checks import checked_parameter
from fullam.model.design_urdf import urdf_text
from fullam.model.loading import read_definition, vehicle_path
from fullam.model.physics import inertia_problem
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

DESIGNS = ("fullam", "quadrotor_arm")
"""The vehicles whose URDF this module writes."""


@dataclass(frozen=True, eq=False)
class Rod:
    """An arm link as a solid cylinder.

    Attributes:
        start: One end, in the link's frame {M_i}, shape (3,) [m].
        end: The other end, shape (3,) [m].
        mass: Mass [kg].
        radius: Radius [m].
    """

    start: Array
    end: Array
    mass: float
    radius: float

    @property
    def com(self) -> Array:
        """Centre of mass: mid-length, shape (3,) [m]."""
        return 0.5 * (self.start + self.end)

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def inertia(self) -> Array:
        """Inertia about the centre of mass, in {M_i} axes, shape (3, 3) [kg m^2].

        I = m (3 r^2 + L^2) / 12 (1 - u u^T) + m r^2 / 2 u u^T, with u along the rod.
        """
        along = (self.end - self.start) / self.length
        across = self.mass * (3.0 * self.radius**2 + self.length**2) / 12.0
        axial = 0.5 * self.mass * self.radius**2
        return across * np.eye(3) + (axial - across) * np.outer(along, along)


@dataclass(frozen=True, eq=False)
class VehicleDesign:
    """Parameters of a vehicle: the [design] table of its TOML, in the same units.

    Attributes:
        platform_mass: Platform with rotors, booms, battery and electronics [kg].
        platform_inertia: Principal moments about {A}'s axes [kg m^2].
        rotor_count: Even number of rotors, equally spaced on a ring.
        ring_radius: From the centre to the hubs [m].
        ring_phase: Azimuth of rotor 1 as a share of the spacing: 0.5 puts x between two rotors.
        rotor_height: Of the hubs above {A} [m].
        cant_deg: Angle between thrust axis and z, tangential, alternating (beta in the paper).
        propeller_radius: Of the discs drawn [m].
        mount_position: Of {M_0} in {A} [m].
        mount_yaw_deg: ^A R_0 = Rz(yaw) Rx(roll).
        mount_roll_deg: See `mount_yaw_deg`.
        craig: Table 1, one row (alpha_{i-1} [deg], a_{i-1} [m], d_i [m]) per joint, and a last
            one for the fixed tool frame.
        tool_length: The last, fixed link: it ends at the tool frame and reaches back so far [m].
        link_masses: One per joint, then the tool's [kg].
        link_radius: Radius of the links [m].
        joint_range_deg: Joints turn from minus to plus this.
        joint_effort: Largest joint torque [N m].
        joint_speed_rpm: Largest joint speed [rpm].
        rotor_rows: Rotors that do not stand evenly on a ring, one row (azimuth_deg, radius,
            height, cant_deg, lean_deg) each; empty for the ring. The thrust axis is turned by the
            cant about the boom, towards the tangent, then by the lean, outward. The table of a
            vehicle on a ring leaves it out.
        where: What an error message names as the source.
    """

    platform_mass: float
    platform_inertia: tuple[float, float, float]
    rotor_count: int
    ring_radius: float
    ring_phase: float
    rotor_height: float
    cant_deg: float
    propeller_radius: float
    mount_position: tuple[float, float, float]
    mount_yaw_deg: float
    mount_roll_deg: float
    craig: tuple[tuple[float, float, float], ...]
    tool_length: float
    link_masses: tuple[float, ...]
    link_radius: float
    joint_range_deg: float
    joint_effort: float
    joint_speed_rpm: float
    rotor_rows: tuple[tuple[float, ...], ...] = ()
    where: str = "design"

    @classmethod
    def from_table(cls, table: Mapping[str, Any], where: str = "design") -> VehicleDesign:
        """Read a [design] table.

        Raises:
            VehicleError: If a parameter is missing, unknown or out of range.
        """
        known = cls.parameters()
        table = Checker(where, VehicleError).table("design", table)
        read.check_keys(table, known, where, "design")
        table = {"rotor_rows": (), **table}
        missing = [key for key in known if key not in table]
        if missing:
            raise VehicleError(where, f"design.{missing[0]}", "is missing", "state it")
        return cls(**table, where=where)

    @classmethod
    def parameters(cls) -> tuple[str, ...]:
        """Names of the parameters, as in the [design] table."""
        return tuple(field.name for field in fields(cls) if field.name != "where")

    def __post_init__(self) -> None:
        """Refuse parameters that no vehicle has; lists become tuples.

        Raises:
            VehicleError: Naming the parameter and what would be right.
        """
        check = Checker(self.where, VehicleError)
        for key in self.parameters():
            object.__setattr__(self, key, checked_parameter(check, key, getattr(self, key)))
        if self.rotor_count % 2:
            self._refuse("rotor_count", f"is {self.rotor_count}", "give an even number")
        if not 0.0 <= self.cant_deg < 90.0:
            self._refuse("cant_deg", f"is {self.cant_deg:g}", "give an angle from 0 to below 90")
        if self.rotor_rows and len(self.rotor_rows) != self.rotor_count:
            self._refuse(
                "rotor_rows", f"are {len(self.rotor_rows)}", f"give {self.rotor_count}, one a rotor"
            )
        problem = inertia_problem(np.diag(self.platform_inertia))
        if problem is not None:
            self._refuse("platform_inertia", problem, "give moments that a body can have")
        if len(self.link_masses) != len(self.craig) or min(self.link_masses) <= 0.0:
            self._refuse(
                "link_masses",
                f"is {list(self.link_masses)}",
                f"give {len(self.craig)} positive masses, one per row of craig",
            )
        if any(rod.length <= 0.0 for rod in self.rods()):
            self._refuse("craig", "has a link without length", "give every link a length")

    def _refuse(self, key: str, problem: str, remedy: str) -> None:
        raise VehicleError(self.where, f"design.{key}", problem, remedy)

    @property
    def mass(self) -> float:
        """Mass of the whole vehicle [kg]."""
        return self.platform_mass + sum(self.link_masses)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the arm's joints, base to tip."""
        return tuple(f"joint_{i}" for i in range(1, len(self.craig)))

    def rotor_names(self) -> tuple[str, ...]:
        """Names of the rotors' frames."""
        return tuple(f"rotor_{i}" for i in range(1, self.rotor_count + 1))

    def azimuths(self) -> Array:
        """Azimuth of each rotor, shape (n,) [rad]."""
        return (np.arange(self.rotor_count) + self.ring_phase) * 2.0 * np.pi / self.rotor_count

    def spins(self) -> Array:
        """Spin directions of eq. (30), shape (n,): alternating, as the cant does.

        The tilted thrust and the drag torque of a rotor then turn the vehicle the same way, which
        gives the larger yaw moment of the two possible choices.
        """
        return np.where(np.arange(self.rotor_count) % 2 == 0, 1.0, -1.0)

    def rotor_placement(self, index: int) -> Array:
        """Pose of a rotor's frame in {A}, shape (4, 4): x outward along the boom, z = thrust.

        R = Rz(azimuth) Rx(-spin cant), so the thrust leans towards the tangent for spin +1; with
        `rotor_rows` R = Rz(azimuth) Ry(lean) Rx(-cant), whatever the spin.
        """
        if self.rotor_rows:
            degrees = np.deg2rad(self.rotor_rows[index])
            _, r, h, _, _ = self.rotor_rows[index]
            turn, cant, lean = degrees[0], degrees[3], degrees[4]
            return homogeneous(
                _rz(turn) @ _ry(lean) @ _rx(-cant), [r * np.cos(turn), r * np.sin(turn), h]
            )
        azimuth = self.azimuths()[index]
        r, h = self.ring_radius, self.rotor_height
        return homogeneous(
            _rz(azimuth) @ _rx(-self.spins()[index] * np.deg2rad(self.cant_deg)),
            [r * np.cos(azimuth), r * np.sin(azimuth), h],
        )

    def mount(self) -> Array:
        """^A T_0, the frame before joint 1 in {A}, shape (4, 4)."""
        yaw, roll = np.deg2rad(self.mount_yaw_deg), np.deg2rad(self.mount_roll_deg)
        return homogeneous(_rz(yaw) @ _rx(roll), self.mount_position)

    def joint_origin(self, row: int) -> Array:
        """Pose of {M_i} at theta_i = 0 in the frame before it, shape (4, 4).

        The first one is seen from {A}, through the mount.
        """
        alpha, a, d = self.craig[row]
        pose = craig_transform(np.deg2rad(alpha), a, d, 0.0)
        return self.mount() @ pose if row == 0 else pose

    def rods(self) -> tuple[Rod, ...]:
        """The links, base to tip: from each joint to the next; the tool's ends at its frame."""
        steps = [self.joint_origin(row)[:3, 3] for row in range(1, len(self.craig))]
        last = steps[-1]
        direction = last / max(float(np.linalg.norm(last)), np.finfo(float).tiny)
        ends = [*steps[:-1], last - self.tool_length * direction]
        back = self.joint_origin(len(self.craig) - 1)[:3, :3].T @ direction
        starts = [np.zeros(3) for _ in ends]
        starts.append(-self.tool_length * back)
        ends.append(np.zeros(3))
        return tuple(
            Rod(start, end, mass, self.link_radius)
            for start, end, mass in zip(starts, ends, self.link_masses, strict=True)
        )

    def to_table(self) -> dict[str, Any]:
        """The [design] table: plain numbers and lists."""
        table = asdict(self)
        del table["where"]
        if not self.rotor_rows:
            del table["rotor_rows"]
        return {
            key: [list(row) if isinstance(row, tuple) else row for row in value]
            if isinstance(value, tuple)
            else value
            for key, value in table.items()
        }

    def rotor_tables(self) -> list[dict[str, Any]]:
        """The [[rotor]] tables: a frame of the URDF and a spin each."""
        return [
            {"frame": name, "spin": int(spin)}
            for name, spin in zip(self.rotor_names(), self.spins(), strict=True)
        ]

    def urdf(self, name: str) -> str:
        """Text of the URDF, the same for the same parameters (see `design_urdf`)."""
        return urdf_text(self, name)


def _rx(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _ry(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _rz(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


Optimiser = Callable[[Vehicle], Mapping[str, Any]]
"""Answers a vehicle with changes of its design; `fullam.analysis.design_search` has one."""


def design_vehicle(
    base: str | Path = "fullam",
    name: str | None = None,
    optimise: Optimiser | None = None,
    **changes: Any,
) -> Vehicle:
    """A variant of one of our designs, by one call: `design_vehicle(rotor_count=6, cant_deg=30)`.

    Args:
        base: Name or path of a vehicle whose TOML has a [design] table.
        name: Of the variant; by default the base's name and the changes.
        optimise: Given the variant, answers with further changes; they are applied on top.
        **changes: Parameters of `VehicleDesign`, or of [rotor_defaults] (k_f, k_tau, max_speed,
            lag, min_speed), to replace.

    Raises:
        VehicleError: If a parameter is unknown or cannot be built.
    """
    if optimise is not None:
        better = optimise(design_vehicle(base, name, **changes))
        return design_vehicle(base, name or f"{base}, optimised", **{**changes, **better})
    path = vehicle_path(base)
    if name is not None:
        Checker("design_vehicle", VehicleError).text("name", name)
    definition = copy.deepcopy(read_definition(path))
    where = str(path)
    if "design" not in definition:
        raise VehicleError(
            where, "design", "is missing", f"only designs have variants: {', '.join(DESIGNS)}"
        )
    numbers = (*read.ROTOR_NUMBERS, *read.ROTOR_OPTIONS)
    known = (*VehicleDesign.parameters(), *numbers)
    read.check_keys(changes, known, f"design_vehicle({str(base)!r})", "")
    for key, value in changes.items():
        table = "rotor_defaults" if key in numbers else "design"
        definition.setdefault(table, {})[key] = value
    design = VehicleDesign.from_table(definition["design"], where)
    if changes:
        listed = ", ".join(f"{key}={value}" for key, value in changes.items())
        definition["name"] = name or f"{definition['name']} with {listed}"
    elif name:
        definition["name"] = name
    definition["design"] = design.to_table()
    definition["mass"] = design.mass
    definition["arm"] = list(design.joint_names)
    definition["rotor"] = design.rotor_tables()
    return Vehicle.from_definition(definition, design.urdf(definition["name"]))


def write_designs(folder: str | Path | None = None) -> list[Path]:
    """Write the URDF of each of `DESIGNS` from its TOML; the TOMLs, written by hand, stay.

    Args:
        folder: Where to write; by default beside the TOML.

    Returns:
        The files written.
    """
    written = []
    for name in DESIGNS:
        path = vehicle_path(name)
        definition = read_definition(path)
        design = VehicleDesign.from_table(definition["design"], str(path))
        target = Path(folder or path.parent) / f"{name}.urdf"
        with atomic_path(target) as temporary:
            temporary.write_text(design.urdf(name), encoding="utf-8")
        written.append(target)
    return written
