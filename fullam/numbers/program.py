"""A program: stages called in turn, period by period, by Python or by machine code."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fullam.numbers.machine_code import Code, available, loop_code, stage_code
from fullam.numbers.records import Rows, flat, reader, rows_of

LOOP = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 4)
STAGE = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 2)


@dataclass(frozen=True, eq=False)
class Stage:
    """A kernel f(view, period) and what it is shown."""

    kernel: Callable[..., None]
    view: Any


class CompiledProgram:
    """Stages as machine code, all of which runs without the interpreter's lock.

    The arrays behind the views stay where they are for as long as this object lives.
    """

    def __init__(self, stages: Sequence[Stage]) -> None:
        """Compile the stages, or load them from disk."""
        self._stages = list(stages)
        self._codes: list[Code] = [stage_code(s.kernel, s.view) for s in stages]
        self._tables = [_table(s.view) for s in stages]
        pairs = zip(self._codes, self._tables, strict=True)
        self._pairs = np.array(
            [[code.address, table.ctypes.data] for code, table in pairs], dtype=np.int64
        ).reshape(-1, 2)
        self._loop_code = loop_code()
        self._loop = LOOP(self._loop_code.address)
        self._arguments = self._pairs.ctypes.data, len(self._stages)

    def run(self, start: int, stop: int) -> None:
        """Call all stages in turn for each of the periods start to stop - 1."""
        self._loop(*self._arguments, start, stop)


class InterpretedProgram:
    """The same in Python: the views become lists of records, and are written back at the end."""

    def __init__(self, stages: Sequence[Stage]) -> None:
        """Keep the stages; their views must hold no lanes."""
        self._stages = list(stages)

    def run(self, start: int, stop: int) -> None:
        """Call all stages in turn for each of the periods start to stop - 1."""
        lists = Lists()
        stages = [(stage.kernel, lists.of(stage.view)) for stage in self._stages]
        for period in range(start, stop):
            for kernel, view in stages:
                kernel(view, period)
        lists.write_back()


Program = CompiledProgram | InterpretedProgram


def program(stages: Sequence[Stage], compiled: bool | None = None) -> Program:
    """A program of stages: machine code where that can be had, unless asked otherwise."""
    compiled = available() if compiled is None else compiled
    return CompiledProgram(stages) if compiled else InterpretedProgram(stages)


SHORT = 64
"""Rows of at most so many numbers of records become lists; longer ones are read where they are."""


class Lists:
    """Views as Python reads them: sequences of records, the same one for the same `Rows`."""

    def __init__(self) -> None:
        """Nothing yet."""
        self._lists: dict[int, tuple[Rows, Any]] = {}

    def of(self, view: Any) -> Any:
        """The view with sequences in the place of its `Rows`."""
        if view is None:
            return None
        if not isinstance(view, Rows):
            return type(view)(*map(self.of, view))
        if id(view) not in self._lists:
            long = view.depth and view.array.shape[0] > SHORT
            self._lists[id(view)] = view, Long(view) if long else view.to_list()
        return self._lists[id(view)][1]

    def live(self, *rows: Rows) -> None:
        """Have these rows read and written in their arrays, however few they are."""
        self._lists.update({id(r): (r, Long(r)) for r in rows})

    def write_back(self) -> None:
        """Write what the lists hold to the arrays."""
        for rows, records in self._lists.values():
            if isinstance(records, list):
                rows.assign(records)


class Long:
    """Many rows, read and written one by one in the array itself."""

    def __init__(self, rows: Rows) -> None:
        """Bind the rows, of one flight."""
        self._array, self._depth, self._read = rows.array, rows.depth, reader(rows.record)

    def __len__(self) -> int:
        """Number of rows."""
        return len(self._array)

    def __getitem__(self, k: int) -> Any:
        """The record, or the rows, at an index."""
        if self._depth == 1:
            return self._read(self._array[k].tolist())
        inner = Long.__new__(Long)
        inner._array, inner._depth, inner._read = self._array[k], self._depth - 1, self._read
        return inner

    def __setitem__(self, k: int, value: Any) -> None:
        """Store a record."""
        self._array[k] = flat(value)

    def __iter__(self) -> Iterator[Any]:
        """The records, or the rows, in turn."""
        return (self[k] for k in range(len(self)))


def _table(view: Any) -> Any:
    """Address and lengths of each `Rows` of a view, in order."""
    words: list[int] = []
    for rows in rows_of(view):
        words += [rows.array.ctypes.data, *rows.array.shape[: rows.depth]]
    return np.array(words, dtype=np.int64)
