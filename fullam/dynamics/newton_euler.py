"""Newton-Euler equations of platform and arm in world axes, eqs. (12)-(13).

f_i, tau_i are the force and moment of link i-1 on link i, in world axes at the origin of {M_i};
the last row, i = n+1, is the wrench of the tool's link ON the environment at the tool point (the
paper's tool is on link n, a vehicle's may be on any). The rotor wrench `wrench_W` is force then
moment in world axes about the ORIGIN of {A}; inside, eq. (12) is written at the platform's centre
of mass, wherever that is. Joint rates and accelerations are known inputs. One state or a batch, as
in `kinematics`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.kinematics import Acceleration, Motion, link_acceleration
from fullam.dynamics.rotations import cross, skew, turn, world_inertia
from fullam.model.chain import LinkChain

Array = NDArray[np.float64]


def gyroscopic_moments(chain: LinkChain, motion: Motion) -> Array:
    """w_i x I_i w_i of all links, the wIw_i of eq. (25); shape (..., n+1, 3) [N m]."""
    return cross(motion.w, turn(world_inertia(motion.R, chain.inertia), motion.w))


def weights(chain: LinkChain) -> Array:
    """G_i = m_i g of all links, the platform's own included; shape (..., n+1, 3) [N]."""
    return chain.mass[..., None] * chain.gravity[..., None, :]


def inertial_wrenches(
    chain: LinkChain, motion: Motion, acceleration: Acceleration
) -> tuple[Array, Array]:
    """Left-hand sides of eqs. (12)-(13), the weight moved over to them.

    Returns:
        m_i ddp_i^c - m_i g [N] and I_i dw_i + w_i x I_i w_i [N m], each (..., n+1, 3).
    """
    inertia = world_inertia(motion.R, chain.inertia)
    force = chain.mass[..., None] * acceleration.ddp_c - weights(chain)
    return force, turn(inertia, acceleration.dw) + gyroscopic_moments(chain, motion)


def joint_wrenches(
    chain: LinkChain,
    motion: Motion,
    acceleration: Acceleration,
    tool_wrench: Array | None = None,
) -> tuple[Array, Array]:
    """Backward pass of eq. (13), from the end effector to joint 1.

    f_i = m_i ddp_i^c - m_i g + f_{i+1} and
    tau_i = I_i dw_i + w_i x I_i w_i - r_i^in x f_i + tau_{i+1} + r_i^out x f_{i+1},
    with r_i^in = p_i - p_i^c and r_i^out = p_{i+1} - p_i^c. A tool on a link before the last gives
    its f_{n+1}, tau_{n+1} to that link.

    Args:
        chain: Constants of the links.
        motion: Positions and velocities of the links.
        acceleration: Accelerations of the links.
        tool_wrench: f_{n+1}, tau_{n+1} on the environment, shape (..., 6); none when absent.

    Returns:
        f_1..f_{n+1} [N] and tau_1..tau_{n+1} [N m], each of shape (..., n+1, 3).
    """
    force, moment = inertial_wrenches(chain, motion, acceleration)
    if tool_wrench is None:
        tool_wrench = np.zeros(6)
    batch = np.broadcast_shapes(force.shape[:-2], tool_wrench.shape[:-1])
    f, tau = np.empty((*batch, chain.n + 1, 3)), np.empty((*batch, chain.n + 1, 3))
    f[..., chain.n, :], tau[..., chain.n, :] = tool_wrench[..., :3], tool_wrench[..., 3:]
    # Row k of f and tau holds joint k + 1, so link i lies between rows i - 1 and i.
    for i in range(chain.n, 0, -1):
        r_in = motion.p[..., i, :] - motion.p_c[..., i, :]
        f_out, tau_out = outgoing_wrench(chain, motion, f, tau, i)
        f[..., i - 1, :] = force[..., i, :] + f_out
        tau[..., i - 1, :] = moment[..., i, :] - cross(r_in, f[..., i - 1, :]) + tau_out
    return f, tau


