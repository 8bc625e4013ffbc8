"""Newton-Euler sweep over platform and arm, eqs. (6)-(13), and the platform's acceleration.

The paper's recursion holds in any inertial axes. Here those that coincide with {A} at the instant
are taken, so that velocities and wrenches come in the platform's own axes and attitude enters
through gravity alone. Summing eq. (13) over the links cancels the inner forces and leaves f_1 and
tau_1 carried to the origin of {A}: one sweep outward does without the one back.

A chain is an array `links` of one row a link, the platform first; see `chain_rows`. Its link frames
are turned so that every joint turns about its z, as Craig's do.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fullam.model.chain import LinkChain
from fullam.simulation.compiled.jit import compiled, merged
from fullam.simulation.compiled.rotations import (
    add,
    along,
    cross,
    scale,
    six,
    solve_symmetric,
    subtract,
    symmetric,
    three,
    turn,
)

Array = NDArray[np.float64]

MASS, COM, INERTIA, TURN, OFFSET, WIDTH = 0, 1, 4, 10, 19, 22
"""Columns of a row of `links`: m, centre of mass (3), inertia about it (xx, xy, xz, yy, yz, zz),
rotation from the link before at angle 0 (9, row by row), and place of the joint on it (3)."""

TURNED, STEP, RATE, ACCELERATION, ARM_WIDTH = 0, 9, 12, 13, 14
"""Columns of a joint's row of the arm's motion: attitude of its link in {A} (9), way from the joint
before to this one in {A} axes (3), joint rate and joint acceleration. The way depends on the
joints before alone, and none of it on masses, so that all who fly the same motion share it."""

UPPER_TRIANGLE = [0, 1, 2, 4, 5, 8]
"""Entries xx, xy, xz, yy, yz, zz of a matrix written row by row."""

LEVEL = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def chain_rows(chain: LinkChain) -> Array:
    """The chain as rows, shape (n + 1, WIDTH), link frames turned so that joint axes are z."""
    frames = z_frames(chain)
    back = frames.transpose(0, 2, 1)
    rows = with_bodies(np.zeros((chain.n + 1, WIDTH)), frames, chain.mass, chain.com, chain.inertia)
    rows[0, TURN : TURN + 9] = np.eye(3).ravel()
    rows[1:, TURN : TURN + 9] = (back[:-1] @ chain.placement_R @ frames[1:]).reshape(-1, 9)
    rows[1:, OFFSET : OFFSET + 3] = (back[:-1] @ chain.placement_P[:, :, None])[:, :, 0]
    return rows


def z_frames(chain: LinkChain) -> Array:
    """Rotations from the link frames of `chain_rows` to the chain's own, shape (n + 1, 3, 3)."""
    return np.stack([np.eye(3), *(_frame_with_z(axis) for axis in chain.axis)])


def with_bodies(rows: Array, frames: Array, mass: Array, com: Array, inertia: Array) -> Array:
    """The same chain of other bodies, given in the chain's own frames; see `LinkChain`."""
    rows, back = rows.copy(), frames.transpose(0, 2, 1)
    rows[:, MASS] = mass
    rows[:, COM : COM + 3] = (back @ com[:, :, None])[:, :, 0]
    turned = (back @ inertia @ frames).reshape(-1, 9)
    rows[:, INERTIA : INERTIA + 6] = turned[:, UPPER_TRIANGLE]
    return rows


def _frame_with_z(axis: Array) -> Array:
    """A rotation whose third column is the unit vector; the identity for z itself."""
    if axis[2] == 1.0:
        return np.eye(3)
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)


@compiled
def place_arm(links, angles, rates, accelerations, row, arm):
    """Write a row of the arm's motion, shape (rows, n, ARM_WIDTH).

    Args:
        links: The chain, shape (n + 1, WIDTH).
        angles: Joint angles, shape (rows, n).
        rates: Joint rates, shape (rows, n).
        accelerations: Joint accelerations, shape (rows, n).
        row: Which of their rows.
        arm: Where it goes.
    """
    R = LEVEL
    for i in range(1, links.shape[0]):
        r = turn(R, three(links, i, OFFSET))
        arm[row, i - 1, STEP], arm[row, i - 1, STEP + 1], arm[row, i - 1, STEP + 2] = r
        x = turn(R, (links[i, TURN], links[i, TURN + 3], links[i, TURN + 6]))
        y = turn(R, (links[i, TURN + 1], links[i, TURN + 4], links[i, TURN + 7]))
        z = turn(R, (links[i, TURN + 2], links[i, TURN + 5], links[i, TURN + 8]))
        c, s = math.cos(angles[row, i - 1]), math.sin(angles[row, i - 1])
        R = (
            c * x[0] + s * y[0],
            c * y[0] - s * x[0],
            z[0],
            c * x[1] + s * y[1],
            c * y[1] - s * x[1],
            z[1],
            c * x[2] + s * y[2],
            c * y[2] - s * x[2],
            z[2],
        )
        for k in range(9):
            arm[row, i - 1, TURNED + k] = R[k]
        arm[row, i - 1, RATE] = rates[row, i - 1]
        arm[row, i - 1, ACCELERATION] = accelerations[row, i - 1]


