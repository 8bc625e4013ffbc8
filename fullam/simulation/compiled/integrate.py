"""Steps of the plant: rotor lag, gusts, and the integrators of `fullam.dynamics.integrators`.

The state is the platform's pose and body velocity; velocity and acceleration are Pinocchio's, so
dv/dt = R^T ddp_A - w x v. The half-step grid of the arm's motion serves every stage.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.simulation.compiled.dynamics import platform_acceleration
from fullam.simulation.compiled.jit import compiled, merged
from fullam.simulation.compiled.rotations import (
    add,
    along,
    carried,
    cross,
    four,
    matrix,
    scale,
    subtract,
    three,
    turn,
    turn_back,
    turned,
    write,
    write_four,
)

Array = NDArray[np.float64]

SEMI_IMPLICIT_EULER, MIDPOINT, RK4 = 0, 1, 2
RULES = {"semi-implicit-euler": SEMI_IMPLICIT_EULER, "midpoint": MIDPOINT, "rk4": RK4}
"""Code of each integrator that is compiled."""


COUPLING, DECAY, ROTOR_WIDTH = 0, 6, 9
"""Columns of a row of `rotors`: squared speed to wrench, eq. (34), and exp(-s / lag) at the start,
the middle and the end of a step."""

RULE, PERIOD, SUBSTEPS, GRAVITY = 0, 1, 2, 3
"""Entries of `plant`: code of the integrator, time step [s], steps in a control period, and gravity
along -z of {W} [m/s^2]."""

POSE, VELOCITY, READING, ESTIMATE, RATE, TOLD, TOLD_VELOCITY, ASKED = range(8)
"""Rows of `state`, shape (8, 7): true pose and body velocity; the pose sensor's last reading; the
filtered pose and its rate; pose and body velocity that the controller is told; wrench in {A}."""

SPEEDS, COMMANDS = 0, 1
"""Rows of `speeds`, shape (2, n_r): true, and asked for [rad/s]."""


class Craft(NamedTuple):
    """The vehicle that flies, and how it is integrated.

    Attributes:
        links: Its chain, shape (n + 1, WIDTH).
        rotors: Shape (n_r, ROTOR_WIDTH).
        plant: Shape (4,).
    """

    links: Array
    rotors: Array
    plant: Array


@merged
def acceleration(links, rotors, g, arm, row, stage, speeds, gusts, k, q, v, w):
    """Derivatives of v and w in body axes at a stage: 0 start, 1 middle, 2 end of the step."""
    R = matrix(q)
    fx, fy, fz = turn_back(R, three(gusts, k, 0))
    mx, my, mz = turn_back(R, three(gusts, k, 3))
    for i in range(rotors.shape[0]):
        command = speeds[COMMANDS, i]
        speed = command + (speeds[SPEEDS, i] - command) * rotors[i, DECAY + stage]
        square = speed * speed
        fx += rotors[i, COUPLING] * square
        fy += rotors[i, COUPLING + 1] * square
        fz += rotors[i, COUPLING + 2] * square
        mx += rotors[i, COUPLING + 3] * square
        my += rotors[i, COUPLING + 4] * square
        mz += rotors[i, COUPLING + 5] * square
    down = scale(-g, (R[6], R[7], R[8]))
    ddp, dw = platform_acceleration(links, arm, row + stage, w, down, (fx, fy, fz), (mx, my, mz))
    return subtract(ddp, cross(w, v)), dw


@compiled
def moved(p, q, v, w, dt):
    """Pose after the body velocity (v, w) for the time dt."""
    v, w = scale(dt, v), scale(dt, w)
    return add(p, turn(matrix(q), carried(v, w))), turned(q, w)


@compiled
def bracket(v1, w1, v2, w2):
    """Lie bracket of two motions."""
    return add(cross(w1, v2), cross(v1, w2)), cross(w1, w2)


@compiled
def inverse_right_jacobian(v1, w1, v2, w2):
    """Motion x + [u, x]/2 + [u, [u, x]]/12 for u = (v1, w1), x = (v2, w2)."""
    va, wa = bracket(v1, w1, v2, w2)
    vb, wb = bracket(v1, w1, va, wa)
    return along(along(v2, 0.5, va), 1.0 / 12.0, vb), along(along(w2, 0.5, wa), 1.0 / 12.0, wb)


@compiled
def rk4(links, rotors, g, dt, arm, row, speeds, gusts, k, p, q, v, w):
    """One step of the Runge-Kutta-Munthe-Kaas rule; see `fullam.dynamics.integrators.rk4`."""
    h = 0.5 * dt
    a1, b1 = acceleration(links, rotors, g, arm, row, 0, speeds, gusts, k, q, v, w)

    v2, w2 = along(v, h, a1), along(w, h, b1)
    _, s = moved(p, q, v, w, h)
    a2, b2 = acceleration(links, rotors, g, arm, row, 1, speeds, gusts, k, s, v2, w2)
    k2, l2 = inverse_right_jacobian(scale(h, v), scale(h, w), v2, w2)

    v3, w3 = along(v, h, a2), along(w, h, b2)
    _, s = moved(p, q, k2, l2, h)
    a3, b3 = acceleration(links, rotors, g, arm, row, 1, speeds, gusts, k, s, v3, w3)
    k3, l3 = inverse_right_jacobian(scale(h, k2), scale(h, l2), v3, w3)

    v4, w4 = along(v, dt, a3), along(w, dt, b3)
    _, s = moved(p, q, k3, l3, dt)
    a4, b4 = acceleration(links, rotors, g, arm, row, 2, speeds, gusts, k, s, v4, w4)
    k4, l4 = inverse_right_jacobian(scale(dt, k3), scale(dt, l3), v4, w4)

    u = add(add(v, k4), scale(2.0, add(k2, k3)))
    m = add(add(w, l4), scale(2.0, add(l2, l3)))
    p, q = moved(p, q, u, m, dt / 6.0)
    a = add(add(a1, a4), scale(2.0, add(a2, a3)))
    b = add(add(b1, b4), scale(2.0, add(b2, b3)))
    return p, q, along(v, dt / 6.0, a), along(w, dt / 6.0, b)


@merged
def advance(links, rotors, plant, arm, row, state, speeds, gusts, k):
    """Fly one control period; true pose, velocity and rotor speeds are rewritten.

    Args:
        links: The chain.
        rotors: The rotors.
        plant: Integrator, rates, gravity.
        arm: The arm's motion on the half-step grid.
        row: Its row at the start.
        state: Shape (8, 7).
        speeds: Shape (2, n_r).
        gusts: Disturbance wrenches in world axes, shape (N, 6).
        k: Which of them blows.
    """
    p, q = three(state, POSE, 0), four(state, POSE, 3)
    v, w = three(state, VELOCITY, 0), three(state, VELOCITY, 3)
    rule, dt, g = plant[RULE], plant[PERIOD], plant[GRAVITY]
    for _ in range(int(plant[SUBSTEPS])):
        if rule == RK4:
            p, q, v, w = rk4(links, rotors, g, dt, arm, row, speeds, gusts, k, p, q, v, w)
        else:
            a, b = acceleration(links, rotors, g, arm, row, 0, speeds, gusts, k, q, v, w)
            if rule == MIDPOINT:
                v_mid, w_mid = along(v, 0.5 * dt, a), along(w, 0.5 * dt, b)
                _, q_mid = moved(p, q, v, w, 0.5 * dt)
                a, b = acceleration(
                    links, rotors, g, arm, row, 1, speeds, gusts, k, q_mid, v_mid, w_mid
                )
                p, q = moved(p, q, v_mid, w_mid, dt)
                v, w = along(v, dt, a), along(w, dt, b)
            else:
                v, w = along(v, dt, a), along(w, dt, b)
                p, q = moved(p, q, v, w, dt)
        row += 2
        for i in range(rotors.shape[0]):
            command = speeds[COMMANDS, i]
            speeds[SPEEDS, i] = command + (speeds[SPEEDS, i] - command) * rotors[i, DECAY + 2]
    write(state, POSE, 0, p)
    write_four(state, POSE, 3, q)
    write(state, VELOCITY, 0, v)
    write(state, VELOCITY, 3, w)
