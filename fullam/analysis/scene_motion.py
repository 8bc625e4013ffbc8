"""What the joints of a scene in MJCF did in a flight: a valve's turn, a door's, a box's way."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from fullam.simulation.record.run import Run

DID = {"hinge": "turned", "ball": "turned", "slide": "slid", "free": "moved"}
"""What joints of a kind do."""


@dataclass(frozen=True)
class SceneMotion:
    """How far a joint is at the end from where it was at the start.

    Attributes:
        name: Of the joint.
        kind: One of `scene_joints.COORDINATES`.
        change: Angle of a hinge [rad], way of a slide [m], both signed; angle of a ball joint
            [rad]; distance of a free body [m].
        largest: The largest size of that in the flight.
    """

    name: str
    kind: str
    change: float
    largest: float

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return asdict(self)

    def __str__(self) -> str:
        """In a few words: "valve turned by 103.2 deg"."""
        turns = self.kind in ("hinge", "ball")
        scale, unit = (180.0 / np.pi, "deg") if turns else (1e3, "mm")
        change, largest = scale * self.change, scale * self.largest
        most = f" ({largest:.1f} {unit} at most)" if largest - abs(change) > 0.05 else ""
        return f"{self.name} {DID[self.kind]} by {change:.1f} {unit}{most}"


def scene_motions(run: Run) -> list[SceneMotion]:
    """What each joint of the scene did, in its order; nothing without a scene or a tick."""
    return [_motion(run, joint.name, joint.kind) for joint in run.scene_joints if len(run)]


def _motion(run: Run, name: str, kind: str) -> SceneMotion:
    values = run.moved(name)[: max(1, len(run) - run.diverged)]  # the last may be no numbers
    if kind == "ball":
        away = 2.0 * np.arccos(np.minimum(np.abs(values @ values[0]), 1.0))
    elif kind == "free":
        away = np.linalg.norm(values[:, :3] - values[0, :3], axis=1)
    else:
        away = values - values[0]
    return SceneMotion(name, kind, float(away[-1]), float(np.abs(away).max()))
