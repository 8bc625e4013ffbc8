"""How functions are compiled: with numba, without fast-math, and kept on disk.

Only the entry points of `entries` are kept on disk; the functions they call become part of them.
"""

from __future__ import annotations

import hashlib
import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fullam.exceptions import MissingDependency

try:
    import numba
except ImportError as error:
    raise MissingDependency("the compiled engine", "numba", "fast") from error

logger = logging.getLogger(__name__)

ANNOUNCE_AFTER = 2.0
"""Loading machine code from disk takes below this [s]; compiling it takes longer."""

CONSTANTS_FROM = ("allocation", "backstepping", "box_qp", "moment_about")
"""Modules of `fullam.control` whose constants are part of the machine code."""

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
"""No global lock, so that threads fly side by side; division by zero gives infinity."""


def compiled(function: Callable[..., Any]) -> Any:
    """Decorator of the inner functions: machine code, part of whatever calls it."""
    return numba.njit(**OPTIONS)(function)


def merged(function: Callable[..., Any]) -> Any:
    """Decorator of inner functions that are called from one place or two: merged into the caller.

    A call hands over every field of every array one by one, some eighty for a function of nine
    arrays, which takes longer than what some of them do.
    """
    return numba.njit(inline="always", **OPTIONS)(function)


def entry(function: Callable[..., Any]) -> Any:
    """Decorator of the entry points: machine code that is kept on disk.

    numba notices a change of the file that holds the entry point, but not of the files whose
    functions went into it. An entry point therefore is a closure over `sources()`, which numba
    makes part of the key.
    """
    return numba.njit(cache=True, **OPTIONS)(function)


def sources() -> str:
    """Digest of all that the machine code is made of."""
    digest = hashlib.sha256()
    for path in source_files():
        digest.update(path.read_bytes())
    return digest.hexdigest()


def source_files() -> list[Path]:
    """The sources of this package, and of the constants that it takes from elsewhere."""
    here = Path(__file__).parent
    control = here.parents[1] / "control"
    return [*sorted(here.glob("*.py")), *(control / f"{name}.py" for name in CONSTANTS_FROM)]


@contextmanager
def announced(what: str, *entries: Any) -> Iterator[None]:
    """Say so when the first call of an entry point in this process has to compile it.

    A log line at level WARNING (which Python shows unless told otherwise), because a prompt that
    is silent for half a minute worries people: one when it takes longer than loading from disk,
    and one when it is done.

    Args:
        what: What is compiled.
        entries: The entry points called inside.
    """
    if all(function.signatures for function in entries):
        yield
        return
    start = time.perf_counter()
    timer = threading.Timer(
        ANNOUNCE_AFTER,
        logger.warning,
        ("compiling %s with numba; this happens once and takes about half a minute", what),
    )
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
    if any(sum(function.stats.cache_misses.values()) for function in entries):
        where = entries[0].stats.cache_path
        logger.warning(
            "compiled %s in %.0f s; kept in %s", what, time.perf_counter() - start, where
        )
