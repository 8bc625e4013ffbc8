"""Positions and attitudes as one space, R^3 x SO(3), through Pinocchio's Lie-group calls."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.dynamics.quaternions import from_euler
from fullam.dynamics.rotations import euler_angles, quaternion_rotation

Array = NDArray[np.float64]

IDENTITY = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
"""The pose at the origin, level: [p, quaternion xyzw]."""


def pose_model() -> pin.Model:
    """R^3 x SO(3) as a Pinocchio model without bodies, nq = 7, nv = 6.

    `pin.difference` on it is [p_1 - p_0; log3(R_0^T R_1)] in one call, and `pin.integrate` its
    inverse: position and attitude stay apart, unlike on SE(3).
    """
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "position")
    model.addJoint(joint, pin.JointModelSpherical(), pin.SE3.Identity(), "attitude")
    return model


class AttitudeView:
    """The rotation matrix of a pose, as a live view that costs one Pinocchio call.

    Attributes:
        R_WA: Attitude of the pose seen last, shape (3, 3), rewritten in place.
    """

    def __init__(self) -> None:
        """Take the view once."""
        self._model = pose_model()
        self._data = self._model.createData()
        self.R_WA: Array = self._data.oMi[2].rotation

    def __reduce__(self) -> tuple[type[AttitudeView], tuple[()]]:
        """A copy takes a view of its own."""
        return AttitudeView, ()

    def look(self, pose: Array) -> Array:
        """R_WA of [p, quaternion xyzw], shape (7,)."""
        pin.forwardKinematics(self._model, self._data, pose)
        return self.R_WA


def pose_from_euler(position: Array, euler_xyz: Array) -> Array:
    """[p, quaternion xyzw] from positions and x-y-z Euler angles, eq. (2).

    Args:
        position: [m], shape (..., 3).
        euler_xyz: (phi, psi, gamma) with R = Rx(phi) Ry(psi) Rz(gamma) [rad], shape (..., 3).

    Returns:
        Poses, shape (..., 7).
    """
    return np.concatenate([position, from_euler(np.asarray(euler_xyz, dtype=float))], axis=-1)


def euler_from_pose(pose: Array) -> Array:
    """x-y-z Euler angles (phi, psi, gamma) of poses, eq. (2); (..., 7) to (..., 3) [rad]."""
    return euler_angles(quaternion_rotation(np.asarray(pose)[..., 3:7]))
