"""How a flight is simulated: rates, integrator, sensors and the bounds of sense."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np

from fullam.checks import Checker, Range, positive, shown
from fullam.control.estimators import estimator_class, make_estimator_settings
from fullam.control.governor import Governor
from fullam.dynamics.integrators import integrator
from fullam.exceptions import ScenarioError
from fullam.plain_values import plain_table
from fullam.simulation.plants.settings import plant_settings

WHERE = "simulation settings"
CHECK = Checker(WHERE, ScenarioError)

RANGES = {
    "control_period": Range(1e-5, 1.0, "s"),
    "plant_period": Range(1e-6, 1.0, "s"),
    "pose_period": Range(1e-5, 100.0, "s"),
    "delay": Range(0.0, 100.0, "s"),
    "max_position_error": positive(1e6, "m"),
    "max_attitude_error_deg": positive(1e3, "deg"),
}
"""What makes sense for each number."""

MOST_TICKS, MOST_STEPS = 2_000_000, 20_000_000
"""Control periods and plant steps of the longest flight; its tables and record take some 3 GB."""


@dataclass(frozen=True)
class SimulationSettings:
    """Everything about a flight that is neither vehicle, scenario, weather nor controller.

    Attributes:
        control_period: Time between controller ticks [s].
        plant_period: Time step of the plant [s]; divides the control period.
        integrator: "midpoint" (order 2), "rk4" (order 4) or "semi-implicit-euler" (order 1).
        plant: Which physics flies: "prescribed" (joints follow their motion exactly),
            "servo" (joints are free, moved by their servos) or "mujoco" (so are they, by MuJoCo;
            "mujoco-prescribed" for comparisons).
        plant_settings: Those of the plant's settings that differ from its defaults; see
            `plants.settings`.
        pose_period: Time between poses from the pose sensor [s]; a multiple of the control period.
        delay: Age of a pose when it arrives [s]; a multiple of the control period.
        estimator: Name of the estimator; None takes the one that the controller is made for, by
            whose name it then stands in the plan and in the record.
        estimator_settings: Those of the estimator's settings that differ from its defaults.
        governor: Takes the target's tilt back while force is short; "off" for none, a mapping
            for other settings than the default ones.
        max_position_error: Farther than this from the reference [m] the flight has diverged.
        max_attitude_error_deg: The same for the angle to the reference attitude [deg].
    """

    control_period: float = 0.01
    plant_period: float = 0.001
    integrator: str = "midpoint"
    plant: str = "prescribed"
    plant_settings: Mapping[str, Any] = field(default_factory=dict, hash=False)
    pose_period: float | None = None
    delay: float = 0.0
    estimator: str | None = None
    estimator_settings: Mapping[str, Any] = field(default_factory=dict, hash=False)
    governor: Any = field(default_factory=Governor)
    max_position_error: float = 5.0
    max_attitude_error_deg: float = 120.0

    def __post_init__(self) -> None:
        """Check ranges, names and that the rates divide each other."""
        if self.pose_period is None:
            object.__setattr__(self, "pose_period", self.control_period)
        for name, numbers in RANGES.items():
            object.__setattr__(self, name, CHECK.number(name, getattr(self, name), numbers))
        integrator(CHECK.text("integrator", self.integrator))
        given = CHECK.table("plant_settings", self.plant_settings)
        plant_settings(self.plant, given)
        object.__setattr__(self, "plant_settings", dict(given))
        if self.estimator is not None:
            estimator_class(CHECK.text("estimator", self.estimator))
        self._own_estimator_settings()
        object.__setattr__(self, "governor", _governor(self.governor))
        self._multiple("control_period", self.control_period, "plant_period", self.plant_period)
        self._multiple("pose_period", self.pose_period, "control_period", self.control_period)
        if self.delay != 0.0:
            self._multiple("delay", self.delay, "control_period", self.control_period)

    def _own_estimator_settings(self) -> None:
        """Copy them as what a record keeps, and see whether the estimator, if named, takes them."""
        given = CHECK.table("estimator_settings", self.estimator_settings)
        changes = plain_table(given, CHECK)
        if self.estimator is not None:
            make_estimator_settings(self.estimator, changes)
        object.__setattr__(self, "estimator_settings", changes)

    def with_estimator(self, name: str) -> SimulationSettings:
        """These settings, with the estimator of that name where they name none.

        Raises:
            SettingsError: It does not take the estimator's settings that are given.
        """
        return self if self.estimator is not None else replace(self, estimator=name)

    def check_length(self, duration: float) -> None:
        """Refuse a flight whose tables would fill the memory.

        Args:
            duration: Length of the flight [s].

        Raises:
            ScenarioError: More than `MOST_TICKS` or `MOST_STEPS`.
        """
        duration = CHECK.number("duration", duration, positive(1e300, "s"))
        for name, period, most in (
            ("control_period", self.control_period, MOST_TICKS),
            ("plant_period", self.plant_period, MOST_STEPS),
        ):
            if duration / period > most:
                raise CHECK.refuse(
                    name,
                    f"{period:g} s makes {duration / period:.2g} steps of {duration:g} s",
                    f"at most {most:g} fit: lengthen it, or shorten the flight",
                )

    def _multiple(self, field: str, value: float | None, unit_name: str, unit: float) -> None:
        ratio = (value or np.nan) / unit
        if not (ratio > 0.5 and abs(ratio - round(ratio)) < 1e-6 * ratio):
            raise ScenarioError(
                WHERE,
                field,
                f"{value!r} s is no multiple of {unit_name} = {unit!r} s",
                "give a whole multiple",
            )

    @property
    def substeps(self) -> int:
        """Plant steps in a control period."""
        return round(self.control_period / self.plant_period)

    @property
    def pose_every(self) -> int:
        """Control periods between two poses."""
        return round((self.pose_period or self.control_period) / self.control_period)

    @property
    def delay_periods(self) -> int:
        """Age of a pose in control periods."""
        return round(self.delay / self.control_period)

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        data = {f.name: getattr(self, f.name) for f in fields(self)}
        governor = asdict(self.governor) if isinstance(self.governor, Governor) else "off"
        settings = {name: dict(data[name]) for name in ("estimator_settings", "plant_settings")}
        return data | settings | {"governor": governor}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> SimulationSettings:
        """The inverse of `to_dict`."""
        values = CHECK.table("settings", data)
        CHECK.known(values, tuple(f.name for f in fields(cls)))
        return cls(**values)


def _governor(given: Any) -> Governor | None:
    """The governor that was asked for."""
    if given is None or isinstance(given, Governor):
        return given
    if isinstance(given, str) and given in ("on", "off"):
        return Governor() if given == "on" else None
    known = [f.name for f in fields(Governor)]
    if not isinstance(given, Mapping) or set(given) - set(known):
        raise CHECK.refuse(
            "governor", f"is {shown(given)}", f"give 'on', 'off', or some of {', '.join(known)}"
        )
    return Governor(**given)
