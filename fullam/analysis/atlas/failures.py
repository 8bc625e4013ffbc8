"""What is left when a rotor stops: the envelope of every single failure."""

from __future__ import annotations

from functools import cached_property

from numpy.typing import ArrayLike

from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.atlas.loads import load_of
from fullam.model.attainable.facets import Facets, facets_of
from fullam.model.rotors import Rotors
from fullam.model.vehicle import Vehicle


class Atlas:
    """The envelopes of a vehicle, whole or with one rotor stopped, for any arm pose and payload.

    The facets are worked out once: they depend on the rotors alone.

    Attributes:
        vehicle: The vehicle.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        """Of a vehicle; facets are found when they are first needed."""
        self.vehicle = vehicle

    @cached_property
    def facets(self) -> Facets:
        """Of all rotors together."""
        return facets_of(self.vehicle.rotors)

    @cached_property
    def failures(self) -> tuple[tuple[Rotors, Facets], ...]:
        """Rotors and facets with each single rotor stopped."""
        rotors = self.vehicle.rotors
        stopped = [rotors.with_failed(k) for k in range(rotors.count)]
        return tuple((each, facets_of(each)) for each in stopped)

    def envelope(
        self,
        theta: ArrayLike | None = None,
        payload: float = 0.0,
        tool_wrench: ArrayLike | None = None,
    ) -> Envelope:
        """With all rotors; arguments and errors as in `load_of`."""
        load = load_of(self.vehicle, theta, payload, tool_wrench)
        return Envelope.from_rotors(self.vehicle.rotors, load, self.facets)

    def after_failures(
        self, theta: ArrayLike | None = None, payload: float = 0.0
    ) -> tuple[Envelope, ...]:
        """With rotor 1, 2, ... stopped; arguments and errors as in `load_of`."""
        load = load_of(self.vehicle, theta, payload)
        return tuple(Envelope.from_rotors(r, load, f) for r, f in self.failures)
