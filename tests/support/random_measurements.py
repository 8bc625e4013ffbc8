"""Vehicles anywhere in any motion, told to go anywhere."""

import numpy as np
import pinocchio as pin

from fullam.control.controller import Measurement, ReferencePoint
from fullam.dynamics.multibody import Multibody, body_acceleration, rotation_of

VEHICLES = ("fullam", "hextilt", "borinot", "quadrotor_arm")
"""Of four to eight rotors; the platforms of some have their centre of mass off the origin."""


def random_measurement(vehicle, rng, arm_moves=True):
    """A pose and a posture, and velocities and accelerations of order 1."""
    m = Measurement(vehicle)
    m.q[:] = pin.integrate(vehicle.model, m.q, rng.normal(size=vehicle.model.nv))
    m.v[:6] = rng.normal(size=6)
    if arm_moves:
        m.v[6:], m.arm_acceleration = rng.normal(size=(2, vehicle.n_arm))
    return m


def random_reference(rng):
    """A pose, and a velocity and an acceleration of order 1."""
    ref = ReferencePoint()
    quaternion = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
    ref.pose = np.concatenate([rng.normal(size=3), quaternion])
    ref.velocity, ref.acceleration = rng.normal(size=(2, 6))
    return ref


def assert_produces_what_it_commands(law, vehicle, rng, tolerance, arm_moves=True):
    """Forward dynamics under the law's wrench give back its u_pid.

    The tolerance is relative to the largest acceleration.
    """
    forward = Multibody(vehicle)
    for _ in range(20):
        m, ref = random_measurement(vehicle, rng, arm_moves), random_reference(rng)
        law.reset(m, ref)
        u = law.wrench(0.0, m, ref)
        wrench_A = (u.reshape(2, 3) @ rotation_of(m.q)).ravel()
        a = forward.base_acceleration(m.q, m.v, m.arm_acceleration, wrench_A)
        wanted = body_acceleration(m.q, m.v, law.u_pid)
        np.testing.assert_allclose(a, wanted, rtol=0, atol=tolerance * np.abs(wanted).max())
