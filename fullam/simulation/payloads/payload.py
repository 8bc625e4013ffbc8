"""Bodies that the tool picks up and drops in flight, and what they make of the arm's last link."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from fullam.checks import Checker, from_zero, positive, within
from fullam.dynamics.recursion import Link, shift_inertia
from fullam.exceptions import ScenarioError
from fullam.model.vehicle import Vehicle
from fullam.numbers.kernel import Number, both, kernel, select
from fullam.numbers.records import Rows
from fullam.numbers.vectors import Symmetric, Vector, add_symmetric, axpy, scale, subtract
from fullam.simulation.tool.held import held_tool

NEVER = 1e6
"""Later than any flight [s]."""


@dataclass(frozen=True)
class Payload:
    """A ball at the tool.

    It has the tool's velocity when it is picked up, so nothing jerks but its weight.

    Attributes:
        mass: Its mass [kg].
        picked_up: When it is at the tool from then on [s].
        dropped: When it is gone again [s].
        offset: Its centre from the tool's point, axes of the arm's last link [m].
        radius: Of a ball of even density [m].
        known: Whether the controller is told, from the pick-up to the drop: what the load takes is
            then added to the law's command (`fullam.control.payload_lift`), and the goals of the
            servos and the twin know of it.
    """

    mass: float
    picked_up: float = 0.0
    dropped: float = NEVER
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius: float = 0.03
    known: bool = False

    def __post_init__(self) -> None:
        """Check the numbers."""
        check = Checker("payload", ScenarioError)
        for name, numbers in (
            ("mass", positive(1e4, "kg")),
            ("picked_up", from_zero(NEVER, "s")),
            ("dropped", positive(NEVER, "s")),
            ("radius", positive(10.0, "m")),
        ):
            object.__setattr__(self, name, check.number(name, getattr(self, name), numbers))
        object.__setattr__(self, "known", check.flag("known", self.known))
        offset = check.vector("offset", self.offset, 3, within(100.0, "m"))
        object.__setattr__(self, "offset", offset)
        if self.dropped <= self.picked_up:
            raise check.refuse("dropped", f"is {self.dropped:g} s", "drop it after the pick-up")

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @classmethod
    def from_dict(cls, data: Any) -> Payload:
        """The inverse of `to_dict`.

        Raises:
            ScenarioError: A field that it does not have, or no mass.
        """
        check = Checker("payload", ScenarioError)
        values = check.table("table", data)
        check.known(values, tuple(f.name for f in fields(cls)))
        if "mass" not in values:
            raise check.refuse("mass", "is missing", "give it [kg]")
        return cls(**values)


class Load(NamedTuple):
    """A payload as numbers: from which control period to which; mass, centre, inertia about it."""

    begin: Number
    end: Number
    mass: Number
    center: Vector
    inertia: Symmetric


class LoadView(NamedTuple):
    """What `load` is shown: `links` to be written, the links without loads, the loads.

    "load" writes the true links, "expect" by the same kernel those that the controller knows of.
    """

    links: Any
    bare: Any
    loads: Any


@kernel
def load(view, k):
    """The links of period k, the last with what it carries."""
    n = len(view.links) - 1
    if k == 0:
        for i in range(n):
            view.links[i] = view.bare[i]
    link = view.bare[n]
    mass, first = link.mass, scale(link.mass, link.com)
    for i in range(len(view.loads)):
        body = view.loads[i]
        m = is_held(body, k) * body.mass
        mass, first = mass + m, axpy(m, body.center, first)
    center = scale(1.0 / mass, first)
    inertia = shift_inertia(link.inertia, link.mass, subtract(link.com, center))
    for i in range(len(view.loads)):
        body = view.loads[i]
        share = is_held(body, k)
        own = shift_inertia(body.inertia, body.mass, subtract(body.center, center))
        inertia = add_symmetric(
            inertia,
            (
                share * own[0],
                share * own[1],
                share * own[2],
                share * own[3],
                share * own[4],
                share * own[5],
            ),
        )
    view.links[n] = Link(mass, center, inertia, link.rotation, link.offset, link.prismatic)


@kernel
def is_held(body, k):
    """1 if a load is there in period k, else 0."""
    return select(both(body.begin <= k, k < body.end), 1.0, 0.0)


def load_rows(vehicle: Vehicle, payloads: Sequence[Payload], period: float) -> Rows:
    """Payloads at a vehicle's tool as `Load` rows.

    Raises:
        ScenarioError: The tool is not on the arm's last link.
    """
    point, frame = held_tool(vehicle, "pick something up")
    rows = []
    for body in payloads:
        center = frame.T @ (point + np.array(body.offset))
        own = 0.4 * body.mass * body.radius**2
        rows.append(
            Load(
                float(round(body.picked_up / period)),
                float(round(body.dropped / period)),
                body.mass,
                tuple(center.tolist()),
                (own, 0.0, 0.0, own, 0.0, own),
            )
        )
    return Rows.of(Load, rows)


def check_apart(learned: Sequence[Payload]) -> None:
    """Refuse to learn two things at a time.

    Raises:
        ScenarioError: They hang together.
    """
    for first, then in pairwise(sorted(learned, key=lambda body: body.picked_up)):
        if then.picked_up < first.dropped:
            raise ScenarioError(
                "plant_settings",
                "payload",
                f"is 'learned', and what is picked up at {then.picked_up:g} s hangs together with "
                "another unknown body",
                "drop one before the next, or leave payload = 'unknown'",
            )
