"""What a vehicle of metal knows of its flight too, read from a record.

Estimated pose and velocity, joints as the law is told of them, and the speeds asked of the rotors,
which follow with their nominal lags. Not: the true state, the gusts, the true speeds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.rotations import quaternion_rotation
from fullam.model.rotors import Rotors
from fullam.simulation.record.run import Run

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """A record as its vehicle saw it, a row a control period.

    Attributes:
        t: Times, shape (N,) [s].
        pose: [p, quaternion xyzw], shape (N, 7).
        attitude: R_WA, shape (N, 3, 3).
        q: Configurations, shape (N, nq).
        v: Velocities, the platform's in body axes, shape (N, nv).
        squares: Mean square of each rotor's speed over the period from each row on, shape (N, n)
            [(rad/s)^2].
    """

    t: Array
    pose: Array
    attitude: Array
    q: Array
    v: Array
    squares: Array

    @classmethod
    def of(cls, run: Run, rotors: Rotors) -> MeasuredMotion:
        """Read a record; `rotors` follow what was asked of them."""
        R = quaternion_rotation(run.measured_pose[:, 3:])
        world = run.measured_velocity.reshape(-1, 2, 3)
        # Joints that are prescribed are known.
        arm, rate = (
            run.columns.get(f"measured_{name}", run.columns[name]) for name in ("arm", "arm_rate")
        )
        body = (world @ R).reshape(-1, 6)  # rows R^T v
        return cls(
            run.t,
            run.measured_pose,
            R,
            np.hstack([run.measured_pose, arm]),
            np.hstack([body, rate]),
            mean_squares(rotors.lags, run.rotor_commands, float(run.t[1] - run.t[0])),
        )

    @property
    def period(self) -> float:
        """Of control [s]."""
        return float(self.t[1] - self.t[0])

    @property
    def lever(self) -> Array:
        """From where it began to the platform, mean over each period, shape (N - 1, 3) [m]."""
        place: Array = self.pose[:, :3] - self.pose[0, :3]
        return 0.5 * (place[1:] + place[:-1])


def mean_squares(lags: Array, commands: Array, period: float) -> Array:
    """Mean square of speeds that follow their commands, over each period.

    A speed follows its command c with the rotor's lag l, Omega = c + g exp(-t / l); the mean of its
    square over a period T is c^2 + 2 c g l/T (1 - e) + g^2 l/(2T) (1 - e^2), e = exp(-T / l).

    Args:
        lags: l of each rotor, shape (n,) [s].
        commands: Speeds that were asked for, shape (N, n) [rad/s]; the first ones are there.
        period: T [s].

    Returns:
        Shape (N, n) [(rad/s)^2].
    """
    lag = np.maximum(lags, 1e-9)
    left, share = np.exp(-period / lag), lag / period
    squares, speeds = np.empty_like(commands), commands[0].copy()
    for k, command in enumerate(commands):
        gap = speeds - command
        squares[k] = command**2 + 2.0 * command * gap * share * (1.0 - left)
        squares[k] += 0.5 * gap**2 * share * (1.0 - left**2)
        speeds = command + gap * left
    return squares


def about_start(wrench_A: Array, motion: MeasuredMotion) -> Array:
    """Wrenches that turn with the platform, {A} axes, in world axes about where it began.

    Args:
        wrench_A: One or several a period at the origin of {A}, shape (N - 1, 6) or (N - 1, 6, m).
        motion: The motion.
    """
    R = 0.5 * (motion.attitude[1:] + motion.attitude[:-1])
    rows = wrench_A.reshape(len(wrench_A), 6, -1)
    force, moment = R @ rows[:, :3], R @ rows[:, 3:]
    moment += np.cross(motion.lever[:, None], force.swapaxes(1, 2)).swapaxes(1, 2)
    return np.concatenate([force, moment], axis=1).reshape(wrench_A.shape)
