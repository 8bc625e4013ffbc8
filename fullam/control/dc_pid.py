"""Dynamic-compensation PID, eqs. (20) and (26): the paper's controller.

u = blkdiag(m_A 1, I_A) u_pid + u_dc, where u_dc cancels the platform's gyroscopic moment and
weight and the wrench (f_1, tau_1) that the arm puts on the platform through joint 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from pinocchio import rnea

from fullam.control.controller import (
    ALL_AXES,
    Measurement,
    ReferencePoint,
    register,
)
from fullam.control.pid import PidBase, PidSettings
from fullam.dynamics.multibody import Multibody
from fullam.dynamics.paper_model import PaperModel
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

COMPENSATIONS = ("desired_acceleration", "previous_wrench")
MODELS = ("pinocchio", "newton-euler")


@dataclass(frozen=True)
class DcPidSettings(PidSettings):
    """Settings of dc-PID: those of the PID, and how the compensation is had.

    Attributes:
        compensation: How the algebraic loop of eqs. (20)-(22) is cut. "desired_acceleration" puts
            u_pid in the platform's rows: exact, no loop. "previous_wrench" solves eq. (21) with
            the wrench at hand, which is the one applied last with its u_pid renewed (the paper's
            text): a fixed-point iteration over the periods that contracts by the arm's share of
            mass and inertia. Where that share is near one (hextilt: a heavy arm under a light
            platform) it settles slower than the flight moves; choose the first there.
        rounds: Solutions of eq. (21) per period with "previous_wrench"; the paper has one.
        model: What yields f_1, tau_1: "pinocchio" or the paper's own "newton-euler" matrix solve.
    """

    compensation: Literal["desired_acceleration", "previous_wrench"] = "desired_acceleration"
    model: Literal["pinocchio", "newton-euler"] = "pinocchio"
    rounds: int = 3

    def __post_init__(self) -> None:
        """Check the choices, then the PID's own settings."""
        super().__post_init__()
        if not (isinstance(self.rounds, int) and self.rounds >= 1):
            raise self._wrong("rounds", "give a whole number, 1 or more")
        for field, known in (("compensation", COMPENSATIONS), ("model", MODELS)):
            if getattr(self, field) not in known:
                raise self._wrong(field, f"give one of {', '.join(known)}")


class JointOneCompensation:
    """u_dc of eq. (20) read from Pinocchio's spatial force at arm joint 1.

    RNEA at (q, v, [a_A, ddtheta]) leaves the force of the platform on link 1 in `data.f`. Carried
    to {A} and joined by the platform's own weight and gyroscopic terms it is, at the origin of
    {A} and in its axes,

        u_dc = [f_1 - m_A g + m_A w x (w x c);
                tau_1 + r x f_1 + w x I_A w - m_A c x g]

    with the platform's mass m_A, centre of mass c and inertia I_A about the origin of {A}. For
    c = 0 this is eq. (20) with its erratum. Adding M_A a_A, the platform's own 6 x 6 inertia times
    the wanted acceleration, gives the wrench of eq. (26).

    Velocity invariance saves the conversion of accelerations: with the linear velocity of {A} set
    to zero (a frame moving along), spatial and classical acceleration are the same numbers.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        """Take the views of Pinocchio's data once: fetching one costs as much as a product."""
        model = vehicle.model
        self.model, self.data = model, vehicle.create_data()
        self.q: Array = vehicle.neutral()
        self.v: Array = np.zeros(model.nv)
        self.a: Array = np.zeros(model.nv)
        self.platform: Array = np.array(model.inertias[1].matrix())
        self.platform.setflags(write=False)
        self._gravity = np.array(model.gravity.linear)
        self._mass_lever = model.inertias[1].mass * np.array(model.inertias[1].lever)
        self._rotational = self.platform[3:, 3:].copy()
        self._mass = model.inertias[1].mass
        self._has_arm = model.njoints > 2
        if self._has_arm:
            placement = model.jointPlacements[2].translation
            self._lever = np.array(pin.skew(placement))
            self._force_1 = self.data.f[2].vector.reshape(2, 3)
            self._R_A1 = self.data.liMi[2].rotation

    def wrench(self, R_WA: Array, out: Array) -> Array:
        """u_dc in {A} axes at the origin of {A} for the q, v, a in this object's buffers.

        Args:
            R_WA: Attitude of {A} that belongs to q, shape (3, 3).
            out: Where to write it, shape (6,) [N, N m].

        `v[:3]` must be zero and `a[:3]` is the classical acceleration of the origin
        of {A} in {A} axes.
        """
        pin.rnea(self.model, self.data, self.q, self.v, self.a)
        w = self.v[3:6]
        g_A = self._gravity @ R_WA
        spin = pin.skew(w)
        out[:3] = spin @ (spin @ self._mass_lever) - self._mass * g_A
        out[3:] = spin @ (self._rotational @ w) - pin.skew(self._mass_lever) @ g_A
        if self._has_arm:
            force, moment = self._force_1 @ self._R_A1.T
            out[:3] += force
            out[3:] += moment + self._lever @ force
        return out


