"""Settings as plain values: any dataclass to what a record keeps, and back.

A record, a campaign's stamp and a TOML file hold numbers, strings, true and false, nothing, and
tuples and tables of them. A settings class needs nothing for that but fields of such values, arrays
of numbers or dataclasses of its own among them, each with a default, by which what was read finds
its form again: a list becomes the tuple or the array that it was.
"""

from __future__ import annotations

import numbers
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import Any

import numpy as np

from fullam.checks import Checker, shown

SAVED = "give numbers, strings, true or false, or tuples, arrays or tables of them"
"""What can be saved."""


def to_plain(settings: Any, check: Checker) -> dict[str, Any]:
    """Settings as JSON values, tuples for lists; what cannot be saved is refused by its field.

    A class may do it itself with a method `to_dict`.

    Raises:
        InvalidInput: A value that cannot be saved, or no dataclass.
    """
    if hasattr(settings, "to_dict"):
        values = check.table("to_dict", settings.to_dict())
    elif is_dataclass(settings) and not isinstance(settings, type):
        values = {f.name: getattr(settings, f.name) for f in fields(settings) if f.init}
    else:
        raise check.refuse("settings", f"are {shown(settings)}", "give a dataclass")
    return plain_table(values, check)


def plain_table(values: Mapping[str, Any], check: Checker) -> dict[str, Any]:
    """Named values as JSON values, tuples for lists; see `to_plain`."""
    return {name: _plain(value, name, check) for name, value in values.items()}


def _plain(value: Any, name: str, check: Checker) -> Any:
    """One value as JSON has it."""
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "biufU":
        return _plain(value.tolist(), name, check)
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, str):
        return str(value)
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real):
        return float(value)
    if isinstance(value, list | tuple):
        return tuple(_plain(entry, f"{name}[{i}]", check) for i, entry in enumerate(value))
    if is_dataclass(value) and not isinstance(value, type):
        value = {f.name: getattr(value, f.name) for f in fields(value) if f.init}
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return {key: _plain(entry, f"{name}.{key}", check) for key, entry in value.items()}
    problem = f"is {shown(value)}, a {type(value).__name__}, which cannot be saved"
    raise check.refuse(name, problem, SAVED)


def from_plain(cls: type[Any], changes: Mapping[str, Any] | None, check: Checker) -> Any:
    """A settings dataclass, its defaults with some of them changed; the inverse of `to_plain`.

    Raises:
        InvalidInput: A setting that it does not have, or one of the wrong type.
    """
    values = {} if changes is None else check.table("settings", changes)
    known = defaults_of(cls, check)
    check.known(values, tuple(known), "setting")
    values = {name: _like(known[name], value, name, check) for name, value in values.items()}
    return check.settings(cls, values)


def defaults_of(cls: type[Any], check: Checker) -> dict[str, Any]:
    """Fields of a settings class and their defaults.

    Raises:
        InvalidInput: It is no dataclass, or a field has no default.
    """
    if not (isinstance(cls, type) and is_dataclass(cls)):
        raise check.refuse("Settings", f"is {shown(cls)}", "give a dataclass, @dataclass(frozen)")
    found = {}
    for f in fields(cls):
        made = f.default_factory
        if f.default is MISSING and made is MISSING and f.init:
            raise check.refuse(f.name, "has no default", f"write `{f.name}: ... = VALUE`")
        if f.init:
            found[f.name] = made() if made is not MISSING else f.default
    return found


def _like(default: Any, value: Any, name: str, check: Checker) -> Any:
    """A value in the form of the default that it takes the place of."""
    if isinstance(default, np.ndarray) and isinstance(value, list | tuple):
        try:
            return np.asarray(value, dtype=default.dtype)
        except (TypeError, ValueError, OverflowError) as error:
            remedy = f"give numbers, as in {shown(default.tolist())}"
            raise check.refuse(name, f"is {shown(value)}", remedy) from error
    if is_dataclass(default) and isinstance(value, Mapping):
        own = Checker(f"{check.where}: {name}", check.error)
        return from_plain(type(default), to_plain(default, own) | dict(value), own)
    if isinstance(default, bool):
        return check.flag(name, value)
    if isinstance(default, int | float) and isinstance(value, str | bool | list | tuple | Mapping):
        raise check.refuse(name, f"is {shown(value)}", f"give a number, as {shown(default)}")
    if isinstance(value, np.ndarray) and not isinstance(default, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return value if isinstance(default, list) else _tuples(value)
    return value


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list | tuple) else value
