"""Where a reference jumps last: from there on a flight is judged."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def last_jump(change: Array) -> int:
    """Row of the last jump of a reference, 0 if it has none.

    A jump is an isolated increment: more than three times both its neighbours, in position or in
    attitude. Ramps and smooth trajectories have none, however fast they are.

    Args:
        change: Increments of the reference, row k from row k-1 to k, shape (N, 6) [mm, deg].
    """
    latest = 0
    for half in (change[:, :3], change[:, 3:]):
        size = np.pad(np.linalg.norm(half, axis=1), 1)
        neighbours = np.maximum(size[:-2], size[2:])
        rows = np.flatnonzero(size[1:-1] > 3.0 * neighbours + 1e-6)
        latest = max(latest, int(rows[-1]) if rows.size else 0)
    return latest
