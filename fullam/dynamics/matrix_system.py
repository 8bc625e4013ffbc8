"""The paper's linear system for accelerations and joint wrenches, eqs. (20)-(25).

Eqs. (10)-(13) of all links are one linear system M X_s = b in the unknowns

    X_s = (dw_A, ddp_A, f_1..f_n, tau_1..tau_n, dw_1..dw_n, ddp_1..ddp_n, ddp^c_1..ddp^c_n),

6 + 15 n scalars: 81 for the paper's five links (the fifth fixed), 66 for four. ddp_A is the
acceleration of the platform's centre of mass, where eq. (12) is written; for the paper that is
the origin of {A}. All arguments and the rotor wrench refer to the origin, as everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.kinematics import (
    Motion,
    centripetal,
    joint_angular_terms,
    joint_linear_terms,
)
from fullam.dynamics.newton_euler import gyroscopic_moments, weights
from fullam.dynamics.rotations import cross, skew, world_inertia
from fullam.exceptions import FullamError
from fullam.model.chain import LinkChain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SystemLayout:
    """Where each unknown and each equation of eq. (21) lies; links are counted 1..n.

    Attributes:
        n: Number of arm links.
    """

    n: int

    @property
    def size(self) -> int:
        """Number of unknowns, 6 + 15 n."""
        return 6 + 15 * self.n

    @property
    def dw_A(self) -> slice:
        """Columns of the platform's angular acceleration; rows of its moment equation."""
        return slice(0, 3)

    @property
    def ddp_A(self) -> slice:
        """Columns of the acceleration of its centre of mass; rows of its force equation."""
        return slice(3, 6)

    def f(self, i: int) -> slice:
        """Columns of f_i."""
        return self._unknown(0, i)

    def tau(self, i: int) -> slice:
        """Columns of tau_i."""
        return self._unknown(1, i)

    def dw(self, i: int) -> slice:
        """Columns of dw_i; those of the platform for i = 0."""
        return self._unknown(2, i) if i else self.dw_A

    def ddp(self, i: int) -> slice:
        """Columns of ddp_i; the platform's, at its centre of mass, for i = 0."""
        return self._unknown(3, i) if i else self.ddp_A

    def ddp_c(self, i: int) -> slice:
        """Columns of ddp_i^c."""
        return self._unknown(4, i)

    def moment_rows(self, i: int) -> slice:
        """Rows of the moment equation of link i, first of eqs. (12) and (13)."""
        return self._equation(0, i) if i else self.dw_A

    def force_rows(self, i: int) -> slice:
        """Rows of the force equation of link i, second of eqs. (12) and (13)."""
        return self._equation(1, i) if i else self.ddp_A

    def angular_rows(self, i: int) -> slice:
        """Rows of the angular acceleration of link i, eq. (10)."""
        return self._equation(2, i)

    def com_rows(self, i: int) -> slice:
        """Rows of the acceleration of the centre of mass of link i, eq. (11)."""
        return self._equation(3, i)

    def origin_rows(self, i: int) -> slice:
        """Rows of the acceleration of the origin of {M_i}, eq. (11)."""
        return self._equation(4, i)

    def _unknown(self, group: int, i: int) -> slice:
        start = 6 + 3 * (group * self.n + i - 1)
        return slice(start, start + 3)

    def _equation(self, group: int, i: int) -> slice:
        start = 6 + 15 * (i - 1) + 3 * group
        return slice(start, start + 3)


@dataclass(frozen=True, eq=False)
class SystemSolution:
    """X_s of eq. (21) with its parts named; all in world axes.

    Attributes:
        X_s: The unknowns as the paper orders them, shape (..., 6 + 15 n).
        acceleration_W: [ddp_A, dw_A] of the ORIGIN of {A}, shape (..., 6).
        f: f_1..f_n, shape (..., n, 3) [N].
        tau: tau_1..tau_n, shape (..., n, 3) [N m].
        dw: dw_1..dw_n, shape (..., n, 3) [rad/s^2].
        ddp: ddp_1..ddp_n, shape (..., n, 3) [m/s^2].
        ddp_c: ddp^c_1..ddp^c_n, shape (..., n, 3) [m/s^2].
    """

    X_s: Array
    acceleration_W: Array
    f: Array
    tau: Array
    dw: Array
    ddp: Array
    ddp_c: Array


