"""Names of the plants, the physics that fly, and what may be chosen of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from fullam.checks import Checker, positive
from fullam.control.arm_feedback import FEEDBACK
from fullam.control.arm_goals import FEED_FORWARD
from fullam.exceptions import SettingsError, UnknownName


@dataclass(frozen=True)
class PrescribedSettings:
    """Joints follow their motion theta(t) exactly: there is nothing to choose."""


@dataclass(frozen=True)
class ServoSettings:
    """Joints are free, and moved by position servos.

    Attributes:
        feedback: What the law is told of the arm: "twin", "encoder", "command" or "truth"; see
            `fullam.control.arm_feedback`.
        feed_forward: What the servos' goals are shifted by: "gravity", "motion" (and gravity) or
            "off"; see `fullam.control.arm_goals`.
    """

    feedback: str = "twin"
    feed_forward: str = "gravity"

    def __post_init__(self) -> None:
        """Check the names."""
        for name, known in (("feedback", FEEDBACK), ("feed_forward", FEED_FORWARD)):
            value = getattr(self, name)
            if not isinstance(value, str) or value not in known:
                raise UnknownName(f"{name} of the plant's servos", str(value), tuple(known))


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


@dataclass(frozen=True)
class MujocoSettings(ServoSettings):
    """MuJoCo with joints on servos.

    Attributes:
        integrator: One of `MUJOCO_INTEGRATORS`; "rk4" is of order 4, the others of order 1.
        tool_radius: Radius of the ball at the tool that touches [m].
    """

    integrator: str = "rk4"
    tool_radius: float = 0.002

    def __post_init__(self) -> None:
        """Check the names and the number."""
        super().__post_init__()
        _check_integrator("mujoco", self.integrator)
        check = Checker("plant 'mujoco'", SettingsError)
        radius = check.number("tool_radius", self.tool_radius, positive(1.0, "m"))
        object.__setattr__(self, "tool_radius", radius)


def _check_integrator(plant: str, name: Any) -> None:
    if not isinstance(name, str) or name not in MUJOCO_INTEGRATORS:
        raise UnknownName(f"integrator of plant '{plant}'", str(name), tuple(MUJOCO_INTEGRATORS))


PLANT_SETTINGS: dict[str, type[Any]] = {
    "prescribed": PrescribedSettings,
    "servo": ServoSettings,
    "mujoco": MujocoSettings,
    "mujoco-prescribed": MujocoPrescribedSettings,
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


def changed_settings(settings: Any) -> dict[str, Any]:
    """Those of a plant's settings that differ from its defaults."""
    default = asdict(type(settings)())
    return {name: value for name, value in asdict(settings).items() if value != default[name]}
