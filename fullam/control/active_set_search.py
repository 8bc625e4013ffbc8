"""Weighted, regularised least squares in the box [0, u_max], solved by a warm active set.

The problem, with A = W B (6 x n) and d = W w:

    minimise  f(u) = 1/2 ||A u - d||^2 + eps/2 ||u - u_0||^2   subject to  0 <= u <= u_max.

For a given active set (which u are free, which held at a bound) the answer is affine in the
wrench w: a free u_i is an inner product with w plus a constant, and so is the multiplier of a held
one. `active_set_map` is that map; it is computed once per set and kept in a store, so a wrench that
meets the same bounds as the last one costs one matrix-vector product. Otherwise a primal active-set
search (Nocedal and Wright, Numerical Optimization, section 16.5) runs from a feasible point: move
to the minimiser of the current set, stop at the first bound in the way and hold it, and at a
minimiser free the held unknown with the most negative multiplier. The cost falls from minimiser to
minimiser (the Hessian A^T A + eps 1 is positive definite), so no set can come back, but for
rounding. If one does, the tolerances are below rounding, and are raised tenfold.

An active set is known by two numbers, the sums of 2^i of the unknowns held at the lower and at the
upper bound: up to 50 unknowns.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.control.active_set_map import (
    AT_LOWER,
    AT_UPPER,
    FREE,
    active_set_map,
    inner,
    value,
)
from fullam.dynamics.spatial import axpy_spatial, multiply_spatial, scale_spatial
from fullam.numbers.kernel import Number, absolute, clip, select, subroutine

BOUND_TOLERANCE = 1e-10
"""How far a free u may pass a bound before it is held, in u. Rounding in the maps is 1e-13."""

MULTIPLIER_TOLERANCE = 1e-13
"""How negative a scaled multiplier may be before its bound is freed, in u.

