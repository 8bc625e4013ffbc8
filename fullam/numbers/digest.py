"""What a kernel is made of, as a key: its code, that of all it calls, and their constants.

The machine code on disk is kept under this key, so that whatever went into it, in this package or
in a user's notebook, makes it another one when it changes.
"""

from __future__ import annotations

import dis
import hashlib
import types
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fullam.numbers.records import Rows, layout


def digest(*parts: Any) -> str:
    """A key of kernels, and of words that say what more decides their machine code."""
    whole = hashlib.sha256(_ground().encode())
    seen: set[int] = set()
    for part in parts:
        for piece in [part] if isinstance(part, str) else _parts(part, seen):
            whole.update(piece.encode())
            whole.update(b"\0")
    return whole.hexdigest()


def describe(view: Any) -> str:
    """A view in words: its fields, their records, lanes and depths."""
    if isinstance(view, Rows):
        return f"[{layout(view.record)!r} {view.lanes} {view.depth}]"
    parts = zip(type(view)._fields, view, strict=True)
    return "(" + ", ".join(f"{name}: {describe(part)}" for name, part in parts) + ")"


def signature(view: Any) -> Any:
    """The same as a key that is quickly made: two views with one signature are described alike."""
    if isinstance(view, Rows):
        return view.record, view.lanes, view.depth
    return type(view), tuple(map(signature, view))


@cache
def _ground() -> str:
    """Digest of the sources of this room, which give kernels their meaning in machine code."""
    whole = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        whole.update(path.read_bytes())
    return whole.hexdigest()


def _parts(function: Any, seen: set[int]) -> Iterator[str]:
    """Names, bytes and constants of a function and of every function that it names."""
    if id(function) in seen:
        return
    seen.add(id(function))
    yield function.__qualname__
    named = dict(function.__globals__)
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    named.update({name: cell.cell_contents for name, cell in cells})
    yield from _code(function.__code__)
    for default in (*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()):
        yield from _value(default, set(), seen)
    yield from _members(_names(function.__code__), _attributes(function.__code__), named, seen)


def _members(
    names: set[str], attributes: set[str], named: Mapping[str, Any], seen: set[int]
) -> Iterator[str]:
    """Those of some names that mean something, and what they mean."""
    for name in sorted(names):
        if name in named:
            yield name
            yield from _value(named[name], attributes, seen)


def _code(code: types.CodeType) -> Iterator[str]:
    yield code.co_code.hex()
    yield repr((code.co_varnames, code.co_names))
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _code(constant)
        else:
            yield repr(constant)


def _names(code: types.CodeType) -> set[str]:
    """Names of globals and cells that code refers to, that inside it included; no attributes."""
    loads = (i for i in dis.get_instructions(code) if i.opname in ("LOAD_GLOBAL", "LOAD_NAME"))
    names = {*(str(i.argval) for i in loads), *code.co_freevars}
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            names |= _names(constant)
    return names


def _attributes(code: types.CodeType) -> set[str]:
    """Names of attributes that code asks for, that inside it included."""
    loads = (i for i in dis.get_instructions(code) if i.opname in ("LOAD_ATTR", "LOAD_METHOD"))
    names = {str(i.argval) for i in loads}
    return names.union(*(_attributes(c) for c in code.co_consts if isinstance(c, types.CodeType)))


def _value(value: Any, attributes: set[str], seen: set[int]) -> Iterator[str]:
    """What a name means; of a module, what its attributes mean that code asks for."""
    if isinstance(value, types.FunctionType):
        yield from _parts(value, seen)
    elif isinstance(value, types.ModuleType):
        if id(value) not in seen:
            seen.add(id(value))
            yield from _members(attributes, attributes, vars(value), seen)
            seen.discard(id(value))
    elif isinstance(value, type) and hasattr(value, "_fields"):
        yield repr((value.__qualname__, value._fields))
    elif isinstance(value, np.ndarray):
        yield repr((value.dtype.str, value.shape))
        yield value.tobytes().hex()
    else:
        yield repr(value) if isinstance(value, float | int | str | tuple | bool) else str(value)
