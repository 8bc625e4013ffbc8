"""What the settings of every law that tracks a pose have in common.

Gains, limits of the integral action, and how a commanded motion reaches the law: a jump is spread
over a minimum-jerk profile, and known lags are taken off it. Whoever feeds the law does both (a
flight plan, before take-off), because they need the whole motion and the law sees one point of it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from fullam.exceptions import SettingsError
from fullam.model.vehicle import Vehicle


@dataclass(frozen=True)
class TrackingSettings:
    """Gains and limits of a law that tracks a pose, and how it is fed.

    Attributes:
        position_gains: Three gains of the three positions; the law says which.
        attitude_gains: The same for the axis-angle error.
        integral_limits: Largest output of the integral action, linear and angular.
        anti_windup: Rate at which undelivered acceleration drains the integral action [1/s].
        max_acceleration: A jump of the reference position is spread over the minimum-jerk profile
            whose peak acceleration is this [m/s^2]; None leaves jumps as they are.
        max_angular_acceleration: The same for the attitude [rad/s^2].
        anticipate: Take the known lags (of the estimator, of the rotors) off the commanded motion,
            so that they are no error. If a jump is left in the motion (for want of a limit on the
            acceleration) nothing is anticipated: the lag behind a jump is the jump itself, and
            taking it off would hide the error from the law.
    """

    position_gains: tuple[float, float, float]
    attitude_gains: tuple[float, float, float]
    integral_limits: tuple[float, float]
    anti_windup: float = 5.0
    max_acceleration: float | None = 2.6
    max_angular_acceleration: float | None = 8.0
    anticipate: bool = True

    def __post_init__(self) -> None:
        """Check every number; lists (from JSON or TOML) become tuples."""
        for field in ("position_gains", "attitude_gains"):
            self._become(field, 3)
        self._become("integral_limits", 2, finite=False)
        for field in ("max_acceleration", "max_angular_acceleration"):
            value = getattr(self, field)
            if value is not None and not 0.0 < value < np.inf:
                raise self._wrong(field, "give a number > 0, or None")
        if not isinstance(self.anticipate, bool):
            raise self._wrong("anticipate", "give true or false")
        if not 0.0 <= self.anti_windup < np.inf:
            raise self._wrong("anti_windup", "give a rate >= 0")

    def _become(self, field: str, count: int, finite: bool = True) -> None:
        """Make a field a tuple of `count` floats; SettingsError unless none is negative."""
        values = np.asarray(getattr(self, field), dtype=float)
        good = values.shape == (count,) and bool(np.all(values >= 0.0))
        if not good or (finite and not np.all(np.isfinite(values))):
            kind = "finite numbers" if finite else "numbers"
            raise self._wrong(field, f"give {count} {kind}, none < 0")
        object.__setattr__(self, field, tuple(values.tolist()))

    def _wrong(self, field: str, remedy: str) -> SettingsError:
        return SettingsError(type(self).__name__, field, f"is {getattr(self, field)!r}", remedy)

    def thrust_lag(self, vehicle: Vehicle) -> float:
        """Time constant with which the law sees its wrench follow its command [s]."""
        return float(vehicle.rotors.lags.mean())

    def to_dict(self) -> dict[str, object]:
        """The settings as JSON values."""
        return {f.name: getattr(self, f.name) for f in fields(self)}
