# mypy: disallow-untyped-defs=False
"""How far a flight is from what was asked of it, in mm and deg, period by period.

Position p - p_d, x-y-z Euler angles minus desired ones, and the rotation vector of R R_d^T.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.so3 import Quaternion, compose, logarithm
from fullam.numbers.elementary import arctan2
from fullam.numbers.kernel import kernel, select, sqrt
from fullam.numbers.machine_code import available
from fullam.numbers.program import Stage, program
from fullam.numbers.records import Rows, aligned, columns, size
from fullam.numbers.vectors import Vector, scale, subtract
from fullam.simulation.flown import Flown

Array = NDArray[np.float64]

DEGREES = 180.0 / math.pi
LEVEL = (0.0,) * 6 + (0.0, 0.0, 0.0, 1.0)
"""The numbers of an `Asked` at the origin, level."""

AXES, SIGNALS = 6, 9
"""Of a deviation: three of position, of Euler angles and of the rotation vector."""


class Asked(NamedTuple):
    """Where the platform should be: position [mm], x-y-z Euler angles [deg], attitude."""

    position: Vector
    euler: Vector
    attitude: Quaternion


class Follow(NamedTuple):
    """What `follow` is shown: the track, what was asked, and the deviations [signal][period]."""

    track: Rows
    asked: Rows
    signals: Rows


@kernel
def euler_xyz(q):
    """(phi, psi, gamma) with R = Rx(phi) Ry(psi) Rz(gamma), eq. (2) [deg].

    sin psi = R_13, tan phi = -R_23 / R_33, tan gamma = -R_12 / R_11; the entries are written so
    that the quaternion's length cancels. At psi = +-90 deg only a sum of phi and gamma is known.
    """
    x, y, z, w = q
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    r_11, r_12 = ww + xx - yy - zz, 2.0 * (x * y - z * w)
    r_23, r_33 = 2.0 * (y * z - x * w), ww - xx - yy + zz
    psi = arctan2(2.0 * (x * z + y * w), sqrt(r_11 * r_11 + r_12 * r_12))
    return scale(DEGREES, (arctan2(-r_23, r_33), psi, arctan2(-r_12, r_11)))


@kernel
def wrap(angle):
    """Difference of two angles within [-180, 180] deg, brought to [-180, 180) deg."""
    return select(angle >= 180.0, angle - 360.0, select(angle < -180.0, angle + 360.0, angle))


@kernel
def deviation(pose, asked):
    """[p - p_d, Euler angles minus desired ones, rotation vector of R R_d^T, world axes]."""
    phi, psi, gamma = subtract(euler_xyz(pose.attitude), asked.euler)
    x, y, z, w = asked.attitude
    return (
        subtract(scale(1e3, pose.position), asked.position),
        (wrap(phi), wrap(psi), wrap(gamma)),
        scale(DEGREES, logarithm(compose(pose.attitude, (-x, -y, -z, w)))),
    )


@kernel
def put(signals, first, k, vector):
    """Store a vector in row k of three signals."""
    signals[first][k] = vector[0]
    signals[first + 1][k] = vector[1]
    signals[first + 2][k] = vector[2]


@kernel
def follow(view, _):
    """Deviations of the last rows of a track, as many as are asked for."""
    start = len(view.track) - len(view.asked)
    for k in range(len(view.asked)):
        position, euler, rotation = deviation(view.track[start + k].pose, view.asked[k])
        put(view.signals, 0, k, position)
        put(view.signals, 3, k, euler)
        put(view.signals, 6, k, rotation)


def asked_rows(coordinates: Array, pose: Array) -> Rows:
    """What is asked of all flights, from coordinates (N, 6) [mm, deg] and poses (N, 7)."""
    return Rows(Asked, np.hstack([coordinates, pose[:, 3:]]))


def lanes_here() -> int:
    """Lanes that one flight is computed in: as many as a campaign's, to share its machine code."""
    return 8 if available() else 0


def track_of(pose: Array, saturated: Array | float = 0.0, thrust: Array | float = 0.0) -> Rows:
    """The track of one flight, in every lane.

    Args:
        pose: [p, quaternion xyzw], shape (N, 7).
        saturated: Whether the allocation met a bound, shape (N,).
        thrust: Sum of the rotor thrusts [N], shape (N,).
    """
    lanes = lanes_here()
    array = aligned((len(pose), size(Flown), *((lanes,) if lanes else ())))
    entries = array if lanes else array[..., None]
    at = columns(Flown)
    entries[:, at["pose"]] = pose[..., None]
    entries[:, at["saturated"].start] = np.reshape(saturated, (-1, 1))
    entries[:, at["thrust"].start] = np.reshape(thrust, (-1, 1))
    return Rows(Flown, array, lanes)


def deviations(pose: Array, asked: Rows) -> Array:
    """`deviation` of one flight, shape (N, 9) [mm, deg, deg], from poses (N, 7)."""
    track = track_of(pose)
    out = Rows.empty(float, SIGNALS, len(pose), lanes=track.lanes)
    program([Stage(follow, Follow(track, asked, out))]).run(0, 1)
    return np.ascontiguousarray(out.array[:, :, 0, 0].T if out.lanes else out.array[:, :, 0].T)


def coordinates(pose: Array) -> Array:
    """[position [mm], x-y-z Euler angles [deg]] of poses, (N, 7) to (N, 6)."""
    level = Rows(Asked, np.tile(LEVEL, (len(pose), 1)))
    return deviations(pose, level)[:, :6]
