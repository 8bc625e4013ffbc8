"""The vehicle that flies, as rows: the nominal one times factors, as `perturb` multiplies them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.recursion import Link
from fullam.model.chain import LinkChain
from fullam.model.perturbation import factor_slices
from fullam.model.rotors import Rotors
from fullam.model.vehicle import Vehicle
from fullam.numbers.elementary import decay
from fullam.numbers.kernel import Number, kernel, maximum
from fullam.numbers.records import Rows
from fullam.numbers.vectors import Vector, scale

SHORTEST_LAG = 1e-12
"""A rotor without lag has this one [s]."""


class RotorRow(NamedTuple):
    """A rotor as the plant has it.

    Force and moment about the origin of {A} per squared speed, its column of eq. (34)
    [N/(rad/s)^2, N m/(rad/s)^2]; exp(-h / lag) for half a plant step h and for a whole one.
    """

    force: Vector
    moment: Vector
    half_decay: Number
    decay: Number


class RotorData(NamedTuple):
    """What a rotor's row is made of: see `fullam.model.rotors.Rotors`."""

    position: Vector
    axis: Vector
    spin: Number
    k_f: Number
    k_tau: Number
    lag: Number


class LinkFactors(NamedTuple):
    """Factors of a link, or their numbers among all factors."""

    mass: Number
    inertia: Number
    com: Number


class RotorFactors(NamedTuple):
    """Factors of a rotor, or their numbers among all factors."""

    k_f: Number
    k_tau: Number
    lag: Number


class Nominal(NamedTuple):
    """The nominal vehicle, and which factors are whose: a view.

    Rows of `Link`, `RotorData`, `LinkFactors` and `RotorFactors`; the plant's period [s].
    """

    links: Any
    rotors: Any
    link_factors: Any
    rotor_factors: Any
    period: Any


def nominal_rows(vehicle: Vehicle, plant_period: float) -> Nominal:
    """Lay out a vehicle; the factor behind the last of `perturbation` is 1, whatever is drawn."""
    chain, rotors = LinkChain.from_vehicle(vehicle), vehicle.rotors
    numbers = {name: np.arange(s.start, s.stop) for name, s in factor_slices(vehicle).items()}
    certain = [numbers["lag"][-1] + 1]
    link_factors = [
        np.concatenate([numbers["platform_mass"], numbers["link_masses"]]),
        np.concatenate([numbers["platform_inertia"], numbers["link_inertias"]]),
        np.concatenate([certain, numbers["link_coms"]]),
    ]
    nominal = Nominal(
        LinkRows.of(chain).rows,
        Rows(RotorData, _rotor_data(rotors)),
        Rows(LinkFactors, np.stack(link_factors, axis=1)),
        Rows(RotorFactors, np.stack([numbers[key] for key in ("k_f", "k_tau", "lag")], axis=1)),
        Rows(float, [[plant_period]]),
    )
    for rows in nominal:
        rows.array.setflags(write=False)
    return nominal


def _rotor_data(rotors: Rotors) -> Any:
    numbers = [rotors.spins, rotors.k_f, rotors.k_tau, rotors.lags]
    return np.concatenate([rotors.positions, rotors.axes, np.stack(numbers, axis=1)], axis=1)


@kernel
def true_link(link, factors):
    """A link with its own mass, inertia and lever; an inertia scales with the mass, too."""
    inertia = factors.mass * factors.inertia
    J = link.inertia
    return Link(
        factors.mass * link.mass,
        scale(factors.com, link.com),
        (
            inertia * J[0],
            inertia * J[1],
            inertia * J[2],
            inertia * J[3],
            inertia * J[4],
            inertia * J[5],
        ),
        link.rotation,
        link.offset,
        link.prismatic,
    )


@kernel
def rotor_row(rotor, factors, period):
    """A rotor's row for a plant of that period [s]: eqs. (31)-(34), and the decays."""
    k_f, drag = rotor.k_f * factors.k_f, rotor.spin * (rotor.k_tau * factors.k_tau)
    r, e = scale(k_f, rotor.position), rotor.axis
    moment = (
        drag * e[0] - r[2] * e[1] + r[1] * e[2],
        r[2] * e[0] + drag * e[1] - r[0] * e[2],
        r[0] * e[1] - r[1] * e[0] + drag * e[2],
    )
    lag = maximum(rotor.lag * factors.lag, SHORTEST_LAG)
    half, whole = decay(0.5 * period / lag), decay(period / lag)
    return RotorRow(scale(k_f, e), moment, 1.0 - half, 1.0 - whole)


@kernel
def write_vehicle(nominal, factors, links, rotors):
    """Write the rows of `Link` and of `RotorRow` of a vehicle with these factors."""
    for i in range(len(links)):
        which = nominal.link_factors[i]
        own = LinkFactors(
            factors[int(which.mass)], factors[int(which.inertia)], factors[int(which.com)]
        )
        links[i] = true_link(nominal.links[i], own)
    for i in range(len(rotors)):
        use = nominal.rotor_factors[i]
        part = RotorFactors(factors[int(use.k_f)], factors[int(use.k_tau)], factors[int(use.lag)])
        rotors[i] = rotor_row(nominal.rotors[i], part, nominal.period[0])
