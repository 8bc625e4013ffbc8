"""How far a tool was from its path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.pose_space import IDENTITY
from fullam.dynamics.rotations import quaternion_rotation
from fullam.model.vehicle import Vehicle
from fullam.simulation.scenario import Scenario
from fullam.simulation.tool_kinematics import ToolKinematics

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AskedTool:
    """What a scenario asks of the tool, and where the arm holds it.

    Attributes:
        counts: Which rows belong to the path, shape (N,).
        places: Where the tool should be, shape (N, 3) [m].
        reach: Where the arm holds it, from {A} in its axes, shape (N, 3) [m].
    """

    counts: NDArray[np.bool_]
    places: Array
    reach: Array

    @classmethod
    def of(cls, scenario: Scenario, vehicle: Vehicle, t: Array, arm: Array) -> AskedTool | None:
        """From a scenario and the arm's motion; None if it has no task for the tool.

        Args:
            scenario: The scenario.
            vehicle: The nominal vehicle.
            t: Times, shape (N,), N > 0 [s].
            arm: Joint positions, shape (N, n) [rad or m].
        """
        if scenario.tool is None:
            return None
        reach = ToolKinematics(vehicle).places(np.tile(IDENTITY, (len(t), 1)), arm)
        pose = scenario.initial_pose
        start = pose[:3] + quaternion_rotation(pose[3:]) @ reach[0]
        return cls(scenario.tool.while_it_lasts(t), start + scenario.tool.offsets(t), reach)

    def until(self, rows: int) -> AskedTool:
        """The part that a flight of that many rows has seen."""
        return AskedTool(self.counts[:rows], self.places[:rows], self.reach[:rows])

    def errors(self, pose: Array) -> Array:
        """Distance of the tool from its place at poses of shape (N, 7), shape (N,) [m]."""
        tool = (
            pose[:, :3] + np.matmul(quaternion_rotation(pose[:, 3:]), self.reach[..., None])[..., 0]
        )
        return np.asarray(np.linalg.norm(tool - self.places, axis=1))

    def rms_mm(self, pose: Array) -> float:
        """Root mean square of the distance along the path [mm]; NaN if no row belongs to it."""
        if not self.counts.any():
            return float("nan")
        return float(1e3 * np.sqrt(np.mean(np.square(self.errors(pose)[self.counts]))))
