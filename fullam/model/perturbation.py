"""The true vehicle: the nominal one with its parameters drawn within a share of their values.

The paper states an uncertainty of +-10 % without saying of what; here the parameters are named.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.checks import Checker, Range, shown
from fullam.exceptions import SettingsError, UnknownName
from fullam.model.physics import body_inertia
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

PARAMETERS = (
    "platform_mass",
    "platform_inertia",
    "link_masses",
    "link_inertias",
    "link_coms",
    "k_f",
    "k_tau",
    "lag",
)
"""What can be uncertain, in the order in which the factors are drawn."""

DEFAULT_PARAMETERS = (
    "platform_mass",
    "platform_inertia",
    "link_masses",
    "link_inertias",
    "k_f",
    "k_tau",
)
"""The masses, inertias and rotor coefficients that a compensation has to know."""


LARGEST_SHARE = 0.999
"""Largest share: of a factor in [1 - share, 1 + share] something is left."""


@dataclass(frozen=True)
class Uncertainty:
    """How far the true parameters are from the nominal ones.

    Attributes:
        share: Each factor is drawn uniformly from [1 - share, 1 + share]; 0 draws nothing.
        parameters: Which of `PARAMETERS` are uncertain.
    """

    share: float = 0.10
    parameters: tuple[str, ...] = DEFAULT_PARAMETERS

    def __post_init__(self) -> None:
        """Check the share and the names.

        Raises:
            SettingsError: If the share is not in [0, 0.999].
            UnknownName: If a parameter is none of `PARAMETERS`.
        """
        check = Checker("uncertainty", SettingsError)
        share = check.number("share", self.share, Range(0.0, LARGEST_SHARE))
        object.__setattr__(self, "share", share)
        if not isinstance(self.parameters, list | tuple):
            raise check.refuse("parameters", f"is {shown(self.parameters)}", "give a list of names")
        object.__setattr__(self, "parameters", tuple(self.parameters))
        for name in self.parameters:
            if name not in PARAMETERS:
                raise UnknownName("uncertain parameter", str(name), PARAMETERS)

    def to_dict(self) -> dict[str, Any]:
        """As plain data, for a file."""
        data = asdict(self)
        data["parameters"] = list(self.parameters)
        return data

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Uncertainty:
        """The inverse of `to_dict`.

        Raises:
            SettingsError: A field that it does not have.
        """
        check = Checker("uncertainty", SettingsError)
        values = check.table("uncertainty", data)
        check.known(values, ("share", "parameters"))
        return cls(**values)


def perturb(vehicle: Vehicle, uncertainty: Uncertainty, rng: np.random.Generator) -> Vehicle:
    """Draw a true vehicle around a nominal one.

    Every parameter of every link and rotor gets its own factor, uniform in
    [1 - share, 1 + share]: masses, centres of mass (the lever in the link's frame), inertias, k_f,
    k_tau and lags. An inertia scales with its body's mass factor times its own, as a whole tensor,
    so a possible one stays possible. A link is a body of the model, with what is fixed to it.

    All factors of all `PARAMETERS` are drawn, in that order, links base to tip and rotors in
    their order, and those of parameters that are not named are dropped: naming one more
    parameter does not change the others.

    Args:
        vehicle: The nominal vehicle; it stays as it is.
        uncertainty: The share and the parameters.
        rng: Source of the factors.

    Returns:
        A vehicle with its own model and rotors. Its `definition` and `urdf` are still the nominal
        ones: they, the uncertainty and the seed rebuild it.
    """
    check = Checker("perturb", SettingsError)
    check.instance("vehicle", vehicle, Vehicle)
    check.instance("uncertainty", uncertainty, Uncertainty)
    check.instance("rng", rng, np.random.Generator)
    drawn = draw_factors(factor_shares(vehicle, uncertainty), rng)
    factors = {name: drawn[where] for name, where in factor_slices(vehicle).items()}
    model = pin.Model(vehicle.model)
    masses = np.concatenate([factors["platform_mass"], factors["link_masses"]])
    inertias = np.concatenate([factors["platform_inertia"], factors["link_inertias"]])
    levers = np.concatenate([[1.0], factors["link_coms"]])
    for index, (mass, inertia, lever) in enumerate(
        zip(masses, inertias, levers, strict=True), start=1
    ):
        body = model.inertias[index]
        model.inertias[index] = body_inertia(
            body.mass * mass, body.lever * lever, body.inertia * (mass * inertia)
        )
    rotors = replace(
        vehicle.rotors,
        k_f=vehicle.rotors.k_f * factors["k_f"],
        k_tau=vehicle.rotors.k_tau * factors["k_tau"],
        lags=vehicle.rotors.lags * factors["lag"],
    )
    return replace(vehicle, model=model, rotors=rotors)


def factor_slices(vehicle: Vehicle) -> dict[str, slice]:
    """Where the factors of each of `PARAMETERS` stand among all that are drawn."""
    links, rotors = vehicle.n_arm, vehicle.rotors.count
    ends = np.cumsum([0, 1, 1, links, links, links, rotors, rotors, rotors]).tolist()
    return {name: slice(*ends[i : i + 2]) for i, name in enumerate(PARAMETERS)}


def factor_shares(vehicle: Vehicle, uncertainty: Uncertainty) -> Array:
    """How far each factor may be from 1, in the order of the draws; 0 where it is certain."""
    slices = factor_slices(vehicle)
    shares = np.zeros(slices[PARAMETERS[-1]].stop)
    for name in uncertainty.parameters:
        shares[slices[name]] = uncertainty.share
    return shares


def draw_factors(shares: Array, rng: np.random.Generator) -> Array:
    """All factors of a true vehicle, 1 + share u with u uniform in [-1, 1]."""
    return 1.0 + shares * rng.uniform(-1.0, 1.0, shares.size)
