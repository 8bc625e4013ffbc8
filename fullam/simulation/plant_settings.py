"""Names of the plants, the physics that fly, and what may be chosen of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from fullam.checks import Checker
from fullam.control.arm_feedback import FEEDBACK
from fullam.control.arm_goals import FEED_FORWARD
from fullam.dynamics.integrators import integrator
from fullam.exceptions import ScenarioError, SettingsError, UnknownName
from fullam.model.vehicle import Vehicle


@dataclass(frozen=True)
class PrescribedSettings:
    """Joints follow their motion theta(t) exactly: there is nothing to choose."""

    def check_step(self, vehicle: Vehicle, integrator_name: str, period: float) -> None:
        """Any time step will do."""


@dataclass(frozen=True)
class ServoSettings:
    """Joints are free, and moved by position servos.

    Attributes:
        feedback: What the law is told of the arm: "twin", "encoder", "command" or "truth"; see
            `fullam.control.arm_feedback`.
        feed_forward: What the servos' goals are shifted by: "motion" (and gravity), "gravity" or
            "off"; see `fullam.control.arm_goals`.
    """

    feedback: str = "twin"
    feed_forward: str = "motion"

    def __post_init__(self) -> None:
        """Check the names."""
        for name, known in (("feedback", FEEDBACK), ("feed_forward", FEED_FORWARD)):
            value = getattr(self, name)
            if not isinstance(value, str) or value not in known:
                raise UnknownName(f"{name} of plant 'servo'", str(value), tuple(known))

    def check_step(self, vehicle: Vehicle, integrator_name: str, period: float) -> None:
        """Refuse a time step at which the rule cannot hold the servos.

        The joints' inertia, the platform free, is at least that of their motors' rotors: no decay
        is faster than d / armature, no swing faster than sqrt((k + stop) / armature).

        Args:
            vehicle: The vehicle, for its servos.
            integrator_name: Name of the plant's integrator.
            period: Its time step [s].

        Raises:
            ScenarioError: The step is too long; the message names one that is not.
        """
        servos = vehicle.servos
        rates = [servos.damping / servos.armature]
        rates.append(np.sqrt((servos.stiffness + servos.stop) / servos.armature))
        fastest = float(np.max(rates, initial=0.0))
        most = integrator(integrator_name).stable / max(fastest, 1e-300)
        if period > most:
            raise ScenarioError(
                "simulation settings",
                "plant_period",
                f"is {period:g} s, but the servos' fastest motion takes {1.0 / fastest:.2g} s",
                f"give at most {most:.2g} s, or servos with more armature in the vehicle's [servo]",
            )


PLANT_SETTINGS: dict[str, type[Any]] = {
    "prescribed": PrescribedSettings,
    "servo": ServoSettings,
}
"""The settings of each plant, by its name; see `plants.PLANTS` for the plants themselves."""


def plant_settings(name: str, changes: Mapping[str, Any]) -> Any:
    """A plant's settings, with those that differ from its defaults.

    Raises:
        UnknownName: No such plant, or no such choice.
        SettingsError: A setting that it does not have.
    """
    if not isinstance(name, str) or name not in PLANT_SETTINGS:
        raise UnknownName("plant", str(name), tuple(PLANT_SETTINGS))
    cls = PLANT_SETTINGS[name]
    known = [f.name for f in fields(cls)]
    for key in Checker(f"plant '{name}'", SettingsError).table("plant_settings", changes):
        if key not in known:
            raise SettingsError(
                f"plant '{name}'",
                str(key),
                "is not one of its settings",
                f"it has {', '.join(known) or 'none'}",
            )
    return cls(**changes)
