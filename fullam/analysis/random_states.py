"""Random states on purpose: ordinary, extreme and near-singular inputs for the witnesses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.dynamics.rotations import euler_rotation, logarithm
from fullam.exceptions import UnknownName

Array = NDArray[np.float64]

CATEGORIES = ("ordinary", "fast", "singular", "stretched", "inertias", "external")
"""Kinds of random states: moderate; fast (20 rad/s, 30 m/s); within 1e-3 to 1e-12 rad of the
Euler singularity; arm straight or folded to 1e-9 rad; random inertias; a wrench at the tool."""


@dataclass(frozen=True, eq=False)
class States:
    """A batch of N random inputs in Pinocchio's convention.

    Attributes:
        q: Configurations, shape (N, nq).
        v: Velocities in body axes, shape (N, nv).
        ddtheta: Joint accelerations, shape (N, n) [rad/s^2].
        wrench_A: Rotor wrenches in {A}, shape (N, 6).
        tool_wrench: Wrenches on the environment, world axes, shape (N, 6).
    """

    q: Array
    v: Array
    ddtheta: Array
    wrench_A: Array
    tool_wrench: Array


def random_states(n: int, category: str, count: int, rng: np.random.Generator) -> States:
    """Draw states of one category for a vehicle with n joints.

    Args:
        n: Number of joints.
        category: One of `CATEGORIES`.
        count: Number of states.
        rng: Source of randomness.

    Raises:
        UnknownName: There is no such category.
    """
    if category not in CATEGORIES:
        raise UnknownName("category of states", category, CATEGORIES)
    pace = 10.0 if category == "fast" else 1.0
    euler = rng.uniform(-np.pi, np.pi, (count, 3))
    euler[:, 1] /= 2.0
    theta = rng.uniform(-np.pi, np.pi, (count, n))
    if category == "singular":
        side = rng.choice([-1.0, 1.0], count)
        euler[:, 1] = side * (np.pi / 2 - 10.0 ** rng.uniform(-12, -3, count))
    if category == "stretched":
        theta[:] = rng.integers(-2, 3, (count, n)) * (np.pi / 2)
        theta += rng.choice([0.0, 1e-9], (count, n)) * rng.normal(size=(count, n))
    half = 0.5 * logarithm(euler_rotation(euler))
    angle = np.linalg.norm(half, axis=1, keepdims=True)
    quaternion = np.hstack([np.sinc(angle / np.pi) * half, np.cos(angle)])
    v = pace * rng.uniform(-1, 1, (count, 6 + n)) * np.repeat([3.0, 2.0], [3, 3 + n])
    tool_wrench = np.zeros((count, 6))
    if category == "external":
        tool_wrench = rng.normal(size=(count, 6)) * np.repeat([20.0, 3.0], 3)
    return States(
        q=np.hstack([rng.uniform(-10, 10, (count, 3)), quaternion, theta]),
        v=v,
        ddtheta=pace**2 * rng.uniform(-5, 5, (count, n)),
        wrench_A=rng.normal(size=(count, 6)) * np.repeat([30.0, 5.0], 3),
        tool_wrench=tool_wrench,
    )


def randomized_inertias(model: pin.Model, rng: np.random.Generator) -> pin.Model:
    """A copy of the model whose links have random physical inertias, centres of mass off-origin."""
    copy = pin.Model(model)
    for joint in range(1, copy.njoints):
        mass = rng.uniform(0.05, 3.0)
        axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        inertia = axes @ np.diag(_principal_moments(mass, rng)) @ axes.T
        copy.inertias[joint] = pin.Inertia(mass, rng.uniform(-0.2, 0.2, 3), inertia)
    return copy


def _principal_moments(mass: float, rng: np.random.Generator) -> Array:
    """Principal moments of a box of random sides: they obey the triangle inequality."""
    squared = rng.uniform(0.02, 0.4, 3) ** 2
    return mass / 12.0 * (np.sum(squared) - squared)
