"""What the tool should do: follow a path, with platform and arm sharing the motion.

The task is solved before take-off by differential inverse kinematics (`solution`), and flies
as a reference of the platform and a motion of the arm, under every law and driver.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, from_zero, positive, shown, within
from fullam.exceptions import ScenarioError
from fullam.simulation.motions import references
from fullam.simulation.motions.trajectory import Trajectory
from fullam.simulation.tool.paths import CirclePath, LinePath, SplinePath, SquarePath, ToolPath
from fullam.simulation.tool.weights import ToolWeights

Array = NDArray[np.float64]

CHECK = Checker("tool task", ScenarioError)

ATTITUDES = ("free", "preferred", "fixed")
PRIORITIES = ("weighted", "strict")

PATHS: dict[str, Any] = {c.kind: c for c in (LinePath, CirclePath, SquarePath)} | {
    "trajectory": Trajectory,
    "minimum-snap": Trajectory.minimum_snap,
    "b-spline": Trajectory.b_spline,
}
"""What a task's path may be, and what makes it; those of a trajectory become a `SplinePath`."""


@dataclass(frozen=True)
class ToolTask:
    """The tool follows a path from where it stands at the start.

    Attributes:
        path: Where it goes; a `Trajectory` counts as a `SplinePath`, and is how a path of one's own
            is given.
        attitude: "fixed": the platform keeps its attitude. "preferred": it turns where that is
            cheaper than moving otherwise, and back. "free": it turns and nobody minds.
        euler_deg: The attitude that is kept or preferred, x-y-z Euler angles; None for the one at
            the start. From that one it is blended in while the path begins.
        priority: "weighted": everything is weighed. "strict": the tool comes first, behind an
            attitude that is fixed alone; one that is preferred second; the rest is weighed.
        weights: What is weighed.
        at: When the path begins [s].
        max_speed: Largest speed of the platform along each of its axes [m/s].
        max_turn_deg: Largest angular velocity of it about each [deg/s].
    """

    path: ToolPath
    attitude: str = "preferred"
    euler_deg: tuple[float, float, float] | None = None
    priority: str = "weighted"
    weights: ToolWeights = field(default_factory=ToolWeights)
    at: float = 0.5
    max_speed: float = 1.0
    max_turn_deg: float = 60.0

    def __post_init__(self) -> None:
        """Check every value."""
        path = SplinePath(self.path) if isinstance(self.path, Trajectory) else self.path
        if not isinstance(path, SplinePath) and not references.is_kind(path, PATHS):
            remedy = "give a LinePath, CirclePath, SquarePath, or a Trajectory"
            raise CHECK.refuse("path", f"is {shown(path)}", remedy)
        object.__setattr__(self, "path", path)
        for name, choices in (("attitude", ATTITUDES), ("priority", PRIORITIES)):
            if CHECK.text(name, getattr(self, name)) not in choices:
                problem = f"is '{getattr(self, name)}'"
                raise CHECK.refuse(name, problem, f"choose from {', '.join(choices)}")
        if self.euler_deg is not None:
            euler = CHECK.vector("euler_deg", self.euler_deg, 3, within(1e5, "deg"))
            object.__setattr__(self, "euler_deg", euler)
        CHECK.instance("weights", self.weights, ToolWeights)
        for name, numbers in (
            ("at", from_zero(1e6, "s")),
            ("max_speed", positive(1e3, "m/s")),
            ("max_turn_deg", positive(1e5, "deg/s")),
        ):
            object.__setattr__(self, name, CHECK.number(name, getattr(self, name), numbers))

    def offsets(self, t: Array) -> Array:
        """Where the tool should be at times of the flight, from its start, (N,) to (N, 3) [m]."""
        return self.path.offsets(t - self.at)

    def while_it_lasts(self, t: Array) -> NDArray[np.bool_]:
        """Which times of the flight belong to the path."""
        return np.asarray((t >= self.at) & (t <= self.at + self.path.duration))

    def to_dict(self) -> dict[str, Any]:
        """JSON values; `from_dict` is the inverse."""
        data = {f.name: getattr(self, f.name) for f in fields(self)}
        path = self.path.trajectory if isinstance(self.path, SplinePath) else self.path
        return data | {"path": references.to_dict(path), "weights": self.weights.to_dict()}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> ToolTask:
        """A task from plain data.

        Raises:
            ScenarioError: An unknown entry, or a value that does not fit.
            UnknownName: A kind of path that does not exist.
        """
        values = CHECK.table("tool", data)
        CHECK.known(values, tuple(f.name for f in fields(cls)))
        if "path" not in values:
            raise CHECK.refuse("path", "is missing", "give it")
        if not isinstance(values["path"], Trajectory):
            values["path"] = references.from_dict(PATHS, "tool path", values["path"])
        if "weights" in values:
            weights = CHECK.table("weights", values["weights"])
            CHECK.known(weights, tuple(f.name for f in fields(ToolWeights)))
            values["weights"] = ToolWeights(**weights)
        return cls(**values)
