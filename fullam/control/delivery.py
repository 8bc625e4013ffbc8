"""From a command to what the rotors deliver: the stage of a control period that allocates."""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.control.ladder import allocate
from fullam.control.signals import NOT_FINITE, Delivery, ended
from fullam.dynamics.so3 import boxplus, rotation_matrix
from fullam.dynamics.spatial import (
    Spatial,
    rotate_spatial,
    rotate_spatial_back,
    subtract_spatial,
)
from fullam.numbers.kernel import absolute, kernel, select
from fullam.numbers.vectors import ZERO

LARGEST = 1e300
"""A wrench beyond this is not finite."""


class AllocateView(NamedTuple):
    """What `allocate_command` is shown: rows.

    The allocation and its memory; the estimate; `Ahead`, whose turn brings the attitude to when the
    rotors will have followed; the command; centres of mass, and rows of them in a control period.
    Written are the status, the delivery, and what was delivered less what was asked for in {A}.
    """

    problem: Any
    memory: Any
    estimate: Any
    ahead: Any
    command: Any
    centers: Any
    joint_rows: Any
    status: Any
    delivery: Any
    residual: Any


@kernel
def allocate_command(view, k):
    """Turn the command to {A} and allocate it; what came of it goes to `delivery`."""
    command = view.command[0].wrench
    R = rotation_matrix(boxplus(view.estimate[0].pose.attitude, view.ahead[k].turn))
    asked = rotate_spatial_back(R, command)
    f, m, center = asked.linear, asked.angular, view.centers[k * int(view.joint_rows[0])]
    wanted = f[0] + f[1] + f[2] + m[0] + m[1] + m[2]
    finite = absolute(wanted + (center[0] + center[1] + center[2])) < LARGEST
    status = ended(view.status[0], finite, k, NOT_FINITE)
    view.status[0] = status
    flying = status.end > k
    achieved, missing, short = allocate(view.problem, view.memory, asked, center, flying)
    residual = subtract_spatial(achieved, asked)
    view.residual[0] = select(short, residual, Spatial(ZERO, ZERO))
    view.delivery[0] = Delivery(
        rotate_spatial(R, achieved), rotate_spatial(R, missing), select(short, 1.0, 0.0)
    )
