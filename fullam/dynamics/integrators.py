"""Integrators on the configuration manifold SE(3) x R^n, with their orders.

The state is (q, v) in Pinocchio's coordinates; dq = q (+) v dt on the manifold, dv = a(t, q, v).
The platform's velocity lives in body axes, so a plain Runge-Kutta average of velocities taken at
different attitudes loses order; `rk4` therefore integrates in the Lie algebra (Runge-Kutta-
Munthe-Kaas), and the midpoint rule is of order 2 as it stands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.registry import Registry

Array = NDArray[np.float64]

Acceleration = Callable[[int, Array, Array], Array]
"""(stage, q, v) -> dv/dt, shape (nv,); stage 0, 1, 2 is the start, middle and end of the step.

The array may be a live buffer: a rule that keeps it over another evaluation copies it."""

Step = Callable[[pin.Model, Acceleration, Array, Array, float], None]
"""Advance q and v in place by dt."""


def semi_implicit_euler(
    model: pin.Model, acceleration: Acceleration, q: Array, v: Array, dt: float
) -> None:
    """Velocity first, v += dt a(q, v), then q = q (+) dt v with it. Order 1, one evaluation."""
    v += dt * acceleration(0, q, v)
    q[:] = pin.integrate(model, q, dt * v)


def midpoint(model: pin.Model, acceleration: Acceleration, q: Array, v: Array, dt: float) -> None:
    """Explicit midpoint rule: half an Euler step, then the whole step from there. Order 2."""
    v_mid = v + (0.5 * dt) * acceleration(0, q, v)
    q_mid = pin.integrate(model, q, (0.5 * dt) * v)
    v += dt * acceleration(1, q_mid, v_mid)
    q[:] = pin.integrate(model, q, dt * v_mid)


def _ad(u: Array, w: Array) -> Array:
    """Lie bracket [u, w] in se(3) of the first six entries; the joints commute."""
    bracket = np.zeros_like(u)
    bracket[:6] = pin.Motion(u[:6]).cross(pin.Motion(w[:6])).vector
    return bracket


def _inverse_right_jacobian(u: Array, w: Array) -> Array:
    """dexp^{-1} for q exp(u): w + [u, w]/2 + [u, [u, w]]/12, exact to the order that RK4 needs."""
    once = _ad(u, w)
    return w + 0.5 * once + _ad(u, once) / 12.0


def rk4(model: pin.Model, acceleration: Acceleration, q: Array, v: Array, dt: float) -> None:
    """Runge-Kutta-Munthe-Kaas with the classical tableau. Order 4, four evaluations.

    The configuration is q (+) u with u(0) = 0 and du/dt = dexp^{-1}_u v, integrated as a vector.
    """
    a1 = acceleration(0, q, v).copy()
    u1 = v.copy()

    v2 = v + (0.5 * dt) * a1
    u = (0.5 * dt) * u1
    a2 = acceleration(1, pin.integrate(model, q, u), v2).copy()
    u2 = _inverse_right_jacobian(u, v2)

    v3 = v + (0.5 * dt) * a2
    u = (0.5 * dt) * u2
    a3 = acceleration(1, pin.integrate(model, q, u), v3).copy()
    u3 = _inverse_right_jacobian(u, v3)

    v4 = v + dt * a3
    u = dt * u3
    a4 = acceleration(2, pin.integrate(model, q, u), v4)
    u4 = _inverse_right_jacobian(u, v4)

    v += (dt / 6.0) * (a1 + 2.0 * (a2 + a3) + a4)
    q[:] = pin.integrate(model, q, (dt / 6.0) * (u1 + 2.0 * (u2 + u3) + u4))


@dataclass(frozen=True)
class Integrator:
    """An integrator and what is known of it.

    Attributes:
        step: The rule.
        order: Order of convergence of the global error; a test measures it.
        evaluations: Accelerations a step asks for.
    """

    step: Step
    order: int
    evaluations: int


INTEGRATORS: Registry[Integrator] = Registry(
    "integrator",
    {
        "semi-implicit-euler": Integrator(semi_implicit_euler, 1, 1),
        "midpoint": Integrator(midpoint, 2, 2),
        "rk4": Integrator(rk4, 4, 4),
    },
)


def integrator(name: str) -> Integrator:
    """The integrator of that name.

    Raises:
        UnknownName: There is no such integrator.
    """
    return INTEGRATORS[name]
