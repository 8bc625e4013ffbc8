"""Craig's (modified) Denavit-Hartenberg chain of the paper's arm, Table 1 and eqs. (3)-(5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def homogeneous(R: ArrayLike, P: ArrayLike) -> Array:
    """Homogeneous transform [[R, P], [0, 1]], the form of eqs. (1) and (3).

    Args:
        R: Rotation, shape (..., 3, 3).
        P: Translation, shape (..., 3) [m].

    Returns:
        Transform, shape (..., 4, 4).
    """
    R, P = np.asarray(R, dtype=float), np.asarray(P, dtype=float)
    T = np.zeros((*np.broadcast_shapes(R.shape[:-2], P.shape[:-1]), 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = R, P, 1.0
    return T


def craig_transform(alpha: float, a: float, d: float, theta: ArrayLike) -> Array:
    """Transform {M_{i-1}} to {M_i} by Craig's convention, eq. (4) with its erratum.

    A = Rot_x(alpha) Trans_x(a) Trans_z(d) Rot_z(theta): the translation (a, -d sin alpha,
    d cos alpha) does not depend on theta, as the text below eq. (4) says. (Printed is the distal
    matrix, whose translation does.)

    Args:
        alpha: Twist alpha_{i-1} about x [rad].
        a: Length a_{i-1} along x [m].
        d: Offset d_i along z [m].
        theta: Joint angle about z [rad], one or a batch, shape (...).

    Returns:
        Transform, shape (..., 4, 4).
    """
    theta = np.asarray(theta, dtype=float)
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    A = np.zeros((*theta.shape, 4, 4))
    A[..., 0, 0], A[..., 0, 1], A[..., 0, 3] = ct, -st, a
    A[..., 1, 0], A[..., 1, 1], A[..., 1, 2], A[..., 1, 3] = st * ca, ct * ca, -sa, -d * sa
    A[..., 2, 0], A[..., 2, 1], A[..., 2, 2], A[..., 2, 3] = st * sa, ct * sa, ca, d * ca
    A[..., 3, 3] = 1.0
    return A


@dataclass(frozen=True)
class CraigRow:
    """One row of Table 1, columns in the corrected order.

    Attributes:
        alpha: Twist about x [rad].
        a: Length along x [m].
        d: Offset along z [m].
        fixed: Whether theta is identically zero (the paper's fifth "joint").
    """

    alpha: float
    a: float
    d: float
    fixed: bool = False

    def transform(self, theta: ArrayLike = 0.0) -> Array:
        """^{i-1}A_i at the joint angle theta, eqs. (3)-(4); shape (..., 4, 4)."""
        return craig_transform(self.alpha, self.a, self.d, theta)


def craig_table(l_1: float, l_2: float, l_3: float, l_4: float) -> tuple[CraigRow, ...]:
    """Table 1 of the paper with its columns exchanged as the units demand.

    Four joints, and a fifth, fixed row that carries {M_5} to the end effector.

    Args:
        l_1: Distance from joint 1 to joint 2 [m].
        l_2: Distance from joint 2 to joint 3 [m].
        l_3: Offset of joint 4 along its own axis [m].
        l_4: Distance from {M_4} to the end effector along z_4 [m].
    """
    quarter = np.pi / 2
    return (
        CraigRow(0.0, 0.0, 0.0),
        CraigRow(0.0, l_1, 0.0),
        CraigRow(-quarter, l_2, 0.0),
        CraigRow(-quarter, 0.0, l_3),
        CraigRow(0.0, 0.0, l_4, fixed=True),
    )


def mount(drop: float = 0.06, turn_z: float = np.pi / 4, turn_x: float = np.pi / 2) -> Array:
    """Constant mount ^A T_0 = Trans(0, 0, -drop) Rot_z(turn_z) Rot_x(turn_x), erratum of Table 1.

    Without it z_1 would be parallel to z_A and the arm could never hang. The defaults are the
    values that the static moments of the group's recorded flights fit.

    Args:
        drop: Distance of {M_0} below the origin of {A} [m].
        turn_z: Turn of the arm's plane about z_A [rad].
        turn_x: Tilt that lays z_0 into the plane of the platform [rad].

    Returns:
        Transform, shape (4, 4).
    """
    shift = homogeneous(np.eye(3), [0.0, 0.0, -drop])
    return shift @ craig_transform(0.0, 0.0, 0.0, turn_z) @ craig_transform(turn_x, 0.0, 0.0, 0.0)


def chain_transforms(
    T_WA: Array, rows: Sequence[CraigRow], theta: Array, T_A0: Array | None = None
) -> Array:
    """Transforms ^0T_i = T_WA ^AT_0 prod_k ^{k-1}A_k of all link frames, eq. (5).

    Args:
        T_WA: Pose of {A}, eq. (1), shape (..., 4, 4).
        rows: The Craig table; a fixed row takes no angle.
        theta: Angles of the free rows in order [rad], shape (..., n_free).
        T_A0: Mount, shape (4, 4); the identity (the paper as printed) when absent.

    Returns:
        Transforms of {M_1}..{M_n}, shape (..., n, 4, 4).
    """
    theta = np.asarray(theta, dtype=float)
    T = T_WA if T_A0 is None else T_WA @ T_A0
    frames, used = [], 0
    for row in rows:
        if row.fixed:
            T = T @ row.transform()
        else:
            T = T @ row.transform(theta[..., used])
            used += 1
        frames.append(T)
    shape = np.broadcast_shapes(*(frame.shape for frame in frames))
    return np.stack([np.broadcast_to(frame, shape) for frame in frames], axis=-3)
