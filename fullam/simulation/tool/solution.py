"""Solving a tool task before take-off: which motions of platform and arm take the tool along.

At knots 20 ms apart the configuration is moved until the tool is where the path says, by steps of
`step`; through the knots go splines of degree 5, which are what flies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.dynamics.rotations import euler_rotation, exponential
from fullam.exceptions import ScenarioError
from fullam.model.vehicle import Vehicle
from fullam.simulation.motions import arm_motion
from fullam.simulation.motions.arm_motion import HoldArm
from fullam.simulation.motions.joint_trajectory import JointTrajectory
from fullam.simulation.motions.reference_table import tabulate
from fullam.simulation.motions.trajectory import Trajectory
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.tool.follows import FollowsTool
from fullam.simulation.tool.kinematics import ToolKinematics
from fullam.simulation.tool.paths import minimum_jerk
from fullam.simulation.tool.step import RateSolver, RateTask
from fullam.simulation.tool.task import CHECK, ToolTask

Array = NDArray[np.float64]

KNOT = 0.02
"""Time between knots [s]."""

CORRECTIONS = 3
"""Times that a knot is solved, each on the Jacobian of where the last one led."""

RETURN = 1.0
"""Rate at which joints go back to their posture and the platform to its attitude [1/s]."""

NEAR, KEPT = 5.0, 0.01
"""A joint comes nearer to a limit by at most so much of the rest a second [1/s], and leaves out
this share of its range at either end, for the spline between the knots."""

OF_MAX_RATE = 0.9
"""Share of a joint's largest rate that is used at knots; between them it may be a little more."""

EXACT, TOOL = 0, 1
"""Levels: an attitude that is fixed; the tool, and what is weighed against it."""

BLEND = 2.0
"""Time in which an attitude that differs from that at the start is blended in [s]."""

MOST_MISSED = 1e-3
"""Farther than this the tool may not stay from its path in what flies [m]."""


@dataclass(frozen=True, eq=False)
class ToolSolution:
    """Motions that take the tool along its path.

    Attributes:
        reference: Of the platform.
        arm: Of the arm.
        missed: How far the tool stays from the path at most, in kinematics [m].
    """

    reference: Trajectory
    arm: JointTrajectory | HoldArm
    missed: float


def solve_tool(
    task: ToolTask, vehicle: Vehicle, start_pose: Array, start_arm: Array, duration: float
) -> ToolSolution:
    """Motions of platform and arm for the whole flight.

    Args:
        task: What the tool should do.
        vehicle: The nominal vehicle.
        start_pose: Where the platform starts, shape (7,).
        start_arm: Where the arm starts, shape (n,) [rad or m].
        duration: Length of the flight [s].

    Raises:
        ScenarioError: The tool cannot follow within the limits; the message says when.
    """
    times = np.arange(int(np.ceil(duration / KNOT - 1e-9)) + 1, dtype=np.float64) * KNOT
    kinematics = ToolKinematics(vehicle)
    start = np.concatenate([start_pose, start_arm])
    path = kinematics.place(start) + task.offsets(times)
    knots = _Knots(task, vehicle, kinematics, start).along(times, path)
    reference = Trajectory.from_arrays(times, knots[:, :3], knots[:, 3:7], degree=5)
    joints = vehicle.joints
    arm: JointTrajectory | HoldArm = HoldArm()
    if vehicle.n_arm:
        typed = joints.to_typed(knots[:, 7:])
        arm = JointTrajectory.from_arrays(times, typed, degree=5, units=joints.units)
    fine = np.arange(2 * times.size - 1, dtype=np.float64) * (0.5 * KNOT)
    poses = tabulate(reference, fine, start_pose).pose
    theta = arm_motion.tabulate(arm, fine, start_arm, joints).theta
    away = kinematics.places(poses, theta) - kinematics.place(start) - task.offsets(fine)
    missed = np.linalg.norm(away, axis=1)
    if missed.max() > MOST_MISSED:
        first = fine[np.argmax(missed > MOST_MISSED)]
        raise CHECK.refuse(
            f"path at t = {first:g} s",
            f"the tool stays up to {1e3 * missed.max():.3g} mm from it within the limits of "
            f"'{vehicle.name}'",
            "give it more time, let the platform move faster (max_speed, max_turn_deg), or weigh "
            "the tool more (weights.tool, priority = 'strict')",
        )
    return ToolSolution(reference, arm, float(missed.max()))


