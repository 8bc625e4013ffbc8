"""Where the arm's joints and the vehicle's centre of mass are, row by row of a motion."""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.dynamics.recursion import Chain, composite_body, place_joints
from fullam.numbers.kernel import kernel
from fullam.numbers.vectors import scale


class PlaceView(NamedTuple):
    """What `place` is shown: links, the arm's motion, and where its joints and centres go."""

    links: Any
    motions: Any
    joints: Any
    centers: Any


@kernel
def place(view, k):
    """Joints of a row of the arm's motion, and the vehicle's centre of mass with it."""
    place_joints(view.links, view.motions[k], view.joints[k])
    whole = composite_body(Chain(view.links, view.joints[k]))
    view.centers[k] = scale(1.0 / whole.mass, whole.first_moment)