def outgoing_wrench(
    chain: LinkChain, motion: Motion, f: Array, tau: Array, i: int
) -> tuple[Array, Array]:
    """What link i gives to the next link, and to the tool if it carries it.

    f_{i+1} and tau_{i+1} + r_i^out x f_{i+1}, a moment about the link's centre of mass; the
    tool's f_{n+1}, tau_{n+1} count for link `chain.tool_link`.

    Args:
        chain: Constants of the links.
        motion: Positions and velocities of the links.
        f: f_1..f_{n+1}, shape (..., n+1, 3) [N].
        tau: tau_1..tau_{n+1}, shape (..., n+1, 3) [N m].
        i: Number of the link, 0 for the platform.

    Returns:
        Force [N] and moment [N m], each of shape (..., 3).
    """
    rows = ([i] if i < chain.n else []) + ([chain.n] if i == chain.tool_link else [])
    force, moment = np.zeros_like(f[..., 0, :]), np.zeros_like(f[..., 0, :])
    for row in rows:
        r_out = motion.p[..., row + 1, :] - motion.p_c[..., i, :]
        force = force + f[..., row, :]
        moment = moment + tau[..., row, :] + cross(r_out, f[..., row, :])
    return force, moment


def root_wrench(
    chain: LinkChain, motion: Motion, acceleration: Acceleration, f: Array, tau: Array
) -> Array:
    """Rotor wrench that eq. (12) asks for, moved from the centre of mass to the origin of {A}.

    U_f = m_A ddp_A^c - m_A g + f_1, U_tau = I_A dw_A + w_A x I_A w_A + tau_1 + r_A^out x f_1,
    and what a tool on the platform itself exerts.

    Args:
        chain: Constants of the links.
        motion: Positions and velocities of the links.
        acceleration: Accelerations of the links.
        f: f_1..f_{n+1}, shape (..., n+1, 3) [N].
        tau: tau_1..tau_{n+1}, shape (..., n+1, 3) [N m].

    Returns:
        wrench_W, shape (..., 6).
    """
    force, moment = inertial_wrenches(chain, motion, acceleration)
    f_out, tau_out = outgoing_wrench(chain, motion, f, tau, 0)
    U_f = force[..., 0, :] + f_out
    U_tau = moment[..., 0, :] + tau_out
    to_com = motion.p_c[..., 0, :] - motion.p[..., 0, :]
    return np.concatenate([U_f, U_tau + cross(to_com, U_f)], axis=-1)


def inverse_dynamics(
    chain: LinkChain,
    motion: Motion,
    ddtheta: Array,
    acceleration_W: Array,
    tool_wrench: Array | None = None,
) -> Array:
    """Rotor wrench for a wanted acceleration of the platform, eqs. (10)-(13); (..., 6).

    Args:
        chain: Constants of the links.
        motion: Positions and velocities of the links.
        ddtheta: Joint accelerations, shape (..., n) [rad/s^2 or m/s^2].
        acceleration_W: [ddp_A, dw_A] of the origin of {A}, world axes, shape (..., 6).
        tool_wrench: Wrench on the environment, shape (..., 6).
    """
    acceleration = link_acceleration(
        chain, motion, ddtheta, acceleration_W[..., 3:], acceleration_W[..., :3]
    )
    f, tau = joint_wrenches(chain, motion, acceleration, tool_wrench)
    return root_wrench(chain, motion, acceleration, f, tau)


def locked_inertia(chain: LinkChain, motion: Motion) -> Array:
    """Spatial inertia of the whole vehicle with its joints locked, at the origin of {A}.

    Sum over all links of [[m 1, -m s(c)], [m s(c), I - m s(c) s(c)]], c = p_i^c - p_A.

    Returns:
        Shape (..., 6, 6), world axes, force rows first.
    """
    s = skew(motion.p_c - motion.p[..., :1, :])
    ms = chain.mass[..., None, None] * s
    M = np.zeros((*ms.shape[:-3], 6, 6))
    M[..., :3, :3] = np.sum(chain.mass, axis=-1)[..., None, None] * np.eye(3)
    M[..., :3, 3:] = -np.sum(ms, axis=-3)
    M[..., 3:, :3] = np.sum(ms, axis=-3)
    M[..., 3:, 3:] = np.sum(world_inertia(motion.R, chain.inertia) - ms @ s, axis=-3)
    return M