def with_tool_solved(scenario: Scenario, vehicle: Vehicle) -> Scenario:
    """The scenario with the motions that follow from its tool's task, if any do.

    Raises:
        ScenarioError: The tool cannot follow its path within the limits, the message says when; or
            the platform is not controlled in all axes.
    """
    if scenario.tool is None or not isinstance(scenario.reference, FollowsTool):
        return scenario
    if not all(scenario.axes_mask):
        problem = f"are {', '.join(scenario.axes)}"
        raise CHECK.refuse(
            "axes", problem, "a platform that follows a tool is controlled in all six"
        )
    arm = scenario.initial_arm(vehicle)
    found = solve_tool(scenario.tool, vehicle, scenario.initial_pose, arm, scenario.duration)
    return replace(scenario, reference=found.reference, arm_motion=found.arm)


class _Knots:
    """Goes from knot to knot."""

    def __init__(
        self, task: ToolTask, vehicle: Vehicle, kinematics: ToolKinematics, start: Array
    ) -> None:
        self._task, self._joints, self._kinematics = task, vehicle.joints, kinematics
        self._model, self._start = vehicle.model, start
        self._n = 6 + vehicle.n_arm
        self._solver = RateSolver(self._n)
        begin = np.array(pin.Quaternion(start[3:7]).toRotationMatrix())
        wanted = begin
        if task.euler_deg is not None:
            wanted = euler_rotation(np.radians(task.euler_deg))
        self._begin, self._way = begin, np.array(pin.log3(begin.T @ wanted))

    def along(self, times: Array, path: Array) -> Array:
        """Configurations at the knots, shape (N, 7 + n)."""
        knots = [self._start]
        for t, place in zip(times[1:], path[1:], strict=True):
            knots.append(self._next(knots[-1], float(t), place))
        return np.array(knots)

    def _next(self, before: Array, t: float, place: Array) -> Array:
        """The configuration that has the tool at a place, from the one a knot earlier."""
        low, high = self._bounds(before)
        rates, q = np.zeros(self._n), before
        for _ in range(CORRECTIONS):
            J = self._kinematics.jacobian(q)
            here = self._kinematics.place(q)
            tasks = self._rate_tasks(before, t, J, J @ rates + (place - here) / KNOT)
            found = self._solver.solve(tasks, low, high)
            if found is None:
                raise ScenarioError(
                    "tool task",
                    f"path at t = {t:g} s",
                    "the rates of platform and joints cannot be solved for",
                    "weigh less unevenly (weights)",
                )
            rates = found
            q = np.array(pin.integrate(self._model, before, rates * KNOT))
        return q

    def _rate_tasks(self, before: Array, t: float, J: Array, velocity: Array) -> list[RateTask]:
        asked, w, n = self._task, self._task.weights, self._n
        eye, joints = np.eye(n), n - 6
        strict, fixed = asked.priority == "strict", asked.attitude == "fixed"
        costs = np.array([w.platform] * 3 + [w.turn] * 3 + [w.joints] * joints)
        rest = TOOL + 2 * strict
        tasks = [RateTask(J, velocity, w.tool, TOOL), RateTask(eye, np.zeros(n), costs, rest)]
        if asked.attitude != "free":
            attitude = np.array(pin.Quaternion(before[3:7]).toRotationMatrix())
            turn = np.array(pin.log3(attitude.T @ self._wanted(t)))
            if fixed:
                tasks.append(RateTask(eye[3:6], turn / KNOT, 1.0, EXACT))
            else:
                tasks.append(RateTask(eye[3:6], RETURN * turn, w.attitude, TOOL + strict))
        if joints and w.posture > 0.0:
            back = RETURN * (self._start[7:] - before[7:])
            tasks.append(RateTask(eye[6:], back, w.posture, rest))
        return tasks

    def _wanted(self, t: float) -> Array:
        """The attitude that is kept or preferred at a time."""
        angle = float(np.linalg.norm(self._way))
        if angle == 0.0:
            return self._begin
        share = float(minimum_jerk(np.array(t - self._task.at), BLEND))
        return np.asarray(self._begin @ exponential(self._way / angle, share * angle))

    def _bounds(self, before: Array) -> tuple[Array, Array]:
        """Least and largest rates: none that leads out of a joint's range, and 0 always is one."""
        joints, task = self._joints, self._task
        platform = np.repeat([task.max_speed, np.radians(task.max_turn_deg)], 3)
        theta, reach = before[7:], OF_MAX_RATE * np.minimum(joints.max_rates, 1e3)
        margin = np.where(np.isfinite(joints.upper - joints.lower), joints.upper - joints.lower, 0)
        down = NEAR * np.maximum(theta - joints.lower - KEPT * margin, 0.0)
        up = NEAR * np.maximum(joints.upper - KEPT * margin - theta, 0.0)
        low = np.concatenate([-platform, -np.minimum(reach, down)])
        high = np.concatenate([platform, np.minimum(reach, up)])
        return low, high
