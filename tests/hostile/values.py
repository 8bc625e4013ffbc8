"""Values that do not belong where they are put, and ways to damage what was whole."""

from __future__ import annotations

import copy
import datetime
import json
import math
from collections.abc import Iterator, Sequence
from typing import Any

from hypothesis import strategies as st

TEXTS = (
    *("", " ", "nan", "1e5", "../../etc/passwd", "/dev/zero", "a\0b", "\x1b[31m", "<!--<script>"),
    *("$x_{$", "\\frac", "Robert'); DROP", "Ω ≈ √2", "\u202e", "𝔘", "x" * 5000, "%s%n", "{0}"),
)
NUMBERS = (
    *(0, -1, 1, 2, 255, 2**31, 2**63, -(2**63), 10**30, 10**400, 10**4200),
    *(0.0, -0.0, 0.1, -1.0, 1e-300, 5e-324, 1e-6, 2e-7, 1e6, 1e15, 1e100, 1e150, 1e300, 1.8e308),
    *(math.nan, math.inf, -math.inf),
)
DATES = (
    datetime.date(1979, 5, 27),
    datetime.time(7, 32),
    datetime.datetime(1979, 5, 27, 7, 32),
)

json_values = st.recursive(
    st.one_of(
        st.sampled_from(NUMBERS),
        st.sampled_from(TEXTS),
        st.booleans(),
        st.none(),
        st.floats(),
        st.integers(),
        st.text(st.characters(exclude_categories=["Cs"]), max_size=20),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(st.sampled_from(("kind", "a", "share", "position")), inner, max_size=3),
    ),
    max_leaves=6,
)
toml_values = st.one_of(json_values, st.sampled_from(DATES))


def toml(value: Any) -> str:
    """A value as TOML text."""
    if isinstance(value, bool):
        return str(value).lower()
    if value is None:
        return "''"
    if isinstance(value, int):
        return "1" + "0" * 4300 if abs(value) > 10**4199 else str(value)
    if isinstance(value, float):
        return str(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    if isinstance(value, dict):
        pairs = (f"{json.dumps(k)} = {toml(v)}" for k, v in value.items() if v is not None)
        return "{" + ", ".join(pairs) + "}"
    return "[" + ", ".join(toml(entry) for entry in value) + "]"


def document(table: dict[str, Any]) -> str:
    """A table as a TOML document; TOML has no null, and leaves such entries out."""
    entries = ((key, value) for key, value in table.items() if value is not None)
    return "".join(f"{json.dumps(key)} = {toml(value)}\n" for key, value in entries)


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of every entry inside a nest of dictionaries and lists."""
    entries = value.items() if isinstance(value, dict) else enumerate(value)
    for key, entry in entries:
        yield (*path, key)
        if isinstance(entry, dict | list):
            yield from places(entry, (*path, key))


def at(nest: Any, path: Sequence[Any]) -> Any:
    """What stands at a path."""
    for key in path:
        nest = nest[key]
    return nest


@st.composite
def damaged(draw: st.DrawFn, whole: dict[str, Any], values: st.SearchStrategy[Any]) -> Any:
    """A nest with one to three entries replaced, removed, added or doubled."""
    nest = copy.deepcopy(whole)
    for _ in range(draw(st.integers(1, 3))):
        found = list(places(nest))
        if not found:
            break
        # Half of the time a number becomes another number: types that fit get farthest.
        numbers = [path for path in found if isinstance(at(nest, path), int | float)]
        if numbers and draw(st.booleans()):
            *parents, last = draw(st.sampled_from(numbers))
            inside = at(nest, parents)
            inside[last] = draw(st.one_of(st.sampled_from(NUMBERS), st.floats(-10, 10)))
            continue
        *parents, last = draw(st.sampled_from(found))
        inside = at(nest, parents)
        match draw(st.sampled_from((*["replace"] * 5, "remove", "add", "double"))):
            case "replace":
                inside[last] = draw(values)
            case "remove":
                del inside[last]
            case "add":
                extra = draw(values)
                inside.append(extra) if isinstance(inside, list) else inside.update(strange=extra)
            case "double" if isinstance(inside, list):
                inside.append(copy.deepcopy(inside[last]))
    return nest


@st.composite
def torn(draw: st.DrawFn, whole: bytes) -> bytes:
    """Bytes with one to four places overwritten, removed, doubled, or the end cut off."""
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, max(0, len(data) - 1)))
        size = draw(st.sampled_from((1, 1, 1, 2, 8, 100)))
        match draw(st.sampled_from(("flip", "flip", "write", "remove", "double", "cut"))):
            case "flip" if data:
                data[start] ^= 1 << draw(st.integers(0, 7))
            case "write":
                data[start : start + size] = draw(st.binary(min_size=size, max_size=size))
            case "remove":
                del data[start : start + size]
            case "double":
                data[start:start] = data[start : start + size]
            case "cut":
                del data[start:]
    return bytes(data)


def mostly(usual: st.SearchStrategy[Any], rare: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """The one four times as often as the other: torn files end at the parser, most of them."""
    return st.integers(0, 4).flatmap(lambda k: rare if k == 4 else usual)
