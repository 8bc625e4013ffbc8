"""The compiled functions that Python calls, kept on disk; see `jit.entry`.

Each is a closure over the digest of the sources, which makes numba compile it anew when any module
of this package has changed.
"""

from __future__ import annotations

import math
from typing import Any

from fullam.simulation.compiled import loop
from fullam.simulation.compiled.allocation import achieved, allocate, exact
from fullam.simulation.compiled.box_qp import MAX_SPEED, RESIDUAL, WANTED, U
from fullam.simulation.compiled.dynamics import composite, place_arm, platform_acceleration
from fullam.simulation.compiled.integrate import (
    COMMANDS,
    POSE,
    TOLD,
    TOLD_VELOCITY,
    VELOCITY,
    advance,
)
from fullam.simulation.compiled.jit import entry, sources
from fullam.simulation.compiled.moment_about import allocate_about
from fullam.simulation.compiled.rotations import (
    cross,
    four,
    matrix,
    scale,
    subtract,
    three,
    write,
)

IN_REACH, OUT_OF_REACH, NOT_FINITE, NO_CENTER = range(4)
"""What a tick says of its wrench, and of a centre of mass that is not finite."""


def _build(digest: str) -> tuple[Any, ...]:
    """The entry points, keyed by the digest of all sources."""

    @entry
    def fly(job, log, start, stop, last):
        """See `loop.fly`."""
        version = digest  # noqa: F841 - what makes it part of the key
        return loop.fly(job, log, start, stop, last)

    @entry
    def tick(
        numbers,
        links,
        memory,
        box,
        scales,
        keys,
        maps,
        unknowns,
        sixes,
        sets,
        minimisers,
        counters,
        state,
        speeds,
        reference,
        joints,
        arm,
        inputs,
    ):
        """One control period without sensors: law, turn to {A}, allocation, rotor speeds.

        `inputs` holds q, v, ddtheta, then pose, velocity and acceleration of the reference, end to
        end. Arrays come one by one, because numba looks at a tuple of them for 10 us.

        Returns:
            IN_REACH, OUT_OF_REACH, NOT_FINITE, or NO_CENTER with the centre in row RESIDUAL.
        """
        version = digest  # noqa: F841
        n = links.shape[0] - 1
        for i in range(7):
            state[TOLD, i] = inputs[i]
            reference[0, i] = inputs[13 + 3 * n + i]
        for i in range(6):
            state[TOLD_VELOCITY, i] = inputs[7 + n + i]
            reference[1, i] = inputs[20 + 3 * n + i]
            reference[2, i] = inputs[26 + 3 * n + i]
        for i in range(n):
            joints[0, i] = inputs[7 + i]
            joints[1, i] = inputs[13 + n + i]
            joints[2, i] = inputs[13 + 2 * n + i]
        place_arm(links, joints, joints[1:], joints[2:], 0, arm)
        R = loop.command(
            numbers, links, memory, state, reference, reference[1:], reference[2:], 0, arm, 0
        )
        if not loop.ask(memory, state, sixes, R):
            return NOT_FINITE
        saturated = False
        if not exact(box, unknowns, sixes, counters):
            m, s, _ = composite(links, arm, 0)
            center = scale(1.0 / m, s)
            if not math.isfinite(center[0] + center[1] + center[2]):
                write(sixes, RESIDUAL, 0, center)
                return NO_CENTER
            saturated = allocate_about(
                box, scales, keys, maps, unknowns, sixes, sets, minimisers, counters, state, center
            )
            if saturated:
                force, moment = achieved(box, unknowns)
                loop.deliver(numbers, links, memory, R, R, force, moment, sixes, arm, 0)
        for i in range(box.shape[0]):
            speeds[COMMANDS, i] = box[i, MAX_SPEED] * math.sqrt(unknowns[U, i])
        return OUT_OF_REACH if saturated else IN_REACH

    @entry
    def place(links, angles, rates, accelerations, arm):
        """See `dynamics.place_arm`; all rows."""
        version = digest  # noqa: F841
        for row in range(angles.shape[0]):
            place_arm(links, angles, rates, accelerations, row, arm)

    @entry
    def step(links, rotors, plant, arm, row, state, speeds, gusts):
        """See `integrate.advance`; the first gust blows."""
        version = digest  # noqa: F841
        advance(links, rotors, plant, arm, row, state, speeds, gusts, 0)

    @entry
    def accelerate(links, arm, gravity, state, wrench, out):
        """Derivatives of the true body velocity under a wrench in {A}, row 0 of each array."""
        version = digest  # noqa: F841
        R = matrix(four(state, POSE, 3))
        g = scale(-gravity, (R[6], R[7], R[8]))
        v, w = three(state, VELOCITY, 0), three(state, VELOCITY, 3)
        a, b = platform_acceleration(links, arm, 0, w, g, three(wrench, 0, 0), three(wrench, 0, 3))
        write(out, 0, 0, subtract(a, cross(w, v)))
        write(out, 0, 3, b)

    @entry
    def allot(allotment, wrench):
        """See `allocation.allocate`."""
        version = digest  # noqa: F841
        box, scales, keys, maps, unknowns, sixes, sets, minimisers, counters = allotment
        write(sixes, WANTED, 0, three(wrench, 0, 0))
        write(sixes, WANTED, 3, three(wrench, 0, 3))
        return allocate(box, scales, keys, maps, unknowns, sixes, sets, minimisers, counters)

    return fly, tick, place, step, accelerate, allot


fly, tick, place, step, accelerate, allot = _build(sources())
