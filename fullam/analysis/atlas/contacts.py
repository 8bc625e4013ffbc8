"""Where a figure of the atlas ends: the facets that it meets, and at which wrench.

Every figure (a tilt, a margin, a force) is the end of a path of wrenches: it grows until the path
meets a facet. Facets that are met at the same wrench form a *contact*; a figure that is the least
over many paths (the worst tilt, a margin) may have several contacts with the same value.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.atlas.envelope import UP, Envelope
from fullam.analysis.atlas.rays import ROUNDING
from fullam.analysis.atlas.tilt import cap_distances, half_tangents
from fullam.exceptions import FullamError, NotFullyActuated

Array = NDArray[np.float64]

TIE = 1e-9
"""Figures closer than this share of their size, or of 1, are equal."""


@dataclass(frozen=True, eq=False)
class Contact:
    """Facets met at one wrench.

    A change of the rotors (d B), the load (d w) and the path (d path) moves the figure, as far as
    one facet is concerned, by  rate (n . dB u - n . dw - n . dpath), u being what makes the wrench.

    Attributes:
        facets: Indices of the facets, shape (k,).
        normals: Outward, shape (k, 6).
        rates: Shape (k,): figure per slack.
        wrench: Where they are met, in {A}, shape (6,) [N, N m].
        up: The vertical in {A} there, shape (3,).
        path: Force whose point of action moves with the load, shape (3,) [N]; 0 for none.
        point: What that point is: "center", "tool" or "".
    """

    facets: NDArray[np.intp]
    normals: Array
    rates: Array
    wrench: Array
    up: Array
    path: Array
    point: str = ""


def tilt_contacts(envelope: Envelope, azimuth: float | None) -> tuple[float, list[Contact]]:
    """Of the first exit towards an azimuth [rad], or of the worst one.

    Raises:
        NotFullyActuated: The rotors lack an axis: there is nothing to differentiate.
        FullamError: It cannot hover level, or no attitude ends the tilt.
    """
    _require(envelope)
    bounds = envelope.bounds
    if azimuth is None:
        values = np.maximum(cap_distances(bounds), 0.0)
    else:
        heading = np.array([np.cos(azimuth), np.sin(azimuth)])
        q_h = bounds.directions[:, :2] @ heading
        values = 2.0 * np.arctan(half_tangents(bounds.directions[:, 2], q_h, bounds.limits))
    tilt = float(values.min())
    if not tilt < np.pi:
        raise FullamError("every attitude on the way can be held: no facet ends the tilt.")
    rows = np.flatnonzero(values <= tilt + TIE)
    count = len(envelope.facets.normals)
    contacts = []
    for group, a in _groups(rows, bounds.directions, azimuth):
        up = np.array([np.sin(tilt) * np.cos(a), np.sin(tilt) * np.sin(a), np.cos(tilt)])
        onward = np.array([np.cos(tilt) * np.cos(a), np.cos(tilt) * np.sin(a), -np.sin(tilt)])
        normals = _signed(envelope, group)
        contacts.append(
            Contact(
                facets=group % count,
                normals=normals,
                rates=1.0 / (normals @ (envelope.load.map @ onward)),
                wrench=envelope.load.wrench(up),
                up=up,
                path=np.zeros(3),
            )
        )
    return tilt, contacts


def _groups(
    rows: NDArray[np.intp], directions: Array, azimuth: float | None
) -> list[tuple[NDArray[np.intp], float]]:
    """Rows that are met at the same azimuth, and that azimuth."""
    if azimuth is not None:
        return [(rows, azimuth)]
    angles = np.arctan2(directions[rows, 1], directions[rows, 0])
    groups: list[tuple[NDArray[np.intp], float]] = []
    left = np.ones(len(rows), dtype=bool)
    for k in range(len(rows)):
        if left[k]:
            same = left & (np.abs(np.angle(np.exp(1j * (angles - angles[k])))) < 1e-6)
            groups.append((rows[same], float(angles[k])))
            left &= ~same
    return groups


def ray_contacts(envelope: Envelope, direction: Array, point: str) -> tuple[float, list[Contact]]:
    """Of the largest force along a unit vector, at the "center" of mass or at the "tool".

    Raises:
        NotFullyActuated: The rotors lack an axis.
        FullamError: It cannot hover level.
    """
    _require(envelope)
    facets, load = envelope.facets, envelope.load
    place = load.tool if point == "tool" else load.center
    d = np.concatenate([direction, np.cross(place, direction)])
    normals = np.vstack([facets.normals, -facets.normals])
    climb, start = normals @ d, envelope.hover_wrench
    slack = np.tile(facets.half_widths, 2) - normals @ (start - facets.center)
    steps = np.full(len(climb), np.inf)
    size = float(np.linalg.norm(d / facets.scale))
    np.divide(np.maximum(slack, 0.0), climb, out=steps, where=climb > ROUNDING * size)
    value = float(steps.min())
    rows = np.flatnonzero(steps <= value + TIE * max(value, 1.0))
    return value, [
        Contact(
            facets=rows % len(facets.normals),
            normals=normals[rows],
            rates=1.0 / climb[rows],
            wrench=start + value * d,
            up=UP,
            path=value * direction,
            point=point,
        )
    ]


def margin_contacts(envelope: Envelope) -> tuple[float, list[Contact]]:
    """Of the largest ball of wrenches about level hover.

    Raises:
        NotFullyActuated: The rotors lack an axis.
    """
    _require(envelope, hovering=False)
    facets, length = envelope.facets, envelope.length
    weights = np.array([1.0, 1.0, 1.0, length, length, length])
    normals = np.vstack([facets.normals, -facets.normals])
    start = envelope.hover_wrench
    size = np.linalg.norm(normals * weights, axis=1)
    radii = (np.tile(facets.half_widths, 2) - normals @ (start - facets.center)) / size
    value = float(radii.min())
    contacts = []
    for row in np.flatnonzero(radii <= value + TIE * max(abs(value), 1.0)):
        towards = normals[row] * weights**2 / size[row]
        contacts.append(
            Contact(
                facets=np.array([row % len(facets.normals)]),
                normals=normals[row : row + 1],
                rates=1.0 / size[row : row + 1],
                wrench=start + value * towards,
                up=UP,
                path=np.zeros(3),
            )
        )
    return value, contacts


def _signed(envelope: Envelope, rows: NDArray[np.intp]) -> Array:
    """Outward normals of rows of the attitude bounds."""
    count = len(envelope.facets.normals)
    return np.where(rows < count, 1.0, -1.0)[:, None] * envelope.facets.normals[rows % count]


def _require(envelope: Envelope, hovering: bool = True) -> None:
    if envelope.facets.rank < 6:
        raise NotFullyActuated(
            envelope.rotors.where, envelope.facets.rank, 6, "tilt the rotors to get a gradient"
        )
    if hovering and not envelope.can_hover:
        raise FullamError("the vehicle cannot hover level: no gradient; that of its margin exists.")
