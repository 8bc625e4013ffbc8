"""Kernels compiled to machine code, and kept on disk.

A *stage* is a kernel f(view, period). Compiled, it is a C function of two 64-bit numbers: the
address of a table that describes the view, and the period. Stages therefore know nothing of each
other: a new law compiles alone, and the rest of the flight comes from disk. What is kept is the
object code that LLVM made; loading it asks for llvmlite alone, and neither numba nor a compiler.
"""

from __future__ import annotations

import functools
import logging
import os
import platform
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from fullam.numbers.code_store import load, store
from fullam.numbers.digest import describe, digest, signature
from fullam.version import version_of

logger = logging.getLogger(__name__)

ANNOUNCE_AFTER = 3.0
"""A function that compiles longer than this [s] says so: a silent prompt worries people."""

_lock = threading.RLock()
_codes: dict[str, Code] = {}
_stage_keys: dict[Any, str] = {}


class Code:
    """Machine code of one function, in memory for as long as this object lives.

    Attributes:
        address: Where it begins.
    """

    def __init__(self, name: str, object_code: bytes) -> None:
        """Load object code; OSError if it holds no function of that name."""
        from llvmlite import binding

        _start_llvm()
        target = binding.Target.from_default_triple().create_target_machine(jit=True)
        self._engine = binding.create_mcjit_compiler(binding.parse_assembly(""), target)
        self._engine.add_object_file(binding.ObjectFileRef.from_data(object_code))
        self._engine.finalize_object()
        self.address: int = self._engine.get_function_address(name)
        if not self.address:
            raise OSError(f"the object code has no function '{name}'")


@functools.cache
def available() -> bool:
    """Whether kernels can be compiled here: numba supports this interpreter and is installed."""
    try:
        version_of("numba")
        import llvmlite.binding  # noqa: F401 - all that loading from disk needs
    except ImportError:  # PackageNotFoundError is one
        return False
    return True


def stage_code(kernel: Callable[..., Any], view: Any) -> Code:
    """Machine code of a kernel f(view, period) for views like this one: f(table, period)."""
    known = kernel, signature(view)
    if known not in _stage_keys:  # to work a key out is to read all the code that a kernel calls
        _stage_keys[known] = digest(kernel, "stage", describe(view), *_machine())
    return _code(
        _stage_keys[known],
        kernel.__qualname__,
        lambda: _compiler().compile_stage(kernel, view),
    )


def loop_code() -> Code:
    """Machine code of f(stages, count, start, stop): all stages in turn, period by period.

    `stages` is the address of pairs (address of a function, address of its table).
    """
    return _code(_loop_key(), "the loop", lambda: _compiler().compile_loop())


@functools.cache
def _loop_key() -> str:
    return digest("loop", *_machine())


def _code(key: str, what: str, compile_it: Callable[[], tuple[str, bytes]]) -> Code:
    with _lock:
        if key not in _codes:
            kept = load(key)
            if kept is None:
                with _announced(what):
                    kept = compile_it()
                store(key, *kept)
            _codes[key] = Code(*kept)
        return _codes[key]


@functools.cache
def _machine() -> tuple[str, ...]:
    """What else decides the machine code: processor, interpreter, compiler."""
    from llvmlite import binding

    return (
        platform.machine(),
        platform.python_version(),
        binding.get_host_cpu_name(),
        binding.get_host_cpu_features().flatten(),
        # What numba is told to compile for, instead of the processor at hand.
        os.environ.get("NUMBA_CPU_NAME", ""),
        os.environ.get("NUMBA_CPU_FEATURES", ""),
        version_of("numba"),
        version_of("llvmlite"),
    )


@functools.cache
def _start_llvm() -> None:
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()


@contextmanager
def _announced(what: str) -> Iterator[None]:
    """Log that something compiles, if it takes long."""
    words = "compiling %s; this happens once", what
    timer = threading.Timer(ANNOUNCE_AFTER, logger.warning, words)
    timer.daemon = True
    timer.start()
    start = time.perf_counter()
    try:
        yield
    finally:
        timer.cancel()
    logger.info("compiled %s in %.1f s", what, time.perf_counter() - start)


def _compiler() -> Any:
    """The module that imports numba, which takes a second and is rarely needed."""
    from fullam.numbers import compiler

    return compiler
