"""The paper's first-order pose filter, on R^3 x SO(3) instead of on Euler angles."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.dynamics.pose_space import IDENTITY, pose_model

Array = NDArray[np.float64]


class FirstOrderPoseFilter:
    """y <- y (+) gain (x (-) y), gain = cutoff * period, and its rate of change.

    The published runs filter position and Euler angles with y += 0.01 * 18 * (x - y). The same
    recursion with the difference taken on R^3 x SO(3) has no singular attitude and equals theirs
    to second order in the angle between x and y.

    Attributes:
        pose: Filtered [p, quaternion xyzw], shape (7,), a new array after each update.
        rate: [dp (world axes), w ({A} axes)] of the filtered pose over the last period, (6,), live.
    """

    def __init__(self, cutoff: float, period: float) -> None:
        """Set the gain.

        Args:
            cutoff: Corner frequency [rad/s]; infinity passes the input through.
            period: Time between updates [s].
        """
        self.gain = min(1.0, cutoff * period)
        # As arrays: numpy takes twice as long over a Python number.
        self._gains, self._rates = np.full(6, self.gain), np.full(6, self.gain / period)
        self._model = pose_model()
        self.pose: Array = np.array(IDENTITY)
        self.rate: Array = np.zeros(6)

    def reset(self, pose: Array) -> None:
        """Start at `pose`, at rest."""
        self.pose = np.array(pose)
        self.rate[:] = 0.0

    def update(self, pose: Array) -> None:
        """Take in the next pose [p, quaternion xyzw]."""
        step = pin.difference(self._model, self.pose, pose)
        np.multiply(step, self._rates, self.rate)
        np.multiply(step, self._gains, step)
        self.pose = pin.integrate(self._model, self.pose, step)