class MatrixSystem:
    """Eq. (21) in preallocated arrays: `assemble` for a state, then solve.

    Attributes:
        chain: Constants of the links.
        layout: Where unknowns and equations lie.
        M: Matrix, shape (..., 6 + 15 n, 6 + 15 n), rewritten by `assemble`.
        b: Right-hand side without the rotor wrench, shape (..., 6 + 15 n).
    """

    def __init__(self, chain: LinkChain, batch: tuple[int, ...] = ()) -> None:
        """Allocate, and write the blocks that never change.

        Args:
            chain: Constants of the links.
            batch: Shape of the leading axes; () for one state.
        """
        self.chain, self.layout = chain, SystemLayout(chain.n)
        N, at, eye = self.layout.size, self.layout, np.eye(3)
        self.M, self.b = np.zeros((*batch, N, N)), np.zeros((*batch, N))
        self._motion: Motion | None = None
        self._set(at.force_rows(0), at.ddp_A, chain.mass[..., 0, None, None] * eye)
        if chain.n:
            self._set(at.moment_rows(0), at.tau(1), eye)
            self._set(at.force_rows(0), at.f(1), eye)
        for i in range(1, chain.n + 1):
            self._set(at.moment_rows(i), at.tau(i), -eye)
            self._set(at.force_rows(i), at.f(i), -eye)
            self._set(at.force_rows(i), at.ddp_c(i), chain.mass[..., i, None, None] * eye)
            self._set(at.angular_rows(i), at.dw(i), eye)
            self._set(at.angular_rows(i), at.dw(i - 1), -eye)
            self._set(at.com_rows(i), at.ddp_c(i), eye)
            self._set(at.com_rows(i), at.ddp(i), -eye)
            self._set(at.origin_rows(i), at.ddp(i), eye)
            self._set(at.origin_rows(i), at.ddp(i - 1), -eye)
            if i < chain.n:
                self._set(at.moment_rows(i), at.tau(i + 1), eye)
                self._set(at.force_rows(i), at.f(i + 1), eye)

    @property
    def motion(self) -> Motion:
        """The state last assembled.

        Raises:
            FullamError: Nothing has been assembled.
        """
        if self._motion is None:
            raise FullamError("the system holds no state yet; call assemble() first")
        return self._motion

    def assemble(self, motion: Motion, ddtheta: Array, tool_wrench: Array | None = None) -> None:
        """Write the blocks of eqs. (22)-(25) that depend on the state, errata applied.

        Args:
            motion: Positions and velocities of the links.
            ddtheta: Joint accelerations, shape (..., n) [rad/s^2 or m/s^2].
            tool_wrench: f_{n+1}, tau_{n+1} on the environment, shape (..., 6); moved to the
                right-hand side, since they are known.
        """
        chain, at, n = self.chain, self.layout, self.chain.n
        self._motion = motion
        inertia = world_inertia(motion.R, chain.inertia)
        wIw, G = gyroscopic_moments(chain, motion), weights(chain)
        h = joint_angular_terms(chain, motion.R, motion.w, motion.dtheta, ddtheta)
        slide = joint_linear_terms(chain, motion.R, motion.w, motion.dtheta, ddtheta)
        for i in range(n + 1):
            self._set(at.moment_rows(i), at.dw(i), inertia[..., i, :, :])
            self.b[..., at.moment_rows(i)] = -wIw[..., i, :]
            self.b[..., at.force_rows(i)] = G[..., i, :]
            if i < n:
                r_out = motion.p[..., i + 1, :] - motion.p_c[..., i, :]
                self._set(at.moment_rows(i), at.f(i + 1), skew(r_out))
        if tool_wrench is not None:
            k, f_out, tau_out = chain.tool_link, tool_wrench[..., :3], tool_wrench[..., 3:]
            reach = motion.p[..., n + 1, :] - motion.p_c[..., k, :]
            self.b[..., at.moment_rows(k)] -= tau_out + cross(reach, f_out)
            self.b[..., at.force_rows(k)] -= f_out
        for i in range(1, n + 1):
            r_in = motion.p[..., i, :] - motion.p_c[..., i, :]
            self._set(at.moment_rows(i), at.f(i), -skew(r_in))
            self.b[..., at.angular_rows(i)] = h[..., i - 1, :]
            # -s_i^1 = s(R_i ^iP_i^c) and -s_i^2 = s(R_{i-1} ^{i-1}P_i) of eq. (25); the latter
            # starts at the platform's centre of mass for i = 1, as its ddp_A does.
            self._set(at.com_rows(i), at.dw(i), skew(-r_in))
            self.b[..., at.com_rows(i)] = centripetal(motion.w[..., i, :], -r_in)
            start = motion.p_c[..., 0, :] if i == 1 else motion.p[..., i - 1, :]
            lever = motion.p[..., i, :] - start
            self._set(at.origin_rows(i), at.dw(i - 1), skew(lever))
            self.b[..., at.origin_rows(i)] = (
                centripetal(motion.w[..., i - 1, :], lever) + slide[..., i - 1, :]
            )

    def solve_wrench(self, wrench_W: Array) -> SystemSolution:
        """Solve eq. (21) for the accelerations and joint wrenches under a rotor wrench.

        Args:
            wrench_W: Rotor wrench, world axes at the origin of {A}, shape (..., 6).

        Raises:
            FullamError: Nothing has been assembled.
        """
        motion = self.motion
        U_f = wrench_W[..., :3]
        b = np.array(np.broadcast_to(self.b, (*wrench_W.shape[:-1], self.layout.size)))
        b[..., self.layout.force_rows(0)] += U_f
        arm = motion.p_c[..., 0, :] - motion.p[..., 0, :]
        b[..., self.layout.moment_rows(0)] += wrench_W[..., 3:] - cross(arm, U_f)
        return self._solution(self.M, b)

    def solve_acceleration(self, acceleration_W: Array) -> SystemSolution:
        """Solve eq. (21) with the platform's rows replaced by its wanted acceleration.

        The algebraic loop of eqs. (20)-(22) does not arise: f_1 and tau_1 come out as they will
        be when the platform does accelerate so.

        Args:
            acceleration_W: [ddp_A, dw_A] of the origin of {A}, world axes, shape (..., 6).

        Raises:
            FullamError: Nothing has been assembled.
        """
        motion, at = self.motion, self.layout
        M = self.M.copy()
        M[..., :6, :] = 0.0
        M[..., :6, :6] = np.eye(6)
        b = np.array(np.broadcast_to(self.b, (*acceleration_W.shape[:-1], at.size)))
        dw = acceleration_W[..., 3:]
        b[..., at.dw_A] = dw
        b[..., at.ddp_A] = acceleration_W[..., :3] + self._from_origin(motion, dw)
        return self._solution(M, b)

    def condition_number(self) -> Array:
        """Condition number of the assembled matrix in the 2-norm, shape (...)."""
        return np.asarray(np.linalg.cond(self.M), dtype=np.float64)

    def _set(self, rows: slice, columns: slice, block: Array) -> None:
        self.M[..., rows, columns] = block

    @staticmethod
    def _from_origin(motion: Motion, dw: Array) -> Array:
        """ddp_A^c - ddp_A: what eq. (11) adds from the origin to the platform's centre of mass."""
        arm = motion.p_c[..., 0, :] - motion.p[..., 0, :]
        return cross(dw, arm) + centripetal(motion.w[..., 0, :], arm)

    def _solution(self, M: Array, b: Array) -> SystemSolution:
        at, n = self.layout, self.chain.n
        X_s = np.asarray(np.linalg.solve(M, b[..., None])[..., 0], dtype=np.float64)
        dw_A = X_s[..., at.dw_A]
        ddp_A = X_s[..., at.ddp_A] - self._from_origin(self.motion, dw_A)
        groups = X_s[..., 6:].reshape(*X_s.shape[:-1], 5, n, 3)
        return SystemSolution(
            X_s,
            np.concatenate([ddp_A, dw_A], axis=-1),
            *(groups[..., k, :, :] for k in range(5)),
        )


