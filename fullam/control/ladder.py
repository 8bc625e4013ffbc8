"""Allocation: from a wrench to rotor speeds within their bounds.

The unknowns are u_i = Omega_i^2 / Omega_max,i^2 in [0, 1]; the rotors give the wrench B u, with B
the coupling matrix of eq. (34) scaled by the largest squared speeds. The allocator solves

    minimise  1/2 ||W (B u - w)||^2 + eps/2 ||u - u_0||^2   subject to  0 <= u <= 1

by a ladder, each rung tried when the one above does not apply:

1. "exact": the unconstrained minimiser u = K w + k, if it is within the bounds;
2. "active-set": the warm active set of `box_qp`, if its KKT residual confirms it;
3. "proxqp": the referee, which the `Allocator` asks; machine code has no such rung;
4. "clip": K w + k cut to the bounds. A vehicle in flight must be told something, so the ladder
   returns this flagged instead of raising; with method="proxqp" a failure is an AllocationFailed.

A wrench that rung 1 does not reach may cost force. `moment_about` says which moment to ask for
then, so that the vehicle turns about its centre of mass as it should.

Rung 1 flies in lanes; the flights that it does not serve go down the ladder one by one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.control.active_set_map import inner, value
from fullam.control.active_set_search import (
    Box,
    Held,
    Last,
    Search,
    kkt_residual,
    solve_box,
    weighted_residual,
)
from fullam.control.moment_about import Tried, corrected, search_about
from fullam.dynamics.spatial import Spatial, subtract_spatial
from fullam.numbers.kernel import (
    Number,
    absolute,
    both,
    clip,
    kernel,
    lane_count,
    lane_of,
    maximum,
    select,
    some,
    sqrt,
    subroutine,
)
from fullam.numbers.records import one
from fullam.numbers.vectors import ZERO, axpy

KKT_TOLERANCE = 1e-8
"""Largest KKT residual with which the active set's answer is believed; it leaves 1e-13."""

LARGEST_FINITE = 1e300
"""A sum of a wrench's entries beyond this is not finite."""

EXACT, ACTIVE_SET, PROXQP, CLIP, REFUSED = 0.0, 1.0, 2.0, 3.0, 4.0
"""Rungs as numbers; REFUSED is a wrench or a centre that is not finite."""


class RotorColumn(NamedTuple):
    """A rotor as the allocation sees it: its column of B [N, N m], and its largest speed."""

    coupling: Spatial
    max_speed: Number


class AllocationProblem(NamedTuple):
    """The allocation of a vehicle; one for a thread, since it has a store of maps in it.

    The box problem; n of `RotorColumn`; one number, the square of the weighted wrench error above
    which bounds cost wrench.
    """

    box: Box
    rotors: Any
    tolerance: Any


class Answer(NamedTuple):
    """The last answer of the ladder below rung 1.

    The wrench asked for with its moment corrected; rung; 1 if bounds cost wrench; 1 if the moment
    is the one to ask for; rounds taken.
    """

    asked: Spatial
    rung: Number
    is_short: Number
    is_settled: Number
    rounds: Number


class Counts(NamedTuple):
    """How many wrenches each rung answered, and what the active set had to do; see `Counters`."""

    exact: Number
    active_set: Number
    proxqp: Number
    clip: Number
    refused: Number
    unconfirmed: Number
    unsettled: Number
    rounds: Number
    pivots: Number
    returns: Number


class AllocationMemory(NamedTuple):
    """What the allocation of a flight remembers and answers; zeros at take-off.

    Memory of the search; squared speeds u as shares of the largest, n numbers; rotor speeds, n
    numbers [rad/s]; one each of wrench and centre handed to the ladder, `Answer`, `Counts`.
    """

    search: Search
    shares: Any
    speeds: Any
    wrench: Any
    center: Any
    answer: Any
    counts: Any


@kernel
def allocate(problem, memory, wrench, center, flying):
    """Allocate a wrench in {A}; in lanes. Rotor speeds go to `memory.speeds`.

    Args:
        problem: `AllocationProblem`.
        memory: `AllocationMemory`.
        wrench: The wrench wanted in {A} at its origin [N, N m].
        center: The vehicle's centre of mass in {A}, about which a moment comes first [m].
        flying: Which flights go down the ladder if they have to.

    Returns:
        The wrench achieved in {A}; where bounds cost wrench achieved minus wanted, its moment about
        the centre, else zero; and where that is.
    """
    outside = exact(problem, wrench, memory.shares)
    count_exact(memory, both(flying, opposite(outside)))
    outside = both(flying, outside)
    if some(outside):
        memory.wrench[0], memory.center[0] = wrench, center
        for lane in range(lane_count(outside)):
            if lane_of(outside, lane):
                own = memory_of(memory, lane)
                allocate_about(problem, own, own.wrench[0], own.center[0])
    speeds_of(problem.rotors, memory.shares, memory.speeds)
    achieved, answer = Spatial(*wrench_of(problem.rotors, memory.shares)), memory.answer[0]
    saturated = both(outside, answer.is_short > 0.0)
    missing = subtract_spatial(achieved, answer.asked)
    return achieved, select(saturated, missing, Spatial(ZERO, ZERO)), saturated


@kernel
def exact(problem, wrench, shares):
    """The first rung: write u = K w + k to `shares`; returns where it is out of bounds, or NaN."""
    within, unknowns = True, problem.box.unknowns
    for i in range(len(unknowns)):
        u = value(unknowns[i], wrench)
        shares[i] = u
        within = both(within, both(u >= 0.0, u <= 1.0))
    return opposite(within)


@kernel
def opposite(condition):
    """Where a condition does not hold."""
    return select(condition, 1.0, 0.0) < 0.5


