"""Stands for motions that follow from a scenario's tool task, until a plan has solved it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fullam.exceptions import ScenarioError


@dataclass(frozen=True)
class FollowsTool:
    """The platform and the arm go where the tool's path takes them."""

    kind: ClassVar[str] = "tool"

    def tabulate(self, t: NDArray[np.float64], initial: NDArray[np.float64]) -> Any:
        """There is nothing to tabulate yet.

        Raises:
            ScenarioError: Always.
        """
        raise ScenarioError(
            "tool task",
            "motion",
            "is not solved yet",
            "take the scenario of a plan, prepare(...).scenario, in which it is",
        )
