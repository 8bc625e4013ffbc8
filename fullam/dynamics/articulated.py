"""Forward dynamics of the free-flying vehicle under joint torques: the articulated-body algorithm.

Featherstone's three sweeps, any number of joints that turn or slide. All links are seen from one
place, the origin of {A}, in inertial axes that coincide with {A} at the instant and move with its
origin: spatial vectors and inertias then add up as they are, and nothing is carried from link to
link. A body's spatial inertia is [[M, H], [H^T, J]] with M and J symmetric (`Articulated`).

    out    v_i = v_(i-1) + S_i dq_i,  c_i = v_i x S_i dq_i,  f_i = v_i x* I_i v_i
    in     U = I S, D = S^T U + armature, u = tau - S^T f
           I_(i-1) += I - U U^T / D,  f_(i-1) += f + (I - U U^T / D) c + U u / D
    out    ddq = (u - U^T (a_(i-1) + c)) / D,  a_i = a_(i-1) + c + S ddq

Gravity is an acceleration -g of everything. `multibody` (Pinocchio) is the witness.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.dynamics.recursion import (
    Joint,
    JointMotion,
    RigidBody,
    inertial_wrench,
    place_joints,
    platform_body,
    rotate_inertia,
    shift_inertia,
)
from fullam.dynamics.spatial import (
    Spatial,
    add_spatial,
    bracket,
    scale_spatial,
    subtract_spatial,
)
from fullam.numbers.kernel import Number, kernel
from fullam.numbers.records import Rows
from fullam.numbers.vectors import (
    ZERO,
    Matrix,
    Symmetric,
    add,
    add_symmetric,
    apply_symmetric,
    axpy,
    cross,
    dot,
    rotate,
    rotate_back,
    scale,
    solve_symmetric,
    subtract,
)


class Body(NamedTuple):
    """A link at an instant, seen from the origin of {A}.

    Motion S that a unit rate of its joint gives it; acceleration c that the rates alone give it;
    its inertia; the wrench f that its motion takes beside I a, less what pushes it from outside.
    """

    axis: Spatial
    bias: Spatial
    inertia: RigidBody
    force: Spatial


class Reduced(NamedTuple):
    """What the sweep inward leaves for the one outward: U = I S, u = tau - S^T f, and 1 / D."""

    load: Spatial
    drive: Number
    inverse: Number


class Articulated(NamedTuple):
    """A symmetric spatial inertia, [force; moment] = [[M, H], [H^T, J]] [ddp; dw]."""

    M: Symmetric
    H: Matrix
    J: Symmetric


class ArmRows(NamedTuple):
    """Room for one evaluation: rows, one a joint; of `bodies` one a link, the platform first.

    Read are `motions`, whose accelerations mean nothing, and `torques`; `accelerations` is what
    comes out. A contact reads `joints` and `bodies` after the first sweep.
    """

    motions: Any
    torques: Any
    joints: Any
    bodies: Any
    reduced: Any
    accelerations: Any

    @classmethod
    def empty(cls, joints: int, lanes: int = 0) -> ArmRows:
        """Rows of zeros for that many joints."""
        kinds = JointMotion, float, Joint, Body, Reduced, float
        lengths = (joints, joints, joints, joints + 1, joints, joints)
        rows = zip(kinds, lengths, strict=True)
        return cls(*(Rows.empty(kind, n, lanes=lanes) for kind, n in rows))


@kernel
def momentum_rate(inertia, velocity):
    """Wrench v x* I v that a rigid body takes to go on at a spatial velocity, none pushing it."""
    h, v, w = inertial_wrench(inertia, velocity), velocity.linear, velocity.angular
    return Spatial(cross(w, h.linear), add(cross(w, h.angular), cross(v, h.linear)))


@kernel
def joint_axis(link, R, p):
    """Motion that a unit rate of a link's joint gives it; R is its attitude, p where it is."""
    z, slides = (R[2], R[5], R[8]), link.prismatic
    turns = 1.0 - slides
    return Spatial(axpy(slides, z, scale(turns, cross(p, z))), scale(turns, z))


