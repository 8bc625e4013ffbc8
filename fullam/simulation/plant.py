"""The true vehicle in motion: rotor lag, gusts, and the platform under a prescribed arm."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv

from fullam.dynamics.integrators import integrator
from fullam.model.vehicle import Vehicle
from fullam.simulation.arm_motion import ArmTable

Array = NDArray[np.float64]


class Plant:
    """Integrates the true vehicle between controller ticks.

    Equations of motion of the platform with the joints' motion given (the servos follow theta(t)
    exactly): M_bb a_b = wrench_A + R^T d_W - (M_bj ddtheta + h_b), the first six rows of the
    floating-base dynamics. The rotors follow their commanded speeds with first-order lags, solved
    exactly: Omega(t + s) = Omega_c + (Omega - Omega_c) exp(-s / lag).

    Attributes:
        q: Configuration [p, quaternion xyzw, theta], shape (nq,), live.
        v: Velocity [v_A, w_A, dtheta], body axes, shape (nv,), live.
        speeds: Rotor speeds [rad/s], shape (n_r,), live.
        acceleration: Body acceleration of the platform evaluated last, shape (6,), live.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        arm: ArmTable,
        pose: Array,
        speeds: Array,
        period: float,
        integrator_name: str,
    ) -> None:
        """Place the vehicle.

        Args:
            vehicle: The true vehicle.
            arm: Its arm's motion on the half-step grid: row 2 k is time k * period.
            pose: Initial [p, quaternion xyzw], at rest.
            speeds: Initial rotor speeds [rad/s].
            period: Time step [s].
            integrator_name: See `fullam.dynamics.integrators`.
        """
        model = vehicle.model
        self._model, self._data = model, vehicle.create_data()
        self._arm = arm
        self._period = period
        self._step = integrator(integrator_name).step
        self.q: Array = vehicle.neutral()
        self.v: Array = np.zeros(model.nv)
        self.q[:7] = pose
        self.q[7:], self.v[6:] = arm.theta[0], arm.dtheta[0]
        self.speeds: Array = np.array(speeds, dtype=float)
        self._coupling = np.ascontiguousarray(vehicle.rotors.coupling_matrix)
        lags = np.maximum(vehicle.rotors.lags, 1e-12)
        self._decay = np.exp(-np.array([[0.0], [0.5], [1.0]]) * period / lags)
        self._row = 0
        self._commands: Array = self.speeds.copy()
        self._gust: Array | None = None
        self._gap: Array = np.zeros_like(self.speeds)
        self._known: Array = np.zeros(model.nv)  # [0, ddtheta], what RNEA is asked with
        self._a: Array = np.zeros(model.nv)
        self.acceleration: Array = self._a[:6]
        self._rotation = self._data.liMi[1].rotation
        self._mass_matrix = self._data.M[:6, :6]

    def _acceleration(self, stage: int, q: Array, v: Array) -> Array:
        """dv/dt at a stage of the step; puts the arm of that instant into q and v."""
        row, arm = self._row + stage, self._arm
        q[7:] = arm.theta[row]
        v[6:] = arm.dtheta[row]
        known, a = self._known, self._a
        known[6:] = arm.ddtheta[row]
        speeds = self._commands + self._gap * self._decay[stage]
        bias = pin.rnea(self._model, self._data, q, v, known)
        pin.crba(self._model, self._data, q)
        wrench = np.dot(self._coupling, speeds * speeds)
        wrench -= bias[:6]
        if self._gust is not None:
            # R of this q is the free flyer's placement, refreshed by RNEA.
            wrench += np.dot(self._gust, self._rotation).ravel()
        a[:6] = dposv(self._mass_matrix, wrench)[1]
        a[6:] = known[6:]
        return a

    def advance(self, commands: Array, gust_W: Array | None, steps: int) -> None:
        """Fly `steps` plant steps under constant commands.

        Args:
            commands: Rotor speeds asked for [rad/s], shape (n_r,).
            gust_W: Disturbance wrench on the platform at its origin, world axes, or None.
            steps: Number of plant steps.
        """
        self._commands = commands
        self._gust = None if gust_W is None else gust_W.reshape(2, 3)
        arm = self._arm
        for _ in range(steps):
            np.subtract(self.speeds, commands, out=self._gap)
            self._step(self._model, self._acceleration, self.q, self.v, self._period)
            self._row += 2
            self.q[7:] = arm.theta[self._row]
            self.v[6:] = arm.dtheta[self._row]
            np.add(commands, self._gap * self._decay[2], out=self.speeds)
