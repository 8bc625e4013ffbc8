"""A load that is known, carried beside the law: its weight and what it takes to move it.

The law flies the nominal vehicle without the load. What the load adds to the inverse dynamics of
platform and arm, at the acceleration of the target and with the arm as it moves,

    u_load = u(with the load; dv_target) - u(without; dv_target),

is added to its command, at the origin of {A}; and it is told of what was delivered less that. So
any law carries a load, whatever it knows of models, and cancels nothing twice: to its observer
load and u_load are no wrench.

The error that the law feeds back is not multiplied with the load's inertia. It might be, by telling
the law's own model; but an arm on servos gives way, and what hangs at its end does not follow the
platform as fast as the law answers. With 0.2 kg at the default vehicle's AX-12As dc-PID, whose
model was told, circled at 20 deg behind the first-order filter in paper weather (at 4 deg on servos
16 times as stiff), and dc-PID+ was up to 17 mm off after the pick-up, against 13 mm untold.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.control.signals import Command, Delivery
from fullam.dynamics.recursion import Chain, root_wrench
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import add_spatial, subtract_spatial
from fullam.numbers.kernel import kernel


class LiftView(NamedTuple):
    """What `lift` is shown.

    Gravity, one row; links with and without the load; joints, and rows of them in a control period;
    estimate and target. Rewritten is the command; written is u_load.
    """

    gravity: Any
    loaded: Any
    bare: Any
    joints: Any
    joint_rows: Any
    estimate: Any
    target: Any
    command: Any
    lift: Any


class ShareView(NamedTuple):
    """What `share` is shown: what was delivered, u_load, and where the law's share is written."""

    delivery: Any
    lift: Any
    share: Any


@kernel
def lift(view, k):
    """Add to the command of period k what the load takes; see the module's text."""
    estimate, command = view.estimate[0], view.command[0]
    R, w = rotation_matrix(estimate.pose.attitude), estimate.velocity.angular
    a, g = view.target[0].acceleration, view.gravity[0]
    joints = view.joints[k * int(view.joint_rows[0])]
    loaded, _ = root_wrench(Chain(view.loaded, joints), R, w, a, g)
    bare, _ = root_wrench(Chain(view.bare, joints), R, w, a, g)
    own = subtract_spatial(loaded, bare)
    view.lift[0] = own
    view.command[0] = Command(add_spatial(command.wrench, own), command.u_pid, command.u_dc)


@kernel
def share(view, k):
    """What the law got of its own command."""
    delivery = view.delivery[0]
    wrench = subtract_spatial(delivery.wrench, view.lift[0])
    view.share[0] = Delivery(wrench, delivery.missing, delivery.saturated)
