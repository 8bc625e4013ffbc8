"""Taking known lags off a motion that was commanded and is therefore known.

The estimate trails the vehicle (its filter), and the thrust trails the command (rotor lag, and half
a control period of holding it). Neither can be helped for what is unknown; but by how much the
reference moves meanwhile can be told before take-off.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fullam.control.controller import Measurement
from fullam.control.estimator import Estimator
from fullam.dynamics.pose_space import AttitudeView, pose_model
from fullam.simulation.references import ReferenceTable

Array = NDArray[np.float64]

STILL = 1e-9
"""Below this [m, rad, m/s, rad/s] a row of the table counts as zero."""


@dataclass(frozen=True, eq=False)
class Anticipation:
    """By how much the reference runs ahead of what is estimated and of what the rotors do.

    Attributes:
        pose: [p_ref - p_seen (world); log(R_seen^T R_ref) ({A})], shape (N, 6) [m, rad]: the
            reference against the reference as the estimator would see it.
        velocity: Velocity of the reference minus that seen, world axes, shape (N, 6).
        turn: [0; R^T w_ref lag]: what the platform turns until the rotors follow, shape (N, 6).
        reference: The reference with its acceleration taken one rotor lag ahead.
        moving: Whether the row differs from zero; a Python list, which a loop reads faster.
    """

    pose: Array
    velocity: Array
    turn: Array
    reference: ReferenceTable
    moving: list[bool]

    @classmethod
    def of(
        cls, reference: ReferenceTable, estimator: Estimator, actuation_lag: float
    ) -> Anticipation:
        """Tabulate it for a reference on the control grid.

        Args:
            reference: What the vehicle should follow.
            estimator: A fresh estimator, for its lag.
            actuation_lag: Time from a command to the thrust [s].
        """
        poses, velocities = estimator.as_seen(reference.pose, reference.velocity)
        seen, asked = Rotation.from_quat(poses[:, 3:]), Rotation.from_quat(reference.pose[:, 3:])
        pose = np.hstack([reference.pose[:, :3] - poses[:, :3], (seen.inv() * asked).as_rotvec()])
        velocity = reference.velocity - velocities
        turn = np.zeros_like(pose)
        turn[:, 3:] = actuation_lag * asked.inv().apply(reference.velocity[:, 3:])
        ahead = reference.t + actuation_lag
        acceleration = np.stack(
            [np.interp(ahead, reference.t, column) for column in reference.acceleration.T], axis=1
        )
        moving = np.abs(np.hstack([pose, velocity, turn])).max(axis=1) > STILL
        return cls(
            pose, velocity, turn, replace(reference, acceleration=acceleration), moving.tolist()
        )

    def __post_init__(self) -> None:
        """Prepare the workspace."""
        object.__setattr__(self, "_model", pose_model())
        object.__setattr__(self, "_attitude", AttitudeView())
        object.__setattr__(self, "_world", np.zeros(6))

    def advance(self, k: int, m: Measurement) -> None:
        """Advance pose and velocity of the measurement by row k: the estimator's lag."""
        attitude: AttitudeView = self._attitude  # type: ignore[attr-defined]
        world: Array = self._world  # type: ignore[attr-defined]
        pose, velocity = m.q[:7], m.v[:6].reshape(2, 3)
        R = attitude.look(pose)
        rows = world.reshape(2, 3)
        velocity.dot(R.T, rows)
        np.add(world, self.velocity[k], world)
        pose[:] = pin.integrate(self._model, pose, self.pose[k])  # type: ignore[attr-defined]
        rows.dot(attitude.look(pose), velocity)

    def attitude_of_thrust(self, k: int, m: Measurement) -> Array:
        """R_WA when the rotors will have followed: the attitude to turn a wrench to {A} with."""
        pose = pin.integrate(self._model, m.q[:7], self.turn[k])  # type: ignore[attr-defined]
        return self._attitude.look(pose)  # type: ignore[attr-defined]
