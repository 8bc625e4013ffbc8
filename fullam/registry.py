"""Named things: a dictionary whose missing names are an error that lists the known ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from fullam.checks import Checker, shown
from fullam.exceptions import SettingsError, UnknownName
from fullam.ownership import Names, claim, know
from fullam.plain_values import defaults_of
from fullam.plugins import discover

T = TypeVar("T")


class Registry(Names[T]):
    """Name to thing.

    A name that is not there is looked for in the plugins of installed packages before it is
    refused; what a plugin registers is its own (see `plugins`).

    Attributes:
        kind: What the things are, for the error: "scenario", "controller", ...
    """

    def __init__(self, kind: str, entries: Mapping[str, T] | Iterable[tuple[str, T]] = ()) -> None:
        """Begin with some entries."""
        super().__init__(entries)
        self.kind = kind
        know(self)

    def __getitem__(self, name: str) -> T:
        """The thing of that name; what is no text is no name.

        Raises:
            UnknownName: There is none; the message lists the known names.
        """
        if not isinstance(name, str):
            raise UnknownName(self.kind, shown(name), self)
        return super().__getitem__(name)

    def __setitem__(self, name: str, thing: T) -> None:
        """Register a thing, or another one in its place.

        Raises:
            PluginError: In a plugin, and the name is somebody else's.
        """
        claim(self, name, thing)
        super().__setitem__(name, thing)

    def __missing__(self, name: str) -> T:
        """Look for an unknown name in the installed plugins, or refuse it.

        Raises:
            UnknownName: Nobody knows it; the message lists the known names.
        """
        discover()
        if name not in self:
            raise UnknownName(self.kind, str(name), self)
        return super().__getitem__(name)


def check_class(cls: Any, base: type, where: str) -> None:
    """Refuse a class that could be registered but not flown, while its author looks on.

    Raises:
        SettingsError: It is not derived from `base`, leaves a method out, or its `Settings` are no
            dataclass whose fields all have a default.
    """
    check = Checker(where, SettingsError)
    if not (isinstance(cls, type) and issubclass(cls, base)):
        remedy = f"derive a class from {base.__name__}"
        raise check.refuse("class", f"{shown(cls)} is no {base.__name__}", remedy)
    missing = ", ".join(sorted(getattr(cls, "__abstractmethods__", ())))
    if missing:
        problem = f"{cls.__name__} does not define {missing}"
        raise check.refuse("class", problem, f"the docstring of {base.__name__} says what they do")
    defaults_of(cls.Settings, check)  # type: ignore[attr-defined]
