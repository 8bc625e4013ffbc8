"""Integrators of the platform's motion on SE(3), each rule once, with their orders.

The state is a pose and a twist in body axes: the pose moves by the twist, the twist by
`derivative(system, stage, pose, twist)`, where stage counts the evaluations of a step from 0 and
`system` is whatever the derivative wants to know; `half_steps` tells where in the step a stage is.
In machine code the derivative is the recursion's; in Python it may be Pinocchio's.

What else moves with the platform, as joints do, is integrated by the same rule in the derivative's
own rows: every rule here evaluates at the start plus so many half steps of the slope evaluated
last, and sums its slopes by `Integrator.weights`.

The twist lives in body axes, so a plain Runge-Kutta average of twists taken at different attitudes
loses order; `rk4` therefore integrates in the Lie algebra (Runge-Kutta-Munthe-Kaas), and the
midpoint rule is of order 2 as it stands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fullam.dynamics.spatial import add_spatial, axpy_spatial, bracket, move, scale_spatial
from fullam.numbers.kernel import kernel
from fullam.registry import Registry


@kernel
def half_steps(stage):
    """How many half steps behind the start of the step a stage is evaluated."""
    return (stage + 1) // 2


@kernel
def semi_implicit_euler(derivative, system, pose, twist, dt):
    """Twist first, then the pose with it. Order 1, one evaluation.

    Args:
        derivative: d twist/dt, see the module's first lines.
        system: What it is evaluated on.
        pose: At the start of the step.
        twist: At the start, body axes.
        dt: Length of the step [s].

    Returns:
        Pose and twist at the end, and the derivative evaluated last.
    """
    rate = derivative(system, 0, pose, twist)
    after = axpy_spatial(dt, rate, twist)
    return move(pose, after, dt), after, rate


@kernel
def midpoint(derivative, system, pose, twist, dt):
    """Half an Euler step, then the whole step from there. Order 2, two evaluations.

    Arguments and results as in `semi_implicit_euler`.
    """
    halfway = axpy_spatial(0.5 * dt, derivative(system, 0, pose, twist), twist)
    rate = derivative(system, 1, move(pose, twist, 0.5 * dt), halfway)
    return move(pose, halfway, dt), axpy_spatial(dt, rate, twist), rate


@kernel
def inverse_right_jacobian(u, w):
    """Rate of u in q exp(u) for a twist w: w + [u, w]/2 + [u, [u, w]]/12, exact enough for RK4."""
    once = bracket(u, w)
    return axpy_spatial(1 / 12, bracket(u, once), axpy_spatial(0.5, once, w))


@kernel
def rk4(derivative, system, pose, twist, dt):
    """Runge-Kutta-Munthe-Kaas with the classical tableau. Order 4, four evaluations.

    The pose is q exp(u) with u(0) = 0, and u is integrated as a vector. Arguments and results as in
    `semi_implicit_euler`.
    """
    a1, u1 = derivative(system, 0, pose, twist), twist

    v2, u = axpy_spatial(0.5 * dt, a1, twist), scale_spatial(0.5 * dt, u1)
    a2 = derivative(system, 1, move(pose, u, 1.0), v2)
    u2 = inverse_right_jacobian(u, v2)

    v3, u = axpy_spatial(0.5 * dt, a2, twist), scale_spatial(0.5 * dt, u2)
    a3 = derivative(system, 2, move(pose, u, 1.0), v3)
    u3 = inverse_right_jacobian(u, v3)

    v4, u = axpy_spatial(dt, a3, twist), scale_spatial(dt, u3)
    a4 = derivative(system, 3, move(pose, u, 1.0), v4)
    u4 = inverse_right_jacobian(u, v4)

    a = add_spatial(add_spatial(a1, a4), scale_spatial(2.0, add_spatial(a2, a3)))
    u = add_spatial(add_spatial(u1, u4), scale_spatial(2.0, add_spatial(u2, u3)))
    return (
        move(pose, scale_spatial(dt * (1 / 6), u), 1.0),
        axpy_spatial(dt * (1 / 6), a, twist),
        a4,
    )


Rule = Callable[..., tuple[Any, Any, Any]]


@dataclass(frozen=True)
class Integrator:
    """An integrator and what is known of it.

    Attributes:
        step: The rule, a kernel.
        order: Order of convergence of the global error; a test measures it.
        evaluations: Derivatives that a step asks for.
        weights: Share of each evaluation in the step.
        implicit: 1 if positions move by the rates at the end of the step, else 0.
        stable: How far -dt lambda of a decay may go, for the step to be stable.
    """

    step: Rule
    order: int
    evaluations: int
    weights: tuple[float, ...]
    implicit: float
    stable: float


INTEGRATORS: Registry[Integrator] = Registry(
    "integrator",
    {
        "semi-implicit-euler": Integrator(semi_implicit_euler, 1, 1, (1.0,), 1.0, 2.0),
        "midpoint": Integrator(midpoint, 2, 2, (0.0, 1.0), 0.0, 2.0),
        "rk4": Integrator(rk4, 4, 4, (1 / 6, 1 / 3, 1 / 3, 1 / 6), 0.0, 2.78),
    },
)


def integrator(name: str) -> Integrator:
    """The integrator of that name.

    Raises:
        UnknownName: There is no such integrator.
    """
    return INTEGRATORS[name]
