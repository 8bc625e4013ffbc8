"""What the rotors have to hold: a vehicle at rest, with its arm in some pose, as a few numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from fullam.exceptions import VehicleError
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Load:
    """What a vehicle at rest asks of its rotors.

    With u the up vector seen from {A}, the wrench is  m g [u; c x u] + extra.

    Attributes:
        mass: m, of everything carried [kg].
        gravity: g [m/s^2].
        center: c, centre of mass of everything in {A}, shape (3,) [m].
        inertia: About the centre of mass, in {A} axes, arm locked, shape (3, 3) [kg m^2].
        tool: Origin of the tool frame in {A}, shape (3,) [m].
        extra: What the rotors give beside holding the weight, fixed in {A}: the opposite of a
            wrench on the tool, shape (6,) [N, N m].
    """

    mass: float
    gravity: float
    center: Array
    inertia: Array
    tool: Array
    extra: Array

    @property
    def weight(self) -> float:
        """Weight m g [N]."""
        return self.mass * self.gravity

    @property
    def map(self) -> Array:
        """Map m g [1; skew(c)]: up vector in {A} to the wrench that holds it, (6, 3) [N]."""
        return self.weight * np.vstack([np.eye(3), pin.skew(self.center)])

    def wrench(self, up_A: ArrayLike = (0.0, 0.0, 1.0)) -> Array:
        """Rotor wrench that holds the vehicle with this unit vector of {A} pointing up, (6,)."""
        return self.map @ np.asarray(up_A, dtype=float) + self.extra

    def with_payload(self, payload: float) -> Load:
        """The same with a point mass [kg] at the tool."""
        mass = self.mass + payload
        center = (self.mass * self.center + payload * self.tool) / mass
        arm = self.tool - self.center
        reduced = self.mass * payload / mass
        spread = reduced * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return replace(self, mass=mass, center=center, inertia=self.inertia + spread)


def load_of(
    vehicle: Vehicle,
    theta: ArrayLike | None = None,
    payload: float = 0.0,
    tool_wrench: ArrayLike | None = None,
) -> Load:
    """What a vehicle at rest asks of its rotors.

    Args:
        vehicle: The vehicle.
        theta: Arm pose, shape (n_arm,) [rad or m]; at rest by default.
        payload: Point mass at the tool [kg].
        tool_wrench: What the world exerts on the tool, in {A} axes at the tool's origin, shape
            (6,) [N, N m]; it stays as it is in {A} when the vehicle tilts.

    Raises:
        VehicleError: If `theta` has not one entry per arm joint, without gravity, or for a payload
            below 0.
    """
    where = f"vehicle '{vehicle.name}'"
    if vehicle.gravity <= 0.0:
        raise VehicleError(
            where,
            "gravity",
            f"is {vehicle.gravity:g}",
            "hovering needs a weight; give a positive one",
        )
    if not payload >= 0.0:
        raise VehicleError(where, "payload", f"is {payload:g} kg", "give 0 or more")
    q, data = vehicle.neutral(theta), vehicle.create_data()
    center = np.array(pin.centerOfMass(vehicle.model, data, q))
    pin.ccrba(vehicle.model, data, q, np.zeros(vehicle.model.nv))
    pin.framesForwardKinematics(vehicle.model, data, q)
    tool = np.array(data.oMf[vehicle.model.getFrameId(vehicle.tool)].translation)
    extra = np.zeros(6)
    if tool_wrench is not None:
        given = np.asarray(tool_wrench, dtype=float)
        extra = -np.concatenate([given[:3], given[3:] + np.cross(tool, given[:3])])
    load = Load(
        mass=vehicle.mass,
        gravity=vehicle.gravity,
        center=center,
        inertia=np.array(data.Ig.inertia),
        tool=tool,
        extra=extra,
    )
    return load.with_payload(payload) if payload > 0.0 else load


def centers_of(vehicle: Vehicle, thetas: ArrayLike) -> Array:
    """Centres of mass in {A} for many arm poses, shape (k, 3) [m].

    Args:
        vehicle: The vehicle.
        thetas: Arm poses, shape (k, n_arm) [rad].
    """
    q, data, model = vehicle.neutral(), vehicle.create_data(), vehicle.model
    poses = np.asarray(thetas, dtype=float)
    centers = np.empty((len(poses), 3))
    for row, angles in enumerate(poses):
        q[7:] = angles
        centers[row] = pin.centerOfMass(model, data, q)
    return centers


def center_jacobian(vehicle: Vehicle, theta: ArrayLike | None = None) -> Array:
    """How the centre of mass in {A} moves with the arm's joints, shape (3, n_arm) [m/rad]."""
    q, data = vehicle.neutral(theta), vehicle.create_data()
    return np.array(pin.jacobianCenterOfMass(vehicle.model, data, q)[:, 6:])