def platform_inertia(chain: LinkChain, motion: Motion) -> Array:
    """Inertia of the platform alone about the origin of {A}, the matrix of eq. (26); (..., 6, 6).

    blkdiag(m_A 1, I_A) with the centre of mass at the origin, as in the paper; in general
    [[m 1, -m s(c)], [m s(c), I - m s(c) s(c)]] with c = p_A^c - p_A, all in world axes.
    """
    s = skew(motion.p_c[..., 0, :] - motion.p[..., 0, :])
    ms = chain.mass[..., 0, None, None] * s
    inertia = world_inertia(motion.R[..., 0, :, :], chain.inertia[..., 0, :, :])
    M = np.zeros((*inertia.shape[:-2], 6, 6))
    M[..., :3, :3] = chain.mass[..., 0, None, None] * np.eye(3)
    M[..., :3, 3:], M[..., 3:, :3], M[..., 3:, 3:] = -ms, ms, inertia - ms @ s
    return M


def compensation(
    chain: LinkChain,
    motion: Motion,
    f_1: Array,
    tau_1: Array,
    tool_wrench: Array | None = None,
) -> Array:
    """Compensation u_dc of eq. (20), errata applied: force then moment, force row f_1 - G_A.

    At the platform's centre of mass the equation reads

        u_dc = [f_1 - m_A g; w_A x I_A w_A + tau_1 + r_A^out x f_1].

    Here it is taken at the origin of {A}, where the wanted acceleration and the rotor wrench are
    given: the force row gains m_A w x (w x c), c = p_A^c - p_A, and the moment row c x force.
    With c = 0 nothing changes. `platform_inertia` times the wanted acceleration plus u_dc is
    then the wrench of eq. (12) exactly.

    Args:
        chain: Constants of the links.
        motion: Positions and velocities of the links.
        f_1: Force of the platform on link 1, shape (..., 3) [N].
        tau_1: Moment of the platform on link 1, shape (..., 3) [N m].
        tool_wrench: f_{n+1}, tau_{n+1} on the environment, shape (..., 6). It counts here only
            when the tool of a vehicle with an arm is on the platform; f_1, tau_1 hold it else.

    Returns:
        u_dc in world axes at the origin of {A}, shape (..., 6).
    """
    com = motion.p_c[..., 0, :]
    c = com - motion.p[..., 0, :]
    m, g = chain.mass[..., 0, None], chain.gravity
    force = f_1 - m * g + m * centripetal(motion.w[..., 0, :], c)
    wIw = gyroscopic_moments(chain, motion)[..., 0, :]
    moment = wIw + tau_1 + cross(motion.p[..., 1, :] - com, f_1)
    if chain.n and chain.tool_link == 0 and tool_wrench is not None:
        f_out = tool_wrench[..., :3]
        force = force + f_out
        moment = moment + tool_wrench[..., 3:] + cross(motion.p[..., -1, :] - com, f_out)
    return np.concatenate([force, moment + cross(c, force)], axis=-1)
