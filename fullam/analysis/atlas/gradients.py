"""How the figures of the atlas change with the vehicle: gradients by the envelope theorem.

A figure is the end of a path of wrenches at a facet. It answers a small change of the rotors and of
the load as if the facet's normal n and the rotors' shares u at the contact stayed what they are,

    d figure = rate (n . dB u - n . dw - n . dpath),

since they are optimal there: the derivative of a linear program. That is a gradient where u is
unique: one facet, spanned by no more generators than its dimension needs. Elsewhere (symmetric
vehicles are full of such places) the figure has a kink. Then there is no gradient, and the
derivative along a given change is what one has: over all u that make the contact's wrench,

    max over u of  min over the facets met there of  rate (n . dB u - n . dw - n . dpath),

a small linear program; and of several contacts with the same value, the least counts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from fullam.analysis.atlas.contacts import (
    Contact,
    margin_contacts,
    ray_contacts,
    tilt_contacts,
)
from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.atlas.loads import center_jacobian
from fullam.exceptions import FullamError
from fullam.model.rotors import Rotors
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

INSIDE = 1e-9
"""A share this far from its bounds is free."""


@dataclass(frozen=True, eq=False)
class Change:
    """A small change of a vehicle, per unit of some parameter; what is left out does not change.

    Attributes:
        positions: Of the hubs, shape (n, 3) [m].
        axes: Of the thrust axes, orthogonal to them, shape (n, 3).
        k_f: Shape (n,) [N/(rad/s)^2].
        mass: Of everything, the centre of mass staying where it is [kg].
        center: Of the centre of mass, shape (3,) [m].
        tool: Of the tool's origin, shape (3,) [m].
    """

    positions: ArrayLike = 0.0
    axes: ArrayLike = 0.0
    k_f: ArrayLike = 0.0
    mass: float = 0.0
    center: ArrayLike = field(default=(0.0, 0.0, 0.0))
    tool: ArrayLike = field(default=(0.0, 0.0, 0.0))

    def columns(self, rotors: Rotors) -> Array:
        """dB: change of the columns of `normalized_coupling`, shape (6, n)."""
        r, e = rotors.positions, rotors.axes
        dr = np.broadcast_to(np.asarray(self.positions, dtype=float), r.shape)
        de = np.broadcast_to(np.asarray(self.axes, dtype=float), e.shape)
        square = np.square(rotors.max_speeds)
        force = square * rotors.k_f
        drag = square * rotors.spins * rotors.k_tau
        stronger = square * np.asarray(self.k_f, dtype=float)
        df = force[:, None] * de + stronger[:, None] * e
        moment = force[:, None] * (np.cross(dr, e) + np.cross(r, de)) + drag[:, None] * de
        moment = moment + stronger[:, None] * np.cross(r, e)
        return np.hstack([df, moment]).T


@dataclass(frozen=True, eq=False)
class Gradient:
    """Derivatives of a figure; angles in rad, everything else in SI units.

    Attributes:
        positions: Per hub position, shape (n, 3).
        axes: Per change of the thrust axis across itself, shape (n, 3).
        cants: Per angle between the thrust axis and z of {A}, in their plane, shape (n,); NaN for a
            vertical axis, which has no such plane.
        azimuths: Per angle by which a rotor, hub and axis, turns about z of {A}, shape (n,).
        k_f: Per thrust coefficient, k_tau staying as it is, shape (n,).
        mass: Per mass, the centre of mass staying where it is.
        center: Per centre of mass, shape (3,).
        tool: Per origin of the tool, shape (3,).
    """

    positions: Array
    axes: Array
    cants: Array
    azimuths: Array
    k_f: Array
    mass: float
    center: Array
    tool: Array

    def along_arm(self, vehicle: Vehicle, theta: ArrayLike | None = None) -> Array:
        """Per joint angle, shape (n_arm,); without payload."""
        model, data, q = vehicle.model, vehicle.create_data(), vehicle.neutral(theta)
        frame = model.getFrameId(vehicle.tool)
        tool = pin.computeFrameJacobian(
            model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )[:3, 6:]
        moved: Array = self.center @ center_jacobian(vehicle, theta) + self.tool @ tool
        return moved


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """A figure and how it changes.

    Attributes:
        value: The figure.
        contacts: What ends it.
        gradient: Its derivatives; None at a kink.
    """

    value: float
    contacts: tuple[Contact, ...]
    gradient: Gradient | None
    _envelope: Envelope

    @property
    def smooth(self) -> bool:
        """Whether there is a gradient."""
        return self.gradient is not None

    @property
    def facets(self) -> tuple[int, ...]:
        """Indices of the facets that end the figure."""
        return tuple(int(facet) for contact in self.contacts for facet in contact.facets)

    def along(self, change: Change) -> float:
        """Derivative of the figure along a change: one-sided, and right at kinks too."""
        return min(_directional(self._envelope, contact, change) for contact in self.contacts)


def tilt_sensitivity(envelope: Envelope, azimuth: float | None = None) -> Sensitivity:
    """Of the first exit towards an azimuth [rad]; of the worst tilt by default.

    Raises:
        FullamError: If there is no such tilt (see `tilt_contacts`).
    """
    return _sensitivity(envelope, tilt_contacts, azimuth)


def margin_sensitivity(envelope: Envelope) -> Sensitivity:
    """Of the largest ball of wrenches about level hover; its length does not change with the hubs.

    Raises:
        NotFullyActuated: The rotors lack an axis.
    """
    return _sensitivity(envelope, margin_contacts)


def push_sensitivity(envelope: Envelope, direction: ArrayLike) -> Sensitivity:
    """Of the largest force at the tool along a unit vector of {A}, shape (3,).

    Raises:
        FullamError: It cannot hover level, or lacks an axis.
    """
    return _sensitivity(envelope, ray_contacts, np.asarray(direction, dtype=float), "tool")


def force_sensitivity(envelope: Envelope, direction: ArrayLike) -> Sensitivity:
    """Of the largest force through the centre of mass along a unit vector of {A}, shape (3,).

    Raises:
        FullamError: It cannot hover level, or lacks an axis.
    """
    return _sensitivity(envelope, ray_contacts, np.asarray(direction, dtype=float), "center")


def _sensitivity(
    envelope: Envelope, find: Callable[..., tuple[float, list[Contact]]], *arguments: Any
) -> Sensitivity:
    value, contacts = find(envelope, *arguments)
    gradient = None
    if len(contacts) == 1 and len(contacts[0].facets) == 1:
        contact = contacts[0]
        shares, free = _shares(envelope, contact)
        if free.sum() == envelope.facets.rank - 1:
            gradient = _gradient(envelope, contact, shares)
    return Sensitivity(value, tuple(contacts), gradient, envelope)


def _shares(envelope: Envelope, contact: Contact) -> tuple[Array, NDArray[np.bool_]]:
    """Shares u that make the contact's wrench, and which rotors are not pinned by its facets.

    With more free rotors than equations, one of many.
    """
    facets = envelope.facets
    free = np.all(facets.members[contact.facets], axis=0)
    free &= np.any(facets.matrix != 0.0, axis=0)
    climb = contact.normals @ facets.matrix
    # Where several facets meet, a rotor pinned by any of them is pinned.
    decisive = np.where(facets.members[contact.facets], 0.0, climb)
    strongest = decisive[np.abs(decisive).argmax(axis=0), np.arange(decisive.shape[1])]
    shares = np.where(strongest > 0.0, 1.0, facets.least)
    shares[~np.any(facets.matrix != 0.0, axis=0)] = 0.0
    rest = contact.wrench - facets.matrix[:, ~free] @ shares[~free]
    scaled = facets.matrix[:, free] / facets.scale[:, None]
    shares[free] = np.linalg.lstsq(scaled, rest / facets.scale, rcond=None)[0]
    return shares, free


def _gradient(envelope: Envelope, contact: Contact, shares: Array) -> Gradient:
    rotors, load = envelope.rotors, envelope.load
    n, rate = contact.normals[0], float(contact.rates[0])
    r, e, square = rotors.positions, rotors.axes, np.square(rotors.max_speeds)
    weights = (rate * shares * square)[:, None] * n  # gradient by the columns of eq. (34)
    force, moment = weights[:, :3], weights[:, 3:]
    k_f, drag = rotors.k_f[:, None], (rotors.spins * rotors.k_tau)[:, None]
    positions = k_f * np.cross(e, moment)
    axes = k_f * (force + np.cross(moment, r)) + drag * moment
    axes = axes - np.sum(axes * e, axis=1, keepdims=True) * e
    flat = np.hypot(e[:, 0], e[:, 1])
    heading = np.divide(
        e[:, :2], flat[:, None], where=flat[:, None] > INSIDE, out=e[:, :2] * np.nan
    )
    lean = np.column_stack([e[:, 2:] * heading, -flat])
    z = np.array([0.0, 0.0, 1.0])
    turned = np.sum(positions * np.cross(z, r) + axes * np.cross(z, e), axis=1)
    held = np.concatenate([contact.up, np.cross(load.center, contact.up)])
    center = -rate * load.weight * np.cross(contact.up, n[3:])
    tool = -rate * np.cross(load.extra[:3], n[3:])
    moved = -rate * np.cross(contact.path, n[3:])
    return Gradient(
        positions=positions,
        axes=axes,
        cants=np.sum(axes * lean, axis=1),
        azimuths=turned,
        k_f=np.sum(force * e, axis=1) + np.sum(moment * np.cross(r, e), axis=1),
        mass=-rate * load.gravity * float(n @ held),
        center=center + moved * (contact.point == "center"),
        tool=tool + moved * (contact.point == "tool"),
    )


def _directional(envelope: Envelope, contact: Contact, change: Change) -> float:
    """Derivative along a change for the facets that meet at one contact."""
    load, facets = envelope.load, envelope.facets
    columns = change.columns(envelope.rotors)
    shares, free = _shares(envelope, contact)
    held = np.concatenate([contact.up, np.cross(load.center, contact.up)])
    d_center, d_tool = np.asarray(change.center, float), np.asarray(change.tool, float)
    moment = load.weight * np.cross(d_center, contact.up) + np.cross(d_tool, load.extra[:3])
    if contact.point:
        moment = moment + np.cross(d_tool if contact.point == "tool" else d_center, contact.path)
    d_wrench = load.gravity * change.mass * held + np.concatenate([np.zeros(3), moment])
    lines = contact.rates[:, None] * (contact.normals @ columns)
    offsets = -contact.rates * (contact.normals @ d_wrench)
    if free.sum() < facets.rank and len(contact.facets) == 1:
        return float((lines @ shares + offsets)[0])
    return _best_of_worst(envelope, contact, lines, offsets, (shares, free))


def _best_of_worst(
    envelope: Envelope,
    contact: Contact,
    lines: Array,
    offsets: Array,
    state: tuple[Array, NDArray[np.bool_]],
) -> float:
    """The most over u of the least over facets of lines . u + offsets, with B u = w."""
    from scipy.optimize import linprog

    facets, (shares, free) = envelope.facets, state
    base = lines[:, ~free] @ shares[~free] + offsets
    scaled = facets.matrix[:, free] / facets.scale[:, None]
    rest = (contact.wrench - facets.matrix[:, ~free] @ shares[~free]) / facets.scale
    # Only as many equations as the free generators span: the others hold by the facet's own plane.
    left, sizes, _ = np.linalg.svd(scaled)
    basis = left[:, : np.count_nonzero(sizes > INSIDE * sizes.max(initial=0.0))].T
    count = int(free.sum())
    size = float(np.abs(lines).max(initial=0.0)) or 1.0
    found = linprog(
        np.concatenate([np.zeros(count), [-1.0]]),
        A_ub=np.column_stack([-lines[:, free] / size, np.ones(len(lines))]),
        b_ub=base / size,
        A_eq=np.column_stack([basis @ scaled, np.zeros(len(basis))]) if count else None,
        b_eq=basis @ rest if count else None,
        bounds=[*((low, 1.0) for low in facets.least[free]), (None, None)],
    )
    if found.status != 0:
        raise FullamError(f"derivative at a kink: {found.message}")
    return float(found.x[-1]) * size