@kernel
def sweep_out(links, w, arm):
    """Place the joints and write the bodies of a chain whose platform turns at w, {A} axes."""
    place_joints(links, arm.motions, arm.joints)
    still = Spatial(ZERO, ZERO)
    own = platform_body(links)
    arm.bodies[0] = Body(still, still, own, momentum_rate(own, Spatial(ZERO, w)))
    p = linear = scale(0.0, w)  # zeros that have lanes where w has
    angular = w
    for i in range(1, len(links)):
        link, joint = links[i], arm.joints[i - 1]
        R = joint.rotation
        p = add(p, joint.step)
        axis = joint_axis(link, R, p)
        added = scale_spatial(arm.motions[i - 1].rate, axis)
        bias = bracket(Spatial(linear, angular), added)
        linear, angular = add(linear, added.linear), add(angular, added.angular)
        place = add(p, rotate(R, link.com))
        J = shift_inertia(rotate_inertia(R, link.inertia), link.mass, place)
        body = RigidBody(link.mass, scale(link.mass, place), J)
        force = momentum_rate(body, Spatial(linear, angular))
        arm.bodies[i] = Body(axis, bias, body, force)


@kernel
def push_last(arm, push):
    """Push the last link from outside with a wrench about the origin of {A}, {A} axes."""
    last = len(arm.bodies) - 1
    body = arm.bodies[last]
    arm.bodies[last] = Body(body.axis, body.bias, body.inertia, subtract_spatial(body.force, push))


@kernel
def articulated(body):
    """A rigid body's spatial inertia: M = m 1, H w = w x s, J about the origin."""
    m, s = body.mass, body.first_moment
    zero = 0.0 * m  # which has lanes where m has
    return Articulated(
        (m, zero, zero, m, zero, m),
        (zero, s[2], -s[1], -s[2], zero, s[0], s[1], -s[0], zero),
        body.inertia,
    )


@kernel
def add_body(inertia, body):
    """An articulated inertia and a rigid body, joined."""
    M, H, J = inertia
    m, s = body.mass, body.first_moment
    return Articulated(
        (M[0] + m, M[1], M[2], M[3] + m, M[4], M[5] + m),
        (
            H[0],
            H[1] + s[2],
            H[2] - s[1],
            H[3] - s[2],
            H[4],
            H[5] + s[0],
            H[6] + s[1],
            H[7] - s[0],
            H[8],
        ),
        add_symmetric(J, body.inertia),
    )


@kernel
def apply_articulated(inertia, motion):
    """Product of a spatial inertia and a motion."""
    M, H, J = inertia
    a, w = motion
    return Spatial(
        add(apply_symmetric(M, a), rotate(H, w)), add(rotate_back(H, a), apply_symmetric(J, w))
    )


@kernel
def less_square(J, s, a):
    """Symmetric J - s a a^T."""
    x, y, z = s * a[0], s * a[1], s * a[2]
    return (
        J[0] - x * a[0],
        J[1] - x * a[1],
        J[2] - x * a[2],
        J[3] - y * a[1],
        J[4] - y * a[2],
        J[5] - z * a[2],
    )


@kernel
def less_product(H, s, a, b):
    """Matrix H - s a b^T."""
    x, y, z = s * a[0], s * a[1], s * a[2]
    return (
        H[0] - x * b[0],
        H[1] - x * b[1],
        H[2] - x * b[2],
        H[3] - y * b[0],
        H[4] - y * b[1],
        H[5] - y * b[2],
        H[6] - z * b[0],
        H[7] - z * b[1],
        H[8] - z * b[2],
    )


@kernel
def project(wrench, motion):
    """Power of a wrench at a motion."""
    return dot(wrench.linear, motion.linear) + dot(wrench.angular, motion.angular)


