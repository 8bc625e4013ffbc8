"""A reference for a vehicle with failed rotors: position and heading as asked, the tilt trimmed.

The target attitude R is turned by the shortest way to where the up vector h of the trim attitude
(see `fullam.control.trim`) points up: with z = R h and e = e_z,

    R' = exp(angle(z, e) (z x e) / |z x e|) R.

R' then turns about the vertical alone, with

    w' = e (e + z) . w / (1 + e . z),        dw' = e ((e + z) . dw - w'_z dz_z) / (1 + e . z),

since w . dz = w . (w x z) = 0. First it turns, then it moves: what the trim attitude has to spare
is not there before.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.control.trim import HoverMargins, Trim
from fullam.dynamics import quaternions
from fullam.dynamics.rotations import quaternion_rotation
from fullam.model.attainable.facets import MOST_ROTORS, facets_of
from fullam.model.vehicle import Vehicle
from fullam.simulation.motions.references import ReferenceTable
from fullam.simulation.motions.shaping import Shaping

Array = NDArray[np.float64]

ARM_POSES = 25
"""Arm poses of a flight that the trim attitude is looked for in."""

USED = 0.5
"""Share of the margin that a blend may take for its acceleration."""

TURNED = 1e-9
"""An entry of a quaternion this far from its end is there."""

LEAST_ACCELERATION = 0.1
"""What a blend accelerates with where nothing is to spare [m/s^2]."""

LEAST = 1e-9
"""Least 1 + e . z: upside down a heading means nothing."""


def trim_of(vehicle: Vehicle, arm: Array, attitudes: Array | None = None) -> Trim | None:
    """The trim of a vehicle with failed rotors; None if none has failed, or an axis is lacking.

    Args:
        vehicle: The nominal vehicle.
        arm: Its arm poses, shape (k, n_arm).
        attitudes: Attitudes that are asked for, shape (m, 4), quaternions xyzw; if they are known.
    """
    rotors, weight = vehicle.rotors, vehicle.mass * vehicle.gravity
    failed = np.flatnonzero(rotors.max_speeds == 0.0)
    if not failed.size or weight <= 0.0 or rotors.count > MOST_ROTORS:
        return None
    facets = facets_of(rotors)
    if facets.rank < 6:
        return None
    length = float(np.linalg.norm(rotors.positions, axis=1).mean()) or 1.0
    margins = HoverMargins.of(facets, weight, _centers(vehicle, arm), length)
    up, margin = margins.best()
    asked = None
    if attitudes is not None:
        ups = np.unique(np.round(quaternion_rotation(attitudes)[:, 2, :], 6), axis=0)
        asked = float(margins.at(ups).min())
    names = tuple(rotors.names[i] for i in failed)
    return Trim(names, up, margin, float(margins.at(np.eye(3)[2])), asked, length)


def _centers(vehicle: Vehicle, arm: Array) -> Array:
    """Centres of mass in {A} of some of the arm poses, shape (k, 3)."""
    poses = np.unique(arm, axis=0)
    if len(poses) > ARM_POSES:
        poses = poses[np.linspace(0, len(poses) - 1, ARM_POSES).round().astype(int)]
    data, model = vehicle.create_data(), vehicle.model
    found = [np.array(pin.centerOfMass(model, data, vehicle.neutral(pose))) for pose in poses]
    return np.array(found)


def trim_reference(
    asked: ReferenceTable, start: Array, shaping: Shaping, trim: Trim, mass: float
) -> ReferenceTable:
    """What a vehicle with failed rotors is to follow: trimmed, and blended within its margin.

    Args:
        asked: The reference.
        start: Pose from which the first row is a jump, shape (7,).
        shaping: The scenario's shaping.
        trim: How the vehicle hovers.
        mass: Of the vehicle [kg].
    """
    acceleration = max(USED * trim.margin / mass, LEAST_ACCELERATION)
    return blended(trimmed(asked, trim.up), start, shaping, acceleration)


def trimmed(table: ReferenceTable, up: Array) -> ReferenceTable:
    """The reference with every attitude trimmed; see the module's first lines.

    Args:
        table: The reference.
        up: Up vector of the trim attitude, seen from {A}, shape (3,).
    """
    z = quaternion_rotation(table.pose[:, 3:]) @ up
    # z x e = (z_y, -z_x, 0)
    axis = np.stack([z[:, 1], -z[:, 0], np.zeros(len(z))], axis=1)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine, z[:, 2:])
    turn = quaternions.from_rotation_vector(axis * angle / np.where(sine > 0.0, sine, 1.0))
    pose, velocity, acceleration = (
        column.copy() for column in (table.pose, table.velocity, table.acceleration)
    )
    pose[:, 3:] = quaternions.product(turn, pose[:, 3:])
    w, dw = table.velocity[:, 3:], table.acceleration[:, 3:]
    both = z + np.array([0.0, 0.0, 1.0])
    size = np.maximum(both[:, 2], LEAST)
    spin = np.sum(both * w, axis=1) / size
    velocity[:, 3:] = acceleration[:, 3:] = 0.0
    velocity[:, 5] = spin
    sinking = w[:, 0] * z[:, 1] - w[:, 1] * z[:, 0]
    acceleration[:, 5] = (np.sum(both * dw, axis=1) - spin * sinking) / size
    return ReferenceTable(table.t, pose, velocity, acceleration)


def blended(
    table: ReferenceTable, start: Array, shaping: Shaping, acceleration: float
) -> ReferenceTable:
    """The reference with its jumps spread, of position and attitude each in a time of its own.

    The position stands still until the attitude has arrived.

    Args:
        table: The reference.
        start: Pose from which the first row is a jump, shape (7,).
        shaping: The scenario's shaping.
        acceleration: What there is for accelerating [m/s^2]; the shaping's own limit if less.
    """
    most = min(shaping.max_acceleration or np.inf, acceleration)
    gentle = replace(shaping, max_acceleration=most)
    turning = gentle.blend(_only(table, slice(3, 7)), _posed(start, slice(3, 7)))
    place = _only(table, slice(0, 3))
    turned = np.abs(turning.pose[:, 3:] - table.pose[:, 3:]).max(axis=1) <= TURNED
    until = int(turned.argmax())  # 0 if it never does
    place.pose[:until, :3] = start[:3]
    place.velocity[:until] = place.acceleration[:until] = 0.0
    moving = gentle.blend(place, _posed(start, slice(0, 3)))
    pose = np.hstack([moving.pose[:, :3], turning.pose[:, 3:]])
    rates = [
        np.hstack([a[:, :3], b[:, 3:]])
        for a, b in (
            (moving.velocity, turning.velocity),
            (moving.acceleration, turning.acceleration),
        )
    ]
    return ReferenceTable(table.t, pose, *rates)


def _posed(pose: Array, part: slice) -> Array:
    """Poses, shape (..., 7), of which a part is left; the rest is that of the origin."""
    found = np.zeros_like(pose)
    found[..., 6] = 1.0
    found[..., part] = pose[..., part]
    return found


def _only(table: ReferenceTable, part: slice) -> ReferenceTable:
    """A reference of position or attitude alone."""
    rates = slice(min(part.start, 3), min(part.stop, 6))
    velocity, acceleration = np.zeros_like(table.velocity), np.zeros_like(table.acceleration)
    velocity[:, rates] = table.velocity[:, rates]
    acceleration[:, rates] = table.acceleration[:, rates]
    return ReferenceTable(table.t, _posed(table.pose, part), velocity, acceleration)
