"""The moment to ask for at the origin of {A} so that it comes out right about another point.

A vehicle turns about its centre of mass, at c from the origin of {A}. A force that falls short by
f - F also lacks the moment -c x (f - F) about c. The moment asked for is therefore corrected to

    m = M + c x (B_f u(F, m) - F),                                                             (C1)

where u(F, m) is the allocation, which gives up force before moment. While its active set stays the
same, u is affine and B_f u = P F + Q m + r, so that (C1) is three linear equations:

    (1 - [c]x Q) m = M + [c]x ((P - 1) F + r).                                                 (C2)

Semi-smooth Newton: solve (C2) for the last active set, allocate (F, m), and repeat with the active
set of that, until it is the one which m was solved with. In flight the first round does it in most
periods, since the set rarely changes.

The right side of (C1) is bounded and continuous, so a solution exists, and (its degree being one)
one with det(1 - [c]x Q) > 0 where it is regular. From an active set whose determinant is not
positive Newton comes back to where it was; there, and when two sets take turns, the plain step of
(C1) is taken instead. That settles all but one in thousands (see the tests); what is left ends
with a bounded answer for the last (F, m), and says so.

Scalar code: a flight for itself.
"""

from __future__ import annotations

from typing import NamedTuple

from fullam.control.active_set_map import AT_UPPER, FREE
from fullam.control.active_set_search import Held, map_of, solve_box
from fullam.dynamics.spatial import Spatial
from fullam.numbers.kernel import Number, kernel, select, subroutine
from fullam.numbers.vectors import ZERO, Vector, add, axpy, cross, dot, scale, subtract

LARGEST_ROUNDS = 10
"""Allocations at most; two are enough from any set far away, ten leave one in thousands."""

SETTLED_MOMENT = 1e-3
"""Change of m [N m] at which plain steps alone end."""

LEAST_DETERMINANT = 0.01
"""Least det(1 - [c]x Q) with which (C2) is solved; it is 1 for c = 0."""


class Tried(NamedTuple):
    """How a search ended, as numbers.

    The wrench it was asked for last; 1 if it is solved; 1 if it is the one to ask for, (C1); rounds
    taken; changes of the active set, and how often one came back.
    """

    asked: Spatial
    is_solved: Number
    is_settled: Number
    rounds: Number
    pivots: Number
    returns: Number


class Response(NamedTuple):
    """Columns of P and of Q, and r, of an active set."""

    P: tuple[Vector, Vector, Vector]
    Q: tuple[Vector, Vector, Vector]
    r: Vector


@subroutine
def search_about(box, rotors, search, wrench, center):
    """Find m and allocate (F, m).

    Args:
        box: The allocation's box problem.
        rotors: Rows with the rotors' `coupling`.
        search: Memory of the box solver; starts at, and leaves, its last answer.
        wrench: F and M at the origin of {A} [N, N m].
        center: c in {A} [m].

    Returns:
        `Tried`.
    """
    held, last, before = search.last[0].held, Held(-1.0, -1.0), Held(-1.0, -1.0)
    asked, rounds, pivots, returns = wrench, 0.0, 0.0, 0.0
    solved = settled = False
    for _ in range(LARGEST_ROUNDS):
        determinant, m = 0.0, ZERO
        if not (held.lower == before.lower and held.upper == before.upper):
            slot = map_of(box, search.status, held)
            response = force_response(rotors, box, slot, search.status)
            determinant, m = newton_step(response, wrench, center)
        is_newton = determinant >= LEAST_DETERMINANT
        if not is_newton:
            m = corrected(rotors, search.solution, wrench, center)
        asked = Spatial(wrench.linear, m)
        solved, more_pivots, more_returns = solve_box(box, search, asked)
        rounds, pivots, returns = rounds + 1.0, pivots + more_pivots, returns + more_returns
        now = search.last[0].held
        settled = solved and is_newton and now.lower == held.lower and now.upper == held.upper
        if settled or not solved:
            break
        before, last, held = last, held, now
    ends = select(solved, 1.0, 0.0), select(settled, 1.0, 0.0)
    return Tried(asked, ends[0], ends[1], rounds, pivots, returns)


@kernel
def force_of(rotors, shares):
    """Force B_f u of shares of the squared speeds, in {A} [N]."""
    force = ZERO
    for i in range(len(rotors)):
        force = axpy(shares[i], rotors[i].coupling.linear, force)
    return force


@kernel
def corrected(rotors, shares, wrench, center):
    """M + c x (B_f u - F)."""
    lack = subtract(force_of(rotors, shares), wrench.linear)
    return add(wrench.angular, cross(center, lack))


@subroutine
def force_response(rotors, box, slot, status):
    """Columns of P and of Q, and r, of the active set whose map is in a slot of the store."""
    rows = box.maps[slot]
    px = py = pz = qx = qy = qz = r = ZERO
    for i in range(len(rotors)):
        b = rotors[i].coupling.linear
        if status[i] == FREE:
            row = rows[i]
            force, moment = row.gain.linear, row.gain.angular
            px, py, pz = axpy(force[0], b, px), axpy(force[1], b, py), axpy(force[2], b, pz)
            qx, qy, qz = axpy(moment[0], b, qx), axpy(moment[1], b, qy), axpy(moment[2], b, qz)
            r = axpy(row.offset, b, r)
        elif status[i] == AT_UPPER:
            r = axpy(box.unknowns[i].upper, b, r)
    return Response((px, py, pz), (qx, qy, qz), r)


@kernel
def newton_step(response, wrench, center):
    """Determinant and solution m of (C2); m means something if the determinant is not 0."""
    F, P, Q = wrench.linear, response.P, response.Q
    force = axpy(F[0], P[0], axpy(F[1], P[1], axpy(F[2], P[2], response.r)))
    right = add(wrench.angular, cross(center, subtract(force, F)))
    # Columns of 1 - [c]x Q, and m by Cramer's rule.
    x = subtract((1.0, 0.0, 0.0), cross(center, Q[0]))
    y = subtract((0.0, 1.0, 0.0), cross(center, Q[1]))
    z = subtract((0.0, 0.0, 1.0), cross(center, Q[2]))
    yz, zx, xy = cross(y, z), cross(z, x), cross(x, y)
    determinant = dot(x, yz)
    guarded = select(determinant == 0.0, 1.0, determinant)
    return determinant, scale(1.0 / guarded, (dot(yz, right), dot(zx, right), dot(xy, right)))
