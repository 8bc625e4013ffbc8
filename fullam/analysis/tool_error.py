"""How far a tool was from its path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.pose_space import IDENTITY
from fullam.dynamics.rotations import quaternion_rotation
from fullam.model.vehicle import Vehicle
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.tool.kinematics import ToolKinematics

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AskedTool:
    """What a scenario asks of the tool, and where the arm holds it.

    Attributes:
        counts: Which rows belong to the path, shape (N,).
        places: Where the tool should be, shape (N, 3) [m].
        reach: Where the arm holds it, from {A} in its axes, shape (N, 3) or, at the start alone,
            (1, 3) [m].
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
            arm: Joint positions, shape (N, n); or, of an arm that yields, those that it begins
                with, shape (1, n) [rad or m].
        """
        if scenario.tool is None:
            return None
        reach = ToolKinematics(vehicle).places(np.tile(IDENTITY, (len(arm), 1)), arm)
        pose = scenario.initial_pose
        start = pose[:3] + quaternion_rotation(pose[3:]) @ reach[0]
        return cls(scenario.tool.while_it_lasts(t), start + scenario.tool.offsets(t), reach)

    def until(self, rows: int) -> AskedTool:
        """The part that a flight of that many rows has seen."""
        return AskedTool(self.counts[:rows], self.places[:rows], self.reach[:rows])

    def held_at(self, pose: Array) -> Array:
        """Where the arm holds the tool at poses of shape (N, 7), shape (N, 3) [m]."""
        turned = np.matmul(quaternion_rotation(pose[:, 3:]), self.reach[..., None])[..., 0]
        return np.asarray(pose[:, :3] + turned)

    def rms_mm(self, tools: Array) -> Array:
        """Root mean square of each tool's distance from the path [mm]; NaN if no row belongs to it.

        Args:
            tools: Where they were, shape (N, 3, flights) [m].
        """
        if not self.counts.any():
            return np.full(tools.shape[2], np.nan)
        x, y, z = np.moveaxis((tools - self.places[..., None])[self.counts], 1, 0)
        squares = np.square(np.sqrt(x * x + y * y + z * z))
        means = [np.mean(one) for one in squares.T]
        return np.asarray(1e3 * np.sqrt(means))
