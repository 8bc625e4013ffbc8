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

from fullam.checks import Checker, Range
from fullam.exceptions import ScenarioError
from fullam.simulation.motions.blending import blend_jumps, leaves_jumps
from fullam.simulation.motions.references import ReferenceTable

Array = NDArray[np.float64]

CHECK = Checker("shaping", ScenarioError)

LIMITS = {
    "max_acceleration": Range(1e-6, 1e6, "m/s^2"),
    "max_angular_acceleration": Range(1e-6, 1e6, "rad/s^2"),
}
"""What makes sense for each limit; None stands for no limit."""


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
        for name, numbers in LIMITS.items():
            value = getattr(self, name)
            if value is not None:
                unlimited = isinstance(value, float) and value == np.inf
                value = None if unlimited else CHECK.number(name, value, numbers)
            object.__setattr__(self, name, value)
        object.__setattr__(self, "anticipate", CHECK.flag("anticipate", self.anticipate))

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
        values = CHECK.table("shaping", changes)
        CHECK.known(values, tuple(self.to_dict()))
        return Shaping(**self.to_dict() | values)


SHAPED = Shaping()
"""What is usual."""

UNSHAPED = Shaping(None, None, anticipate=False)
"""The reference as it is."""
