"""What is compiled, what is kept on disk, and when it is compiled anew."""

from __future__ import annotations

import ast
import builtins
import importlib
import sys
import time
from pathlib import Path

import pytest

from fullam.exceptions import MissingDependency
from fullam.simulation.simulate import simulate

pytest.importorskip("numba", reason="the compiled engine needs the extra 'fast'")

from fullam.simulation.compiled import entries, jit


def test_without_numba_the_error_says_what_to_install(monkeypatch):
    real = builtins.__import__

    def blocked(name, *rest):
        if name == "numba":
            raise ImportError(name)
        return real(name, *rest)

    for module in [m for m in sys.modules if m.startswith("fullam.simulation.compiled.")]:
        monkeypatch.delitem(sys.modules, module)
    package = importlib.import_module("fullam.simulation.compiled")
    monkeypatch.delattr(package, "engine", raising=False)
    monkeypatch.setattr(builtins, "__import__", blocked)
    with pytest.raises(MissingDependency, match=r"fullam\[fast\]"):
        simulate("task-1", engine="compiled")


def test_compiling_is_announced(caplog, monkeypatch):
    monkeypatch.setattr(jit, "ANNOUNCE_AFTER", 0.0)

    class Slow:
        signatures = ()
        stats = entries.fly.stats._replace(cache_misses={"x": 1})

    with jit.announced("a thing", Slow()):
        time.sleep(0.05)
    text = caplog.text
    assert "compiling a thing" in text
    assert "kept in" in text


def test_the_machine_code_on_disk_is_keyed_by_all_sources():
    assert jit.sources() in [c.cell_contents for c in entries.fly.py_func.__closure__]


def imported_constants(tree):
    """Modules of fullam outside this package from which a source imports constants."""
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.ImportFrom)
            and node.module.startswith("fullam.")
            and not node.module.startswith("fullam.simulation.compiled")
            and any(alias.name.isupper() for alias in node.names)
        ):
            yield node.module


def test_constants_from_elsewhere_are_part_of_that_key():
    """Those of every file that defines compiled functions: numba writes them into the code."""
    keyed, found = set(jit.source_files()), set()
    for path in Path(jit.__file__).parent.glob("*.py"):
        tree = ast.parse(path.read_text("utf-8"))
        decorators = {
            decorator.id
            for node in ast.walk(tree)
            if isinstance(node, ast.FunctionDef)
            for decorator in node.decorator_list
            if isinstance(decorator, ast.Name)
        }
        assert path in keyed
        if decorators & {"compiled", "merged", "entry"}:
            found.update(imported_constants(tree))
    assert {Path(importlib.import_module(module).__file__) for module in found} <= keyed
    assert {f"fullam.control.{name}" for name in jit.CONSTANTS_FROM} == found
