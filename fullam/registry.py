"""Named things: a dictionary whose missing names are an error that lists the known ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NoReturn, TypeVar

from fullam.exceptions import UnknownName

T = TypeVar("T")


class Registry(dict[str, T]):
    """Name to thing.

    Attributes:
        kind: What the things are, for the error: "scenario", "controller", ...
    """

    def __init__(self, kind: str, entries: Mapping[str, T] | Iterable[tuple[str, T]] = ()) -> None:
        """Begin with some entries."""
        super().__init__(entries)
        self.kind = kind

    def __missing__(self, name: str) -> NoReturn:
        """Refuse an unknown name.

        Raises:
            UnknownName: Always; the message lists the known names.
        """
        raise UnknownName(self.kind, str(name), self)
