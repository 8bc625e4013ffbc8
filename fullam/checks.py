"""Checks of values where they come in: each says what is wrong, where, and what would be right.

A `Checker` belongs to one file or object and raises one class of error. Its methods take the name
of a value and the value, and give it back in one form: a float, an int, a tuple of floats, a text.
So wrong types, NaN, infinities and numbers beyond sense end where they come in, and nothing behind
has to ask again.
"""

from __future__ import annotations

import datetime
import math
import numbers
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.exceptions import InvalidInput

LONGEST_SHOWN = 60
"""More characters of a value than this do not help whoever reads the message."""

MOST_FILE_BYTES = 16 << 20
"""A TOML or URDF that is larger is not read; ours have some ten thousand bytes."""

CONTROL = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff\u2028\u2029\u202a-\u202e\u2066-\u2069]"
)
"""Characters that steer terminals or pages, or stand for bytes that are no text."""


def shown(value: Any) -> str:
    """A value as a message shows it: short, NaN and infinities by their names."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool) or value is None:
        return repr(value)
    if isinstance(value, int) and abs(value) >= 10**20:
        return f"an integer of about {int(value.bit_length() * math.log10(2.0)) + 1} digits"
    if isinstance(value, float):
        return "NaN" if value != value else repr(value)
    if isinstance(value, datetime.date | datetime.time):
        return f"the {type(value).__name__} {value}"
    try:
        text = repr(value)
    except Exception as error:  # noqa: BLE001 - whatever a stranger's __repr__ raises
        text = f"a {type(value).__name__} ({type(error).__name__} on showing it)"
    return text if len(text) <= LONGEST_SHOWN else f"{text[: LONGEST_SHOWN - 3]}..."


@dataclass(frozen=True)
class Range:
    """The numbers that make sense for a value.

    Attributes:
        low: Smallest.
        high: Largest.
        unit: What they count.
        above: Whether `low` itself is excluded.
    """

    low: float = -math.inf
    high: float = math.inf
    unit: str = ""
    above: bool = False

    def __contains__(self, value: float) -> bool:
        """Whether a finite number is one of them."""
        return (self.low < value if self.above else self.low <= value) and value <= self.high

    def __str__(self) -> str:
        """As a remedy: "give a number above 0, at most 1e+05 rad/s"."""
        unit = f" {self.unit}" if self.unit else ""
        if self.high == math.inf:
            ends = "" if self.low == -math.inf else f" of at least {self.low:g}"
            ends = f" above {self.low:g}" if self.above else ends
        elif self.above:
            ends = f" above {self.low:g}, at most {self.high:g}"
        else:
            ends = f" from {self.low:g} to {self.high:g}"
        return f"give a {'' if ends else 'finite '}number{ends}{unit}"


FINITE = Range()


def positive(high: float, unit: str = "") -> Range:
    """Above 0, at most `high`."""
    return Range(0.0, high, unit, above=True)


def within(size: float, unit: str = "") -> Range:
    """From -size to size."""
    return Range(-size, size, unit)


def from_zero(high: float, unit: str = "") -> Range:
    """From 0 to `high`."""
    return Range(0.0, high, unit)


@dataclass(frozen=True)
class Checker:
    """Checks the values of one file or object.

    Attributes:
        where: What a message names as their place.
        error: What it raises.
    """

    where: str
    error: type[InvalidInput] = InvalidInput

    def refuse(self, field: str, problem: str, remedy: str) -> InvalidInput:
        """The error, for the caller to raise."""
        return self.error(self.where, field, problem, remedy)

    def number(self, field: str, value: Any, range: Range = FINITE) -> float:
        """A finite real number in a range; numpy's are welcome, bools and texts are not."""
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value[()]
        if isinstance(value, bool | np.bool_) or not isinstance(value, numbers.Real):
            raise self.refuse(field, f"is {shown(value)}", str(range))
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not (math.isfinite(number) and number in range):
            raise self.refuse(field, f"is {shown(value)}", str(range))
        return number

    def whole(self, field: str, value: Any, low: int = 0, high: int = 2**63 - 1) -> int:
        """A whole number from low to high."""
        if (
            isinstance(value, bool | np.bool_)
            or not isinstance(value, int | np.integer)
            or not low <= value <= high
        ):
            most = f" to {high}" if high < 2**63 - 1 else " or more"
            raise self.refuse(field, f"is {shown(value)}", f"give a whole number, {low}{most}")
        return int(value)

    def flag(self, field: str, value: Any) -> bool:
        """True or False, and nothing that merely counts as one."""
        if not isinstance(value, bool | np.bool_):
            raise self.refuse(field, f"is {shown(value)}", "give true or false")
        return bool(value)

    def vector(
        self, field: str, value: Any, size: int | None = 3, range: Range = FINITE
    ) -> tuple[float, ...]:
        """Numbers in a range, as many as `size` says; any number of them if it is None."""
        wanted = {None: "numbers", 3: "three finite numbers"}.get(size, f"{size} finite numbers")
        if isinstance(value, np.ndarray):
            fits = value.ndim == 1 and value.dtype.kind in "iuf"
        else:
            fits = isinstance(value, list | tuple)
        if not fits or (size is not None and len(value) != size):
            raise self.refuse(field, f"is {shown(value)}", f"give {wanted}")
        return tuple(self.number(f"{field}[{i}]", entry, range) for i, entry in enumerate(value))

    def array(self, field: str, value: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """Finite numbers of a shape, in whatever nest they come."""
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError, OverflowError) as error:
            raise self.refuse(field, f"is {shown(value)}", f"give numbers, {shape}") from error
        if array.shape != shape:
            raise self.refuse(field, f"has shape {array.shape}", f"give shape {shape}")
        if not np.isfinite(array).all():
            raise self.refuse(field, f"is {shown(value)}", "give finite numbers")
        return array

    def text(self, field: str, value: Any, prose: bool = False) -> str:
        """A string without control characters; prose may be empty and have lines."""
        if not isinstance(value, str):
            raise self.refuse(field, f"is {shown(value)}", "give a string")
        if not (value.strip() or prose):
            raise self.refuse(field, "is empty", "give a string")
        if CONTROL.search(value) or not (prose or value.isprintable()):
            problem = f"holds control characters ({shown(value)})"
            raise self.refuse(field, problem, "give a string that can be printed")
        return value

    def instance(self, field: str, value: Any, kinds: type | tuple[type, ...]) -> Any:
        """An object of one of some classes."""
        if not isinstance(value, kinds):
            names = [k.__name__ for k in (kinds if isinstance(kinds, tuple) else (kinds,))]
            raise self.refuse(field, f"is {shown(value)}", f"give a {' or a '.join(names)}")
        return value

    def items(self, field: str, value: Any) -> tuple[Any, ...]:
        """Several things in order: a list, a tuple, a range or the entries of an array."""
        fits = isinstance(value, list | tuple | range)
        if not (fits or (isinstance(value, np.ndarray) and value.ndim == 1)):
            raise self.refuse(field, f"is {shown(value)}", "give a list of them")
        return tuple(value)

    def path(self, field: str, value: Any, suffix: str = "") -> Path:
        """The path of a file, with a suffix if one is wanted."""
        if not isinstance(value, str | Path) or not str(value).strip() or "\0" in str(value):
            raise self.refuse(field, f"is {shown(value)}", "give the path of a file")
        if Path(value).suffix.lower() != suffix and suffix:
            problem = f"{shown(str(value))} does not end in {suffix}"
            raise self.refuse(field, problem, "give it that suffix")
        return Path(value)

    def table(self, field: str, value: Any) -> dict[str, Any]:
        """A mapping whose keys are texts."""
        if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
            raise self.refuse(field, f"is {shown(value)}", "give a table of named values")
        return dict(value)

    def known(self, table: Mapping[str, Any], names: tuple[str, ...], what: str = "field") -> None:
        """Refuse keys that nobody reads: a typing error must not pass as a default."""
        for key in table:
            if key not in names:
                raise self.refuse(
                    key, f"is no {what} of it", f"it has {', '.join(names) or 'none'}"
                )

    def settings(self, cls: type[Any], changes: Mapping[str, Any] | None) -> Any:
        """A settings dataclass, its defaults with some of them changed."""
        values = {} if changes is None else self.table("settings", changes)
        self.known(values, tuple(field.name for field in fields(cls)), "setting")
        try:
            return cls(**values)
        except (TypeError, ValueError, OverflowError) as error:
            problem = f"is of the wrong type ({error})"
            culprits = [name for name in values if _fails(cls, name, values[name])]
            field = culprits[0] if culprits else "a setting"
            raise self.refuse(field, problem, f"see the defaults, {cls()}") from error


