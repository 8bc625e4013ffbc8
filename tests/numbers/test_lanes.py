"""Machine code, for one flight and in lanes, has the bits of Python's floats.

This is the alarm for upgrades of numba and llvmlite: `lanes`, `compiled_records` and
`machine_code` know them from the inside, and everything that these know is used here.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest

from fullam.numbers import kernel as k_
from fullam.numbers.elementary import arctan2, decay, sincos
from fullam.numbers.kernel import (
    Number,
    absolute,
    both,
    clip,
    either,
    kernel,
    lane_count,
    lane_of,
    maximum,
    minimum,
    select,
    some,
    sqrt,
    subroutine,
)
from fullam.numbers.program import Stage, program
from fullam.numbers.records import Rows, one
from fullam.numbers.vectors import Vector, axpy, cross, dot

SPECIAL = [0.0, -0.0, 1.0, -1.0, np.inf, -np.inf, np.nan, 5e-324, 1.7e308, -3.5, 1e-9]
LANES = 8


class Pair(NamedTuple):
    a: Number
    b: Number


class Answers(NamedTuple):
    sums: tuple[Number, Number, Number, Number]
    chosen: Pair
    ordered: Vector
    compared: tuple[Number, Number, Number, Number, Number, Number]
    angles: tuple[Number, Number, Number, Number, Number]
    nested: tuple[Pair, Vector]


class View(NamedTuple):
    pairs: Any
    factor: Any
    vectors: Any
    answers: Any
    totals: Any
    log: Any


@kernel
def arithmetic(p, factor):
    below = select(absolute(p.b) > 0.0, p.b, 1.0)
    return (p.a + p.b, p.a - factor * p.b, -(p.a * p.b), p.a / below)


@kernel
def conditions(p):
    low, high, equal = p.a < p.b, p.a >= p.b, p.a == p.b
    return (
        select(low, 1.0, 0.0),
        select(high, 1.0, p.a),
        select(both(low, p.a > 0.0), 1.0, 0.0),
        select(either(low, p.b <= 0.0), p.b, 0.0),
        select(either(equal, True), 1.0, 0.0),
        select(both(True, equal), 1.0, 2.0),
    )


@kernel
def angles(p):
    x, y = clip(p.a, -900.0, 900.0), clip(p.b, -900.0, 900.0)
    sine, cosine = sincos(x)
    return (sine, cosine, arctan2(y, x), decay(absolute(y)), sqrt(absolute(x)))


@kernel
def applied(function, p, n):
    """A function as an argument, and a loop that begins with floats."""
    total = 0.0
    for _ in range(n):
        total = function(total, p.a)
    return total


@kernel
def mean(x, y):
    return 0.5 * (x + y)


@subroutine
def summed(vectors, p):
    total = (0.0, 0.0, 0.0)
    for i in range(len(vectors)):
        total = axpy(p.a, cross(vectors[i], (1.0, p.b, 2.0)), total)
    return total


@kernel
def everything(view, k):
    p, factor = view.pairs[k], view.factor[0]
    other = view.pairs[max(0, k - 1)]
    rare = p.a > 1.0
    nested = other
    if some(rare):
        nested = select(rare, Pair(p.b, p.a), other)
    view.answers[k] = Answers(
        arithmetic(p, factor),
        Pair(select(p.a < p.b, p.a, 7), applied(mean, p, 3)),
        (minimum(p.a, p.b), maximum(p.a, p.b), absolute(p.a)),
        conditions(p),
        angles(p),
        (nested, summed(view.vectors[k], p)),
    )
    if k % 2 == 0:
        view.totals[0] = 1
    view.totals[1] = view.totals[1] + 1.0 * k


@kernel
def lane_by_lane(view, k):
    """A search that branches on data, for those that need it."""
    p = view.pairs[k]
    wanted = p.a > 0.5
    for lane in range(lane_count(wanted)):
        if lane_of(wanted, lane):
            pairs, log = one(view.pairs, lane), one(view.log, lane)
            x, rounds = pairs[k].a, 0
            while x > 0.5 and rounds < 100:
                x, rounds = 0.5 * x, rounds + 1
            log[k] = x + rounds + dot(one(view.vectors, lane)[k][1], (1.0, 1.0, 1.0))


STAGES = (everything, lane_by_lane)


def inputs(rng, lanes):
    """Pairs and vectors of some flights, (periods, entries, lanes), special ones first."""
    special = np.array([(a, b) for a in SPECIAL for b in SPECIAL]).T
    periods = -(-special.shape[1] // lanes) + 40
    pairs = rng.normal(size=(2, periods * lanes)) * 10.0 ** rng.uniform(-3, 3, (2, periods * lanes))
    pairs[:, : special.shape[1]] = special
    pairs = np.moveaxis(pairs.reshape(2, periods, lanes), 0, 1)
    return pairs, rng.normal(size=(periods, 2, 3, lanes))


def view_of(pairs, vectors, lanes, lane=None):
    """The same numbers as rows, of all flights in lanes or of one of them."""
    if lane is not None:
        pairs, vectors = pairs[..., lane], vectors[..., lane]
    periods = len(pairs)
    return View(
        Rows(Pair, pairs, lanes),
        Rows(float, [[0.3]]),
        Rows(Vector, vectors, lanes),
        Rows.empty(Answers, periods, lanes=lanes),
        Rows.empty(float, 2, lanes=lanes),
        Rows.empty(float, periods, lanes=lanes),
    )


def flown(view, compiled, periods):
    with np.errstate(invalid="ignore", over="ignore"):
        program([Stage(stage, view) for stage in STAGES], compiled).run(0, periods)
    return [view.answers.array, view.totals.array, view.log.array]


def same_bits(a, b):
    """Zeros with their signs; a NaN is a NaN, whatever its payload."""
    a, b = np.asarray(a), np.asarray(b)
    numbers = ~np.isnan(a)
    return np.array_equal(numbers, ~np.isnan(b)) and np.array_equal(
        np.ascontiguousarray(a)[numbers].view(np.int64),
        np.ascontiguousarray(b)[numbers].view(np.int64),
    )


@pytest.mark.parametrize("lanes", [LANES, 3])
def test_python_scalar_code_and_lanes_give_the_same_bits(rng, lanes):
    pairs, vectors = inputs(rng, lanes)
    periods = len(pairs)
    in_lanes = flown(view_of(pairs, vectors, lanes), True, periods)
    for lane in range(lanes):
        scalar = flown(view_of(pairs, vectors, 0, lane), True, periods)
        python = flown(view_of(pairs, vectors, 0, lane), False, periods)
        for one_lane, compiled, plain in zip(in_lanes, scalar, python, strict=True):
            assert same_bits(plain, compiled)
            assert same_bits(plain, one_lane[..., lane])
        assert python[2].any()


def test_a_run_in_stretches_is_the_whole_run(rng):
    pairs, vectors = inputs(rng, LANES)
    periods, ends = len(pairs), []
    for cuts in ((0, periods), (0, 1, 17, 17, periods)):
        view = view_of(pairs, vectors, LANES)
        flight = program([Stage(stage, view) for stage in STAGES], True)
        for start, stop in pairwise(cuts):
            flight.run(start, stop)
        ends.append(view)
    for a, b in zip(ends[0], ends[1], strict=True):
        assert same_bits(a.array, b.array)


def test_stages_are_called_in_turn_and_a_program_may_have_none():
    order = []

    def first(view, k):
        order.append(("first", k))

    def second(view, k):
        order.append(("second", k))

    none = View(*[Rows.empty(float, 0)] * 6)
    program([Stage(first, none), Stage(second, none)], False).run(3, 5)
    assert order == [("first", 3), ("second", 3), ("first", 4), ("second", 4)]
    program([], True).run(0, 5)
    program([], False).run(0, 5)


def test_machine_code_contracts_nothing():
    """Of a b + c both roundings are kept: fused into one instruction it would not be 0 here."""
    a, c = 1.0 + 2.0**-30, -(1.0 + 2.0**-29)
    view = Fused(Rows(Vector, [[a, a, c]]), Rows.empty(float, 1))
    program([Stage(multiply_add, view)], True).run(0, 1)
    assert view.result.array[0, 0] == a * a + c == 0.0  # and not 2^-60


class Fused(NamedTuple):
    numbers: Any
    result: Any


@kernel
def multiply_add(view, k):
    a, b, c = view.numbers[0]
    view.result[0] = a * b + c


def test_rows_of_the_same_array_are_the_same_list_in_python():
    """Stages that share rows see what each other wrote, in Python as in machine code."""
    shared = Rows.empty(float, 1)
    stages = [Stage(add_one, Fused(shared, shared)), Stage(add_one, Fused(shared, shared))]
    for compiled in (False, True):
        shared.array[:] = 0.0
        program(stages, compiled).run(0, 10)
        assert shared.array[0, 0] == 20.0


@kernel
def add_one(view, k):
    view.result[0] = view.numbers[0] + 1.0


def test_what_python_does_not_offer_is_no_primitive():
    """Every primitive has its meaning in lanes: a new one is to be added to `everything` above."""
    named = {"select", "sqrt", "both", "either", "some", "lane_count", "lane_of"}
    named |= {"minimum", "maximum", "absolute", "clip", "kernel", "subroutine"}
    public = {n for n, v in vars(k_).items() if callable(v) and v.__module__ == k_.__name__}
    assert {name for name in public if not name.startswith("_")} == named
