"""Names of the plants, the physics that fly, and what may be chosen of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from fullam.checks import Checker, positive
from fullam.control.arm_feedback import FEEDBACK
from fullam.control.arm_goals import FEED_FORWARD
from fullam.dynamics.integrators import integrator
from fullam.exceptions import ScenarioError, SettingsError, UnknownName
from fullam.model.vehicle import Vehicle

PAYLOAD = ("unknown", "learned")
"""What is made of payloads that nobody told of."""


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
        payload: What is made of payloads that nobody told of: "unknown" leaves them to the law's
            observer or integrator, "learned" estimates them in flight and hands them over; see
            `fullam.control.payload_observer`.
    """

    plant: ClassVar[str] = "servo"
    feedback: str = "twin"
    feed_forward: str = "motion"
    payload: str = "unknown"

    def __post_init__(self) -> None:
        """Check the names."""
        for name, known in (
            ("feedback", FEEDBACK),
            ("feed_forward", FEED_FORWARD),
            ("payload", PAYLOAD),
        ):
            value = getattr(self, name)
            if not isinstance(value, str) or value not in known:
                raise UnknownName(f"{name} of plant '{self.plant}'", str(value), tuple(known))

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


MUJOCO_INTEGRATORS = {
    "rk4": "mjINT_RK4",
    "implicitfast": "mjINT_IMPLICITFAST",
    "euler": "mjINT_EULER",
}
"""MuJoCo's integrators, and what MuJoCo calls them."""


@dataclass(frozen=True)
class MujocoPrescribedSettings:
    """MuJoCo with joints that follow their motion.

    Attributes:
        integrator: One of `MUJOCO_INTEGRATORS`; "rk4" is of order 4, the others of order 1.
    """

    integrator: str = "rk4"

    def __post_init__(self) -> None:
        """Check the name."""
        _check_integrator("mujoco-prescribed", self.integrator)

    def check_step(self, vehicle: Vehicle, integrator_name: str, period: float) -> None:
        """Any time step will do."""


@dataclass(frozen=True)
class MujocoSettings(ServoSettings):
    """MuJoCo with joints on servos.

    Attributes:
        integrator: One of `MUJOCO_INTEGRATORS`; "rk4" is of order 4, the others of order 1.
        tool_radius: Radius of the ball at the tool that touches [m].
    """

    plant: ClassVar[str] = "mujoco"
    integrator: str = "rk4"
    tool_radius: float = 0.002

    def __post_init__(self) -> None:
        """Check the names and the number."""
        super().__post_init__()
        _check_integrator(self.plant, self.integrator)
        check = Checker("plant 'mujoco'", SettingsError)
        radius = check.number("tool_radius", self.tool_radius, positive(1.0, "m"))
        object.__setattr__(self, "tool_radius", radius)

    def check_step(self, vehicle: Vehicle, integrator_name: str, period: float) -> None:
        """See `ServoSettings`; by MuJoCo's integrator."""
        own = "rk4" if self.integrator == "rk4" else "semi-implicit-euler"
        super().check_step(vehicle, own, period)


def _check_integrator(plant: str, name: Any) -> None:
    if not isinstance(name, str) or name not in MUJOCO_INTEGRATORS:
        raise UnknownName(f"integrator of plant '{plant}'", str(name), tuple(MUJOCO_INTEGRATORS))


PLANT_SETTINGS: dict[str, type[Any]] = {
    "prescribed": PrescribedSettings,
    "servo": ServoSettings,
    "mujoco": MujocoSettings,
    "mujoco-prescribed": MujocoPrescribedSettings,
}
"""The settings of each plant, by its name; see `named.PLANTS` for the plants themselves."""


IN_KERNELS = {"mujoco": "servo", "mujoco-prescribed": "prescribed"}
"""Plants that machine code cannot fly, and the one of the same joints that it can."""


def in_kernels(name: str, changes: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """A plant and its changed settings, or what machine code flies in its place."""
    other = IN_KERNELS.get(name, name)
    known = [f.name for f in fields(PLANT_SETTINGS[other])]
    return other, {key: value for key, value in changes.items() if key in known}


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