def base_acceleration(
    chain: LinkChain,
    motion: Motion,
    ddtheta: Array,
    wrench_W: Array,
    tool_wrench: Array | None = None,
) -> Array:
    """Acceleration of the platform under a rotor wrench with prescribed joints, eqs. (12)-(13).

    The wrench is affine in the acceleration: inverse dynamics at zero, plus the locked inertia
    times the acceleration.

    Args:
        chain: Constants of the links.
        motion: Positions and velocities of the links.
        ddtheta: Joint accelerations, shape (..., n) [rad/s^2 or m/s^2].
        wrench_W: Rotor wrench, world axes at the origin of {A}, shape (..., 6).
        tool_wrench: Wrench on the environment, shape (..., 6).

    Returns:
        [ddp_A, dw_A] of the origin of {A} in world axes, shape (..., 6).
    """
    bias = inverse_dynamics(chain, motion, ddtheta, np.zeros(6), tool_wrench)
    solved = np.linalg.solve(locked_inertia(chain, motion), (wrench_W - bias)[..., None])
    return np.asarray(solved[..., 0], dtype=np.float64)


def platform_residual(
    chain: LinkChain,
    motion: Motion,
    acceleration: Acceleration,
    wrench_W: Array,
    f: Array,
    tau: Array,
) -> Array:
    """Left minus right side of eq. (12) at the centre of mass, force then moment; (..., 6).

    Arguments as in `root_wrench`, with the rotor wrench that is to satisfy the equation.
    """
    inertia = world_inertia(motion.R[..., 0, :, :], chain.inertia[..., 0, :, :])
    w, com = motion.w[..., 0, :], motion.p_c[..., 0, :]
    f_out, tau_out = outgoing_wrench(chain, motion, f, tau, 0)
    U_f = wrench_W[..., :3]
    U_tau = wrench_W[..., 3:] - cross(com - motion.p[..., 0, :], U_f)
    G = weights(chain)[..., 0, :]
    force = chain.mass[..., 0, None] * acceleration.ddp_c[..., 0, :] - (U_f - f_out + G)
    left = turn(inertia, acceleration.dw[..., 0, :]) + cross(w, turn(inertia, w))
    moment = left - (U_tau - tau_out)
    return np.concatenate([force, moment], axis=-1)


def link_residuals(
    chain: LinkChain, motion: Motion, acceleration: Acceleration, f: Array, tau: Array
) -> Array:
    """Left minus right side of eq. (13) for links 1..n, force then moment; (..., n, 6).

    Args:
        chain: Constants of the links.
        motion: Positions and velocities of the links.
        acceleration: Accelerations of the links.
        f: f_1..f_{n+1}, shape (..., n+1, 3) [N].
        tau: tau_1..tau_{n+1}, shape (..., n+1, 3) [N m].
    """
    inertia = world_inertia(motion.R, chain.inertia)[..., 1:, :, :]
    w, com = motion.w[..., 1:, :], motion.p_c[..., 1:, :]
    r_in, f_in = motion.p[..., 1:-1, :] - com, f[..., :-1, :]
    out = [outgoing_wrench(chain, motion, f, tau, i) for i in range(1, chain.n + 1)]
    f_out, tau_out = (np.stack(part, axis=-2) for part in zip(*out, strict=True))
    left_force = chain.mass[..., 1:, None] * acceleration.ddp_c[..., 1:, :]
    force = left_force - (f_in - f_out + weights(chain)[..., 1:, :])
    left = turn(inertia, acceleration.dw[..., 1:, :]) + cross(w, turn(inertia, w))
    right = tau[..., :-1, :] + cross(r_in, f_in) - tau_out
    return np.concatenate([force, left - right], axis=-1)
