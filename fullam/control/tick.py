"""One control period without sensors: law, turn to {A}, allocation, rotor speeds."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.control.allocation import Allocator, allocation_memory
from fullam.control.controller import Controller, Measurement, ReferencePoint
from fullam.control.delivery import AllocateView, allocate_command
from fullam.control.law import (
    CommandView,
    InformView,
    KernelLaw,
    LawStage,
    command_stage,
    inform_stage,
)
from fullam.control.signals import (
    FOREVER,
    Ahead,
    Command,
    Delivery,
    Estimate,
    Status,
    Target,
)
from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.placing import PlaceView, place
from fullam.dynamics.recursion import Joint, JointMotion
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial, rotate_spatial
from fullam.exceptions import NonFiniteCenter, NonFiniteWrench
from fullam.model.chain import LinkChain
from fullam.numbers.kernel import kernel
from fullam.numbers.machine_code import available
from fullam.numbers.program import Lists, Stage, program
from fullam.numbers.records import Rows, size
from fullam.numbers.vectors import Vector

Array = NDArray[np.float64]

ROWS = 2
"""Rows of what has one a period: a law starts in period 0, and all others are period 1."""


class TakeView(NamedTuple):
    """What `take` is shown: a measurement in its parts, and where it goes."""

    pose: Any
    twist: Any
    positions: Any
    rates: Any
    accelerations: Any
    estimate: Any
    motions: Any


@kernel
def take(view, k):
    """A measurement as estimate and motion of the arm; velocities come in {A} axes."""
    pose = view.pose[0]
    velocity = rotate_spatial(rotation_matrix(pose.attitude), view.twist[0])
    view.estimate[0] = Estimate(pose, velocity)
    for i in range(len(view.positions)):
        motion = JointMotion(view.positions[i], view.rates[i], view.accelerations[i])
        view.motions[k][i] = motion


class ControlTick:
    """A controller and its allocation: from measurement and reference to rotor speeds.

    This is what runs on a flight computer, and what a simulated flight does once a period. A law
    written as kernels runs as machine code where that can be had. A wrench out of reach is
    allocated about the vehicle's centre of mass, and the law is told what it got. Copies and
    pickles begin afresh, as those of a controller do.

    Attributes:
        controller: The law.
        compiled: Whether machine code runs.
    """

    def __init__(
        self, controller: Controller, allocator: Allocator, compiled: bool | None = None
    ) -> None:
        """Bind the two.

        Args:
            controller: The law.
            allocator: The allocation.
            compiled: Whether machine code shall run; None where it can be had and the law is
                written as kernels.
        """
        self.controller, self._allocator = controller, allocator
        if compiled is None:
            compiled = available() and isinstance(controller, KernelLaw)
        self.compiled = compiled
        vehicle = controller.vehicle
        n, rotors = vehicle.n_arm, vehicle.rotors.count
        widths = 7, n, 6, n, n, size(Target)
        self._inputs = np.zeros(sum(widths))
        parts = np.split(self._inputs, np.cumsum(widths)[:-1])
        pose, positions, twist, rates, accelerations, target = parts
        links = LinkRows.of(LinkChain.from_model(vehicle.model)).rows
        self._estimate, motions = Rows.empty(Estimate, 1), Rows.empty(JointMotion, ROWS, n)
        joints, centers = Rows.empty(Joint, ROWS, n), Rows.empty(Vector, ROWS)
        self._targets, self._ahead = Rows.empty(Target, ROWS), Rows.empty(Ahead, ROWS)
        self._command, self._delivery = Rows.empty(Command, 1), Rows.empty(Delivery, 1)
        self._residual, self._status = Rows.empty(Spatial, 1), Rows(Status, [[FOREVER, 0.0]])
        self._memory, once = allocation_memory(rotors), Rows(float, [[1.0]])
        self._taken = TakeView(
            Rows(Pose, pose[None]),
            Rows(Spatial, twist[None]),
            Rows(float, positions[:, None]),
            Rows(float, rates[:, None]),
            Rows(float, accelerations[:, None]),
            self._estimate,
            motions,
        )
        self._target = target
        allocating = AllocateView(
            allocator.problem(),
            self._memory,
            self._estimate,
            self._ahead,
            self._command,
            centers,
            once,
            self._status,
            self._delivery,
            self._residual,
        )
        self._taking = Stage(take, self._taken)
        self._placing = Stage(place, PlaceView(links, motions, joints, centers))
        self._allocating = Stage(allocate_command, allocating)
        self._is_first = True