def _fails(cls: type[Any], name: str, value: Any) -> bool:
    """Whether a class cannot be made with this one value."""
    try:
        cls(**{name: value})
    except (TypeError, ValueError, OverflowError):
        return True
    except InvalidInput:
        return False
    return False


def read_text(path: Path, check: Checker) -> str:
    """The text of a small file; what is no UTF-8, no file or too large is refused unread."""
    try:
        if not path.is_file():
            raise check.refuse("file", "cannot be read (there is no such file)", "check the path")
        if (size := path.stat().st_size) > MOST_FILE_BYTES:
            most = f"at most {MOST_FILE_BYTES >> 20} MiB are read"
            raise check.refuse("file", f"has {size / 2**20:.0f} MiB", most)
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeError, ValueError) as error:
        problem = f"cannot be read ({error})"
        raise check.refuse("file", problem, "give a text file in UTF-8") from error


def read_toml(path: Path, check: Checker) -> dict[str, Any]:
    """The content of a TOML file."""
    text = read_text(path, check)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise check.refuse("TOML", str(error), "correct the syntax there") from error
    except ValueError as error:  # Python reads no integer of more than 4300 digits
        raise check.refuse("TOML", str(error), "give numbers of a few digits") from error
    except RecursionError as error:
        raise check.refuse("TOML", "is nested too deeply", "write it flat") from error
