"""Allocation about the centre of mass; `fullam.control.moment_about` is the reference."""

from __future__ import annotations

from fullam.control.moment_about import LARGEST_ROUNDS, LEAST_DETERMINANT
from fullam.simulation.compiled.allocation import confirm
from fullam.simulation.compiled.box_qp import (
    ROUNDS,
    SOLUTION,
    STATUS,
    UNSETTLED,
    WANTED,
    B,
    U,
    code_of,
    rows_of,
    solve_box,
)
from fullam.simulation.compiled.integrate import ASKED
from fullam.simulation.compiled.jit import compiled, merged
from fullam.simulation.compiled.rotations import (
    add,
    cross,
    dot,
    scale,
    subtract,
    three,
    write,
)


@merged
def corrected(box, unknowns, row, state, center):
    """M + c x (B_f u - F) for a row of `unknowns`."""
    f0 = f1 = f2 = 0.0
    for i in range(box.shape[0]):
        u = unknowns[row, i]
        f0 += box[i, B] * u
        f1 += box[i, B + 1] * u
        f2 += box[i, B + 2] * u
    lack = subtract((f0, f1, f2), three(state, ASKED, 0))
    return add(three(state, ASKED, 3), cross(center, lack))


@merged
def force_lack(maps, row, F):
    """One entry of (P - 1) F + r."""
    return maps[row, 0] * F[0] + maps[row, 1] * F[1] + maps[row, 2] * F[2] + maps[row, 6]


@compiled
def newton_step(maps, first, state, center):
    """Determinant and solution m of (1 - [c]x Q) m = M + [c]x ((P - 1) F + r).

    The rows of P - 1, Q and r begin at `first`.
    """
    F = three(state, ASKED, 0)
    lack = (
        force_lack(maps, first, F),
        force_lack(maps, first + 1, F),
        force_lack(maps, first + 2, F),
    )
    b = add(three(state, ASKED, 3), cross(center, lack))
    # Columns of 1 - [c]x Q: x, y, z.
    qx = cross(center, (maps[first, 3], maps[first + 1, 3], maps[first + 2, 3]))
    qy = cross(center, (maps[first, 4], maps[first + 1, 4], maps[first + 2, 4]))
    qz = cross(center, (maps[first, 5], maps[first + 1, 5], maps[first + 2, 5]))
    x, y = subtract((1.0, 0.0, 0.0), qx), subtract((0.0, 1.0, 0.0), qy)
    z = subtract((0.0, 0.0, 1.0), qz)
    yz, zx, xy = cross(y, z), cross(z, x), cross(x, y)
    determinant = dot(x, yz)
    return determinant, scale(1.0 / determinant, (dot(yz, b), dot(zx, b), dot(xy, b)))


@compiled
def allocate_about(
    box, scales, keys, maps, unknowns, sixes, sets, minimisers, counters, state, center
):
    """Allocate row ASKED of `state`, the moment taken about `center`; True if bounds cost wrench.

    Row WANTED of `sixes` holds the wrench asked for, and becomes the one with the moment corrected.
    """
    active, last, before = code_of(sets, STATUS), -1, -1
    solved = settled = False
    for _ in range(LARGEST_ROUNDS):
        counters[ROUNDS] += 1
        determinant, m = 0.0, (0.0, 0.0, 0.0)
        if active != before:
            first = rows_of(box, scales, keys, maps, sets, STATUS) + box.shape[0]
            determinant, m = newton_step(maps, first, state, center)
        newton = determinant >= LEAST_DETERMINANT
        if not newton:
            m = corrected(box, unknowns, SOLUTION, state, center)
        write(sixes, WANTED, 3, m)
        solved = solve_box(box, scales, keys, maps, unknowns, sixes, sets, minimisers, counters)
        reached = code_of(sets, STATUS)
        settled = solved and newton and reached == active
        if settled or not solved:
            break
        before, last, active = last, active, reached
    short, believed = confirm(box, scales, unknowns, sixes, sets, counters, solved)
    if not (settled and believed):
        write(sixes, WANTED, 3, corrected(box, unknowns, U, state, center))
        counters[UNSETTLED] += 1
    return short
