"""Bodies that the last link carries for a while: a stage that gives the plant its links."""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.dynamics.recursion import Link, shift_inertia
from fullam.numbers.kernel import Number, kernel
from fullam.numbers.vectors import Symmetric, Vector, add_symmetric, axpy, scale, subtract


class Payload(NamedTuple):
    """A body fixed to the last link in the control periods from `start` on, up to `stop`.

    Mass [kg]; centre of mass [m] and inertia about it [kg m^2], in the axes of the last link's row
    (see `link_rows`), from its joint.
    """

    start: Number
    stop: Number
    mass: Number
    com: Vector
    inertia: Symmetric


class LoadView(NamedTuple):
    """What `load` is shown: true links, rows of `Payload`, and the links that fly, rewritten."""

    links: Any
    payloads: Any
    carried: Any


@kernel
def joined(link, payload):
    """A link with a body fixed to it."""
    mass = link.mass + payload.mass
    center = scale(1.0 / mass, axpy(payload.mass, payload.com, scale(link.mass, link.com)))
    own = shift_inertia(link.inertia, link.mass, subtract(link.com, center))
    added = shift_inertia(payload.inertia, payload.mass, subtract(payload.com, center))
    return Link(mass, center, add_symmetric(own, added), link.rotation, link.offset, link.prismatic)


@kernel
def load(view, k):
    """The links that fly in period k; what is picked up comes at the last link's speed."""
    last = len(view.links) - 1
    for i in range(len(view.links)):
        view.carried[i] = view.links[i]
    for i in range(len(view.payloads)):
        payload = view.payloads[i]
        # Times are the plan's, the same for all flights: a branch on no data.
        if payload.start <= k and k < payload.stop:
            view.carried[last] = joined(view.carried[last], payload)
