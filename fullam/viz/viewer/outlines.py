"""Lines along a shape: edges of a box, rings of a ball, ends of a cylinder."""

from __future__ import annotations

import base64

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.rotations import quaternion_rotation
from fullam.viz.viewer.shapes import Shape

Array = NDArray[np.float64]

AROUND = np.linspace(0.0, 2.0 * np.pi, 13)
CIRCLE = np.column_stack([np.cos(AROUND), np.sin(AROUND), np.zeros_like(AROUND)])
"""A closed one about z, of radius 1."""

SQUARE = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1], [-1, -1, 1]], dtype=float)

SLIM = 5.0
"""A rod that is so many times longer than thick is a line."""


def outlines(shape: Shape) -> list[list[list[float]]]:
    """Lines along a shape in its parent's axes, point by point, to 0.1 mm; of a mesh its box."""
    pose = np.array(shape.get("pose", (0.0,) * 6 + (1.0,)))
    R = quaternion_rotation(pose[3:])
    return [(pose[:3] + line @ R.T).round(4).tolist() for line in _own(shape)]


def _own(shape: Shape) -> list[Array]:
    """The lines in the shape's own axes."""
    kind = shape["type"]
    if kind in ("sphere", "ellipsoid"):
        size = np.array(shape["size"]) if kind == "ellipsoid" else shape["radius"]
        return [np.roll(CIRCLE, k, axis=1) * size for k in range(3)]
    if kind in ("cylinder", "capsule"):
        radius, half = shape["radius"], 0.5 * shape["length"]
        if half > SLIM * radius:
            return [np.array([[0.0, 0.0, half], [0.0, 0.0, -half]])]
        end = CIRCLE * radius + [0.0, 0.0, half]
        return _prism(end)
    if kind == "mesh":
        numbers = np.frombuffer(base64.b64decode(shape["vertices"]), "<f4").reshape(-1, 3)
        low, high = numbers.min(axis=0).astype(float), numbers.max(axis=0).astype(float)
        return [0.5 * (low + high) + line for line in _prism(SQUARE * 0.5 * (high - low))]
    return _prism(SQUARE * 0.5 * np.array(shape["size"]))


def _prism(loop: Array) -> list[Array]:
    """A loop above, the same below, and four edges in between."""
    below = loop * [1.0, 1.0, -1.0]
    corners = range(0, len(loop) - 1, (len(loop) - 1) // 4)
    return [loop, below, *(np.stack([loop[k], below[k]]) for k in corners)]
