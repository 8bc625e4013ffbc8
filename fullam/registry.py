"""Named things: a dictionary whose missing names are an error that lists the known ones."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from fullam.checks import Checker, shown
from fullam.exceptions import SettingsError, UnknownName
from fullam.ownership import Names, claim, know
from fullam.plain_values import defaults_of
from fullam.plugins import discover

T = TypeVar("T")

LONGEST_NAME = 100
"""Characters of a name."""


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
            SettingsError: It is no name that anybody could type.
        """
        check_name(self.kind, name)
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


def check_name(kind: str, name: Any) -> None:
    """Refuse a name that no command line could name: lists have commas, estimators follow an @."""
    check = Checker(f"{kind} {shown(name)}", SettingsError)
    text = check.text("name", name)
    if len(text) > LONGEST_NAME or text != text.strip() or text[0] == "-" or set(text) & set(",@"):
        problem = "is too long, begins with -, or has a comma, an @ or blanks around it"
        raise check.refuse("name", problem, "give a name such as 'my-law'")


def check_class(cls: Any, base: type, where: str) -> None:
    """Refuse a class that could be registered but not flown, while its author looks on.

    Raises:
        SettingsError: It is not derived from `base`, leaves a method out, cannot be made as `base`
            is, or its `Settings` are no dataclass whose fields all have a default.
    """
    check = Checker(where, SettingsError)
    if not (isinstance(cls, type) and issubclass(cls, base)):
        remedy = f"derive a class from {base.__name__}"
        raise check.refuse("class", f"{shown(cls)} is no {base.__name__}", remedy)
    missing = ", ".join(sorted(getattr(cls, "__abstractmethods__", ())))
    if missing:
        problem = f"{cls.__name__} does not define {missing}"
        raise check.refuse("class", problem, f"the docstring of {base.__name__} says what they do")
    given = inspect.signature(base).parameters
    try:
        inspect.signature(cls).bind(*given)
    except (TypeError, ValueError) as error:
        remedy = f"take {', '.join(given)}, and give them to super().__init__"
        raise check.refuse("__init__", f"cannot be called ({error})", remedy) from error
    defaults_of(cls.Settings, check)  # type: ignore[attr-defined]


def made(cls: type[T], *parts: Any) -> T:
    """A registered class, called.

    Raises:
        SettingsError: Its own `__init__` leaves out its base's; or its base reads a setting that
            its own `Settings` do not have.
    """
    where = f"class {cls.__name__}"
    try:
        thing = cls(*parts)
    except AttributeError as error:
        if error.obj is None or not any(error.obj is part for part in parts):
            raise
        problem = f"has no '{error.name}', which its base reads"
        remedy = "derive it from the Settings of the base"
        raise SettingsError(where, type(error.obj).__name__, problem, remedy) from error
    if "period" not in getattr(thing, "__dict__", ()):
        remedy = "call super().__init__ with all that it is given"
        raise SettingsError(where, "__init__", "does not call that of its base", remedy)
    return thing
