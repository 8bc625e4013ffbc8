"""World-frame recursion over platform and arm: eqs. (1), (6) and (8)-(11).

Link 0 is the platform, links 1..n the arm. Every vector is in world axes; the state is that of
the origin of {A}. All functions take one state or a batch: leading axes are samples, and there
is no loop over samples, only over links. The axis R_i Z_0 of the paper is R_i `chain.axis[i]`
here, which is the same for Craig's frames and also right for a URDF's.

The paper's joints are revolute. A prismatic joint does not turn its link; it moves the link's
origin along the axis z_i = R_i `chain.axis[i]`, which adds z_i theta_i to eq. (6), z_i dtheta_i to
eq. (9), and 2 w_{i-1} x z_i dtheta_i + z_i ddtheta_i to eq. (11). Its theta is in metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.rotations import cross, exponential, quaternion_rotation, turn
from fullam.model.chain import LinkChain
from fullam.model.craig import homogeneous

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """Positions and velocities of all links in world axes, eqs. (5)-(9).

    Attributes:
        R: Attitudes R_i, shape (..., n+1, 3, 3).
        p: Origins p_i of {A}, {M_1}..{M_n}, and the tool point last, (..., n+2, 3) [m].
        p_c: Centres of mass, shape (..., n+1, 3) [m].
        w: Angular velocities, shape (..., n+1, 3) [rad/s].
        v: Velocities of the origins, shape (..., n+1, 3) [m/s].
        v_c: Velocities of the centres of mass, shape (..., n+1, 3) [m/s].
        theta: Joint positions, shape (..., n) [rad or m].
        dtheta: Joint rates, shape (..., n) [rad/s or m/s].
    """

    R: Array
    p: Array
    p_c: Array
    w: Array
    v: Array
    v_c: Array
    theta: Array
    dtheta: Array


@dataclass(frozen=True, eq=False)
class Acceleration:
    """Accelerations of all links in world axes, eqs. (10)-(11).

    Attributes:
        dw: Angular accelerations, shape (..., n+1, 3) [rad/s^2].
        ddp: Accelerations of the origins, shape (..., n+1, 3) [m/s^2].
        ddp_c: Accelerations of the centres of mass, shape (..., n+1, 3) [m/s^2].
    """

    dw: Array
    ddp: Array
    ddp_c: Array


def platform_pose(R_WA: Array, p_WA: Array) -> Array:
    """Pose of {A} in {W}, T_WA = [[R_WA, p_WA], [0, 1]], eq. (1); shape (..., 4, 4)."""
    return homogeneous(R_WA, p_WA)


def attitudes(chain: LinkChain, R_WA: Array, theta: Array) -> Array:
    """Attitudes R_i = R_{i-1} ^{i-1}R_i(theta_i) of all links, the rotations of eq. (5).

    Args:
        chain: Constants of the links.
        R_WA: Attitude of the platform, shape (..., 3, 3).
        theta: Joint positions, shape (..., n) [rad or m].

    Returns:
        Shape (..., n+1, 3, 3).
    """
    batch = np.broadcast_shapes(R_WA.shape[:-2], theta.shape[:-1], chain.mass.shape[:-1])
    R = np.empty((*batch, chain.n + 1, 3, 3))
    R[..., 0, :, :] = R_WA
    joint = chain.placement_R @ exponential(chain.axis, np.where(chain.prismatic, 0.0, theta))
    for i in range(1, chain.n + 1):
        R[..., i, :, :] = R[..., i - 1, :, :] @ joint[..., i - 1, :, :]
    return R


def positions(chain: LinkChain, R: Array, p_WA: Array, theta: Array) -> tuple[Array, Array]:
    """Origins and centres of mass, eq. (6).

    p_i = p_{i-1} + R_{i-1} ^{i-1}P_i and p_i^c = p_i + R_i ^iP_i^c.

    Args:
        chain: Constants of the links.
        R: Attitudes of the links, shape (..., n+1, 3, 3).
        p_WA: Position of the origin of {A}, shape (..., 3) [m].
        theta: Joint positions, shape (..., n) [rad or m].

    Returns:
        Origins with the tool point last, (..., n+2, 3), and centres of mass, (..., n+1, 3).
    """
    p = np.empty((*R.shape[:-3], chain.n + 2, 3))
    p[..., 0, :] = p_WA
    lever, k = levers(chain, R, theta), chain.tool_link
    for i in range(1, chain.n + 1):
        p[..., i, :] = p[..., i - 1, :] + lever[..., i - 1, :]
    p[..., -1, :] = p[..., k, :] + turn(R[..., k, :, :], chain.tool_P)
    return p, p[..., :-1, :] + turn(R, chain.com)


def levers(chain: LinkChain, R: Array, theta: Array) -> Array:
    """R_{i-1} ^{i-1}P_i from origin to origin, a prismatic joint's z_i theta_i in it; (..., n, 3).

    Args:
        chain: Constants of the links.
        R: Attitudes of the links, shape (..., n+1, 3, 3).
        theta: Joint positions, shape (..., n) [rad or m].
    """
    return turn(R[..., :-1, :, :], chain.placement_P) + slides(chain, R) * theta[..., None]


def turns(chain: LinkChain, R: Array) -> Array:
    """Axes z_i = R_i Z_0 of the revolute joints, zero of the prismatic ones; (..., n, 3)."""
    return turn(R[..., 1:, :, :], np.where(chain.prismatic[..., None], 0.0, chain.axis))


def slides(chain: LinkChain, R: Array) -> Array:
    """Axes z_i = R_i Z_0 of the prismatic joints, zero of the revolute ones; (..., n, 3)."""
    return turn(R[..., 1:, :, :], np.where(chain.prismatic[..., None], chain.axis, 0.0))


def angular_velocities(chain: LinkChain, R: Array, w_W: Array, dtheta: Array) -> Array:
    """Angular velocities w_i = w_{i-1} + R_i Z_0 dtheta_i, eq. (8); shape (..., n+1, 3).

    Args:
        chain: Constants of the links.
        R: Attitudes of the links, shape (..., n+1, 3, 3).
        w_W: Angular velocity of the platform, shape (..., 3) [rad/s].
        dtheta: Joint rates, shape (..., n) [rad/s or m/s].
    """
    w = np.empty((*R.shape[:-3], chain.n + 1, 3))
    w[..., 0, :] = w_W
    about_joint = turns(chain, R) * dtheta[..., None]
    for i in range(1, chain.n + 1):
        w[..., i, :] = w[..., i - 1, :] + about_joint[..., i - 1, :]
    return w


def velocities(
    chain: LinkChain, R: Array, w: Array, v_W: Array, theta: Array, dtheta: Array
) -> tuple[Array, Array]:
    """Velocities of origins and centres of mass, eq. (9).

    dp_i = dp_{i-1} + w_{i-1} x R_{i-1} ^{i-1}P_i and dp_i^c = dp_i + w_i x R_i ^iP_i^c; of a
    prismatic joint dp_i gains z_i dtheta_i.

    Args:
        chain: Constants of the links.
        R: Attitudes of the links, shape (..., n+1, 3, 3).
        w: Angular velocities of the links, shape (..., n+1, 3) [rad/s].
        v_W: Velocity of the origin of {A}, shape (..., 3) [m/s].
        theta: Joint positions, shape (..., n) [rad or m].
        dtheta: Joint rates, shape (..., n) [rad/s or m/s].

    Returns:
        Two arrays of shape (..., n+1, 3) [m/s].
    """
    v = np.empty((*R.shape[:-3], chain.n + 1, 3))
    v[..., 0, :] = v_W
    step = cross(w[..., :-1, :], levers(chain, R, theta)) + slides(chain, R) * dtheta[..., None]
    for i in range(1, chain.n + 1):
        v[..., i, :] = v[..., i - 1, :] + step[..., i - 1, :]
    return v, v + cross(w, turn(R, chain.com))


def joint_angular_terms(
    chain: LinkChain, R: Array, w: Array, dtheta: Array, ddtheta: Array
) -> Array:
    """What a joint adds to the angular acceleration, h_i of eq. (25); shape (..., n, 3).

    h_i = w_i x (R_i Z_0 dtheta_i) + R_i Z_0 ddtheta_i, and 0 of a prismatic joint. Arguments as
    in `angular_accelerations`.
    """
    z = turns(chain, R)
    return cross(w[..., 1:, :], z * dtheta[..., None]) + z * ddtheta[..., None]


def joint_linear_terms(
    chain: LinkChain, R: Array, w: Array, dtheta: Array, ddtheta: Array
) -> Array:
    """What a joint adds to the acceleration of its link's origin; shape (..., n, 3) [m/s^2].

    2 w_{i-1} x z_i dtheta_i + z_i ddtheta_i (Coriolis, and along the axis) of a prismatic joint,
    and 0 of a revolute one. Arguments as in `angular_accelerations`.
    """
    z = slides(chain, R)
    return 2.0 * cross(w[..., :-1, :], z * dtheta[..., None]) + z * ddtheta[..., None]


def angular_accelerations(
    chain: LinkChain, R: Array, w: Array, dtheta: Array, ddtheta: Array, dw_W: Array
) -> Array:
    """Angular accelerations, eq. (10); shape (..., n+1, 3) [rad/s^2].

    dw_i = dw_{i-1} + w_i x (R_i Z_0 dtheta_i) + R_i Z_0 ddtheta_i.

    Args:
        chain: Constants of the links.
        R: Attitudes of the links, shape (..., n+1, 3, 3).
        w: Angular velocities of the links, shape (..., n+1, 3) [rad/s].
        dtheta: Joint rates, shape (..., n) [rad/s or m/s].
        ddtheta: Joint accelerations, shape (..., n) [rad/s^2 or m/s^2].
        dw_W: Angular acceleration of the platform, shape (..., 3) [rad/s^2].
    """
    h = joint_angular_terms(chain, R, w, dtheta, ddtheta)
    batch = np.broadcast_shapes(R.shape[:-3], h.shape[:-2], dw_W.shape[:-1])
    dw = np.empty((*batch, chain.n + 1, 3))
    dw[..., 0, :] = dw_W
    for i in range(1, chain.n + 1):
        dw[..., i, :] = dw[..., i - 1, :] + h[..., i - 1, :]
    return dw


def centripetal(w: Array, lever: Array) -> Array:
    """g(w, R, P) = w x (w x R P) of eq. (25), the lever R P given; shape (..., 3)."""
    return cross(w, cross(w, lever))


def accelerations(
    chain: LinkChain, motion: Motion, dw: Array, ddp_W: Array, ddtheta: Array
) -> tuple[Array, Array]:
    """Accelerations of origins and centres of mass, eq. (11).

    ddp_i = ddp_{i-1} + dw_{i-1} x L + w_{i-1} x (w_{i-1} x L) with L = R_{i-1} ^{i-1}P_i, and
    ddp_i^c the same from ddp_i with dw_i, w_i and L = R_i ^iP_i^c; ddp_i of a prismatic joint
    gains `joint_linear_terms`.

    Args:
        chain: Constants of the links.
        motion: Positions and velocities of the links.
        dw: Angular accelerations of the links, shape (..., n+1, 3) [rad/s^2].
        ddp_W: Acceleration of the origin of {A}, shape (..., 3) [m/s^2].
        ddtheta: Joint accelerations, shape (..., n) [rad/s^2 or m/s^2].

    Returns:
        Two arrays of shape (..., n+1, 3) [m/s^2].
    """
    R, w = motion.R, motion.w
    ddp = np.empty((*np.broadcast_shapes(dw.shape[:-2], ddp_W.shape[:-1]), chain.n + 1, 3))
    ddp[..., 0, :] = ddp_W
    lever = levers(chain, R, motion.theta)
    step = cross(dw[..., :-1, :], lever) + centripetal(w[..., :-1, :], lever)
    step = step + joint_linear_terms(chain, R, w, motion.dtheta, ddtheta)
    for i in range(1, chain.n + 1):
        ddp[..., i, :] = ddp[..., i - 1, :] + step[..., i - 1, :]
    to_com = turn(R, chain.com)
    return ddp, ddp + cross(dw, to_com) + centripetal(w, to_com)


def link_motion(
    chain: LinkChain,
    R_WA: Array,
    p_WA: Array,
    w_W: Array,
    v_W: Array,
    theta: Array,
    dtheta: Array,
) -> Motion:
    """Where all links are and how they move, eqs. (5), (6), (8) and (9).

    Args:
        chain: Constants of the links.
        R_WA: Attitude of the platform, shape (..., 3, 3).
        p_WA: Position of the origin of {A}, shape (..., 3) [m].
        w_W: Angular velocity of the platform in world axes, shape (..., 3) [rad/s].
        v_W: Velocity of the origin of {A} in world axes, shape (..., 3) [m/s].
        theta: Joint positions, shape (..., n) [rad or m].
        dtheta: Joint rates, shape (..., n) [rad/s or m/s].
    """
    R = attitudes(chain, R_WA, theta)
    p, p_c = positions(chain, R, p_WA, theta)
    w = angular_velocities(chain, R, w_W, dtheta)
    v, v_c = velocities(chain, R, w, v_W, theta, dtheta)
    return Motion(R, p, p_c, w, v, v_c, theta, dtheta)


def motion_of(chain: LinkChain, q: Array, v: Array) -> Motion:
    """`link_motion` from Pinocchio's coordinates, one state or a batch.

    Args:
        chain: Constants of the links.
        q: [p, quaternion xyzw, theta], shape (..., 7 + n).
        v: [v_A, w_A, dtheta], the platform's in body axes, shape (..., 6 + n).
    """
    R_WA = quaternion_rotation(q[..., 3:7])
    w_W, v_W = turn(R_WA, v[..., 3:6]), turn(R_WA, v[..., :3])
    return link_motion(chain, R_WA, q[..., :3], w_W, v_W, q[..., 7:], v[..., 6:])


def link_acceleration(
    chain: LinkChain, motion: Motion, ddtheta: Array, dw_W: Array, ddp_W: Array
) -> Acceleration:
    """How all links accelerate with the platform and the joints, eqs. (10)-(11).

    Args:
        chain: Constants of the links.
        motion: Positions and velocities of the links.
        ddtheta: Joint accelerations, shape (..., n) [rad/s^2 or m/s^2].
        dw_W: Angular acceleration of the platform, world axes, shape (..., 3) [rad/s^2].
        ddp_W: Acceleration of the origin of {A}, world axes, shape (..., 3) [m/s^2].
    """
    dw = angular_accelerations(chain, motion.R, motion.w, motion.dtheta, ddtheta, dw_W)
    return Acceleration(dw, *accelerations(chain, motion, dw, ddp_W, ddtheta))