@kernel
def sweep_in(servos, arm):
    """Reduce the arm, tip to base: inertia and force of the whole vehicle at the platform."""
    n = len(arm.reduced)
    tip = arm.bodies[n]
    inertia, force = articulated(tip.inertia), tip.force
    for i in range(n, 0, -1):
        body, below = arm.bodies[i], arm.bodies[i - 1]
        U = apply_articulated(inertia, body.axis)
        k = 1.0 / (project(U, body.axis) + servos[i - 1].armature)
        u = arm.torques[i - 1] - project(force, body.axis)
        arm.reduced[i - 1] = Reduced(U, u, k)
        M, H, J = inertia
        inertia = Articulated(
            less_square(M, k, U.linear),
            less_product(H, k, U.linear, U.angular),
            less_square(J, k, U.angular),
        )
        taken = add_spatial(apply_articulated(inertia, body.bias), scale_spatial(k * u, U))
        force = add_spatial(below.force, add_spatial(force, taken))
        inertia = add_body(inertia, below.inertia)
    return inertia, force


@kernel
def spread_out(arm, a):
    """Write the joints' accelerations for one of the platform, [ddp_A - g; dw_A]."""
    for i in range(len(arm.reduced)):
        body, reduced = arm.bodies[i + 1], arm.reduced[i]
        a = add_spatial(a, body.bias)
        rate = reduced.inverse * (reduced.drive - project(reduced.load, a))
        arm.accelerations[i] = rate
        a = add_spatial(a, scale_spatial(rate, body.axis))


@kernel
def solve_articulated(inertia, wrench):
    """Acceleration that a wrench gives an articulated body: its inverse, by halves.

    a = M^-1 (F - H w), and (J - H^T M^-1 H) w = T - H^T M^-1 F.
    """
    M, H, J = inertia
    x = solve_symmetric(M, (H[0], H[3], H[6]))
    y = solve_symmetric(M, (H[1], H[4], H[7]))
    z = solve_symmetric(M, (H[2], H[5], H[8]))
    left = solve_symmetric(M, wrench.linear)
    hx, hy, hz = rotate_back(H, x), rotate_back(H, y), rotate_back(H, z)
    S = (
        J[0] - hx[0],
        J[1] - hy[0],
        J[2] - hz[0],
        J[3] - hy[1],
        J[4] - hz[1],
        J[5] - hz[2],
    )
    w = solve_symmetric(S, subtract(wrench.angular, rotate_back(H, left)))
    taken = axpy(w[0], x, axpy(w[1], y, scale(w[2], z)))
    return Spatial(subtract(left, taken), w)


@kernel
def swept_acceleration(servos, g, wrench, arm):
    """Acceleration of the platform, the joints' into `arm`, once `sweep_out` has been.

    Args:
        servos: One a joint, of which the `armature` counts: rotor inertia of its motor, seen at the
            joint [kg m^2 or kg].
        g: Acceleration of gravity, {A} axes.
        wrench: On the platform at its origin, {A} axes.
        arm: `ArmRows`.

    Returns:
        [ddp_A (classical), dw_A] in {A} axes.
    """
    inertia, force = sweep_in(servos, arm)
    a = solve_articulated(inertia, subtract_spatial(wrench, force))
    spread_out(arm, a)
    return Spatial(add(a.linear, g), a.angular)


@kernel
def free_acceleration(links, servos, w, g, wrench, arm):
    """Acceleration of the platform under a wrench, the joints moved by torques.

    As `recursion.base_acceleration`, with `arm.torques` in the place of the joints' accelerations,
    which it writes. Arguments as in `sweep_out` and `swept_acceleration`.
    """
    sweep_out(links, w, arm)
    return swept_acceleration(servos, g, wrench, arm)


@kernel
def holding_torques(g, arm):
    """Write the torques that hold the arm up at rest against g, once `sweep_out` has been."""
    force = moment = ZERO
    for i in range(len(arm.reduced), 0, -1):
        body = arm.bodies[i]
        force = axpy(-body.inertia.mass, g, force)
        moment = subtract(moment, cross(body.inertia.first_moment, g))
        arm.torques[i - 1] = project(Spatial(force, moment), body.axis)
