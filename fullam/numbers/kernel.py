"""The mark of a kernel, and the primitives that kernels are made of beside + - * / and < <= > >=.

`lanes` gives the primitives their meaning in machine code; what stands here is what they mean for
Python's floats and for CasADi's expressions.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

KERNELS: list[Callable[..., Any]] = []
"""All kernels, in the order of definition, for `machine_code` to hand to the compiler."""

SUBROUTINES: set[Callable[..., Any]] = set()
"""Those of them that are called; see `subroutine`."""

Number = float
"""In annotations of records: a float, lanes or an expression."""


def kernel(function: Function) -> Function:
    """Mark a function as a kernel: machine code may then call it, with any number.

    The function stays what it is. Nothing is imported or compiled before a `Program` asks for it.
    """
    KERNELS.append(function)
    return function


def subroutine(function: Function) -> Function:
    """Mark a kernel that machine code calls instead of taking it in.

    For long scalar code, as a search, that would stand in several places: a call costs it nothing,
    and compiling it once instead of five times saves seconds.
    """
    SUBROUTINES.add(function)
    return kernel(function)


def _symbolic(x: Any) -> Any:
    """CasADi if x is one of its expressions, else None; it was imported by whoever made x."""
    if isinstance(x, float | bool) or not type(x).__module__.startswith("casadi"):
        return None
    import casadi

    return casadi


def select(condition: Any, a: Any, b: Any) -> Any:
    """The number or record a where the condition holds, else b."""
    if condition is True or condition is False:  # nearly always: it need not be looked at twice
        return a if condition else b
    casadi = _symbolic(condition)
    if casadi is None:
        return a if condition else b
    if isinstance(a, tuple):
        parts = [select(condition, x, y) for x, y in zip(a, b, strict=True)]
        return tuple(parts) if type(a) is tuple else type(a)(*parts)
    return casadi.if_else(condition, a, b)


def sqrt(x: Any) -> Any:
    """Square root, correctly rounded everywhere."""
    casadi = None if type(x) is float else _symbolic(x)
    return math.sqrt(x) if casadi is None else casadi.sqrt(x)


def both(a: Any, b: Any) -> Any:
    """The condition a and b."""
    casadi = _symbolic(a)
    return (a and b) if casadi is None else casadi.logic_and(a, b)


def either(a: Any, b: Any) -> Any:
    """The condition a or b."""
    casadi = _symbolic(a)
    return (a or b) if casadi is None else casadi.logic_or(a, b)


def some(condition: Any) -> bool:
    """Whether a condition holds for any of the flights at hand; True where that cannot be known.

    The one branch on data that a kernel may have is a shortcut, `if some(rare): ...`, around what
    `select(rare, ...)` then takes where it is wanted.
    """
    return bool(condition) if _symbolic(condition) is None else True


def lane_count(condition: Any) -> int:
    """How many flights a condition is about."""
    return 1


def lane_of(condition: Any, lane: int) -> bool:
    """What a condition says of one of them."""
    return bool(condition)


@kernel
def minimum(a, b):
    """The lesser of two numbers; b if either is NaN."""
    return select(a < b, a, b)


@kernel
def maximum(a, b):
    """The greater of two numbers; b if either is NaN."""
    return select(a > b, a, b)


@kernel
def absolute(x):
    """Absolute value."""
    return select(x < 0.0, -x, x)


@kernel
def clip(x, low, high):
    """The number within [low, high]; NaN stays NaN, so that nobody takes a bound for an answer."""
    return select(x < low, low, select(x > high, high, x))
