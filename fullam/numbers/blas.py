"""One thread for BLAS while something flies.

A flight's matrices are small: more threads gain nothing, and beside busy processors each product
waits for all of them, tenfold and more. The libraries' setting is the process's, so whoever is the
first to fly sets it, and whoever lands last puts back what was there before.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from threadpoolctl import ThreadpoolController


class _Cap:
    """Who flies in this process, and what BLAS had before."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._flying, self._modules = 0, -1
        self._libraries: Any = None
        self._before: Any = None

    def enter(self) -> None:
        with self._lock:
            if self._flying == 0:
                if self._modules != len(sys.modules):  # these may have brought a library
                    self._libraries, self._modules = ThreadpoolController(), len(sys.modules)
                self._before = self._libraries.limit(limits=1, user_api="blas")
            self._flying += 1

    def leave(self) -> None:
        with self._lock:
            self._flying -= 1
            if self._flying == 0:
                # Some versions of threadpoolctl heed the first thread alone that set something.
                self._let_any_thread_set()
                self._before.restore_original_limits()
                self._let_any_thread_set()

    def _let_any_thread_set(self) -> None:
        for library in self._libraries.lib_controllers:
            clear = getattr(library, "clear_controlling_thread", None)
            if clear is not None:
                clear(force=True)


_CAP = _Cap()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Hold BLAS at one thread; also a decorator of functions.

    May be nested, and entered by several threads at once. It costs 10 us, and 0.4 ms more after
    further modules have been imported. A library that is loaded meanwhile is held from the next
    time on.
    """
    _CAP.enter()
    try:
        yield
    finally:
        _CAP.leave()
