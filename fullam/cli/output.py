"""What the command line writes: text and JSON to stdout, progress and complaints to stderr."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fullam.simulation.progress import Progress

PATIENCE = 1.0
"""What takes longer than this shows its progress [s]."""


def say(text: str) -> None:
    """Write a line of results."""
    sys.stdout.write(f"{text}\n")


def complain(text: str) -> None:
    """Write a line about what went wrong."""
    sys.stderr.write(f"fullam: {text}\n")


def say_json(value: Any) -> None:
    """Write strict JSON: a number that is not finite becomes null."""
    say(json.dumps(_finite(value), indent=2, allow_nan=False, ensure_ascii=False))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def table(rows: Sequence[Sequence[str]], header: Sequence[str] = (), left: int = 1) -> str:
    """Rows as text in aligned columns.

    Args:
        rows: Cells; every row as long as the header.
        header: Names of the columns, underlined; none by default.
        left: How many columns, from the first, are aligned to the left; the others are numbers.
    """
    lines = [list(row) for row in ([header] if header else []) + list(rows)]
    if not lines:
        return ""
    widths = [max(len(cell) for cell in column) for column in zip(*lines, strict=True)]
    text = [
        "  ".join(
            cell.ljust(width) if k < left else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]
    if header:
        text.insert(1, "-" * (sum(widths) + 2 * (len(widths) - 1)))
    return "\n".join(text)


def number(value: float | bool | None, digits: int = 2) -> str:
    """A cell: fixed digits, yes or no, or a dash for what does not exist."""
    if value is None or value != value:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.{digits}f}"


@contextmanager
def progress(text: str) -> Iterator[Progress]:
    """A progress bar on stderr, if it is a terminal and the work takes over a second.

    Yields:
        A function of (done, total).
    """
    from tqdm import tqdm

    terminal = sys.stderr.isatty()
    with tqdm(
        desc=text, delay=PATIENCE, leave=False, disable=not terminal, file=sys.stderr, total=1
    ) as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield show
