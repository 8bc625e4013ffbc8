"""What the settings of every law that tracks a pose have in common.

Gains, and limits of the integral action.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from fullam.exceptions import SettingsError


@dataclass(frozen=True)
class TrackingSettings:
    """Gains and limits of a law that tracks a pose.

    Attributes:
        position_gains: Three gains of the three positions; the law says which.
        attitude_gains: The same for the axis-angle error.
        integral_limits: Largest output of the integral action, linear and angular.
        anti_windup: Rate at which undelivered acceleration drains the integral action [1/s].
    """

    position_gains: tuple[float, float, float]
    attitude_gains: tuple[float, float, float]
    integral_limits: tuple[float, float]
    anti_windup: float = 5.0

    def __post_init__(self) -> None:
        """Check every number; lists (from JSON or TOML) become tuples."""
        for field in ("position_gains", "attitude_gains"):
            self._become(field, 3)
        self._become("integral_limits", 2, finite=False)
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

    def to_dict(self) -> dict[str, object]:
        """The settings as JSON values."""
        return {f.name: getattr(self, f.name) for f in fields(self)}
