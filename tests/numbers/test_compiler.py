"""What cannot be compiled is told in a line, with the kernel's own place."""

import pytest

from fullam.exceptions import KernelError
from fullam.numbers import compiler
from fullam.numbers.kernel import kernel


@kernel
def inner(x):
    """A generator, which machine code has not."""
    return tuple(2.0 * v for v in (x, x))


@kernel
def outer(x):
    """Its caller."""
    return inner(x)


def stage(table, period):
    outer(1.0 * period)


def test_a_kernel_that_cannot_be_compiled_is_named_with_its_line():
    compiler.teach_kernels()
    with pytest.raises(KernelError) as caught:
        compiler.object_code(stage, 2)
    error = caught.value
    assert error.field == "inner"
    assert error.where.endswith(f"test_compiler.py, line {inner.__code__.co_firstlineno + 3}")
    assert "yield in a closure is unsupported" in error.problem
    assert "comprehensions" in error.remedy
    assert len(str(error)) < 600  # of the compiler's four pages


def test_words_without_a_place_are_told_too():
    assert "something new" in str(compiler.not_compiled("something new"))
