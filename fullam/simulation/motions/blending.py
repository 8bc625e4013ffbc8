"""Jumps of a reference, spread over minimum-jerk profiles of bounded acceleration."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics import quaternions
from fullam.dynamics.rotations import quaternion_rotation
from fullam.dynamics.rotations import turn as rotate
from fullam.simulation.motions.references import ReferenceTable

Array = NDArray[np.float64]

PEAK_ACCELERATION = 10.0 / np.sqrt(3.0)
"""Peak of |d^2 s/dx^2| for the minimum-jerk profile s = 10 x^3 - 15 x^4 + 6 x^5."""


def blend_jumps(
    table: ReferenceTable,
    start_pose: Array,
    max_acceleration: float | None,
    max_angular_acceleration: float | None,
) -> ReferenceTable:
    """Spread the jumps of a reference over minimum-jerk profiles of bounded acceleration.

    A jump by delta at t_j (from `start_pose` at the first row) is undone and led in again:
    p(t) = p_ref(t) - delta (1 - s(x)), R(t) = exp(-(1 - s(x)) phi) R_ref(t), with
    s = 10 x^3 - 15 x^4 + 6 x^5, x = (t - t_j) / T and T such that the peak acceleration
    10/sqrt(3) |delta| / T^2 meets the limit. Position and attitude share the longer T, so that all
    six axes arrive together. What is smooth in the reference passes unchanged.

    Args:
        table: The reference, rows evenly spaced.
        start_pose: Pose from which the first row is a jump, shape (7,).
        max_acceleration: Peak linear acceleration of a blend [m/s^2]; None for no limit.
        max_angular_acceleration: Peak angular acceleration [rad/s^2]; None for no limit.

    Returns:
        A table on the same grid; the table itself if both limits are None.
    """
    if max_acceleration is None and max_angular_acceleration is None:
        return table
    t, pose = table.t, table.pose.copy()
    velocity, acceleration = table.velocity.copy(), table.acceleration.copy()
    jumps, delta, turn = _jumps(table, start_pose)
    # Last to first: an earlier blend that is still under way turns the later one with it.
    for j in jumps[::-1]:
        T = _blend_time(delta[j], turn[j], max_acceleration, max_angular_acceleration)
        if T <= 0.0:
            continue
        x = np.clip((t[j:] - t[j]) / T, 0.0, 1.0)[:, None]
        left = 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        rate = 30.0 * x**2 * (1.0 - x) ** 2 / T
        curve = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / T**2
        undo = quaternions.from_rotation_vector(-left * turn[j])
        R_undo = quaternion_rotation(undo)
        spin, inner = rate * turn[j], rotate(R_undo, velocity[j:, 3:])
        pose[j:, :3] -= left * delta[j]
        pose[j:, 3:] = quaternions.product(undo, pose[j:, 3:])
        velocity[j:, :3] += rate * delta[j]
        acceleration[j:, :3] += curve * delta[j]
        acceleration[j:, 3:] = (
            curve * turn[j] + rotate(R_undo, acceleration[j:, 3:]) + np.cross(spin, inner)
        )
        velocity[j:, 3:] = spin + inner
    return ReferenceTable(t, pose, velocity, acceleration)


def leaves_jumps(
    table: ReferenceTable,
    start_pose: Array,
    max_acceleration: float | None,
    max_angular_acceleration: float | None,
) -> bool:
    """Whether `blend_jumps`, given the same, leaves a jump as it is for want of a limit.

    It does where a limit is None and the other calls for no profile longer than a row.
    """
    if max_acceleration is not None and max_angular_acceleration is not None:
        return False
    jumps, delta, turn = _jumps(table, start_pose)
    row = table.t[1] - table.t[0] if table.t.size > 1 else 0.0
    return any(
        _blend_time(delta[j], turn[j], max_acceleration, max_angular_acceleration) <= row
        for j in jumps
    )


def _jumps(table: ReferenceTable, start_pose: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """Rows at which the pose jumps; by how much each row moves and turns beyond its velocity."""
    t, acceleration = table.t, table.acceleration
    before = np.vstack([start_pose, table.pose[:-1]])
    # What a smooth reference moves within one row, to first order, is not a jump.
    dt = np.diff(t, prepend=t[0])[:, None]
    travel = np.vstack([table.velocity[:1], table.velocity[:-1]]) * dt
    delta = table.pose[:, :3] - before[:, :3] - travel[:, :3]
    relative = quaternions.product(table.pose[:, 3:], quaternions.inverse(before[:, 3:]))
    turn = quaternions.to_rotation_vector(relative) - travel[:, 3:]
    # Both rows' accelerations: one alone may be passing through zero.
    pull = np.linalg.norm(acceleration, axis=1)
    slack = 1e-6 + np.maximum(pull, np.concatenate([pull[:1], pull[:-1]])) * dt[:, 0] ** 2
    jumps = np.linalg.norm(delta, axis=1) + np.linalg.norm(turn, axis=1) > slack
    return np.flatnonzero(jumps), delta, turn


def _blend_time(
    delta: Array,
    turn: Array,
    max_acceleration: float | None,
    max_angular_acceleration: float | None,
) -> float:
    """Time T over which a jump is spread [s]: the longer of what its two parts call for."""
    distance, angle = np.linalg.norm(delta), np.linalg.norm(turn)
    return float(
        max(
            np.sqrt(PEAK_ACCELERATION * distance / (max_acceleration or np.inf)),
            np.sqrt(PEAK_ACCELERATION * angle / (max_angular_acceleration or np.inf)),
        )
    )
