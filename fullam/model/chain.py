"""The platform and its serial arm as plain arrays, read from a Pinocchio model.

These are the constants of the paper's equations (6)-(13): they are read from the model, so any
serial arm of revolute and prismatic joints that a URDF gives is covered, and its joint axes need
not be z.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.checks import Checker, shown
from fullam.exceptions import UnknownName, VehicleError
from fullam.model.articulation import build_model
from fullam.model.physics import parse_urdf

if TYPE_CHECKING:
    from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

ROOT = 1
"""Index of the free-flyer joint, and so of link 0, in a Pinocchio model."""


@dataclass(frozen=True, eq=False)
class LinkChain:
    """Constants of link 0 (the platform) and links 1..n, as read-only arrays.

    Every array may carry leading axes, one entry per sample, so that a batch of states can have
    a batch of parameters; see `stack`. Link frames {M_i} are the joint frames after the motion of
    the joint: theta_i turns a revolute joint about its axis [rad] and moves a prismatic one along
    it [m].

    Attributes:
        mass: Masses m_i, shape (..., n+1) [kg].
        com: Centres of mass ^iP_i^c in the link's frame, shape (..., n+1, 3) [m].
        inertia: Inertias about the centre of mass in link axes, (..., n+1, 3, 3) [kg m^2].
        placement_R: Rotation {M_{i-1}} to {M_i} at theta_i = 0, shape (..., n, 3, 3).
        placement_P: ^{i-1}P_i at theta_i = 0, shape (..., n, 3) [m].
        axis: Joint axis in {M_i}, unit, shape (..., n, 3); Craig's is z.
        tool_P: Tool point in the frame of the link that carries it, ^nP_{n+1} in {M_n} for the
            paper, shape (..., 3) [m].
        gravity: Acceleration of gravity in {W}, shape (..., 3) [m/s^2].
        prismatic: Which joints move along their axis, shape (..., n), bool; one value holds for
            all joints, and none is prismatic unless said.
        tool_link: Number of the link that carries the tool, 0 for the platform; the last unless
            said (-1 stands for it).
    """

    mass: Array
    com: Array
    inertia: Array
    placement_R: Array
    placement_P: Array
    axis: Array
    tool_P: Array
    gravity: Array
    prismatic: NDArray[np.bool_] = field(default_factory=lambda: np.array(False))
    tool_link: int = -1

    def __post_init__(self) -> None:
        """Own the arrays and freeze them."""
        kinds = np.broadcast_to(np.asarray(self.prismatic, dtype=bool), np.shape(self.axis)[:-1])
        object.__setattr__(self, "prismatic", kinds)
        if self.tool_link < 0:
            object.__setattr__(self, "tool_link", self.n)
        for entry in fields(self):
            if entry.name == "tool_link":
                continue
            dtype = bool if entry.name == "prismatic" else float
            value = np.array(getattr(self, entry.name), dtype=dtype)
            value.setflags(write=False)
            object.__setattr__(self, entry.name, value)

    @property
    def n(self) -> int:
        """Number of joints, and of links beside the platform."""
        return self.mass.shape[-1] - 1

    @classmethod
    def from_model(cls, model: pin.Model, tool: str | None = None) -> LinkChain:
        """Read the chain from a model with a free flyer and a serial arm.

        Args:
            model: The Pinocchio model.
            tool: Frame of the tool point; the origin of the last joint when absent.

        Raises:
            VehicleError: The model is not such a chain; the message names the joint.
            UnknownName: There is no such tool frame.
        """
        check = Checker("chain", VehicleError)
        check.instance("model", model, pin.Model)
        if tool is not None:
            check.text("tool", tool)
        joints = range(ROOT + 1, model.njoints)
        if model.njoints <= ROOT or model.joints[ROOT].shortname() != "JointModelFreeFlyer":
            raise VehicleError(
                model.name, "root joint", "is no free flyer", "load it with a free-flyer root"
            )
        subspaces = [_motion_subspace(model, j) for j in joints]
        links = [model.inertias[j] for j in range(ROOT, model.njoints)]
        placements = [model.jointPlacements[j] for j in joints]
        tool_P, tool_link = np.zeros(3), -1
        if tool is not None:
            if not model.existFrame(tool):
                raise UnknownName("frame", tool, [frame.name for frame in model.frames])
            frame = model.frames[model.getFrameId(tool)]
            tool_P, tool_link = frame.placement.translation, frame.parentJoint - ROOT
        return cls(
            mass=np.array([link.mass for link in links]),
            com=np.array([link.lever for link in links]),
            inertia=np.array([link.inertia for link in links]),
            placement_R=np.array([M.rotation for M in placements]).reshape(-1, 3, 3),
            placement_P=np.array([M.translation for M in placements]).reshape(-1, 3),
            axis=np.array([axis for axis, _ in subspaces]).reshape(-1, 3),
            tool_P=tool_P,
            gravity=model.gravity.linear,
            prismatic=np.array([prismatic for _, prismatic in subspaces], dtype=bool),
            tool_link=tool_link,
        )

    @classmethod
    def from_vehicle(cls, vehicle: Vehicle, released: str | None = None) -> LinkChain:
        """Read the chain of a vehicle, with the vehicle's tool.

        Args:
            vehicle: The vehicle.
            released: A fixed joint whose link is to be a body of its own; see `released_model`.

        Raises:
            VehicleError: As in `from_model`.
            UnknownName: As in `release_joint`.
        """
        model = _model(vehicle) if released is None else released_model(vehicle, released)
        return cls.from_model(model, vehicle.tool)

    @classmethod
    def stack(cls, chains: Sequence[LinkChain]) -> LinkChain:
        """One chain whose arrays have a leading axis over the given ones (of equal n and tool).

        Raises:
            VehicleError: They are no chains, there is none, or they differ in n.
        """
        check = Checker("chain", VehicleError)
        if not isinstance(chains, list | tuple) or not chains:
            raise check.refuse("chains", f"is {shown(chains)}", "give a list of chains")
        if len({check.instance("chains", chain, cls).mass.shape for chain in chains}) > 1:
            raise check.refuse("chains", "differ in their number of links", "give chains of one")
        arrays = {
            entry.name: np.stack([getattr(chain, entry.name) for chain in chains])
            for entry in fields(cls)
            if entry.name != "tool_link"
        }
        return cls(**arrays, tool_link=chains[0].tool_link)


def _motion_subspace(model: pin.Model, joint: int) -> tuple[Array, bool]:
    """Unit axis of a joint and whether it is prismatic; VehicleError when it is of another kind."""
    name, kind = model.names[joint], model.joints[joint]
    if model.parents[joint] != joint - 1:
        raise VehicleError(
            model.name,
            f"joint '{name}'",
            f"hangs on '{model.names[model.parents[joint]]}', so the arm branches",
            "the equations hold for one serial arm",
        )
    data = kind.createData()
    if kind.nq == 1 and kind.nv == 1:
        kind.calc(data, np.zeros(1))
        along, about = np.split(np.asarray(data.S, dtype=float).reshape(6), 2)
        if not np.any(along):
            return about, False
        if not np.any(about):
            return along, True
    raise VehicleError(
        model.name,
        f"joint '{name}'",
        f"is a {kind.shortname()}",
        "the arm's joints must be revolute or prismatic, with one coordinate each",
    )


def release_joint(urdf: str, joint: str) -> str:
    """The same URDF with one fixed joint turned into a revolute one about its z.

    The paper counts the end effector as a fifth link behind a "joint" with theta_5 = 0, while a
    URDF reader merges it into link 4. Released, it is a body of its own again: held at zero, the
    vehicle moves as before, and f_5, tau_5 show.

    Args:
        urdf: URDF text.
        joint: Name of the fixed joint.

    Returns:
        URDF text.

    Raises:
        UnknownName: There is no fixed joint of that name.
        VehicleError: The text is no URDF.
    """
    robot = parse_urdf(urdf, "release_joint")
    Checker("release_joint", VehicleError).text("joint", joint)
    fixed = {e.get("name", ""): e for e in robot.findall("joint") if e.get("type") == "fixed"}
    if joint not in fixed:
        raise UnknownName("fixed joint", joint, fixed)
    element = fixed[joint]
    element.set("type", "revolute")
    for child in element.findall("axis") + element.findall("limit"):
        element.remove(child)
    ET.SubElement(element, "axis", xyz="0 0 1")
    ET.SubElement(element, "limit", lower="-1", upper="1", effort="1", velocity="1")
    return ET.tostring(robot, encoding="unicode")


def released_model(vehicle: Vehicle, joint: str) -> pin.Model:
    """The vehicle's model with one fixed joint released, see `release_joint`.

    Its arm has one joint more, at the place of the released one; with the fixed end link of the
    default vehicle ("tool_joint") that is the paper's n = 5.
    """
    held = _model(vehicle)
    model = build_model(release_joint(vehicle.urdf, joint))
    model.gravity.linear = held.gravity.linear
    model.name = held.name
    return model


def _model(vehicle: Vehicle) -> pin.Model:
    """The model of what has to be a vehicle."""
    model = getattr(vehicle, "model", None)
    if not isinstance(model, pin.Model):
        raise VehicleError("chain", "vehicle", f"is {shown(vehicle)}", "give a Vehicle")
    return model