@register("dc-pid")
class DcPid(PidBase):
    """The paper's dc-PID, eq. (26): PID and the arm's wrench fed forward."""

    Settings = DcPidSettings
    settings: DcPidSettings
    _u_dc: Array
    _u_dc_is_due: bool = False

    def __init__(
        self,
        vehicle: Vehicle,
        settings: DcPidSettings | None = None,
        period: float = 0.01,
        axes: tuple[bool, ...] = ALL_AXES,
    ) -> None:
        """Bind the law; see `Controller`."""
        super().__init__(vehicle, settings, period, axes)
        self._joint_one = JointOneCompensation(vehicle)
        self._multibody = Multibody(vehicle)
        self._paper = PaperModel(vehicle) if self.settings.model == "newton-euler" else None
        self._previous = self.settings.compensation == "previous_wrench"
        self._at_hand_A: Array | None = None
        self._at_root = not self._previous and self._paper is None
        engine = self._joint_one
        self._a_A: Array = engine.a[:6]  # u_pid goes straight into the input of RNEA
        self._a_A_rows = self._a_A.reshape(2, 3)
        self._root_A: Array = engine.data.tau[:6]
        self._root_A_rows = self._root_A.reshape(2, 3)
        self._u_dc_A: Array = np.zeros(6)
        self._u_dc_A_rows = self._u_dc_A.reshape(2, 3)
        self._u_pid_rows, self._u_dc_rows = self.u_pid.reshape(2, 3), self.u_dc.reshape(2, 3)
        self._wrench_rows = self._wrench.reshape(2, 3)
        self._R_AW = self.law.rotation.T
        self._inertial_A: Array = np.zeros(6)

    def reset(self, measurement: Measurement, reference: ReferencePoint) -> None:
        """Empty the integrator and forget the wrench applied last."""
        super().reset(measurement, reference)
        self._at_hand_A = None

    def wrench(self, t: float, measurement: Measurement, reference: ReferencePoint) -> Array:
        """Wrench u of eq. (26), world axes at the origin of {A}; see `Controller.wrench`."""
        self.law.acceleration(measurement, reference, self.u_pid)
        if self._at_root:
            return self._root_wrench(measurement)
        a_W, R, u, a_A = self.u_pid, self.law.rotation, self._wrench, self._a_A
        platform = self._joint_one.platform
        if self._at_hand_A is not None:
            # The wrench applied last, with this period's u_pid in the place of the last one's.
            self._at_hand_A -= platform @ a_A
        np.dot(a_W.reshape(2, 3), R, out=a_A.reshape(2, 3))
        inertial_A = platform @ a_A
        if self._at_hand_A is not None:
            self._at_hand_A += inertial_A
        u_dc_A = self._compensation(measurement)
        if self._at_hand_A is not None:
            for _ in range(self.settings.rounds - 1):
                np.add(inertial_A, u_dc_A, out=self._at_hand_A)
                u_dc_A = self._compensation(measurement)
        inertial_A += u_dc_A
        np.dot(inertial_A.reshape(2, 3), R.T, out=u.reshape(2, 3))
        np.dot(u_dc_A.reshape(2, 3), R.T, out=self.u_dc.reshape(2, 3))
        if self._bounded:
            self._bound()
        if self._previous:
            self._at_hand_A = np.dot(u.reshape(2, 3), R).ravel()
        return u

    @property
    def u_dc(self) -> Array:
        """Compensation of the last tick, world axes, (6,), live; made when it is asked for."""
        if self._u_dc_is_due:
            self._joint_one.platform.dot(self._a_A, self._inertial_A)
            np.subtract(self._root_A, self._inertial_A, self._u_dc_A)
            self._u_dc_A_rows.dot(self._R_AW, self._u_dc_rows)
            self._u_dc_is_due = False
        return self._u_dc

    @u_dc.setter
    def u_dc(self, buffer: Array) -> None:
        self._u_dc = buffer
        self._u_dc_is_due = False

    def _root_wrench(self, m: Measurement) -> Array:
        """Wrench u of eq. (26) as the root's generalised force: the same sum, read at its end.

        RNEA adds the platform's own share to the arm's on its way to the root, so blkdiag(m_A 1,
        I_A) u_pid + u_dc is what it leaves in `tau[:6]`, and u_dc the difference of the two.
        `JointOneCompensation` reads u_dc at joint 1, as eq. (20) has it; a test holds the one to
        the other.
        """
        engine = self._joint_one
        self._u_pid_rows.dot(self.law.rotation, self._a_A_rows)
        engine.v[3:] = m.v[3:]
        engine.a[6:] = m.arm_acceleration
        rnea(engine.model, engine.data, m.q, engine.v, engine.a)
        self._root_A_rows.dot(self._R_AW, self._wrench_rows)
        self._u_dc_is_due = True
        if self._bounded:
            self._bound()
        return self._wrench

    def delivered(self, wrench_W: Array, missing_W: Array) -> None:
        """Anti-windup, and the wrench that "previous_wrench" will solve eq. (21) with."""
        super().delivered(wrench_W, missing_W)
        if self._previous:
            self._at_hand_A = np.dot(wrench_W.reshape(2, 3), self.law.rotation).ravel()

    def _compensation(self, m: Measurement) -> Array:
        """u_dc in {A} axes; the first period has no wrench at hand and uses u_pid."""
        if self._paper is not None:
            return self._paper_compensation(self._paper, m)
        engine = self._joint_one
        engine.q[:] = m.q
        engine.v[3:] = m.v[3:]
        engine.a[6:] = m.arm_acceleration
        if self._at_hand_A is None:
            return engine.wrench(self.law.rotation, self._u_dc_A)
        wanted = self._a_A.copy()
        self._a_A[:] = self._multibody.base_acceleration(
            engine.q, engine.v, m.arm_acceleration, self._at_hand_A
        )
        u_dc_A = engine.wrench(self.law.rotation, self._u_dc_A)
        self._a_A[:] = wanted
        return u_dc_A

    def _paper_compensation(self, paper: PaperModel, m: Measurement) -> Array:
        """u_dc in {A} axes by the paper's matrix system, eqs. (20)-(25)."""
        R = self.law.rotation
        at_hand = self._at_hand_A
        u_dc_W = paper.compensation(
            m.q,
            m.v,
            m.arm_acceleration,
            acceleration_W=self.u_pid if at_hand is None else None,
            wrench_W=None if at_hand is None else (at_hand.reshape(2, 3) @ R.T).ravel(),
        )
        return np.dot(u_dc_W.reshape(2, 3), R).ravel()
