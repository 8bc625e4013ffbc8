"""Momentum and weight of a vehicle as linear maps of its bodies' inertial parameters.

With the ten parameters of every body, pi = [m, m c, I] (I about the body's frame, in the order
xx, xy, yy, xz, yz, zz, as Pinocchio has them), momentum and the wrench of gravity about a point O
that is fixed in the world are

    h_O = H(q, v) pi,    g_O = G(q) pi,    dh_O/dt = U_O + g_O + d_O,

with U_O the rotors' wrench and d_O what else acts; whatever the arm does, and without any
acceleration. World axes, linear part first.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

PER_BODY = 10
"""Inertial parameters of a body."""


class MomentumRegressor:
    """H and G of a vehicle; owns a workspace."""

    def __init__(self, vehicle: Vehicle, point: Array) -> None:
        """Bind it.

        Args:
            vehicle: The vehicle; its masses have no say.
            point: O in {W}, shape (3,) [m].
        """
        self._model, self._data, self._point = vehicle.model, vehicle.create_data(), point
        self._gravity = np.array(vehicle.model.gravity.linear)

    def __call__(self, q: Array, v: Array) -> tuple[Array, Array]:
        """H and G, each of shape (6, 10 bodies), at a configuration and velocity."""
        model, data, g = self._model, self._data, self._gravity
        pin.forwardKinematics(model, data, q, v)
        bodies = model.njoints - 1
        H, G = np.zeros((6, PER_BODY * bodies)), np.zeros((6, PER_BODY * bodies))
        skew_g = pin.skew(g)
        for i in range(1, bodies + 1):
            place, twist = data.oMi[i], data.v[i]
            R, lever = place.rotation, place.translation - self._point
            velocity, w = twist.linear, twist.angular
            part = slice(PER_BODY * (i - 1), PER_BODY * i)
            linear = np.zeros((3, PER_BODY))
            linear[:, 0], linear[:, 1:4] = R @ velocity, R @ pin.skew(w)
            angular = pin.skew(lever) @ linear
            angular[:, 1:4] -= R @ pin.skew(velocity)
            angular[:, 4:] += R @ inertia_map(w)
            H[:3, part], H[3:, part] = linear, angular
            G[:3, part.start], G[3:, part.start] = g, pin.skew(lever) @ g
            G[3:, part.start + 1 : part.start + 4] = -skew_g @ R
        return H, G


def inertia_map(w: Array) -> Array:
    """L(w) with I w = L(w) [I_xx, I_xy, I_yy, I_xz, I_yz, I_zz], shape (3, 6)."""
    x, y, z = w
    return np.array([[x, y, 0.0, z, 0.0, 0.0], [0.0, x, y, 0.0, z, 0.0], [0.0, 0.0, 0.0, x, y, z]])


def parameters(model: pin.Model) -> Array:
    """Inertial parameters pi of every body, one after the other, shape (10 bodies,)."""
    return np.concatenate([body.toDynamicParameters() for body in list(model.inertias)[1:]])
