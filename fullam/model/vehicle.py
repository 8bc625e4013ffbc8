"""A vehicle: a platform with rotors and an arm, as a Pinocchio model and a table of rotors."""

from __future__ import annotations

import copy
import hashlib
import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from fullam.checks import positive, shown
from fullam.exceptions import VehicleError
from fullam.model import definition as read
from fullam.model.articulation import articulate, build_model
from fullam.model.bodies import replace_bodies
from fullam.model.definition_keys import GRAVITY, VEHICLE, names_of
from fullam.model.joints import ArmJoints
from fullam.model.physics import (
    body_inertia,
    check_bodies,
    check_joints,
    check_total_mass,
    inertia_problem,
    link_inertias,
    parse_urdf,
)
from fullam.model.rotors import COLUMNS, Rotors
from fullam.model.servos import Servos
from fullam.model.wrench_axes import rank_on, require_rank

Array = NDArray[np.float64]

MOST_GRAVITY = 300.0
"""Gravity at the sun's surface is 274 m/s^2."""


@dataclass(frozen=True, eq=False)
class Vehicle:
    """What the vehicle is: constant data that every other room reads.

    The configuration is q = [p, quaternion xyzw, theta] and the velocity v = [v_A, w_A, dtheta],
    both of the platform in body axes, as Pinocchio's free flyer has them; {A} is the frame of the
    platform's link.

    Attributes:
        name: Short name.
        description: One sentence.
        urdf: The URDF's text, joints that are not the arm's fixed where they are held.
        platform: Link that carries the rotors; its frame is {A}.
        arm_joints: Names of the arm's joints, base to tip.
        tool: Frame at the tip of the arm.
        model: Pinocchio model: free flyer, then the arm. Links behind fixed joints are merged.
        rotors: The rotors, in {A}.
        definition: The parsed TOML; with `urdf` it rebuilds the vehicle.
        source: File that the definition was read from, if any.
        remarks: What loading let pass and a user should know: joints that are held, impossible
            inertias that vanish in a body.
    """

    name: str
    description: str
    urdf: str
    platform: str
    arm_joints: tuple[str, ...]
    tool: str
    model: pin.Model
    rotors: Rotors
    definition: dict[str, Any]
    source: str | None = None
    remarks: tuple[str, ...] = ()

    @classmethod
    def from_definition(
        cls, definition: Mapping[str, Any], urdf_text: str, source: str | None = None
    ) -> Vehicle:
        """Build a vehicle from data alone; equal data give equal bits.

        Args:
            definition: The parsed TOML (its `urdf` entry is not opened).
            urdf_text: Text of the URDF.
            source: File that the definition came from; error messages name it.

        Raises:
            VehicleError: If the data are incomplete or describe no physical vehicle.
        """
        if not isinstance(definition, Mapping):
            raise VehicleError(
                source or "vehicle", "definition", f"is {shown(definition)}", "give a mapping"
            )
        where = source or f"vehicle {shown(definition.get('name', '?'))}"
        read.check_keys(definition, names_of(VEHICLE), where, "")
        name = read.text(definition, "name", where)
        platform = read.text(definition, "platform", where)
        tool = read.text(definition, "tool", where)
        urdf_place = f"{where} (its URDF)"
        given = parse_urdf(urdf_text, urdf_place)
        check_joints(given, urdf_place)
        _check_root(given, platform, where)
        arm = read.arm_joints(definition, where)
        held = read.subtable(definition, "held", where)
        articulation = articulate(urdf_text, arm, tool, held, where)
        robot = parse_urdf(articulation.urdf, urdf_place)
        try:
            model = build_model(articulation.urdf)
        except ValueError as error:
            raise VehicleError(
                urdf_place, "URDF", f"Pinocchio refuses it ({error})", "check joints and limits"
            ) from error
        gravity = read.number(
            definition.get("gravity", GRAVITY), where, "gravity", positive(MOST_GRAVITY, "m/s^2")
        )
        model.gravity.linear = np.array([0.0, 0.0, -gravity])
        model.name = name
        remarks = [articulation.remark] if articulation.held else []
        if read.choice(definition, "physics", ("check", "trust"), where) == "trust":
            link_inertias(robot, urdf_place)  # numbers they have to be
            remarks.append('masses and inertias are not checked: physics = "trust"')
        else:
            remarks += check_bodies(model, robot, urdf_place)
        replace_bodies(definition, model, where)
        read.frame_id(model, tool, where, "tool")
        if "mass" in definition:
            declared = read.number(definition["mass"], where, "mass")
            check_total_mass(declared, pin.computeTotalMass(model), where)
        Servos.of(definition.get("servo", {}), ArmJoints.from_model(model), where)
        return cls(
            name=name,
            description=read.text(definition, "description", where, ""),
            urdf=articulation.urdf,
            platform=platform,
            arm_joints=arm,
            tool=tool,
            model=model,
            rotors=read.read_rotors(definition, model, where),
            definition=copy.deepcopy(dict(definition)),
            source=source,
            remarks=tuple(remarks),
        )

    def to_data(self) -> dict[str, Any]:
        """JSON values that `from_data` rebuilds this very vehicle from, changes included.

        Beside definition and URDF, what may have been changed on the object since: the rotors'
        columns and the inertia of each body.
        """
        return {
            "definition": self.definition,
            "urdf": self.urdf,
            "rotors": {name: getattr(self.rotors, name).tolist() for name in COLUMNS},
            "bodies": [_body(inertia) for inertia in self.model.inertias[1:]],
        }

    def digest(self) -> str:
        """Sixteen hexadecimal digits of its data: the same name may be another one tomorrow."""
        text = json.dumps(self.to_data(), sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Vehicle:
        """The inverse of `to_data`; what the definition yields by itself is left as it is.

        Raises:
            VehicleError: The data are no vehicle's.
        """
        try:
            return cls._from_data(data)
        except (TypeError, ValueError, LookupError, AttributeError, OverflowError) as error:
            raise VehicleError(
                "vehicle", "data", f"{type(error).__name__}: {error}", "give what to_data gave"
            ) from error

    @classmethod
    def _from_data(cls, data: Mapping[str, Any]) -> Vehicle:
        vehicle = cls.from_definition(data["definition"], data["urdf"])
        columns: dict[str, Any] = {
            name: np.array(values)
            for name, values in data["rotors"].items()
            if not np.array_equal(values, getattr(vehicle.rotors, name))
        }
        if columns:
            vehicle = replace(vehicle, rotors=replace(vehicle.rotors, **columns))
        bodies = list(data["bodies"])
        if len(bodies) != vehicle.model.njoints - 1:
            raise ValueError(f"there are {len(bodies)} bodies")
        for i, body in enumerate(bodies, start=1):
            if body != _body(vehicle.model.inertias[i]):
                vehicle.model.inertias[i] = _inertia(body, vehicle.definition.get("physics"))
        return vehicle

    @property
    def mass(self) -> float:
        """Mass of the whole vehicle [kg]."""
        return float(sum(body.mass for body in self.model.inertias))

    @property
    def n_arm(self) -> int:
        """Number of arm joints."""
        return len(self.arm_joints)

    @property
    def joints(self) -> ArmJoints:
        """Kind, units and limits of the arm's joints."""
        return ArmJoints.from_model(self.model)

    @property
    def servos(self) -> Servos:
        """The arm's servos, as the definition's `[servo]` states them; AX-12As by default."""
        return Servos.of(self.definition.get("servo", {}), self.joints, f"vehicle '{self.name}'")

    @property
    def gravity(self) -> float:
        """Gravity [m/s^2], pointing along -z of {W}."""
        return float(-self.model.gravity.linear[2])

    @property
    def platform_mass(self) -> float:
        """m_A: mass of the platform with all links fixed to it [kg]."""
        return float(self.model.inertias[1].mass)

    @property
    def platform_com(self) -> Array:
        """Centre of mass of the platform in {A}, shape (3,) [m]; the paper has it at the origin."""
        return np.array(self.model.inertias[1].lever)

    @property
    def platform_inertia(self) -> Array:
        """I_A: inertia of the platform about its centre of mass, in {A} axes, (3, 3) [kg m^2]."""
        return np.array(self.model.inertias[1].inertia)

    def neutral(self, theta: ArrayLike | None = None) -> Array:
        """A configuration q at the origin of {W}, level, with the arm at `theta`.

        Args:
            theta: Joint positions [rad or m]; 0 by default, or the limit nearest to it.

        Raises:
            VehicleError: If `theta` has not one entry per arm joint.
        """
        q = pin.neutral(self.model)
        q[7:] = np.clip(0.0, self.model.lowerPositionLimit[7:], self.model.upperPositionLimit[7:])
        if theta is not None:
            try:
                angles = np.asarray(theta, dtype=float)
            except (TypeError, ValueError, OverflowError) as error:
                raise VehicleError(
                    f"vehicle '{self.name}'",
                    "theta",
                    f"is {shown(theta)}",
                    f"give {self.n_arm} joint angles",
                ) from error
            if angles.shape != (self.n_arm,):
                raise VehicleError(
                    f"vehicle '{self.name}'",
                    "theta",
                    f"has shape {angles.shape}",
                    f"give {self.n_arm} joint angles",
                )
            q[7:] = angles
        return q

    def create_data(self) -> pin.Data:
        """A fresh Pinocchio workspace; each owner has its own."""
        return self.model.createData()

    def actuation_rank(self, axes: ArrayLike | None = None) -> int:
        """Rank of the coupling matrix (34) on some wrench axes.

        Args:
            axes: Mask or indices of the six axes, force then moment; all by default.
        """
        return rank_on(self.rotors, axes)

    def require_full_actuation(self, axes: ArrayLike | None = None) -> None:
        """Refuse to control axes that the rotors cannot produce independently.

        Args:
            axes: Mask or indices of the six axes, force then moment; all by default.

        Raises:
            NotFullyActuated: If the rank of (34) on them is below their number.
        """
        require_rank(self.rotors, axes, self.name)

    def with_failed(self, *rotors: int | str) -> Vehicle:
        """The same vehicle with some rotors stopped, which whoever flies it knows.

        Args:
            *rotors: Their names, or numbers as texts, from "1"; or indices from 0.

        Raises:
            VehicleError: It has no such rotor.
        """
        names, n = self.rotors.names, self.rotors.count
        known: dict[Any, int] = {str(i + 1): i for i in range(n)} | dict(enumerate(range(n)))
        known |= {name: i for i, name in enumerate(names)}
        for rotor in rotors:
            if not isinstance(rotor, int | str) or isinstance(rotor, bool) or rotor not in known:
                raise VehicleError(
                    f"vehicle '{self.name}'",
                    "failed rotor",
                    f"is {shown(rotor)}",
                    f"give one of {', '.join(names)}, or a number from 1 to {n}",
                )
        return replace(self, rotors=self.rotors.with_failed(*(known[r] for r in rotors)))

    def __repr__(self) -> str:
        """Name, sizes and mass."""
        return (
            f"Vehicle({self.name!r}, {self.rotors.count} rotors, {self.n_arm} arm joints, "
            f"{self.mass:.3f} kg)"
        )

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore from a pickle or copy, which forget that the arrays are read-only."""
        self.__dict__.update(state)
        for value in vars(self.rotors).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)


def _check_root(robot: ElementTree.Element, platform: str, where: str) -> None:
    children = {child.get("link") for child in robot.iterfind("joint/child")}
    if robot.find("link") is None:
        raise VehicleError(
            where, "URDF", "has no links", "is it a xacro file, or an empty product of one?"
        )
    roots = [link.get("name") for link in robot.findall("link") if link.get("name") not in children]
    floating = [j.get("name") for j in robot.findall("joint") if j.get("type") == "floating"]
    if floating:
        raise VehicleError(
            where,
            f"joint '{floating[0]}'",
            "is a floating joint in the URDF",
            "root the URDF at the platform's link; the free flyer is added on loading",
        )
    if roots != [platform]:
        raise VehicleError(
            where, "platform", f"'{platform}' is not the root link", f"the URDF's root is {roots}"
        )


def _inertia(body: Mapping[str, Any], physics: str | None) -> pin.Inertia:
    """The inverse of `_body`.

    Raises:
        ValueError: No body has such mass properties; with physics = "trust", they are no numbers.
    """
    mass, lever, inertia = (np.array(body[name], float) for name in ("mass", "lever", "inertia"))
    if mass.shape or lever.shape != (3,) or inertia.shape != (3, 3):
        raise ValueError("a body has a mass, three coordinates and a 3 x 3 inertia")
    if not all(np.isfinite(numbers).all() for numbers in (mass, lever, inertia)):
        raise ValueError("a body cannot exist: its mass, centre or inertia is not finite")
    if not np.allclose(inertia, inertia.T, rtol=1e-9, atol=0.0):  # rounding, and no more
        raise ValueError("a body cannot exist: its inertia is not symmetric")
    problem = "a negative mass" if mass < 0.0 else inertia_problem(inertia, float(mass))
    if problem is not None and physics != "trust":
        raise ValueError(f"a body cannot exist: {problem}")
    return body_inertia(float(mass), lever, 0.5 * (inertia + inertia.T))


def _body(inertia: pin.Inertia) -> dict[str, Any]:
    """Mass [kg], centre of mass [m] and inertia about it [kg m^2] of a body, as JSON values."""
    return {
        "mass": inertia.mass,
        "lever": inertia.lever.tolist(),
        "inertia": inertia.inertia.tolist(),
    }
