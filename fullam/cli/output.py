"""What the command line writes: text and JSON to stdout, progress and complaints to stderr."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TextIO

from fullam.analysis.text_table import number as number
from fullam.analysis.text_table import table as table
from fullam.checks import CONTROL

if TYPE_CHECKING:
    from fullam.simulation.progress import Progress

PATIENCE = 1.0
"""What takes longer than this shows its progress [s]."""


LONGEST_COMPLAINT = 900
"""More characters of a complaint than this help nobody; they come from what was typed or read."""

STEERING = re.compile(f"{CONTROL.pattern}|[\x1b\r]")
"""What would move a terminal's cursor, colour it or turn the direction of writing."""


def harmless(text: str, form: str = "\\x{:02x}") -> str:
    """The text with characters that steer a terminal written as their numbers.

    Names of scenarios, vehicles and files come from files, and shall not act on who reads them.
    """
    return STEERING.sub(lambda found: form.format(ord(found[0])), text)


def say(text: str) -> None:
    """Write a line of results."""
    _write(sys.stdout, harmless(text))


def complain(text: str) -> None:
    """Write a line about what went wrong; of a very long one its beginning and end."""
    if len(text) > LONGEST_COMPLAINT:
        text = f"{text[: 2 * LONGEST_COMPLAINT // 3]} ... {text[-LONGEST_COMPLAINT // 3 :]}"
    _write(sys.stderr, f"fullam: {harmless(text)}")


def _write(stream: TextIO, line: str) -> None:
    """A line, also to a terminal whose encoding lacks some of its characters."""
    encoding = stream.encoding or "utf-8"
    stream.write(line.encode(encoding, "backslashreplace").decode(encoding) + "\n")


def say_json(value: Any) -> None:
    """Write strict JSON: a number that is not finite becomes null."""
    text = json.dumps(_finite(value), indent=2, allow_nan=False, ensure_ascii=False)
    _write(sys.stdout, harmless(text, "\\u{:04x}"))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def progress(text: str) -> Iterator[Progress]:
    """A progress bar on stderr, if it is a terminal and the work takes over a second.

    Yields:
        A function of (done, total).
    """
    from tqdm import tqdm

    terminal = sys.stderr.isatty()
    with tqdm(
        desc=harmless(text),
        delay=PATIENCE,
        leave=False,
        disable=not terminal,
        file=sys.stderr,
        total=1,
    ) as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield show
