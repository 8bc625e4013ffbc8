"""The compiler: kernels to object code, through numba and LLVM."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from numba import cfunc, types
from numba.core.errors import NumbaError
from numba.extending import register_jitable

from fullam.exceptions import KernelError
from fullam.numbers import lanes  # noqa: F401 - teaches numba the types of lanes
from fullam.numbers.compiled_records import call, type_of, viewer, word
from fullam.numbers.kernel import KERNELS, SUBROUTINES

_taught: set[int] = set()


def compile_stage(kernel: Callable[..., Any], view: Any) -> tuple[str, bytes]:
    """Name and object code of f(table, period), which shows a kernel the view of a table."""
    teach_kernels()
    look = viewer(type_of(view))

    def stage(table, period):
        kernel(look(table), period)

    return object_code(stage, 2)


def compile_loop() -> tuple[str, bytes]:
    """Name and object code of f(stages, count, start, stop); see `machine_code.loop_code`."""

    def loop(stages, count, start, stop):
        for period in range(start, stop):
            for i in range(count):
                call(word(stages, 2 * i), word(stages, 2 * i + 1), period)

    return object_code(loop, 4)


def teach_kernels() -> None:
    """Let machine code call every kernel that has been defined so far.

    LLVM puts kernels into one another (`forceinline`), which numba's own inline="always" would do
    before it finds types, and take minutes over. Division by zero gives infinity, as in C.
    """
    for kernel in list(KERNELS):
        if id(kernel) not in _taught:
            _taught.add(id(kernel))
            options = {} if kernel in SUBROUTINES else {"forceinline": True}
            register_jitable(error_model="numpy", **options)(kernel)


def object_code(function: Callable[..., Any], arguments: int) -> tuple[str, bytes]:
    """Compile a C function of 64-bit numbers: its name, and the object code.

    Internal to numba: the library behind a C function, and that it can be serialised. A test
    compiles and loads, and says so when an upgrade breaks it.

    Raises:
        KernelError: Some kernel holds what machine code has not; names its line.
    """
    try:
        compiled = cfunc(types.void(*[types.int64] * arguments), error_model="numpy")(function)
    except NumbaError as error:
        raise not_compiled(str(error)) from error
    _, _, (code, _) = compiled._library.serialize_using_object_code()
    return compiled._wrapper_name, code


PLACE = re.compile(r'File "(.+)", line (\d+):\n\s*def (\w+)')
"""Where numba's report quotes a kernel; it begins with the innermost one."""

MOST_SAID = 240
"""More of the compiler's words than this is not repeated."""


def not_compiled(report: str) -> KernelError:
    """What is wrong with a kernel, out of the pages that the compiler says of it."""
    place = PLACE.search(report)
    before = report[: place.start()] if place else report
    told = " ".join(re.split(r"nopython mode pipeline \(step: [^)]*\)", before)[-1].split())
    told = told if len(told) <= MOST_SAID else f"{told[:MOST_SAID]}..."
    where = f"{place[1]}, line {place[2]}" if place else "kernel"
    return KernelError(
        where,
        place[3] if place else "",
        f"cannot become machine code: {told}",
        "a kernel has numbers, tuples of fixed length and records, and calls other kernels; no "
        "comprehensions, generators, strings, numpy or objects (driver='python' flies it anyhow)",
    )
