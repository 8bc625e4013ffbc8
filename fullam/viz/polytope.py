"""The attainable forces as a body in three dimensions, and the tilt rose as a small picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.atlas.envelope import Envelope
from fullam.exceptions import FullamError

Array = NDArray[np.float64]

SIZE = 150
"""Width and height of the rose [px]."""

RINGS_DEG = (10.0, 20.0, 30.0, 45.0, 60.0, 90.0, 180.0)


def force_polytope(envelope: Envelope) -> tuple[Array, NDArray[np.intp]]:
    """Forces that the rotors give without a moment about the centre of mass, while level or not.

    Args:
        envelope: Of a vehicle with all six axes.

    Returns:
        Vertices in {A}, shape (k, 3) [N], and triangles of their indices, shape (m, 3).

    Raises:
        FullamError: Such forces do not fill a body: an axis is missing, or nothing can be held.
    """
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    facets, load = envelope.facets, envelope.load
    if facets.rank < 6 or not envelope.can_hover or envelope.margin.value <= 0.0:
        raise FullamError("the forces without moment fill no body: it cannot hold a push anywhere.")
    along = facets.normals[:, :3] + np.cross(facets.normals[:, 3:], load.center)
    offset = facets.normals @ facets.center
    sides = np.vstack([along, -along])
    limits = np.concatenate([facets.half_widths + offset, facets.half_widths - offset])
    hover = np.array([0.0, 0.0, load.weight])
    found = HalfspaceIntersection(np.column_stack([sides, -limits]), hover)
    points = found.intersections
    hull = ConvexHull(points)
    return points, hull.simplices.astype(np.intp)


def rose_svg(envelope: Envelope, tilt: float = 0.0, azimuth: float = 0.0) -> str:
    """The tilt rose with the present tilt [rad] and its azimuth [rad] as a dot; SVG text.

    Args:
        envelope: What the vehicle can do; where it cannot hover the rose is empty.
        tilt: Present tilt [rad].
        azimuth: Where the platform leans to, seen from {A} [rad].
    """
    angles = np.linspace(0.0, 2.0 * np.pi, 181)
    rose = np.nan_to_num(np.rad2deg(envelope.rose(angles)))
    most = max(float(rose.max()), float(np.rad2deg(tilt)), 10.0)
    scale, middle = 0.46 * SIZE / most, 0.5 * SIZE
    rings = "".join(
        f'<circle cx="{middle}" cy="{middle}" r="{scale * ring:.1f}" fill="none" stroke="#ccc"/>'
        f'<text x="{middle + 2}" y="{middle - scale * ring + 9:.1f}" font-size="8" fill="#888">'
        f"{ring:.0f}°</text>"
        for ring in RINGS_DEG
        if ring <= most
    )
    x, y = middle + scale * rose * np.cos(angles), middle - scale * rose * np.sin(angles)
    outline = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    out = scale * np.rad2deg(tilt)
    dot = f'cx="{middle + out * np.cos(azimuth):.1f}" cy="{middle - out * np.sin(azimuth):.1f}"'
    return (
        f'<svg width="{SIZE}" height="{SIZE}" role="img" aria-label="hover tilt by azimuth">'
        f'{rings}<polygon points="{outline}" fill="#0072B2" fill-opacity="0.2" stroke="#0072B2"/>'
        f'<circle {dot} r="3.5" fill="#D55E00"/></svg>'
    )