Smaller than the multipliers that the regulariser makes, eps / H_ii (1e-9 for the default), so that
preferred speeds are honoured at the bounds too.
"""

FEW_MISFITS = 2
"""With so few bounds that do not fit, the last solution is a good start without asking further."""

MOST_RETURNS = 4
"""How often the tolerances are raised because an active set came back."""


class Held(NamedTuple):
    """An active set: sums of 2^i of the unknowns at the lower and at the upper bound."""

    lower: Number
    upper: Number


class Slot(NamedTuple):
    """A place of the store: the active set whose map stands there, and 1 if there is one."""

    held: Held
    used: Number


class Box(NamedTuple):
    """A box problem with its store of maps and space to work in; one for a thread.

    Sequences of records: n of `Unknown`, one of `Scales`; slots of the store, their n of `Affine`,
    and how many are used (one number); for the search n floats, six rows of floats for the maps,
    and the active sets whose minimiser was reached (their number limits the search).
    """

    unknowns: Any
    scales: Any
    slots: Any
    maps: Any
    used: Any
    goal: Any
    columns: Any
    reached: Any


class Last(NamedTuple):
    """The active set of the last search; 1 if there was one."""

    held: Held
    is_warm: Number


class Search(NamedTuple):
    """What a flight remembers of its last search: solution and status of each unknown, `Last`.

    Zeros are a cold start.
    """

    solution: Any
    status: Any
    last: Any


@subroutine
def map_of(box, status, held):
    """Slot of an active set, its map computed if it is not there; a full store is emptied.

    What is in the store decides about time only: a map depends on its set alone.
    """
    slots, count = box.slots, len(box.slots)
    lower, upper = int(held.lower) % 1048573, int(held.upper) % 1048571
    home = (lower * 104729 + upper * 1299709) % count
    slot = home
    while slots[slot].used > 0.0:
        kept = slots[slot].held
        if kept.lower == held.lower and kept.upper == held.upper:
            return slot
        slot = (slot + 1) % count
    if 2.0 * (box.used[0] + 1.0) > count:
        for i in range(count):
            slots[i] = Slot(Held(0.0, 0.0), 0.0)
        box.used[0] = 0.0
        slot = home
    box.used[0] = box.used[0] + 1.0
    slots[slot] = Slot(held, 1.0)
    active_set_map(box.unknowns, box.scales[0], status, box.columns, box.maps[slot])
    return slot


@subroutine
def solve_box(box, search, wrench):
    """Find the minimiser for a finite wrench, from where the last search ended.

    The last active set is tried first. If more than a few of its bounds do not fit, the search
    starts from the last solution or from the clipped unconstrained minimiser, whichever costs
    less; else from the last solution.

    Args:
        box: The problem.
        search: Memory, moved on: `solution` is the answer, or feasible and the best point found.
        wrench: The wrench w.

    Returns:
        Whether `solution` is the minimiser; changes of the active set; how often a set came back.
    """
    unknowns, status, u = box.unknowns, search.status, search.solution
    held, few = search.last[0].held, FEW_MISFITS
    if search.last[0].is_warm == 0.0:
        held, few = Held(0.0, 0.0), 0
        for i in range(len(unknowns)):
            u[i], status[i] = unknowns[i].prior, FREE
    settled, pivots, returns, known, slack = False, 0.0, 0.0, 0, 1.0
    for _ in range(len(box.reached)):
        slot = map_of(box, status, held)
        misfits, blocking, share, leaving = aim(box, slot, search, wrench, slack)
        if misfits > few:
            few, held = len(unknowns), start_from_clip(box, search, wrench, held)
            continue
        advance(unknowns, search, box.goal, share)
        change = blocking
        if blocking < 0:
            if leaving < 0:
                settled = True
                break
            for i in range(known):
                if box.reached[i].lower == held.lower and box.reached[i].upper == held.upper:
                    returns, slack, known = returns + 1.0, 10.0 * slack, 0
                    break
            if returns > MOST_RETURNS:
                break
            box.reached[known] = held
            known, change = known + 1, leaving
        pivots += 1.0
        held = pivot(unknowns, search, box.goal, held, change)
    search.last[0] = Last(held, 1.0)
    return settled, pivots, returns


@subroutine
def aim(box, slot, search, wrench, slack):
    """Write minimiser and multipliers of an active set, its map in a slot, to `goal`.

    Returns:
        How many do not fit; the first free unknown to meet a bound on the way there, -1 if none
        does, and the share of the way up to it; the held unknown that is to be freed, -1 if none.
    """
    unknowns, rows, status, u, goal = (
        box.unknowns,
        box.maps[slot],
        search.status,
        search.solution,
        box.goal,
    )
    misfits, share, blocking = 0, 1.0, -1
    worst, leaving = -MULTIPLIER_TOLERANCE * slack, -1
    tolerance = BOUND_TOLERANCE * slack
    for i in range(len(unknowns)):
        z = value(rows[i], wrench)
        goal[i] = z
        if status[i] == FREE:
            bound = select(z < 0.0, 0.0, unknowns[i].upper)
            if absolute(z - bound) > tolerance and (z < 0.0 or z > bound):
                misfits += 1
                reached = (bound - u[i]) / (z - u[i])
                if reached < share:
                    share, blocking = reached, i
        elif z < -MULTIPLIER_TOLERANCE * slack:
            misfits += 1
            if z < worst:
                worst, leaving = z, i
    return misfits, blocking, share, leaving


@subroutine
def advance(unknowns, search, goal, share):
    """Move the free unknowns a share of the way to their minimiser, the held ones to their bounds.

    All of the way leads to the minimiser itself, wherever from.
    """
    status, u = search.status, search.solution
    for i in range(len(unknowns)):
        upper = unknowns[i].upper
        if status[i] == FREE:
            moved = select(share < 1.0, u[i] + share * (goal[i] - u[i]), goal[i])
            u[i] = clip(moved, 0.0, upper)
        else:
            u[i] = select(status[i] == AT_UPPER, upper, 0.0)


@subroutine
def pivot(unknowns, search, goal, held, i):
    """Hold the free unknown i at the bound that its minimiser passes, or free it if it is held."""
    status, unknown = search.status, unknowns[i]
    lower, upper, bit = held.lower, held.upper, unknown.bit
    if status[i] == AT_LOWER:
        status[i] = FREE
        lower -= bit
    elif status[i] == AT_UPPER:
        status[i] = FREE
        upper -= bit
    elif goal[i] < 0.0:
        status[i], search.solution[i] = AT_LOWER, 0.0
        lower += bit
    else:
        status[i], search.solution[i] = AT_UPPER, unknown.upper
        upper += bit
    return Held(lower, upper)


@subroutine
def start_from_clip(box, search, wrench, held):
    """Go to the unconstrained minimiser clipped to the box, if it costs less than where we are.

    Returns:
        The active set where we are then.
    """
    unknowns, status, u, clipped = box.unknowns, search.status, search.solution, box.goal
    for i in range(len(unknowns)):
        unknown = unknowns[i]
        clipped[i] = clip(value(unknown, wrench), 0.0, unknown.upper)
    lower, upper = held.lower, held.upper
    if cost(box, clipped, wrench) < cost(box, u, wrench):
        lower = upper = 0.0
        for i in range(len(unknowns)):
            unknown = unknowns[i]
            z, bit, u[i] = value(unknown, wrench), unknown.bit, clipped[i]
            low, high = z < 0.0, z > unknown.upper
            status[i] = select(low, AT_LOWER, select(high, AT_UPPER, FREE))
            lower, upper = lower + select(low, bit, 0.0), upper + select(high, bit, 0.0)
    return Held(lower, upper)


@subroutine
def weighted_residual(box, u, wrench):
    """A u - W w, a six."""
    unknowns = box.unknowns
    residual = scale_spatial(-1.0, multiply_spatial(box.scales[0].weights, wrench))
    for i in range(len(unknowns)):
        residual = axpy_spatial(u[i], unknowns[i].column, residual)
    return residual


@subroutine
def cost(box, u, wrench):
    """The cost f(u)."""
    residual, pull = weighted_residual(box, u, wrench), 0.0
    for i in range(len(box.unknowns)):
        away = u[i] - box.unknowns[i].prior
        pull += away * away
    return 0.5 * inner(residual, residual) + 0.5 * box.scales[0].eps * pull


@subroutine
def kkt_residual(box, u, wrench):
    """How far u is from optimal, and A u - W w.

    The largest entry of |u - clip(u - grad f(u) / diag H, 0, u_max)|: entry i is how far u_i alone
    would still move towards lower cost. All vanish exactly at the minimiser: stationarity,
    complementarity and feasibility in one number. NaN if any entry is.
    """
    eps, residual, worst = box.scales[0].eps, weighted_residual(box, u, wrench), 0.0
    for i in range(len(box.unknowns)):
        unknown = box.unknowns[i]
        slope = inner(unknown.column, residual) + eps * (u[i] - unknown.prior)
        moved = u[i] - slope / unknown.diagonal
        step = absolute(
            u[i] - select(moved < 0.0, 0.0, select(moved > unknown.upper, unknown.upper, moved))
        )
        if not step <= worst:
            worst = step
            if step != step:  # NaN
                break
    return worst, residual
