"""What a verb of the command line is: a function and its arguments, registered by name."""

from __future__ import annotations

import argparse
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

OK, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130
"""Exit codes."""

Argument = tuple[tuple[str, ...], dict[str, Any]]
Execute = Callable[[argparse.Namespace], int]


@dataclass(frozen=True)
class Verb:
    """One verb.

    Attributes:
        summary: First line of the function's docstring, for `fullam --help`.
        description: All of it, for `fullam VERB --help`.
        arguments: What `argparse.ArgumentParser.add_argument` is given, in order.
        execute: The function; takes the parsed arguments, returns the exit code.
    """

    summary: str
    description: str
    arguments: tuple[Argument, ...]
    execute: Execute


VERBS: dict[str, Verb] = {}


def argument(*flags: str, **options: Any) -> Argument:
    """One argument of a verb, as in `argparse.ArgumentParser.add_argument`."""
    return flags, options


def verb(name: str, *arguments: Argument) -> Callable[[Execute], Execute]:
    """Function decorator: make `fullam NAME` call it; its docstring is the help text."""

    def add(execute: Execute) -> Execute:
        text = inspect.getdoc(execute) or ""
        VERBS[name] = Verb(text.split("\n")[0].rstrip("."), text, arguments, execute)
        return execute

    return add
