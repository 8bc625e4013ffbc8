"""What an arm motion gives: joint positions, rates and accelerations on a time grid.

Positions are in rad of a revolute joint and in m of a prismatic one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ArmTable:
    """Joint positions, rates and accelerations on a time grid, each of shape (N, n)."""

    theta: Array
    dtheta: Array
    ddtheta: Array
