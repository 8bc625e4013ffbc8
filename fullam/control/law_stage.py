"""The law as stages of a control period that Python runs: anybody's `Controller`, or kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.checks import shown
from fullam.control.controller import Controller, Measurement, ReferencePoint
from fullam.control.law import KernelLaw, chain_at, flies_as_kernels
from fullam.control.signals import Command, Estimate, Target
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Spatial, rotate_spatial_back
from fullam.exceptions import SettingsError
from fullam.numbers.records import flat, record

Array = NDArray[np.float64]


def _six(law: Controller, name: str, part: Any) -> Spatial:
    """Six numbers of anybody's law as a record."""
    try:
        numbers = np.asarray(part)
    except (TypeError, ValueError):  # rows of different lengths, say
        numbers = np.zeros(0)
    if numbers.shape != (6,) or numbers.dtype.kind not in "fiub":
        problem = f"is {shown(part)}"
        if numbers.size:
            problem += f", of shape {numbers.shape} and type {numbers.dtype}"
        remedy = "return or set six numbers, linear then angular, world axes"
        raise SettingsError(f"controller '{law.name}'", name, problem, remedy)
    return record(Spatial, numbers)


class LawStage:
    """Asks a law for a wrench, and tells it what it did not get.

    Attributes:
        t: Time of the next command [s]; None counts control periods.
    """

    def __init__(self, law: Controller) -> None:
        """Begin anew."""
        self._law, self._as_kernels = law, flies_as_kernels(type(law))
        self._measurement, self._reference = Measurement(law.vehicle), ReferencePoint()
        m = self._measurement
        self._told = m.q, m.v, m.arm_acceleration
        self.t: float | None = None
        self._begins = True

    def command(self, view: Any, k: int) -> None:
        """Ask for a wrench, given a `CommandView` whose joints are `JointMotion`s."""
        law, estimate, target = self._law, view.estimate[0], view.target[0]
        motions = view.joints[k * int(view.joint_rows[0])]
        begins, self._begins = k == 0 or self._begins, False
        if self._as_kernels:
            assert isinstance(law, KernelLaw)
            if begins:
                law.forget()
            view.command[0] = law.command(law.chain(motions), estimate, target)
            return
        self._tell(estimate, target, motions)
        if begins:
            law.reset(self._measurement, self._reference)
        t = k * law.period if self.t is None else self.t
        wrench = law.wrench(t, self._measurement, self._reference)
        parts = {"wrench": wrench, "u_pid": law.u_pid, "u_dc": law.u_dc}
        view.command[0] = Command(*(_six(law, name, part) for name, part in parts.items()))

    def inform(self, deliveries: Any, k: int) -> None:
        """Tell the law what it did not get, given one row of `Delivery`."""
        delivery = deliveries[0]
        if delivery.saturated == 0.0:
            return
        if self._as_kernels:
            assert isinstance(self._law, KernelLaw)
            self._law.inform(delivery)
        else:
            self._law.delivered(*(np.array(flat(part)) for part in delivery[:2]))

    def relieve(self, view: Any, k: int) -> None:
        """Tell of what somebody else has taken over, given a `RelieveView`."""
        if isinstance(self._law, KernelLaw):
            self._law.relieve(chain_at(view, k), view.estimate[0], view.wrench[0])

    def _tell(self, estimate: Estimate, target: Target, motions: Any) -> None:
        """Estimate, target and motion of the arm as the arrays of a `Controller`."""
        m, reference = self._measurement, self._reference
        m.q, m.v, m.arm_acceleration = self._told  # a law may have put others in their place
        R = rotation_matrix(estimate.pose.attitude)
        m.q[:7] = flat(estimate.pose)
        m.v[:6] = flat(rotate_spatial_back(R, estimate.velocity))
        for i, motion in enumerate(motions):
            m.q[7 + i], m.v[6 + i], m.arm_acceleration[i] = motion
        reference.pose = np.array(flat(target.pose))
        reference.velocity = np.array(flat(target.velocity))
        reference.acceleration = np.array(flat(target.acceleration))
