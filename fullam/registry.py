"""Named things: a dictionary whose missing names are an error that lists the known ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NoReturn, TypeVar

from fullam.checks import shown
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

    def __getitem__(self, name: str) -> T:
        """The thing of that name; what is no text is no name.

        Raises:
            UnknownName: There is none; the message lists the known names.
        """
        if not isinstance(name, str):
            raise UnknownName(self.kind, shown(name), self)
        return super().__getitem__(name)

    def __missing__(self, name: str) -> NoReturn:
        """Refuse an unknown name.

        Raises:
            UnknownName: Always; the message lists the known names.
        """
        raise UnknownName(self.kind, str(name), self)
