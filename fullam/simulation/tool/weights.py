"""What a tool task costs: how the ways of moving a tool are weighed against each other."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields

from fullam.checks import Checker, from_zero, positive
from fullam.exceptions import ScenarioError

CHECK = Checker("tool weights", ScenarioError)


@dataclass(frozen=True)
class ToolWeights:
    """Weights of squared rates in the sum that a tool task minimises at every instant.

    Attributes:
        tool: Of the tool's velocity beside the path's [1 / (m/s)^2].
        attitude: Of the platform's turn beside the one to the attitude that is preferred
            [1 / (rad/s)^2].
        posture: Of the joints' rates beside those back to where they start [1 / (rad/s)^2].
        platform: Of the platform's velocity [1 / (m/s)^2].
        turn: Of its angular velocity [1 / (rad/s)^2].
        joints: Of the joints' rates [1 / (rad/s)^2; 1 / (m/s)^2 of prismatic ones].
    """

    tool: float = 1e4
    attitude: float = 1.0
    posture: float = 0.02
    platform: float = 1.0
    turn: float = 0.3
    joints: float = 0.05

    def __post_init__(self) -> None:
        """Check that they are weights, and that every rate has a price."""
        for field in fields(self):
            must = field.name in ("tool", "platform", "turn", "joints")
            numbers = positive(1e9) if must else from_zero(1e9)
            value = CHECK.number(field.name, getattr(self, field.name), numbers)
            object.__setattr__(self, field.name, value)

    def to_dict(self) -> dict[str, float]:
        """JSON values."""
        return asdict(self)
