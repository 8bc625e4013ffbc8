"""A vehicle at rest: the rotor speeds that hold it, whether they can, and the picture of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.atlas.rays import attained
from fullam.control.allocation import Allocator
from fullam.dynamics.pose_space import pose_from_euler
from fullam.model.vehicle import Vehicle
from fullam.model.wrench_axes import controllable_axes
from fullam.viz.viewer.replay import Film
from fullam.viz.viewer.scene import Scene, VehicleScene
from fullam.viz.viewer.snapshot import Snapshot

Array = NDArray[np.float64]

HEIGHT = 1.5
"""Height at which a vehicle at rest is drawn [m]."""


@dataclass(frozen=True, eq=False)
class Hover:
    """A vehicle that holds still, or tries to.

    Attributes:
        vehicle: The vehicle.
        pose: [p, quaternion xyzw].
        arm: Joint angles [rad].
        speeds: Rotor speeds, shape (n,) [rad/s].
        feasible: Whether they hold it.
        missing: What is missing of the wrench that would, in {A}, shape (6,) [N, N m].
        tilt: Angle between the platform's z and the vertical [rad].
        azimuth: Where the platform leans to, seen from {A} [rad].
        envelope: What it can do in this arm pose.
    """

    vehicle: Vehicle
    pose: Array
    arm: Array
    speeds: Array
    feasible: bool
    missing: Array
    tilt: float
    azimuth: float
    envelope: Envelope

    @property
    def largest_tilt(self) -> float:
        """Tilt in this direction up to which all can be held [rad]; 0 without hover."""
        return float(np.nan_to_num(self.envelope.rose(self.azimuth)[0]))

    @property
    def shares(self) -> Array:
        """Thrusts as shares of the largest, shape (n,); 0 for failed rotors."""
        top = self.vehicle.rotors.max_speeds
        return np.square(np.divide(self.speeds, top, out=np.zeros_like(top), where=top > 0.0))

    def snapshot(self) -> Snapshot:
        """As a viewer needs it."""
        vehicle, n = self.vehicle, self.vehicle.n_arm
        R_WA = pin.Quaternion(self.pose[3:]).toRotationMatrix()
        wrench_A = vehicle.rotors.wrench(self.speeds)
        weight_A, _ = _load(vehicle, self.pose, self.arm)
        # What cannot be delivered is held by a hand: the vehicle is drawn at rest all the same.
        hand_A = weight_A - wrench_A
        return Snapshot(
            pose=self.pose,
            velocity=np.zeros(6),
            arm=self.arm,
            arm_rate=np.zeros(n),
            arm_acceleration=np.zeros(n),
            rotor_speeds=self.speeds,
            rotor_wrench=np.concatenate([R_WA @ wrench_A[:3], R_WA @ wrench_A[3:]]),
            disturbance=np.concatenate([R_WA @ hand_A[:3], R_WA @ hand_A[3:]]),
            target=self.pose,
            saturated=not self.feasible,
            spin=0.7 * np.arange(len(self.speeds), dtype=np.float64),
        )


def hover(
    vehicle: Vehicle, arm_deg: ArrayLike | None = None, euler_deg: ArrayLike = (0.0, 0.0, 0.0)
) -> Hover:
    """Work out how a vehicle holds still.

    Args:
        vehicle: The vehicle.
        arm_deg: Joint positions [deg, or m of a prismatic joint]; at rest by default.
        euler_deg: x-y-z Euler angles of the platform [deg].

    Raises:
        VehicleError: Not one angle per arm joint.
    """
    positions = None if arm_deg is None else vehicle.joints.from_typed(arm_deg)
    arm = np.array(vehicle.neutral(positions)[7:])
    pose = pose_from_euler(np.array([0.0, 0.0, HEIGHT]), np.deg2rad(np.asarray(euler_deg)))
    rotors = vehicle.rotors
    wrench_A, up_A = _load(vehicle, pose, arm)
    allocator = Allocator(rotors, axes=controllable_axes(rotors), vehicle_name=vehicle.name)
    speeds = allocator.solve(wrench_A).speeds
    envelope = Envelope.of(vehicle, arm)
    azimuth = float(np.arctan2(up_A[1], up_A[0]))
    return Hover(
        vehicle=vehicle,
        pose=pose,
        arm=arm,
        speeds=speeds,
        feasible=bool(attained(envelope.facets, envelope.load.wrench(up_A))),
        missing=wrench_A - rotors.wrench(speeds),
        tilt=float(np.arccos(np.clip(up_A[2], -1.0, 1.0))),
        azimuth=azimuth,
        envelope=envelope,
    )


def _load(vehicle: Vehicle, pose: Array, arm: Array) -> tuple[Array, Array]:
    """Rotor wrench that holds the vehicle, in {A}, and the vertical seen from {A}."""
    q = np.concatenate([pose, arm])
    wrench = pin.computeGeneralizedGravity(vehicle.model, vehicle.create_data(), q)[:6]
    return np.array(wrench), pin.Quaternion(pose[3:]).toRotationMatrix()[2].copy()


def stage(vehicle: Vehicle, details: str | None = None, forces: Envelope | None = None) -> Scene:
    """A scene with one vehicle at rest, without a target.

    Args:
        vehicle: The vehicle.
        details: A line about it.
        forces: Whose attainable forces are drawn about the platform; None for none.
    """
    part = VehicleScene(vehicle, vehicle.name, ghost=False)
    part.forces = forces
    text = (
        details or f"{vehicle.rotors.count} rotors, {vehicle.n_arm} joints, {vehicle.mass:.3g} kg"
    )
    return Scene([part], vehicle.name, text, np.array([[0.0, 0.0, HEIGHT]]))


def portrait(
    vehicle: Vehicle,
    arm_deg: ArrayLike | None = None,
    euler_deg: ArrayLike = (0.0, 0.0, 0.0),
    forces: bool = False,
) -> Film:
    """A film of one frame: the vehicle at hover, its rotors at the speeds that hold it.

    Args:
        vehicle: The vehicle.
        arm_deg: As in `hover`.
        euler_deg: As in `hover`.
        forces: Draw the forces that it attains about the platform.
    """
    found = hover(vehicle, arm_deg, euler_deg)
    scene = stage(vehicle, forces=found.envelope if forces else None)
    frame = scene.frame(0.0, [found.snapshot()])
    return Film(scene.spec(clock=False), frame[None, :], 1.0)
