"""Backstepping; `fullam.control.backstepping` is the reference and derives the law."""

from __future__ import annotations

import math

from fullam.control.backstepping import SMALL_ANGLE
from fullam.simulation.compiled.dynamics import composite, rigid_bias, rigid_inertia, solve_rigid
from fullam.simulation.compiled.integrate import TOLD_VELOCITY
from fullam.simulation.compiled.jit import compiled, merged
from fullam.simulation.compiled.law import (
    COMMAND,
    DRAIN,
    GRAVITY,
    INTEGRAL,
    MISC,
    OF_ERROR,
    OF_RATE,
    OF_SLOPE,
    U_DC,
    U_PID,
    integrate_error,
    release,
)
from fullam.simulation.compiled.rotations import (
    add,
    along,
    cross,
    dot,
    scale,
    subtract,
    three,
    turn,
    turn_back,
    write,
)

SMALL_SQUARE = SMALL_ANGLE**2
"""Squared angle below which the series of the reference are used."""


@compiled
def attitude_derivative(e, w, w_d):
    """Derivative of e = log(R_d R^T) for the world angular velocities w and w_d."""
    square = dot(e, e)
    if square < SMALL_SQUARE:
        first, second, k = 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 12.0 + square / 720.0
    else:
        angle = math.sqrt(square)
        s, c = math.sin(angle), math.cos(angle)
        first, second = s / angle, (1.0 - c) / square
        k = 1.0 / square - s / (2.0 * angle * (1.0 - c))
    across = cross(e, w)
    relative = subtract(w_d, w)
    relative = along(along(relative, -first, across), -second, cross(e, across))
    sideways = cross(e, relative)
    return along(along(relative, -0.5, sideways), k, cross(e, sideways))


@merged
def backstepping_wrench(numbers, links, memory, R, state, e, de, rate, feedforward, k, arm, row):
    """Wrench of the law, into the memory, and the integral moved on.

    Args:
        numbers: The law.
        links: Chain of the nominal vehicle.
        memory: Its memory.
        R: Attitude.
        state: Pose and body velocity that the controller is told.
        e: Pose error, world axes.
        de: Velocity error, world axes.
        rate: Reference velocities, world axes, shape (N, 6).
        feedforward: Reference accelerations, shape (N, 6).
        k: Row of the reference.
        arm: The arm's motion.
        row: Its row.
    """
    w = three(state, TOLD_VELOCITY, 3)
    turning = attitude_derivative((e[3], e[4], e[5]), turn(R, w), three(rate, k, 3))
    slope = (de[0], de[1], de[2], turning[0], turning[1], turning[2])
    for i in range(6):
        memory[U_PID, i] = (
            numbers[OF_ERROR, i] * e[i]
            + numbers[OF_SLOPE, i] * slope[i]
            + numbers[OF_RATE, i] * (de[i] + memory[INTEGRAL, i])
            + feedforward[k, i]
        )
    m, s, J = composite(links, arm, row)
    g = scale(-numbers[MISC, GRAVITY], (R[6], R[7], R[8]))
    f_bias, t_bias = rigid_bias(m, s, J, w, g)
    a, b = turn_back(R, three(memory, U_PID, 0)), turn_back(R, three(memory, U_PID, 3))
    f, t = rigid_inertia(m, s, J, a, b)
    write(memory, U_DC, 0, turn(R, f_bias))
    write(memory, U_DC, 3, turn(R, t_bias))
    write(memory, COMMAND, 0, turn(R, add(f, f_bias)))
    write(memory, COMMAND, 3, turn(R, add(t, t_bias)))
    integrate_error(numbers, memory, e)


@compiled
def drain_backstepping(numbers, links, memory, R, force, moment, arm, row):
    """Anti-windup for a missing wrench in world axes."""
    m, s, J = composite(links, arm, row)
    a, b = solve_rigid(m, s, J, turn_back(R, force), turn_back(R, moment))
    a, b = turn(R, a), turn(R, b)
    for i in range(3):
        drain = numbers[MISC, DRAIN]
        release(memory, i, a[i], drain / max(numbers[OF_RATE, i], 1.0))
        release(memory, 3 + i, b[i], drain / max(numbers[OF_RATE, 3 + i], 1.0))
