"""Momentum-based observer of the wrench that the nominal model does not explain."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.control.controller import Measurement
from fullam.dynamics.pose_space import AttitudeView
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]


class WrenchObserver:
    """What pushes the vehicle besides rotors and weight, from its momentum.

    The momentum of platform and arm, linear h_f and angular h_tau about the common centre of mass
    (at c from the origin of {A}), changes in world axes by external wrenches alone:

        dh_f = U_f + m g + d_f,    dh_tau = U_tau - c x U_f + d_tau,

    whatever the arm does; no Coriolis term, no derivative of the velocity. Everything but d is
    known: h from the measured velocities and the nominal inertias, U from what the allocation
    delivered, followed by the rotors with a first-order lag in {A} axes. The classical observer of
    rate K, d = K (h - int (U + m g + d) dt), is for a wrench held over the period T

        d+ = d + (1 - exp(-K T)) ((h+ - h) / T - U_mean - m g - d),

    a first-order low-pass filter on the unexplained wrench. It is taken at the origin of {A} before
    the filter, since gusts and rotors act on the platform and not on the moving centre of mass.
    d contains gusts, contact, and what the nominal masses, inertias and thrust coefficients have
    wrong. An impulse J leaves d = K J behind, which decays with K: cancelling d then takes back
    just the momentum that the impulse brought.

    Attributes:
        wrench: d at the origin of {A}, world axes, shape (6,) [N, N m], live.
    """

    def __init__(
        self, vehicle: Vehicle, period: float, rates: tuple[float, float], lag: float
    ) -> None:
        """Bind the nominal vehicle.

        Args:
            vehicle: The nominal vehicle.
            period: Time between updates [s].
            rates: K of force and of moment [rad/s]; 0 switches a half off.
            lag: Time constant with which the wrench follows its command [s].
        """
        self._model, self._data = vehicle.model, vehicle.create_data()
        self._T = period
        self._rates = np.repeat(np.asarray(rates, dtype=float), 3)
        self._gain: Array = 1.0 - np.exp(-self._rates * period)
        self._decay = float(np.exp(-period / lag)) if lag > 0.0 else 0.0
        self._mean = lag / period * (1.0 - self._decay)
        self._weight = np.array([0.0, 0.0, -vehicle.mass * vehicle.gravity])
        self._q, self._v = vehicle.neutral(), np.zeros(vehicle.model.nv)
        self._attitude = AttitudeView()
        self._R: Array = np.eye(3)
        self._c: Array = np.zeros(3)
        self._h: Array = np.zeros(6)
        self._command_A: Array = np.zeros((2, 3))
        self._actual_A: Array = np.zeros((2, 3))
        self.wrench: Array = np.zeros(6)

    def reset(self, m: Measurement) -> None:
        """Nothing unexplained yet; the rotors carry the weight."""
        c = self._momentum(m, self._h)
        self._c[:] = c
        self._R[:] = self._attitude.look(m.q[:7])
        self.wrench[:] = 0.0
        hover = np.array([-self._weight, -(pin.skew(c) @ self._weight)])
        np.dot(hover, self._R, out=self._actual_A)
        self._command_A[:] = self._actual_A

    def update(self, m: Measurement) -> Array:
        """Take in the state one period after the last; returns `wrench`."""
        h = np.empty(6)
        c = self._momentum(m, h)
        gap = self._actual_A - self._command_A
        mean_A = self._command_A + self._mean * gap
        np.add(self._command_A, self._decay * gap, out=self._actual_A)
        R = self._attitude.look(m.q[:7])
        mean_W = mean_A @ (self._R + R).T
        mean_W *= 0.5
        self._R[:] = R
        # The moving arm carries the centre of mass along: what acted had the lever in between.
        lever = pin.skew(0.5 * (self._c + c))
        self._c[:] = c
        unexplained = h - self._h
        self._h = h
        unexplained /= self._T
        unexplained[:3] -= mean_W[0] + self._weight
        unexplained[3:] -= mean_W[1] - lever @ mean_W[0]
        unexplained[3:] += lever @ unexplained[:3]
        unexplained -= self.wrench
        self.wrench += self._gain * unexplained
        return self.wrench

    def slow_down(self, factors: Array) -> None:
        """Run with K times these factors, shape (6,)."""
        np.negative(np.expm1(-self._rates * factors * self._T), out=self._gain)

    def applied(self, wrench_W: Array) -> None:
        """The wrench asked from the rotors for the period that begins, shape (6,), world axes."""
        np.dot(wrench_W.reshape(2, 3), self._R, out=self._command_A)

    def actual(self) -> Array:
        """What the rotors give now, by their lag; world axes at the origin of {A}, shape (6,)."""
        return np.dot(self._actual_A, self._R.T).ravel()

    def _momentum(self, m: Measurement, out: Array) -> Array:
        """Write the momentum about the centre of mass; returns c, both in world axes."""
        self._q[3:], self._v[:] = m.q[3:], m.v
        # With {A} at the origin of the world the centre of mass stands at c.
        out[:] = pin.computeCentroidalMomentum(self._model, self._data, self._q, self._v).vector
        return self._data.com[0]
