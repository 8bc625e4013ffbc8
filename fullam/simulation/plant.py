"""The true vehicle in motion: rotor lag, gusts, and the platform under a prescribed arm."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.dynamics.integrators import integrator, midpoint
from fullam.dynamics.pose_space import AttitudeView
from fullam.model.vehicle import Vehicle
from fullam.simulation.arm_motion import ArmTable

Array = NDArray[np.float64]

DRIVE_INERTIA = 1e16
"""Inertia given to the joints' drives [kg m^2]: what the arm's dynamics do to them is rounding."""


class Plant:
    """Integrates the true vehicle between controller ticks.

    Equations of motion of the platform with the joints' motion given (the servos follow theta(t)
    exactly): M_bb a_b = wrench_A + R^T d_W - (M_bj ddtheta + h_b), the first six rows of the
    floating-base dynamics. A servo that nothing disturbs is a drive of endless inertia, so they are
    solved by one call of the articulated-body algorithm, on a model whose joints have an armature
    of `DRIVE_INERTIA` and are driven by that times ddtheta; `Multibody.base_acceleration` solves
    the same six rows as they stand, and a test holds the one to the other. The rotors follow their
    commanded speeds with first-order lags, solved exactly:
    Omega(t + s) = Omega_c + (Omega - Omega_c) exp(-s / lag).

    Attributes:
        q: Configuration [p, quaternion xyzw, theta], shape (nq,), live.
        v: Velocity [v_A, w_A, dtheta], body axes, shape (nv,), live.
        speeds: Rotor speeds [rad/s], shape (n_r,), live.
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
        model = pin.Model(vehicle.model)
        armature = np.zeros(model.nv)
        armature[6:] = DRIVE_INERTIA
        model.armature = armature
        self._model, self._data = model, model.createData()
        self._arm = arm
        self._moving = bool(arm.dtheta.any() or arm.ddtheta.any() or np.ptp(arm.theta, 0).any())
        self._period = period
        self._step = integrator(integrator_name).step
        self._is_midpoint = self._step is midpoint
        self._half, self._whole = np.full(model.nv, 0.5 * period), np.full(model.nv, period)
        self._v_mid, self._way = np.zeros(model.nv), np.zeros(model.nv)
        self.q: Array = vehicle.neutral()
        self.v: Array = np.zeros(model.nv)
        self.q[:7] = pose
        self.q[7:], self.v[6:] = arm.theta[0], arm.dtheta[0]
        self._now = np.concatenate([speeds, speeds]).astype(float)
        self.speeds: Array = self._now[: len(speeds)]
        self._commands: Array = self._now[len(speeds) :]
        # Squared speeds to generalised force: no torque of the joints comes from the rotors.
        self._coupling = np.zeros((self.speeds.size, model.nv))
        self._coupling[:, :6] = vehicle.rotors.coupling_matrix.T
        self._lags = np.maximum(vehicle.rotors.lags, 1e-12)
        self._row = self._first = 0
        self._gust: Array | None = None
        self._attitude = AttitudeView()
        self._drive = np.zeros((len(arm.ddtheta), model.nv))
        self._drive[:, 6:] = DRIVE_INERTIA * arm.ddtheta
        self._tabulated_for = 0
        self._a: Array = np.zeros(model.nv)

    @property
    def acceleration(self) -> Array:
        """Body acceleration of the platform evaluated last, shape (6,)."""
        return self._a[:6]

    def _tabulate_for(self, steps: int) -> None:
        """Lay out what `hold` fills: a row for each half step, the first and the last included."""
        half_steps = np.arange(2.0 * steps + 1.0)[:, None]
        decay = np.exp(-half_steps * (0.5 * self._period) / self._lags)
        rows, n = decay.shape
        # Speeds of all stages = response @ [speeds now; commands]; a product costs a third of
        # what broadcasting does.
        self._response = np.zeros((rows, n, 2 * n))
        rotor = np.arange(n)
        self._response[:, rotor, rotor], self._response[:, rotor, n + rotor] = decay, 1.0 - decay
        self._response.shape = (rows * n, 2 * n)
        self._stages = np.zeros(rows * n)
        self._squares = np.zeros((rows, n))
        self._squares_flat, self._final = self._squares.reshape(-1), self._stages[-n:]
        self._forces = np.zeros((rows, self.v.size))
        self._force_of = tuple(self._forces)  # rows, live
        self._tabulated_for = steps

    def hold(self, commands: Array, gust_W: Array | None, steps: int = 1) -> None:
        """Command speeds for the next steps: rotor forces at every stage, speeds at the end.

        Args:
            commands: Rotor speeds asked for [rad/s], shape (n_r,).
            gust_W: Disturbance wrench on the platform at its origin, world axes, or None.
            steps: Number of plant steps.
        """
        if steps != self._tabulated_for:
            self._tabulate_for(steps)
        self._gust = None if gust_W is None else gust_W.reshape(2, 3)
        self._first = row = self._row
        stages, forces = self._stages, self._forces
        self._commands[:] = commands
        self._response.dot(self._now, stages)
        self.speeds[:] = self._final
        np.multiply(stages, stages, self._squares_flat)
        self._squares.dot(self._coupling, forces)
        if self._moving:
            np.add(forces, self._drive[row : row + len(forces)], forces)

    def _acceleration(self, stage: int, q: Array, v: Array) -> Array:
        """dv/dt at a stage of the step; puts the arm of that instant into q and v."""
        row = self._row + stage
        if self._moving and stage:
            q[7:] = self._arm.theta[row]
            v[6:] = self._arm.dtheta[row]
        force = self._force_of[row - self._first]
        if self._gust is not None:
            force = force.copy()
            force[:6] += np.dot(self._gust, self._attitude.look(q[:7])).ravel()
        self._a = a = pin.aba(self._model, self._data, q, v, force)
        return a

    def advance(self, commands: Array, gust_W: Array | None, steps: int) -> None:
        """Fly `steps` plant steps under constant commands.

        Args:
            commands: Rotor speeds asked for [rad/s], shape (n_r,).
            gust_W: Disturbance wrench on the platform at its origin, world axes, or None.
            steps: Number of plant steps.
        """
        if self._is_midpoint and gust_W is None:
            self._advance_by_midpoint(commands, steps)
            return
        arm, q, v = self._arm, self.q, self.v
        self.hold(commands, gust_W, steps)
        for _ in range(steps):
            self._step(self._model, self._acceleration, q, v, self._period)
            self._row += 2
            q[7:] = arm.theta[self._row]
            v[6:] = arm.dtheta[self._row]

    def _advance_by_midpoint(self, commands: Array, steps: int) -> None:
        """The loop above with `integrators.midpoint` and `_acceleration` written into it.

        Bit for bit the same, without calls between Python functions and without new arrays: what
        they cost is a third of a step.
        """
        model, data, q, v, moving = self._model, self._data, self.q, self.v, self._moving
        half, whole, v_mid, way = self._half, self._whole, self._v_mid, self._way
        theta, dtheta = self._arm.theta, self._arm.dtheta
        self.hold(commands, None, steps)
        force_of, first = self._force_of, self._row
        aba, integrate, add, multiply = pin.aba, pin.integrate, np.add, np.multiply
        for row in range(first + 1, first + 2 * steps, 2):
            start, middle = force_of[row - 1 - first], force_of[row - first]
            add(v, multiply(half, aba(model, data, q, v, start), v_mid), v_mid)
            q_mid = integrate(model, q, multiply(half, v, way))
            if moving:
                q_mid[7:] = theta[row]
                v_mid[6:] = dtheta[row]
            self._a = a = aba(model, data, q_mid, v_mid, middle)
            add(v, multiply(whole, a, way), v)
            q[:] = integrate(model, q, multiply(whole, v_mid, way))
            q[7:] = theta[row + 1]
            v[6:] = dtheta[row + 1]
        self._row += 2 * steps
