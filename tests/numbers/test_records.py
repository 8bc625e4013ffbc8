"""Records in arrays: layouts, names, alignment, and what does not fit."""

from typing import Generic, NamedTuple, TypeVar

import numpy as np
import pytest

from fullam.exceptions import SettingsError
from fullam.numbers.kernel import Number
from fullam.numbers.records import (
    ALIGNMENT,
    Rows,
    aligned,
    columns,
    flat,
    reader,
    record,
    rows_of,
    size,
)
from fullam.numbers.vectors import Vector


class Inner(NamedTuple):
    place: Vector
    weight: Number


class Outer(NamedTuple):
    first: Inner
    pair: tuple[Number, Number]
    last: Number


First = TypeVar("First")
Rest = TypeVar("Rest")


class Pair(NamedTuple, Generic[First, Rest]):
    first: First
    rest: Rest


class View(NamedTuple):
    some: Rows
    others: "Others"


class Others(NamedTuple):
    few: Rows
    many: Rows


NUMBERS = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
VALUE = Outer(Inner((1.0, 2.0, 3.0), 4.0), (5.0, 6.0), 7.0)


def test_numbers_to_record_and_back():
    assert (size(Outer), size(Inner), size(Vector), size(float)) == (7, 4, 3, 1)
    made = record(Outer, np.array(NUMBERS))
    assert made == VALUE
    assert (type(made), type(made.first), type(made.pair)) == (Outer, Inner, tuple)
    assert [*flat(made)] == NUMBERS
    assert reader(float)([3.0]) == 3.0
    assert columns(Outer) == {"first": slice(0, 4), "pair": slice(4, 6), "last": slice(6, 7)}


def test_rows_are_read_by_name_and_share_the_array():
    array = np.arange(14.0).reshape(2, 7)
    rows = Rows(Outer, array)
    assert rows.array is array
    np.testing.assert_array_equal(rows["pair"], array[:, 4:6])
    rows["last"][1] = -1.0
    assert array[1, 6] == -1.0
    lanes = Rows.empty(Outer, 3, 2, lanes=8)
    assert lanes["first"].shape == (3, 2, 4, 8)
    assert (lanes.depth, rows.depth) == (2, 1)


def test_lists_of_records_and_back():
    rows = Rows.of(Outer, [[VALUE, VALUE], [VALUE, VALUE]])
    assert rows.array.shape == (2, 2, 7)
    assert rows.to_list() == [[VALUE, VALUE], [VALUE, VALUE]]
    moved = VALUE._replace(last=0.0)
    rows.assign([[VALUE, moved], [moved, VALUE]])
    assert rows.array[0, 1, 6] == rows.array[1, 0, 6] == 0.0
    numbers = Rows.of(float, [1.0, 2.0])
    assert numbers.to_list() == [1.0, 2.0]


def test_what_is_read_only_or_empty_is_left_as_it_is():
    rows = Rows.of(float, [1.0, 2.0])
    rows.array.flags.writeable = False
    rows.assign([3.0, 4.0])
    assert rows.to_list() == [1.0, 2.0]
    nothing = Rows.empty(Outer, 0)
    nothing.assign([])
    assert nothing.to_list() == []


@pytest.mark.parametrize(
    ("kind", "shape", "lanes"),
    [
        (Outer, (3, 6), 0),
        (Outer, (7,), 8),
        (Outer, (3, 7), 8),
        (Outer, (7, 4), 8),
        (float, (2,), 0),
    ],
)
def test_entries_that_do_not_fit_are_named(kind, shape, lanes):
    with pytest.raises(ValueError, match=rf"rows of {kind.__name__}: entries have shape"):
        Rows(kind, np.zeros(shape), lanes)


def test_rows_of_one_number_are_a_column():
    assert Rows(float, [[1.0], [2.0]]).depth == 1
    assert Rows(float, np.zeros((4, 2, 1))).depth == 2


@pytest.mark.parametrize("shape", [(1,), (3, 5), (2, 7, 8)])
def test_arrays_begin_at_a_cache_line(shape):
    for _ in range(20):
        assert aligned(shape).ctypes.data % ALIGNMENT == 0
        assert not aligned(shape).any()


def test_lanes_are_copied_to_where_they_are_aligned_and_scalars_are_not():
    room = aligned((1 + 7 * 8,))
    given = room[1:].reshape(7, 8)
    given[:] = np.arange(56.0).reshape(7, 8)
    rows = Rows(Outer, given[None], lanes=8)
    assert rows.array.ctypes.data % ALIGNMENT == 0
    np.testing.assert_array_equal(rows.array[0], given)
    strided = np.zeros((4, 14))[:, ::2]
    assert Rows(Outer, strided).array.flags.c_contiguous
    odd = room[1:15].reshape(2, 7)
    assert Rows(Outer, odd).array.base is not None


def test_a_view_tells_its_rows_in_order():
    rows = [Rows.empty(float, n) for n in (1, 2, 3)]
    assert [*rows_of(View(rows[0], Others(rows[1], rows[2])))] == rows


def test_a_generic_record_holds_what_it_is_told():
    assert size(Pair[Vector, float]) == 4 and size(Pair[float, Inner]) == 5
    assert columns(Pair[Vector, float]) == {"first": slice(0, 3), "rest": slice(3, 4)}
    rows = Rows(Pair[float, Inner], np.arange(10.0).reshape(2, 5))
    assert rows.to_list()[1] == Pair(5.0, Inner((6.0, 7.0, 8.0), 9.0))
    assert type(rows.to_list()[1]) is Pair
    with pytest.raises(SettingsError, match="annotations"):
        size(Pair)
