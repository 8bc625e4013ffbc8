"""How a commanded motion reaches the law, whatever the law: blended, and ahead of known lags.

A jump of the reference is spread over a minimum-jerk profile (`blending`), and the lags that are
known are taken off the motion (`anticipation`). Both need the whole motion before take-off, of
which a law sees one point, so they belong to the experiment and not to the law.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.exceptions import ScenarioError
from fullam.simulation.blending import blend_jumps, leaves_jumps
from fullam.simulation.references import ReferenceTable

Array = NDArray[np.float64]

LIMITS = ("max_acceleration", "max_angular_acceleration")


@dataclass(frozen=True)
class Shaping:
    """What is done to a reference before a law sees it.

    Attributes:
        max_acceleration: A jump of the reference position is spread over the minimum-jerk profile
            whose peak acceleration is this [m/s^2]; None (in a TOML file inf) leaves jumps as they
            are.
        max_angular_acceleration: The same for the attitude [rad/s^2].
        anticipate: Take the known lags (of the estimator, of the rotors) off the commanded motion,
            so that they are no error. If a jump is left in the motion (for want of a limit on the
            acceleration) nothing is anticipated: the lag behind a jump is the jump itself, and
            taking it off would hide the error from the law.
    """

    max_acceleration: float | None = 2.6
    max_angular_acceleration: float | None = 8.0
    anticipate: bool = True

    def __post_init__(self) -> None:
        """Check every value; an infinite limit is none."""
        for field in LIMITS:
            object.__setattr__(self, field, self._limit(field))
        if not isinstance(self.anticipate, bool):
            raise self._wrong("anticipate", "give true or false")

    def _limit(self, field: str) -> float | None:
        value = getattr(self, field)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0.0:
            raise self._wrong(field, "give a number above 0, or None for no limit")
        return None if np.isinf(value) else float(value)

    def _wrong(self, field: str, remedy: str) -> ScenarioError:
        return ScenarioError("shaping", field, f"is {getattr(self, field)!r}", remedy)

    def blend(self, reference: ReferenceTable, start_pose: Array) -> ReferenceTable:
        """The reference with its jumps spread; see `blending.blend_jumps`."""
        return blend_jumps(
            reference, start_pose, self.max_acceleration, self.max_angular_acceleration
        )

    def anticipates(self, reference: ReferenceTable, start_pose: Array) -> bool:
        """Whether lags are to be taken off the blended reference: not if it still has jumps."""
        limits = self.max_acceleration, self.max_angular_acceleration
        return self.anticipate and not leaves_jumps(reference, start_pose, *limits)

    def to_dict(self) -> dict[str, Any]:
        """JSON values; `from_dict` is the inverse."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Shaping:
        """Shaping from plain data.

        Raises:
            ScenarioError: An unknown field, or a value that does not fit.
        """
        return cls().changed(data)

    def changed(self, changes: Mapping[str, Any]) -> Shaping:
        """The same with some fields changed.

        Raises:
            ScenarioError: An unknown field, or a value that does not fit.
        """
        for key in changes:
            if key not in self.to_dict():
                known = ", ".join(self.to_dict())
                raise ScenarioError("shaping", key, "is no field of it", f"it has {known}")
        return Shaping(**self.to_dict() | dict(changes))


SHAPED = Shaping()
"""What is usual."""

UNSHAPED = Shaping(None, None, anticipate=False)
"""The reference as it is."""
