"""What the controller knows of that hangs at the tool, and what it does about it."""

from __future__ import annotations

from collections.abc import Sequence

from fullam.control.payload_lift import LiftView, ShareView, lift, share
from fullam.control.signals import Delivery
from fullam.dynamics.recursion import Link
from fullam.dynamics.spatial import Spatial
from fullam.model.vehicle import Vehicle
from fullam.numbers.program import Stage
from fullam.numbers.records import Rows
from fullam.simulation.payloads.learning import Learner
from fullam.simulation.payloads.payload import Load, LoadView, Payload, load, load_rows


class Carried:
    """What the controller is told of, or finds out itself.

    Attributes:
        loads: All of it, `Load` rows: what is known, then what is learned.
        links: The nominal links with these.
        lift: What they add to the command, one row.
        share: What is delivered of the law's own command, one row of `Delivery`.
        learner: Finds out what is not known; None if it is left unknown.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        period: float,
        bare: Rows,
        known: Sequence[Payload],
        learned: Sequence[Payload],
    ) -> None:
        """Make the rows.

        Args:
            vehicle: The nominal vehicle.
            period: Control period [s].
            bare: Its links, in as many lanes as are flown.
            known: What it is told of.
            learned: What it finds out: the gripper tells when.
        """
        lanes, told = bare.lanes, load_rows(vehicle, [*known, *learned], period).array
        self.loads = Rows.empty(Load, len(told), lanes=lanes)
        self.loads.array[:] = told[..., None] if lanes else told
        self._bare = bare
        self.links = Rows.empty(Link, len(bare.array), lanes=lanes)
        self.lift = Rows.empty(Spatial, 1, lanes=lanes)
        self.share = Rows.empty(Delivery, 1, lanes=lanes)
        self._gravity = Rows(float, [[vehicle.gravity]])
        self.learner = Learner(vehicle, period, self.loads, len(known)) if learned else None

    def begin(self) -> None:
        """Before a flight."""
        if self.learner is not None:
            self.learner.begin()

    def remembered(self) -> Sequence[Rows]:
        """Rows that it takes to go back to a moment."""
        return () if self.learner is None else self.learner.remembered()

    def stages(
        self,
        joints: Rows,
        joint_rows: Rows,
        estimate: Rows,
        target: Rows,
        command: Rows,
        delivery: Rows,
    ) -> dict[str, Stage]:
        """All but what learns."""
        view = LiftView(
            self._gravity,
            self.links,
            self._bare,
            joints,
            joint_rows,
            estimate,
            target,
            command,
            self.lift,
        )
        return {
            "expect": Stage(load, LoadView(self.links, self._bare, self.loads)),
            "lift": Stage(lift, view),
            "share": Stage(share, ShareView(delivery, self.lift, self.share)),
        }
