"""Records: NamedTuples of numbers, kept in arrays and read by name.

A kernel that needs many of something takes a sequence of records: `links[i].mass`. In Python that
is a list of NamedTuples. Machine code gets `Rows`, the same records in one array of doubles,
[..., entry] for one flight and [..., entry, lane] for lanes; there `links[i]` is a load of the
entries that are used, and `states[0] = State(...)` a store. No columns are numbered by hand.

A *view* is a NamedTuple whose fields are `Rows`, or views again: all that a kernel is shown.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Iterator
from functools import cache
from numbers import Real
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.exceptions import SettingsError

Array = NDArray[np.float64]
Plan = tuple[Any, ...] | None

ALIGNMENT = 64
"""Of the arrays [bytes]: a vector that straddles two cache lines loads at half the speed."""


@cache
def layout(kind: Any) -> Plan:
    """What a record is made of: (class, layouts of its fields), or None for a number.

    Raises:
        SettingsError: A field is annotated with what is not known where its class is defined.
    """
    if kind is float:
        return None
    if typing.get_origin(kind) is tuple:
        return (tuple, *map(layout, typing.get_args(kind)))
    try:
        kinds = field_kinds(kind)
    except (NameError, TypeError) as error:
        where = f"record {getattr(kind, '__qualname__', kind)}"
        remedy = "annotate its fields with numbers, tuples and records that are imported there"
        raise SettingsError(where, "annotations", f"cannot be read ({error})", remedy) from error
    return (typing.get_origin(kind) or kind, *map(layout, kinds.values()))


def field_kinds(kind: Any) -> dict[str, Any]:
    """What the fields of a record hold; those of a generic one, `Memory[A, B]`, as it is told."""
    record = typing.get_origin(kind) or kind
    parameters = getattr(record, "__parameters__", ())
    told = dict(zip(parameters, typing.get_args(kind), strict=False))
    return {name: told.get(hint, hint) for name, hint in typing.get_type_hints(record).items()}


@cache
def size(kind: Any) -> int:
    """How many numbers a record holds."""
    plan = layout(kind)
    return 1 if plan is None else _count(plan)


def _count(plan: Plan) -> int:
    return 1 if plan is None else sum(map(_count, plan[1:]))


@cache
def reader(kind: Any) -> Callable[[list[Any]], Any]:
    """A function that makes a record from the list of its numbers."""
    return _reader(layout(kind), 0)


def _reader(plan: Plan, start: int) -> Callable[[list[Any]], Any]:
    if plan is None:
        return itemgetter(start)
    make = getattr(plan[0], "_make", tuple)  # of a NamedTuple
    stop = start + _count(plan)
    if all(part is None for part in plan[1:]):
        return lambda numbers: make(numbers[start:stop])
    reads = []
    for part in plan[1:]:
        reads.append(_reader(part, start))
        start += _count(part)
    return lambda numbers: make([read(numbers) for read in reads])


def record(kind: Any, numbers: Any) -> Any:
    """A record of Python floats from an array of its numbers, shape (size,)."""
    return reader(kind)(np.asarray(numbers, dtype=float).tolist())


def flat(value: Any) -> list[Any]:
    """The numbers of a record, in order."""
    numbers: list[Any] = []
    _append(value if isinstance(value, tuple) else (value,), numbers)
    return numbers


def _append(value: tuple[Any, ...], numbers: list[Any]) -> None:
    for part in value:
        if isinstance(part, tuple):
            _append(part, numbers)
        else:
            numbers.append(part)


def same_shape(one: Any, other: Any) -> bool:
    """Whether two records are made of numbers in the same way."""
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(same_shape, one, other))
    return isinstance(one, Real) and isinstance(other, Real)


@cache
def columns(kind: Any) -> dict[str, slice]:
    """Where each field of a record stands in its row: for reading arrays by name."""
    found, start = {}, 0
    for name, field in field_kinds(kind).items():
        found[name] = slice(start, start + size(field))
        start += size(field)
    return found


class Rows:
    """Records in an array.

    Attributes:
        record: The NamedTuple class, a tuple type such as `vectors.Vector`, or float.
        array: Shape (*lengths, size) or, with lanes, (*lengths, size, lanes).
        lanes: Lanes of each number; 0 for a number that all flights share.
        depth: How many indices lead to a record.
    """

    def __init__(self, record: Any, array: Any, lanes: int = 0) -> None:
        """Take an array; it is copied if it is not contiguous or, for lanes, not aligned.

        Raises:
            ValueError: The array's entries do not fit the record.
        """
        array = np.asarray(array, dtype=np.float64)
        wanted = (size(record), lanes) if lanes else (size(record),)
        shape = array.shape[-len(wanted) :]
        if shape != wanted:
            name = getattr(record, "__name__", str(record))
            raise ValueError(f"rows of {name}: entries have shape {shape}, not {wanted}")
        if not (array.flags.c_contiguous and (array.ctypes.data % ALIGNMENT == 0 or not lanes)):
            array, given = aligned(array.shape), array
            array[:] = given
        self.record, self.array, self.lanes = record, array, lanes
        self.depth = array.ndim - len(wanted)

    @classmethod
    def empty(cls, record: Any, *lengths: int, lanes: int = 0) -> Rows:
        """Rows of zeros."""
        tail = (lanes,) if lanes else ()
        return cls(record, aligned((*lengths, size(record), *tail)), lanes)

    @classmethod
    def of(cls, record: Any, records: Any) -> Rows:
        """Rows of one flight from a list of records, or a list of such lists."""
        return cls(record, np.array(_numbers(records), dtype=np.float64))

    def __getitem__(self, name: str) -> Array:
        """The numbers of a field in all rows, (*lengths, width) or (*lengths, width, lanes)."""
        part = columns(self.record)[name]
        entries: Array = self.array[..., part, :] if self.lanes else self.array[..., part]
        return entries

    def to_list(self) -> Any:
        """The same records as a list (of lists) of NamedTuples; of one flight only."""
        return _records(reader(self.record), self.array.tolist(), self.depth)

    def assign(self, records: Any) -> None:
        """Take over the records of a list of the same lengths; read-only rows stay as they are."""
        if self.array.size and self.array.flags.writeable:
            self.array[:] = np.array(_numbers(records), dtype=np.float64)


def _numbers(records: Any) -> Any:
    return [_numbers(r) for r in records] if isinstance(records, list) else flat(records)


def _records(read: Callable[[list[Any]], Any], values: Any, depth: int) -> Any:
    if depth == 0:
        return read(values)
    return [_records(read, value, depth - 1) for value in values]


def aligned(shape: tuple[int, ...]) -> Array:
    """An array of zeros that begins at a multiple of `ALIGNMENT`."""
    count = int(np.prod(shape))
    room = np.zeros(count + ALIGNMENT // 8)
    start = -(room.ctypes.data // 8) % (ALIGNMENT // 8)
    return room[start : start + count].reshape(shape)


def rows_of(view: Any) -> Iterator[Rows]:
    """The `Rows` of a view, in order."""
    if isinstance(view, Rows):
        yield view
    else:
        for part in view:
            yield from rows_of(part)


def one(rows: Any, lane: int) -> Any:
    """The rows of one of the flights in the lanes, as scalars."""
    return rows