@kernel
def wrench_of(rotors, shares):
    """Force and moment of B u in {A}."""
    force = moment = ZERO
    for i in range(len(rotors)):
        force = axpy(shares[i], rotors[i].coupling.linear, force)
        moment = axpy(shares[i], rotors[i].coupling.angular, moment)
    return force, moment


@kernel
def speeds_of(rotors, shares, speeds):
    """Rotor speeds Omega = sqrt(u) Omega_max."""
    for i in range(len(rotors)):
        speeds[i] = rotors[i].max_speed * sqrt(maximum(shares[i], 0.0))


@kernel
def count_exact(memory, answered):
    """Count what the first rung answered."""
    c = memory.counts[0]
    memory.counts[0] = Counts(
        c.exact + select(answered, 1.0, 0.0),
        c.active_set,
        c.proxqp,
        c.clip,
        c.refused,
        c.unconfirmed,
        c.unsettled,
        c.rounds,
        c.pivots,
        c.returns,
    )


@kernel
def memory_of(memory, lane):
    """The memory of one of the flights in the lanes."""
    search = memory.search
    return AllocationMemory(
        Search(one(search.solution, lane), one(search.status, lane), one(search.last, lane)),
        one(memory.shares, lane),
        one(memory.speeds, lane),
        one(memory.wrench, lane),
        one(memory.center, lane),
        one(memory.answer, lane),
        one(memory.counts, lane),
    )


# Below here: a flight for itself, and branches on its numbers.


@subroutine
def allocate_about(problem, memory, wrench, center):
    """Go down the ladder below the first rung, the moment taken about the centre of mass.

    A wrench or a centre that is not finite is refused before a solver is touched: the rotors get
    their preferred speeds, flagged and counted.
    """
    if not finite(wrench, center):
        refuse(problem, memory, wrench)
        return
    tried = search_about(problem.box, problem.rotors, memory.search, wrench, center)
    believed, error = confirm(problem, memory, tried.asked, tried.is_solved)
    if not believed:
        error = cut(problem, memory, tried.asked)
    rung = select(believed, ACTIVE_SET, CLIP)
    is_short = select(error <= problem.tolerance[0], 0.0, 1.0)
    conclude(problem, memory, tried, wrench, center, rung, is_short)


@kernel
def search_at_origin(problem, memory, wrench):
    """As `search_about`, the moment taken about the origin of {A}; no rounds."""
    solved, pivots, returns = solve_box(problem.box, memory.search, wrench)
    return Tried(wrench, select(solved, 1.0, 0.0), 1.0, 0.0, pivots, returns)


@kernel
def finite(wrench, center):
    """Whether all numbers of a wrench and a centre are finite."""
    a, b = wrench.linear, wrench.angular
    total = a[0] + a[1] + a[2] + b[0] + b[1] + b[2]
    return absolute(total + (center[0] + center[1] + center[2])) < LARGEST_FINITE


@subroutine
def confirm(problem, memory, asked, is_solved):
    """Believe the active set if its KKT residual agrees.

    Returns:
        Whether it is believed; its answer is in `shares` then. The squared weighted error.
    """
    if is_solved == 0.0:
        return False, 0.0
    worst, residual = kkt_residual(problem.box, memory.search.solution, asked)
    believed = worst <= KKT_TOLERANCE
    if believed:
        for i in range(len(memory.shares)):
            memory.shares[i] = memory.search.solution[i]
    return believed, inner(residual, residual)


@subroutine
def cut(problem, memory, asked):
    """Last rung: K w + k cut to the bounds. What was not believed is no start for a search either.

    Returns:
        The squared weighted error.
    """
    unknowns = problem.box.unknowns
    for i in range(len(unknowns)):
        memory.shares[i] = clip(value(unknowns[i], asked), 0.0, unknowns[i].upper)
    memory.search.last[0] = Last(Held(0.0, 0.0), 0.0)
    residual = weighted_residual(problem.box, memory.shares, asked)
    return inner(residual, residual)


@subroutine
def conclude(problem, memory, tried, wrench, center, rung, is_short):
    """Write down what was answered, and count it.

    An answer that is not the active set's, or that (C1) does not hold for, is measured against the
    moment of the force that it gives.
    """
    settled = rung == ACTIVE_SET and tried.is_settled > 0.0
    asked = tried.asked
    if not settled:
        asked = Spatial(wrench.linear, corrected(problem.rotors, memory.shares, wrench, center))
    is_settled = select(settled, 1.0, 0.0)
    memory.answer[0] = Answer(asked, rung, is_short, is_settled, tried.rounds)
    c = memory.counts[0]
    memory.counts[0] = Counts(
        c.exact,
        c.active_set + select(rung == ACTIVE_SET, 1.0, 0.0),
        c.proxqp + select(rung == PROXQP, 1.0, 0.0),
        c.clip + select(rung == CLIP, 1.0, 0.0),
        c.refused,
        c.unconfirmed + select(rung == ACTIVE_SET, 0.0, 1.0),
        c.unsettled + select(settled or tried.rounds == 0.0, 0.0, 1.0),
        c.rounds + tried.rounds,
        c.pivots + tried.pivots,
        c.returns + tried.returns,
    )


@subroutine
def refuse(problem, memory, wrench):
    """Answer what is not finite."""
    for i in range(len(memory.shares)):
        memory.shares[i] = problem.box.unknowns[i].prior
    memory.answer[0] = Answer(wrench, REFUSED, 1.0, 0.0, 0.0)
    c = memory.counts[0]
    memory.counts[0] = Counts(
        c.exact,
        c.active_set,
        c.proxqp,
        c.clip,
        c.refused + 1.0,
        c.unconfirmed,
        c.unsettled,
        c.rounds,
        c.pivots,
        c.returns,
    )
