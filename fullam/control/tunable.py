"""What may be tuned of a law: declared where its settings are, field by field.

A law's settings are a frozen dataclass. A field that `fullam tune` may change says so, and between
which values, in the place of its default:

    @dataclass(frozen=True)
    class SpringSettings:
        stiffness: float = tunable(6.0, low=1.0, high=60.0)
        damping: tuple[float, float] = tunable((4.0, 2.0), low=(1.0, 0.5), high=(20.0, 10.0))
        offset: float = tunable(0.0, low=-1.0, high=1.0, scale="linear")
        rounds: int = tunable(3, low=1, high=9)
        model: str = "pinocchio"  # is not tuned

`low` and `high` have the shape of the default: a number for a number, as many numbers for a tuple;
None in both stands for an entry that is left alone. On the scale "log" (the default, for gains and
rates) the search moves by factors, and `low` is above 0; on "linear" it moves by differences.
Values are tried to four digits; fields that are annotated `int` stay whole. A search whose start
lies outside a range begins at the nearer end of it. A subclass that gives a field another default
declares its range again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, Literal

from fullam.checks import Checker, shown
from fullam.exceptions import SettingsError

KEY = "fullam.tunable"
"""Where a field's metadata hold its ranges."""

Scale = Literal["log", "linear"]
SCALES = ("log", "linear")

CHECK = Checker("tunable", SettingsError)


@dataclass(frozen=True)
class Parameter:
    """One number that a search may choose.

    Attributes:
        field: Field of the settings.
        index: Which entry of the field; None if the field is one number.
        low: Smallest value.
        high: Largest value.
        scale: One of `SCALES`.
        whole: Whether it is a whole number.
    """

    field: str
    index: int | None
    low: float
    high: float
    scale: Scale = "log"
    whole: bool = False

    @property
    def name(self) -> str:
        """As a message names it: "position_gains[0]"."""
        return self.field if self.index is None else f"{self.field}[{self.index}]"

    def decode(self, x: float) -> float:
        """Value of x in [0, 1], to four digits: what is written is what was flown."""
        if self.scale == "log":
            value = self.low * (self.high / self.low) ** x
        else:
            value = self.low + (self.high - self.low) * x
        return round(value) if self.whole else float(f"{value:.4g}")

    def encode(self, value: float) -> float:
        """The inverse of `decode`, clipped to [0, 1]."""
        value = min(max(value, self.low), self.high)
        if self.scale == "log":
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def of(self, settings: Mapping[str, Any]) -> float:
        """Its value among some settings."""
        value = settings[self.field]
        return float(value if self.index is None else value[self.index])


def tunable(default: Any, low: Any, high: Any, *, scale: Scale = "log") -> Any:
    """A dataclass field that may be tuned; the module's text has an example.

    Args:
        default: A number, or a tuple of numbers.
        low: Smallest values, in the shape of the default; None where nothing is tuned.
        high: Largest values, in the same shape.
        scale: "log" or "linear".

    Returns:
        What `dataclasses.field` gives, typed so that it can stand for a default.

    Raises:
        SettingsError: Shapes that differ, an empty range, or one that reaches 0 on the scale "log".
    """
    if CHECK.text("scale", scale) not in SCALES:
        raise CHECK.refuse("scale", f"is {shown(scale)}", f"give one of {', '.join(SCALES)}")
    many = isinstance(default, tuple | list)
    values, lows, highs = ((tuple(x) if _is_many(x) else (x,)) for x in (default, low, high))
    if {_is_many(low), _is_many(high)} != {many} or not len(values) == len(lows) == len(highs):
        raise CHECK.refuse(
            "low, high", f"are {shown(low)}, {shown(high)}", f"give them as {shown(default)} is"
        )
    ranges = []
    for i, (value, least, most) in enumerate(zip(values, lows, highs, strict=True)):
        CHECK.number("default", value)
        if (least is None) != (most is None):
            raise CHECK.refuse("low, high", "lack one end", "give both, or None twice")
        if least is None:
            continue
        least, most = CHECK.number("low", least), CHECK.number("high", most)
        if not (least < most and (scale == "linear" or least > 0.0)):
            above = "" if scale == "linear" else ", low above 0"
            problem = f"are {least:g}, {most:g} on the scale '{scale}'"
            raise CHECK.refuse("low, high", problem, f"give low < high{above}")
        ranges.append(Parameter("", i if many else None, least, most, scale))
    if many:
        default = tuple(default)
    return field(default=default, metadata={KEY: tuple(ranges)})


def _is_many(value: Any) -> bool:
    return isinstance(value, tuple | list)


def _is_whole(annotation: Any) -> bool:
    """Whether a field's annotation, a class or its text, is of whole numbers."""
    text = annotation.__name__ if isinstance(annotation, type) else str(annotation)
    return text == "int" or text.startswith("tuple[int")


def search_space(settings: type) -> tuple[Parameter, ...]:
    """What a settings class declares tunable, in the order of its fields.

    Raises:
        SettingsError: Nothing; the message says how it is declared.
    """
    CHECK.instance("settings", settings, type)
    found = [
        replace(p, field=f.name, whole=_is_whole(f.type))
        for f in (fields(settings) if is_dataclass(settings) else ())
        for p in f.metadata.get(KEY, ())
    ]
    if not found:
        raise SettingsError(
            settings.__name__,
            "settings",
            "declare nothing that may be tuned",
            "give fields of that dataclass a range in the place of their default: 'gain: float = "
            "fullam.tunable(5.0, low=0.5, high=50.0)'; help(fullam.control.tunable) says more",
        )
    return tuple(found)
