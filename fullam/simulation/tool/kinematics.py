"""Where the tool of a vehicle is, and how it moves."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]


class ToolKinematics:
    """Where the tool of a vehicle is, and how it moves with the configuration."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Take the vehicle's model."""
        self.model = vehicle.model
        self._data = self.model.createData()
        self._frame = self.model.getFrameId(vehicle.tool)

    def place(self, q: Array) -> Array:
        """Place of the tool in the world, shape (3,) [m]."""
        pin.forwardKinematics(self.model, self._data, q)
        return np.array(pin.updateFramePlacement(self.model, self._data, self._frame).translation)

    def places(self, poses: Array, arm: Array) -> Array:
        """Places at poses (N, 7) and joint positions (N, n), shape (N, 3) [m]."""
        return np.array([self.place(q) for q in np.hstack([poses, arm])]).reshape(-1, 3)

    def jacobian(self, q: Array) -> Array:
        """Velocity of the tool in the world by rates, the platform's in its axes; (3, 6 + n)."""
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        J = pin.computeFrameJacobian(self.model, self._data, q, self._frame, axes)
        return np.array(J[:3])
