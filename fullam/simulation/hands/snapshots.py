"""Moments of a flight that it can go back to.

What a flight remembers from one control period to the next is little: the rows that its stages
rewrite, the memories of law and estimator, and what hands are doing. All records in these rows are
immutable, so that copies of the lists are enough.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

from fullam.control.controller import Controller
from fullam.control.estimator import Estimator, flies_as_kernel
from fullam.control.law import flies_as_kernels
from fullam.numbers.program import Long


@dataclass(frozen=True, eq=False)
class Saved:
    """A part of a flight and what it held: a view of lists, or the fields of an object."""

    part: Any
    content: Any

    def restore(self) -> None:
        """Put the content back where it was."""
        if isinstance(self.content, dict):
            self.part.__dict__.clear()
            self.part.__dict__.update({k: duplicate(v) for k, v in self.content.items()})
        else:
            put_back(self.part, self.content)


def saved_rows(view: Any) -> Saved:
    """The content of a view of lists."""
    return Saved(view, duplicate(view))


def saved_fields(part: Any) -> Saved:
    """The fields of a law or an estimator that is written as kernels."""
    return Saved(part, {name: duplicate(value) for name, value in vars(part).items()})


def can_be_saved(law: Controller, estimator: Estimator) -> bool:
    """Whether both keep what they remember where it can be copied: they are kernels.

    What somebody's own class keeps is its own affair; such a flight can only begin anew.
    """
    return flies_as_kernels(type(law)) and flies_as_kernel(type(estimator))


def duplicate(value: Any) -> Any:
    """A copy of lists (of lists) of records, also in views; everything else as it is."""
    if isinstance(value, list):
        return [duplicate(entry) for entry in value]
    if isinstance(value, Long):
        return list(value)
    if isinstance(value, tuple) and hasattr(value, "_fields") and any(map(_is_kept, value)):
        return type(value)(*map(duplicate, value))
    return copy.copy(value) if isinstance(value, dict) else value


def put_back(value: Any, content: Any) -> None:
    """Write what was duplicated into the same lists again."""
    if isinstance(value, Long):
        for i, entry in enumerate(content):
            value[i] = entry
    elif isinstance(value, tuple) or (value and isinstance(value[0], list)):
        for part, saved in zip(value, content, strict=True):
            put_back(part, saved)
    else:
        value[:] = content


def _is_kept(value: Any) -> bool:
    """Whether something in a view is rewritten: lists, or views that hold some."""
    if isinstance(value, tuple):
        return any(map(_is_kept, value))
    return isinstance(value, list | Long)
