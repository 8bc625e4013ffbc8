"""The Pinocchio counterpart of the paper's equations: the engine that flies, and their witness.

Shares no code with `newton_euler`, `kinematics` or `matrix_system`. At this boundary q, v and a
are Pinocchio's: q = [p, quaternion xyzw, theta], v = [v_A, w_A, dtheta] in body axes, a its
coordinate derivative (so a[:3] is R^T ddp_A - w x v_A, not the classical acceleration; the two
functions `body_acceleration` and `world_acceleration` convert). A wrench is force then moment:
`wrench_A` in the axes of {A} at its origin, `wrench_W` in world axes, also at the origin of {A}.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.exceptions import UnknownName, VehicleError

if TYPE_CHECKING:
    from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

ROOT = 1
"""Index of the free-flyer joint in a Pinocchio model; the arm's joints follow it."""


def rotation_of(q: Array) -> Array:
    """Attitude R_WA of a configuration, shape (3, 3)."""
    return pin.Quaternion(q[3:7]).toRotationMatrix()


def body_acceleration(q: Array, v: Array, acceleration_W: Array) -> Array:
    """Pinocchio's base acceleration from the classical one in world axes.

    Args:
        q: Configuration, shape (nq,).
        v: Velocity in body axes, shape (nv,).
        acceleration_W: [ddp_A, dw_A] of the origin of {A} in world axes, shape (6,).

    Returns:
        [R^T ddp_A - w_A x v_A, R^T dw_A] in body axes, shape (6,).
    """
    R_AW = rotation_of(q).T
    linear = R_AW @ acceleration_W[:3] - pin.skew(v[3:6]) @ v[:3]
    return np.concatenate([linear, R_AW @ acceleration_W[3:]])


def world_acceleration(q: Array, v: Array, a_A: Array) -> Array:
    """Classical acceleration [ddp_A, dw_A] in world axes, the inverse of `body_acceleration`."""
    R_WA = rotation_of(q)
    return np.concatenate([R_WA @ (a_A[:3] + pin.skew(v[3:6]) @ v[:3]), R_WA @ a_A[3:6]])