@compiled
def attitude(arm, row, i):
    """Attitude of link i + 1 in {A}."""
    return (
        arm[row, i, 0],
        arm[row, i, 1],
        arm[row, i, 2],
        arm[row, i, 3],
        arm[row, i, 4],
        arm[row, i, 5],
        arm[row, i, 6],
        arm[row, i, 7],
        arm[row, i, 8],
    )


@compiled
def sweep_arm(links, arm, row, w, dw, a):
    """Forward recursion (6)-(11) over links 1..n and the sum of eq. (13), in {A} axes.

    Args:
        links: The chain, shape (n + 1, WIDTH).
        arm: The arm's motion, shape (rows, n, ARM_WIDTH); see `place_arm`.
        row: Which of its rows.
        w: Angular velocity of {A}.
        dw: Its derivative.
        a: ddp_A - g, the classical acceleration of the origin of {A} less gravity.

    Returns:
        f_1 and tau_1 + (p_1 - p_A) x f_1: the wrench on the arm at the origin of {A}; and the
        arm's first moment sum m c and its inertia about the origin, as in `symmetric`.
    """
    force = moment = first = p = (0.0, 0.0, 0.0)
    Jxx = Jxy = Jxz = Jyy = Jyz = Jzz = 0.0
    for i in range(1, links.shape[0]):
        r = (arm[row, i - 1, STEP], arm[row, i - 1, STEP + 1], arm[row, i - 1, STEP + 2])
        a = add(a, add(cross(dw, r), cross(w, cross(w, r))))
        p = add(p, r)
        R = attitude(arm, row, i - 1)
        z = (R[2], R[5], R[8])
        rate = arm[row, i - 1, RATE]
        dw = add(dw, add(scale(rate, cross(w, z)), scale(arm[row, i - 1, ACCELERATION], z)))
        w = along(w, rate, z)
        m, lever = links[i, MASS], turn(R, three(links, i, COM))
        f = scale(m, add(a, add(cross(dw, lever), cross(w, cross(w, lever)))))
        own = six(links, i, INERTIA)
        # J = R I R^T, of which six entries differ.
        b0 = symmetric(own, (R[0], R[1], R[2]))
        b1 = symmetric(own, (R[3], R[4], R[5]))
        b2 = symmetric(own, (R[6], R[7], R[8]))
        J = (
            b0[0] * R[0] + b0[1] * R[1] + b0[2] * R[2],
            b0[0] * R[3] + b0[1] * R[4] + b0[2] * R[5],
            b0[0] * R[6] + b0[1] * R[7] + b0[2] * R[8],
            b1[0] * R[3] + b1[1] * R[4] + b1[2] * R[5],
            b1[0] * R[6] + b1[1] * R[7] + b1[2] * R[8],
            b2[0] * R[6] + b2[1] * R[7] + b2[2] * R[8],
        )
        place = add(p, lever)
        spin = add(symmetric(J, dw), cross(w, symmetric(J, w)))
        force = add(force, f)
        moment = add(moment, add(cross(place, f), spin))
        first = along(first, m, place)
        xx, yy, zz = place[0] * place[0], place[1] * place[1], place[2] * place[2]
        Jxx += J[0] + m * (yy + zz)
        Jxy += J[1] - m * place[0] * place[1]
        Jxz += J[2] - m * place[0] * place[2]
        Jyy += J[3] + m * (xx + zz)
        Jyz += J[4] - m * place[1] * place[2]
        Jzz += J[5] + m * (xx + yy)
    return force, moment, first, (Jxx, Jxy, Jxz, Jyy, Jyz, Jzz)


