"""A vehicle's links as rows of `recursion.Link`, frames turned so that joint axes are z."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.recursion import Link
from fullam.model.chain import LinkChain
from fullam.numbers.records import Rows

Array = NDArray[np.float64]

UPPER_TRIANGLE = [0, 1, 2, 4, 5, 8]
"""Entries xx, xy, xz, yy, yz, zz of a matrix written row by row."""


@dataclass(frozen=True, eq=False)
class LinkRows:
    """A chain as rows, and the same chain with other bodies.

    Attributes:
        frames: Rotations from the frames of the rows to the chain's own, shape (n + 1, 3, 3).
        rows: `Link` rows, the platform first.
    """

    frames: Array
    rows: Rows

    @classmethod
    def of(cls, chain: LinkChain) -> LinkRows:
        """Turn the frames, lay out the rows."""
        frames = np.stack([np.eye(3), *(_frame_with_z(axis) for axis in chain.axis)])
        rows = Rows.empty(Link, chain.n + 1)
        back = frames.transpose(0, 2, 1)
        rows["rotation"][0] = np.eye(3).ravel()
        rows["rotation"][1:] = (back[:-1] @ chain.placement_R @ frames[1:]).reshape(-1, 9)
        rows["offset"][1:] = (back[:-1] @ chain.placement_P[:, :, None])[:, :, 0]
        rows["prismatic"][1:, 0] = chain.prismatic
        links = cls(frames, rows)
        links.write_bodies(rows.array, chain.mass, chain.com, chain.inertia)
        return links

    def write_bodies(self, array: Array, mass: Array, com: Array, inertia: Array) -> None:
        """Write other bodies, given in the chain's own frames, into an array of `Link` rows."""
        back = self.frames.transpose(0, 2, 1)
        array[:, 0] = mass
        array[:, 1:4] = (back @ com[:, :, None])[:, :, 0]
        array[:, 4:10] = (back @ inertia @ self.frames).reshape(-1, 9)[:, UPPER_TRIANGLE]


def _frame_with_z(axis: Array) -> Array:
    """A rotation whose third column is the unit vector; the identity for z itself."""
    if axis[2] == 1.0:
        return np.eye(3)
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)
