"""Machine code for the atlas and its facets: functions on flat arrays, compiled when first called.

Everything here runs without numba, by numpy or by plain Python. Where numba is installed the
functions marked `compiled` turn into machine code on their first call, and are kept on disk under a
key made of the sources of all kernels: numba by itself does not notice that a callee has changed.
Nothing is imported before that first call.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

KERNELS: list[Callable[..., Any]] = []
"""All kernels, in the order of definition: a kernel calls only those before it."""

_taught: list[Callable[..., Any]] = []
"""Those that machine code knows already: modules may be imported after the first compilation."""

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
"""No global lock, so that threads run side by side; division by zero gives infinity."""


def kernel(function: Function) -> Function:
    """Mark a function that machine code may call; it stays what it is."""
    KERNELS.append(function)
    return function


@functools.cache
def available() -> bool:
    """Whether numba is installed and supports this interpreter."""
    if importlib.util.find_spec("numba") is None:
        return False
    try:
        import numba  # noqa: F401 - an interpreter that is too new makes this fail
    except ImportError:
        return False
    return True


def machine_code(function: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel as machine code, or as it is without numba."""
    return _compiled(function) if available() else function


@functools.cache
def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    import numba

    _teach_kernels()
    version = _digest()

    def entry(*arguments):  # type: ignore[no-untyped-def]
        version  # noqa: B018 - a closed-over value is part of numba's key on disk
        return function(*arguments)

    try:
        return numba.njit(cache=True, **OPTIONS)(entry)
    except RuntimeError:  # no folder that numba could keep it in
        return numba.njit(**OPTIONS)(entry)


def _teach_kernels() -> None:
    """Let machine code call every kernel that has been defined so far."""
    from numba.extending import register_jitable

    while len(_taught) < len(KERNELS):
        function = KERNELS[len(_taught)]
        register_jitable(**OPTIONS)(function)
        _taught.append(function)


def _digest() -> str:
    """Digest of the sources that machine code is made of."""
    files = sorted({Path(function.__code__.co_filename) for function in KERNELS})
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()
