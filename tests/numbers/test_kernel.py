"""The primitives of kernels as Python's floats have them; `test_lanes` holds the others to it."""

import math
from typing import NamedTuple

import pytest

from fullam.numbers.kernel import (
    KERNELS,
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
)
from fullam.numbers.records import one

NAN = math.nan


class Point(NamedTuple):
    x: Number
    y: Number


class Segment(NamedTuple):
    start: Point
    way: tuple[Number, Number]


def test_a_kernel_stays_the_function_it_is():
    def twice(x):
        return 2.0 * x

    assert kernel(twice) is twice
    assert KERNELS.pop() is twice


@pytest.mark.parametrize("condition", [True, False])
def test_select_takes_numbers_and_whole_records(condition):
    a, b = Segment(Point(1.0, 2.0), (3.0, 4.0)), Segment(Point(5.0, 6.0), (7.0, 8.0))
    taken = select(condition, a, b)
    assert taken == (a if condition else b)
    assert type(taken) is Segment
    assert type(taken.start) is Point
    assert select(condition, 1.0, 2.0) == (1.0 if condition else 2.0)


def test_what_is_not_taken_does_not_spoil_what_is():
    assert select(True, 1.0, NAN) == 1.0
    assert select(False, math.inf, -0.0) == 0.0


@pytest.mark.parametrize(("a", "b"), [(True, True), (True, False), (False, True), (False, False)])
def test_conditions(a, b):
    assert both(a, b) is (a and b)
    assert either(a, b) is (a or b)
    assert some(a) is a


def test_one_flight_has_one_lane():
    assert lane_count(True) == 1
    assert lane_of(True, 0) is True
    assert lane_of(False, 0) is False
    rows = [1.0, 2.0]
    assert one(rows, 0) is rows


def test_the_lesser_and_the_greater():
    assert (minimum(1.0, 2.0), minimum(2.0, 1.0)) == (1.0, 1.0)
    assert (maximum(1.0, 2.0), maximum(2.0, 1.0)) == (2.0, 2.0)
    # NaN is not less than anything: the second argument is taken, whichever is NaN.
    assert (minimum(NAN, 1.0), maximum(NAN, 1.0)) == (1.0, 1.0)
    assert math.isnan(minimum(1.0, NAN))
    assert math.isnan(maximum(1.0, NAN))


def test_absolute_value_clip_and_root():
    assert (absolute(-2.0), absolute(2.0), absolute(-math.inf)) == (2.0, 2.0, math.inf)
    assert [clip(x, -1.0, 2.0) for x in (-3.0, 0.5, 9.0)] == [-1.0, 0.5, 2.0]
    assert math.isnan(clip(NAN, -1.0, 2.0)), "a bound is no answer to what is not known"
    assert sqrt(2.0) == math.sqrt(2.0)
