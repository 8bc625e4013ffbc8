"""Momentum of platform and arm, as a kernel: one sweep of velocities outward along the chain."""

from __future__ import annotations

from fullam.dynamics.recursion import rotate_inertia
from fullam.dynamics.spatial import Spatial
from fullam.numbers.kernel import kernel
from fullam.numbers.vectors import (
    ZERO,
    add,
    apply_symmetric,
    axpy,
    cross,
    rotate,
    scale,
    subtract,
)


@kernel
def momentum(chain, v, w):
    """Linear momentum, angular momentum about the common centre of mass, and where that is.

    h_f = sum m_i v_i and h_tau = sum (I_i w_i + c_i x m_i v_i) - c x h_f, with the places c_i and c
    from the origin of {A}.

    Args:
        chain: Platform and arm.
        v: Velocity of the origin of {A}.
        w: Angular velocity of {A}.

    Returns:
        [h_f; h_tau] and c, everything in {A} axes.
    """
    links, joints = chain.links, chain.joints
    body = links[0]
    mass, first = body.mass, scale(body.mass, body.com)
    linear = scale(body.mass, add(v, cross(w, body.com)))
    angular = add(apply_symmetric(body.inertia, w), cross(body.com, linear))
    p = ZERO
    for i in range(1, len(links)):
        link, joint = links[i], joints[i - 1]
        R, r = joint.rotation, joint.step
        z = (R[2], R[5], R[8])
        v = axpy(joint.sliding[0], z, add(v, cross(w, r)))
        w = axpy(joint.turning[0], z, w)
        p = add(p, r)
        lever = rotate(R, link.com)
        place = add(p, lever)
        h = scale(link.mass, add(v, cross(w, lever)))
        spin = apply_symmetric(rotate_inertia(R, link.inertia), w)
        linear, angular = add(linear, h), add(angular, add(spin, cross(place, h)))
        mass, first = mass + link.mass, axpy(link.mass, place, first)
    c = scale(1.0 / mass, first)
    return Spatial(linear, subtract(angular, cross(c, linear))), c