@merged
def about_origin(links):
    """Inertia of the platform about the origin of {A}, as in `symmetric`."""
    m, c, own = links[0, MASS], three(links, 0, COM), six(links, 0, INERTIA)
    return (
        own[0] + m * (c[1] * c[1] + c[2] * c[2]),
        own[1] - m * c[0] * c[1],
        own[2] - m * c[0] * c[2],
        own[3] + m * (c[0] * c[0] + c[2] * c[2]),
        own[4] - m * c[1] * c[2],
        own[5] + m * (c[0] * c[0] + c[1] * c[1]),
    )


@merged
def platform_body(links):
    """Mass, first moment and inertia of the platform alone about the origin of {A}."""
    m = links[0, MASS]
    return m, scale(m, three(links, 0, COM)), about_origin(links)


@compiled
def composite(links, arm, row):
    """Mass, first moment and inertia of the whole vehicle about the origin of {A}, {A} axes."""
    none = (0.0, 0.0, 0.0)
    _, _, first, J = sweep_arm(links, arm, row, none, none, none)
    _, s, J0 = platform_body(links)
    return total_mass(links), add(first, s), sum_six(J, J0)


@compiled
def rigid_bias(m, s, J, w, g):
    """Wrench on a rigid body (mass, first moment, inertia) that turns at w and is held at g."""
    return (
        subtract(cross(w, cross(w, s)), scale(m, g)),
        subtract(cross(w, symmetric(J, w)), cross(s, g)),
    )


@compiled
def rigid_inertia(m, s, J, ddp, dw):
    """What an acceleration adds to that: m ddp + dw x s, and s x ddp + J dw."""
    return add(scale(m, ddp), cross(dw, s)), add(cross(s, ddp), symmetric(J, dw))


@compiled
def solve_rigid(m, s, J, force, moment):
    """Accelerations (ddp, dw) of m ddp + dw x s = F, s x ddp + J dw = M.

    Eliminating ddp leaves (J - (|s|^2 1 - s s^T) / m) dw = M - s x F / m: three equations.
    """
    k = 1.0 / m
    xx, yy, zz = s[0] * s[0] * k, s[1] * s[1] * k, s[2] * s[2] * k
    central = (
        J[0] - (yy + zz),
        J[1] + k * s[0] * s[1],
        J[2] + k * s[0] * s[2],
        J[3] - (xx + zz),
        J[4] + k * s[1] * s[2],
        J[5] - (xx + yy),
    )
    dw = solve_symmetric(central, subtract(moment, scale(k, cross(s, force))))
    return scale(k, subtract(force, cross(dw, s))), dw


@merged
def compensation(links, arm, row, w, dw, ddp, g):
    """u_dc of eq. (20) at the wanted acceleration, {A} axes at the origin of {A}.

    f_1 - m_A g + m_A w x (w x c), and tau_1 + r x f_1 + w x I_A w - c x m_A g.
    """
    f, t, _, _ = sweep_arm(links, arm, row, w, dw, subtract(ddp, g))
    m, s, J = platform_body(links)
    force, moment = rigid_bias(m, s, J, w, g)
    return add(force, f), add(moment, t)


@merged
def platform_acceleration(links, arm, row, w, g, force, moment):
    """Acceleration of the platform under a wrench, the arm's motion being prescribed.

    `solve_rigid` with the whole vehicle's mass, first moment and inertia about the origin of {A},
    and the wrench less the one that keeps ddp = dw = 0.

    Args:
        links: The chain, shape (n + 1, WIDTH).
        arm: The arm's motion, shape (rows, n, ARM_WIDTH).
        row: Which of its rows.
        w: Angular velocity.
        g: Gravity.
        force: Force on the platform.
        moment: Moment about the origin of {A}.

    Returns:
        ddp (classical) and dw; everything in {A} axes.
    """
    none = (0.0, 0.0, 0.0)
    f, t, first, J = sweep_arm(links, arm, row, w, none, scale(-1.0, g))
    m, s, J0 = platform_body(links)
    f0, t0 = rigid_bias(m, s, J0, w, g)
    F, M = subtract(force, add(f, f0)), subtract(moment, add(t, t0))
    return solve_rigid(total_mass(links), add(first, s), sum_six(J, J0), F, M)


@merged
def total_mass(links):
    """Mass of the whole vehicle."""
    m = 0.0
    for i in range(links.shape[0]):
        m += links[i, MASS]
    return m


@compiled
def sum_six(a, b):
    """Sum of two tuples of six."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])
