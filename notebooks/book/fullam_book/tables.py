"""Tables of keys and settings in Markdown, from dataclasses and from tables of `Key`."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from typing import Any

from fullam.model.definition_keys import REQUIRED, Key
from fullam.simulation.weather import WEATHERS, Weather

UNIT = re.compile(r"\s*\[((?:1|-|m|s|N|kg|rad|deg|Hz|rpm|[ */^()0-9,.-]|or|periods)+)\]")
"""A unit in a docstring, as in "Mass [kg]"."""

WORDS = {
    "float": "number", "int": "whole number", "bool": "true or false", "str": "text",
    "None": "none", "Any": "see there", "ArrayLike": "numbers", "Mapping[str, Any]": "table",
    "Reference": "table, see below", "ArmMotion": "table, see below",
    "Weather": "name or table, see below", "Shaping": "table, see below",
    "Uncertainty": "table, see below",
}  # fmt: skip
"""Types as whoever types a TOML says them."""

COUNTS = ("", "one", "two", "three", "four", "five", "six", "seven", "eight")


@dataclass(frozen=True)
class Row:
    """One line of a table: name, kind, default, unit and meaning, each Markdown."""

    name: str
    kind: str
    default: str
    unit: str
    meaning: str


def of_keys(table: Iterable[Key]) -> list[Row]:
    """The rows of a table of keys."""
    return [
        Row(f"`{k.name}`", k.kind, shown_key(k), unit(k.unit), inline(k.meaning)) for k in table
    ]


def shown_key(key: Key) -> str:
    """The default of a key: words are words, an example of a value is code."""
    if key.default is REQUIRED:
        return "**required**"
    if isinstance(key.default, str):
        return key.default or '`""`'
    return shown(key.default)


def of_maker(make: Any) -> list[Row]:
    """The rows of what is made of a table: a dataclass, or a function with its arguments."""
    if is_dataclass(make):
        return of_dataclass(make)
    told, rows = entries(make, "Args"), []
    for name, parameter in inspect.signature(make).parameters.items():
        default = REQUIRED if parameter.default is parameter.empty else parameter.default
        rows.append(_row(make, name, parameter.annotation, default, told))
    return rows


def of_dataclass(cls: type[Any], without: Iterable[str] = ()) -> list[Row]:
    """The rows of a dataclass: its fields, with what its docstrings say of them."""
    told, rows = attributes(cls), []
    for field in fields(cls):
        if field.name not in set(without):
            default = field.default
            if field.default_factory is not MISSING:
                default = field.default_factory()
            default = REQUIRED if default is MISSING else default
            rows.append(_row(cls, field.name, field.type, default, told))
    return rows


def _row(owner: Any, name: str, annotation: Any, default: Any, told: Mapping[str, str]) -> Row:
    """One row.

    Raises:
        LookupError: No docstring explains it.
    """
    if name not in told:
        raise LookupError(f"{owner.__qualname__}: '{name}' is not in the docstring")
    text, units = told[name], UNIT.findall(told[name])
    if len(units) == 1:
        text = UNIT.sub("", text)
    value = "**required**" if default is REQUIRED else shown(default)
    return Row(f"`{name}`", kind_of(annotation), value, _units(units), inline(text))


def _units(units: list[str]) -> str:
    return unit(", ".join(dict.fromkeys(units)))


def attributes(cls: type[Any]) -> dict[str, str]:
    """What the docstrings of a class and its bases say of its attributes."""
    told: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        told |= entries(base, "Attributes")
    return told


def entries(thing: Any, section: str) -> dict[str, str]:
    """The names in a section of a docstring, each with what stands after it."""
    text = inspect.cleandoc(thing.__doc__ or "").partition(f"{section}:\n")[2]
    text = text.split("\n\n")[0] if not text.startswith("    ") else text
    found = re.findall(r"^    (\w+): (.*(?:\n        .*)*)", text, re.MULTILINE)
    return {name: " ".join(words.split()) for name, words in found}


def kind_of(annotation: Any) -> str:
    """The type of a field, in words."""
    text = annotation if isinstance(annotation, str) else getattr(annotation, "__name__", "?")
    if text.startswith("Literal["):
        return "one of " + ", ".join(f"`{word}`" for word in re.findall(r"['\"](.*?)['\"]", text))
    return _words(text)


def _words(text: str) -> str:
    text = text.strip()
    if text in WORDS:
        return WORDS[text]
    if " | " in text and "[" not in text.partition(" | ")[0]:
        return " or ".join(_words(part) for part in text.split(" | "))
    if text.endswith("| None"):
        return f"{_words(text.removesuffix('| None'))} or none"
    if match := re.fullmatch(r"tuple\[(.*)\]", text):
        inner = _split(match[1])
        if inner[-1] == "...":
            return "list of " + _plural(_words(inner[0]))
        if len(set(inner)) == 1:
            return f"{COUNTS[len(inner)]} {_plural(_words(inner[0]))}"
    return f"`{text}`"


def _plural(word: str) -> str:
    return {"text": "texts", "number": "numbers"}.get(word, word)


def _split(text: str) -> list[str]:
    """The parts between commas that are in no bracket."""
    parts, depth = [""], 0
    for c in text:
        depth += (c == "[") - (c == "]")
        if c == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += c
    return [part.strip() for part in parts if part.strip()]


def shown(value: Any) -> str:
    """A default as a TOML writes it."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple | list):
        return "`[" + ", ".join(shown(entry).strip("`") for entry in value) + "]`"
    if isinstance(value, str):
        return f'`"{value}"`'
    if isinstance(value, dict):
        return "`{}`" if not value else f"`{value}`"
    if is_dataclass(value) and hasattr(value, "kind"):
        needed = [f.name for f in fields(value) if f.default is MISSING]
        parts = [f"{name} = {shown(getattr(value, name)).strip('`')}" for name in ("kind", *needed)]
        return f"`{{ {', '.join(parts)} }}`"
    if isinstance(value, Weather):
        return next(f'`"{name}"`' for name, known in WEATHERS.items() if known == value)
    if is_dataclass(value):
        return "its defaults"
    return f"`{value}`"


def unit(text: str) -> str:
    """A unit with its powers raised."""
    return re.sub(r"\^(-?\d+)", r"<sup>\1</sup>", text).replace("-", "–") if text != "-" else "–"


def inline(text: str) -> str:
    """A sentence of a docstring as a cell of a Markdown table."""
    text = text.replace("|", "\\|").replace("<", "&lt;")
    # Outside code, underscores and stars are letters.
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(p if p.startswith("`") else re.sub(r"([*_\[\]])", r"\\\1", p) for p in parts)


def markdown(rows: list[Row], first: str = "key") -> str:
    """The table; columns that are empty all the way down are left out."""
    heads = {"name": first, "kind": "type", "default": "default", "unit": "unit",
             "meaning": "meaning"}  # fmt: skip
    used = [n for n in heads if n in ("name", "meaning") or any(getattr(r, n) for r in rows)]
    lines = [
        "| " + " | ".join(heads[n] for n in used) + " |",
        "|" + "---|" * len(used),
        *("| " + " | ".join(getattr(r, n) for n in used) + " |" for r in rows),
    ]
    return "\n".join(lines) + "\n"


def summary(thing: Any) -> str:
    """First paragraph of a docstring."""
    return inline(" ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split()))