class Multibody:
    """Rigid-body dynamics of platform and arm with prescribed joint motion, by Pinocchio.

    The tool wrench is that of the end link ON the environment (f_{n+1}, tau_{n+1} of eq. (13)),
    in world axes at the origin of the tool frame. Every method returns arrays of its own.

    Attributes:
        model: The Pinocchio model, free flyer first, then a serial arm.
        data: Its workspace, owned by this object; not to be shared between threads.
        n_arm: Number of arm joints.
    """

    def __init__(self, vehicle: Vehicle | pin.Model, tool: str | None = None) -> None:
        """Own a workspace for the model.

        Args:
            vehicle: A vehicle, or a bare model with a free flyer and a serial arm.
            tool: Frame where the tool wrench acts; a vehicle brings its own, a bare model
                without one takes the origin of the last joint.

        Raises:
            VehicleError: The model does not begin with a free flyer.
            UnknownName: There is no such tool frame.
        """
        if isinstance(vehicle, pin.Model):
            self.model = vehicle
        else:
            self.model, tool = vehicle.model, vehicle.tool if tool is None else tool
        if self.model.njoints < 2 or self.model.joints[ROOT].shortname() != "JointModelFreeFlyer":
            raise VehicleError(
                self.model.name, "root joint", "is no free flyer", "load it with a free-flyer root"
            )
        self.data = self.model.createData()
        self.n_arm: int = self.model.njoints - 2
        self._last = self.model.njoints - 1
        self._tool = np.zeros(3)
        if tool is not None:
            if not self.model.existFrame(tool):
                raise UnknownName("frame", tool, [frame.name for frame in self.model.frames])
            frame = self.model.frames[self.model.getFrameId(tool)]
            self._last = frame.parentJoint
            self._tool = frame.placement.translation.copy()
        self._external = pin.StdVec_Force()
        self._external.extend([pin.Force.Zero() for _ in range(self.model.njoints)])
        self._a = np.zeros(self.model.nv)

    def base_acceleration(
        self,
        q: Array,
        v: Array,
        ddtheta: Array,
        wrench_A: Array,
        tool_wrench: Array | None = None,
    ) -> Array:
        """Acceleration of the platform under a rotor wrench, the joint motion being prescribed.

        Solves M_bb a_b = wrench_A - (M_bj ddtheta + h_b), the first six rows of the equations of
        motion, with M_bb from the composite rigid body and the bracket from RNEA at a_b = 0.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
            ddtheta: Joint accelerations, shape (n,) [rad/s^2].
            wrench_A: Wrench of the rotors (and of whatever else pushes) in {A}, shape (6,).
            tool_wrench: Wrench on the environment at the tool, world axes, shape (6,).

        Returns:
            Body acceleration in Pinocchio's convention, shape (6,).
        """
        self._a[:6] = 0.0
        self._a[6:] = ddtheta
        bias = self._rnea(q, v, self._a, tool_wrench)[:6]
        # crba fills the upper triangle only, but a joint's own diagonal block in full.
        mass = pin.crba(self.model, self.data, q)[:6, :6]
        return np.linalg.solve(mass, wrench_A - bias)

    def root_wrench(self, q: Array, v: Array, a: Array, tool_wrench: Array | None = None) -> Array:
        """Wrench on the platform that produces the acceleration a, by RNEA; wrench_A, (6,).

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
            a: Full acceleration [a_b, ddtheta], shape (nv,).
            tool_wrench: Wrench on the environment at the tool, world axes, shape (6,).
        """
        return self._rnea(q, v, a, tool_wrench)[:6].copy()

    def joint_wrenches(
        self, q: Array, v: Array, a: Array, tool_wrench: Array | None = None
    ) -> tuple[Array, Array]:
        """Force and moment of link i-1 on link i, in world axes, at the origin of {M_i}.

        Arguments as in `root_wrench`.

        Returns:
            f [N] and tau [N m], each of shape (n, 3).
        """
        self._rnea(q, v, a, tool_wrench)
        # rnea refreshes data.f and liMi, but not the world placements.
        pin.forwardKinematics(self.model, self.data, q)
        f, tau = np.empty((self.n_arm, 3)), np.empty((self.n_arm, 3))
        for i in range(self.n_arm):
            R = self.data.oMi[ROOT + 1 + i].rotation
            force = self.data.f[ROOT + 1 + i]
            f[i], tau[i] = R @ force.linear, R @ force.angular
        return f, tau

    def platform_inertia(self, q: Array) -> Array:
        """Spatial inertia of the platform alone about the origin of {A}, in world axes, (6, 6).

        Equals blkdiag(m_A 1, I_A), the matrix of eq. (26), when the platform's centre of mass is
        at the origin; otherwise [[m 1, -m s(c)], [m s(c), I - m s(c) s(c)]] with c = R_WA c_A.
        """
        turn = pin.SE3(rotation_of(q), np.zeros(3))
        return turn.act(self.model.inertias[ROOT]).matrix()

    def compensation(self, q: Array, v: Array, a: Array, tool_wrench: Array | None = None) -> Array:
        """Compensation u_dc of eq. (20) in world axes at the origin of {A}, force then moment.

        What the platform must be given beside its own inertia times the wanted acceleration:

            u_dc = [m w x (w x c) - m g + f_1;
                    w x I_O w - c x m g + tau_1 + (p_1 - p_A) x f_1],

        with c the platform's centre of mass seen from the origin and I_O its inertia about the
        origin. With c = 0 this is eq. (20) with its erratum; for every c

            platform_inertia(q) @ [ddp_A, dw_A] + u_dc = root wrench, in world axes, exactly.

        f_1 and tau_1 are those at the acceleration a. Arguments as in `root_wrench`.

        Returns:
            u_dc, shape (6,).
        """
        self._rnea(q, v, a, tool_wrench)
        R_WA = rotation_of(q)
        inertia = self.model.inertias[ROOT]
        spin = pin.Motion(np.zeros(3), v[3:6])
        gravity = pin.Motion(R_WA.T @ self.model.gravity.linear, np.zeros(3))
        u_dc = spin.cross(inertia * spin) - inertia * gravity
        for joint in range(ROOT + 1, self.model.njoints):
            if self.model.parents[joint] == ROOT:
                u_dc += self.data.liMi[joint].act(self.data.f[joint])
        if self._last == ROOT:
            u_dc -= self._external[ROOT]
        return np.concatenate([R_WA @ u_dc.linear, R_WA @ u_dc.angular])

    def _rnea(self, q: Array, v: Array, a: Array, tool_wrench: Array | None) -> Array:
        """RNEA with the environment's reaction on the end link; a live view."""
        if tool_wrench is None:
            if self._last == ROOT:
                self._external[ROOT] = pin.Force.Zero()
            return pin.rnea(self.model, self.data, q, v, a)
        pin.forwardKinematics(self.model, self.data, q)
        R = self.data.oMi[self._last].rotation
        force = -(R.T @ tool_wrench[:3])
        moment = -(R.T @ tool_wrench[3:]) + pin.skew(self._tool) @ force
        self._external[self._last] = pin.Force(force, moment)
        return pin.rnea(self.model, self.data, q, v, a, self._external)
