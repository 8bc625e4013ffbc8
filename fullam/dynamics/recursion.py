"""The world-frame Newton-Euler recursion (6)-(13) as kernels, and the platform's acceleration.

The recursion holds in any inertial axes. Here those that coincide with {A} at the instant are
taken, so that attitude enters through gravity alone. Summing eq. (13) over the links cancels the
inner forces and leaves f_1 and tau_1, carried to the origin of {A}: one sweep outward does without
the one back. `newton_euler` has the recursion as printed, `multibody` Pinocchio's; they are the
witnesses of this one.

Link frames are turned so that every joint turns about, or slides along, its z, as Craig's do.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.dynamics.spatial import (
    Spatial,
    add_spatial,
    rotate_spatial,
    rotate_spatial_back,
    subtract_spatial,
)
from fullam.numbers.elementary import sincos
from fullam.numbers.kernel import Number, kernel
from fullam.numbers.vectors import (
    IDENTITY,
    ZERO,
    Matrix,
    Symmetric,
    Vector,
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


class Link(NamedTuple):
    """A body of the chain, and the joint before it.

    Mass, centre of mass and inertia about it, link axes; rotation from the link before at joint
    position 0, place of the joint on it, and 1 if the joint slides instead of turning.
    """

    mass: Number
    com: Vector
    inertia: Symmetric
    rotation: Matrix
    offset: Vector
    prismatic: Number


class JointMotion(NamedTuple):
    """Position, rate and acceleration of a joint [rad or m, and per s, s^2]."""

    position: Number
    rate: Number
    acceleration: Number


class Joint(NamedTuple):
    """A joint at an instant, in {A} axes.

    Attitude of its link, way from the joint before, and rate and acceleration of turning and of
    sliding. None of it depends on masses, so all who fly the same motion share it.
    """

    rotation: Matrix
    step: Vector
    turning: tuple[Number, Number]
    sliding: tuple[Number, Number]


class Chain(NamedTuple):
    """Platform and arm at an instant: a sequence of `Link`, platform first, and one of `Joint`."""

    links: Any
    joints: Any


class RigidBody(NamedTuple):
    """Mass, first moment m c and inertia about the origin of {A}, in {A} axes."""

    mass: Number
    first_moment: Vector
    inertia: Symmetric


@kernel
def place_joints(links, motions, joints):
    """Write the `Joint`s of an instant, from their `JointMotion`s, eqs. (3)-(6)."""
    R = IDENTITY
    for i in range(1, len(links)):
        T, motion, slides = links[i].rotation, motions[i - 1], links[i].prismatic
        step = rotate(R, links[i].offset)
        x, y = rotate(R, (T[0], T[3], T[6])), rotate(R, (T[1], T[4], T[7]))
        z = rotate(R, (T[2], T[5], T[8]))
        turns = 1.0 - slides
        step = axpy(slides * motion.position, z, step)
        s, c = sincos(turns * motion.position)
        x, y = axpy(s, y, scale(c, x)), axpy(-s, x, scale(c, y))
        R = (x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2])
        joints[i - 1] = Joint(
            R,
            step,
            (turns * motion.rate, turns * motion.acceleration),
            (slides * motion.rate, slides * motion.acceleration),
        )


@kernel
def rotate_inertia(R, own):
    """Inertia R I R^T, eq. (14), of which six entries differ."""
    a, b, c = R[0:3], R[3:6], R[6:9]
    x, y, z = apply_symmetric(own, a), apply_symmetric(own, b), apply_symmetric(own, c)
    return (dot(x, a), dot(x, b), dot(x, c), dot(y, b), dot(y, c), dot(z, c))


@kernel
def shift_inertia(J, m, c):
    """Inertia about a point from which the centre of mass is c away, from that about it."""
    return (
        J[0] + m * (c[1] * c[1] + c[2] * c[2]),
        J[1] - m * c[0] * c[1],
        J[2] - m * c[0] * c[2],
        J[3] + m * (c[0] * c[0] + c[2] * c[2]),
        J[4] - m * c[1] * c[2],
        J[5] + m * (c[0] * c[0] + c[1] * c[1]),
    )


@kernel
def arm_load(chain, w, dw, a):
    """Forward recursion, eqs. (6)-(11), over links 1..n, and the sum of eq. (13), in {A} axes.

    Args:
        chain: Platform and arm.
        w: Angular velocity of {A}.
        dw: Its derivative.
        a: ddp_A - g, the classical acceleration of the origin of {A} less gravity.

    Returns:
        Force and moment on the arm at the origin of {A}; mass, first moment and inertia of the arm
        as one rigid body.
    """
    links, joints = chain.links, chain.joints
    force = moment = first = p = ZERO
    mass, inertia = 0.0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for i in range(1, len(links)):
        link, joint = links[i], joints[i - 1]
        R, r = joint.rotation, joint.step
        turning, turning_rate = joint.turning
        sliding, sliding_rate = joint.sliding
        z = (R[2], R[5], R[8])
        wz = cross(w, z)
        a = add(a, add(cross(dw, r), cross(w, cross(w, r))))
        a = axpy(2.0 * sliding, wz, axpy(sliding_rate, z, a))
        p = add(p, r)
        dw = axpy(turning, wz, axpy(turning_rate, z, dw))
        w = axpy(turning, z, w)
        lever = rotate(R, link.com)
        f = scale(link.mass, add(a, add(cross(dw, lever), cross(w, cross(w, lever)))))
        J = rotate_inertia(R, link.inertia)
        place = add(p, lever)
        gyroscopic = add(apply_symmetric(J, dw), cross(w, apply_symmetric(J, w)))
        force, moment = add(force, f), add(moment, add(cross(place, f), gyroscopic))
        mass, first = mass + link.mass, axpy(link.mass, place, first)
        inertia = add_symmetric(inertia, shift_inertia(J, link.mass, place))
    return force, moment, mass, first, inertia


@kernel
def platform_body(links):
    """The platform alone as a rigid body."""
    link = links[0]
    inertia = shift_inertia(link.inertia, link.mass, link.com)
    return RigidBody(link.mass, scale(link.mass, link.com), inertia)


@kernel
def composite_body(chain):
    """Platform and arm as one rigid body, frozen in the shape that the arm has now."""
    body = platform_body(chain.links)
    mass, first, inertia = body.mass, body.first_moment, body.inertia
    p = ZERO
    for i in range(1, len(chain.links)):
        link, joint = chain.links[i], chain.joints[i - 1]
        p = add(p, joint.step)
        place = add(p, rotate(joint.rotation, link.com))
        J = rotate_inertia(joint.rotation, link.inertia)
        mass, first = mass + link.mass, axpy(link.mass, place, first)
        inertia = add_symmetric(inertia, shift_inertia(J, link.mass, place))
    return RigidBody(mass, first, inertia)


@kernel
def inertial_wrench(body, acceleration):
    """Wrench that an acceleration takes: m ddp + dw x s, and s x ddp + J dw; {A} axes."""
    s, ddp, dw = body.first_moment, acceleration.linear, acceleration.angular
    return Spatial(
        add(scale(body.mass, ddp), cross(dw, s)),
        add(cross(s, ddp), apply_symmetric(body.inertia, dw)),
    )


@kernel
def bias_wrench(body, w, g):
    """Wrench that a rigid body takes to turn at w and be held up against g; {A} axes."""
    s = body.first_moment
    return Spatial(
        subtract(cross(w, cross(w, s)), scale(body.mass, g)),
        subtract(cross(w, apply_symmetric(body.inertia, w)), cross(s, g)),
    )


@kernel
def solve_body(body, wrench):
    """Acceleration that a wrench gives a rigid body at rest, the inverse of `inertial_wrench`.

    Eliminating ddp from m ddp + dw x s = F, s x ddp + J dw = M leaves three equations,
    (J - (|s|^2 1 - s s^T) / m) dw = M - s x F / m.
    """
    s, k, F = body.first_moment, 1.0 / body.mass, wrench.linear
    central = shift_inertia(body.inertia, -k, s)
    dw = solve_symmetric(central, subtract(wrench.angular, scale(k, cross(s, F))))
    return Spatial(scale(k, subtract(F, cross(dw, s))), dw)


@kernel
def gravity_in(R, gravity):
    """Acceleration of gravity in the axes of {A}, for an attitude R."""
    return scale(-gravity, (R[6], R[7], R[8]))


@kernel
def composite_load(chain, w, g):
    """Platform and arm as one rigid body, and the wrench that they take while ddp_A = dw_A = 0.

    What a wanted acceleration takes beside is `inertial_wrench` of that body; {A} axes.
    """
    force, moment, mass, first, inertia = arm_load(chain, w, ZERO, scale(-1.0, g))
    own = platform_body(chain.links)
    whole = RigidBody(
        own.mass + mass, add(own.first_moment, first), add_symmetric(own.inertia, inertia)
    )
    return whole, add_spatial(bias_wrench(own, w, g), Spatial(force, moment))


@kernel
def base_acceleration(chain, w, g, wrench):
    """Acceleration of the platform under a wrench, the arm's motion being prescribed.

    Solves eqs. (12) and (13) for ddp_A (classical) and dw_A; everything in {A} axes, g included.
    """
    whole, load = composite_load(chain, w, g)
    return solve_body(whole, subtract_spatial(wrench, load))


# What a law needs, in world axes as the paper has it; R is the attitude, w the angular velocity.


@kernel
def platform_wrench(chain, R, acceleration):
    """blkdiag(m_A 1, I_A) times an acceleration, eq. (26), for any centre of mass; world axes."""
    body = platform_body(chain.links)
    return rotate_spatial(R, inertial_wrench(body, rotate_spatial_back(R, acceleration)))


@kernel
def compensation(chain, R, w, acceleration, gravity):
    """u_dc of eq. (20) at a wanted acceleration [ddp_A, dw_A], world axes at the origin of {A}.

    u_dc = [f_1 - m_A g; tau_1 + r_1 x f_1 + w x I_A w] for a platform whose centre of mass is at
    the origin: `arm_load` gives f_1 and tau_1 + r_1 x f_1, `bias_wrench` the platform's own terms.
    """
    a = rotate_spatial_back(R, acceleration)
    spin = rotate_back(R, w)
    g = gravity_in(R, gravity)
    force, moment, _, _, _ = arm_load(chain, spin, a.angular, subtract(a.linear, g))
    own = bias_wrench(platform_body(chain.links), spin, g)
    return rotate_spatial(R, add_spatial(own, Spatial(force, moment)))


@kernel
def root_wrench(chain, R, w, acceleration, gravity):
    """Wrench on the platform for an acceleration [ddp_A, dw_A], and for none; world axes.

    The first is that of (20) and (26) together: u = M_bb a + M_bj ddtheta + h_b.
    """
    whole, load = composite_load(chain, rotate_back(R, w), gravity_in(R, gravity))
    inertial = inertial_wrench(whole, rotate_spatial_back(R, acceleration))
    return rotate_spatial(R, add_spatial(inertial, load)), rotate_spatial(R, load)


@kernel
def platform_acceleration(chain, R, w, wrench, gravity):
    """Acceleration [ddp_A, dw_A] under a rotor wrench, eq. (21), world axes."""
    spin = rotate_back(R, w)
    u = rotate_spatial_back(R, wrench)
    return rotate_spatial(R, base_acceleration(chain, spin, gravity_in(R, gravity), u))
