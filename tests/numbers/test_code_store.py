"""Machine code on disk: whole or not at all, the user's alone, and never in the way."""

import json
import os
import subprocess
import sys

import pytest

from fullam.numbers import code_store

SCRIPT = """
import logging
import sys
from typing import Any, NamedTuple

import numpy as np

from fullam.numbers.kernel import kernel
from fullam.numbers.program import Stage, program
from fullam.numbers.records import Rows

logging.basicConfig(level=logging.INFO, stream=sys.stdout, format="%(message)s")


class View(NamedTuple):
    x: Any


@kernel
def double(view, k):
    view.x[k] = 2.0 * view.x[k]


view = View(Rows(float, [[1.0], [2.0]]))
program([Stage(double, view)], compiled=True).run(0, 2)
print("numba" in sys.modules, view.x.array.ravel().tolist())
"""
"""Compiles one stage, says what it compiled and whether that took numba."""


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder of its own for this process's store."""
    monkeypatch.setenv(code_store.VARIABLE, str(tmp_path / "code"))
    code_store.folder.cache_clear()
    yield tmp_path / "code"
    code_store.folder.cache_clear()


def run_script(folder):
    environment = os.environ | {code_store.VARIABLE: str(folder)}
    command = [sys.executable, "-W", "error", "-c", SCRIPT]
    out = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    assert out.stderr == ""
    lines = out.stdout.splitlines()
    return [line for line in lines if not line.startswith("compiling ")]  # said when slow


def test_what_is_stored_is_loaded(place):
    code_store.store("key", "f", b"\x00code\nwith lines")
    assert code_store.load("key") == ("f", b"\x00code\nwith lines")
    assert code_store.load("other") is None
    assert [path.name for path in place.iterdir()] == [f"key{code_store.SUFFIX}"]
    assert place.stat().st_mode & 0o077 == 0, "whoever writes here decides what runs"


def damaged(data):
    head, code = data.split(b"\n", 1)
    said = json.loads(head)
    yield b""
    yield data[:10]
    yield data[:-1]
    yield data + b"x"
    yield head + b"\n" + bytes(len(code))
    yield b"[]\n" + code
    yield b"{}\n" + code
    yield json.dumps({"name": said["name"]}).encode() + b"\n" + code
    yield b"\xff\xfe garbage \x00 without a line"


def test_what_is_not_whole_is_not_loaded(place):
    code_store.store("key", "f", bytes(range(256)))
    path = place / f"key{code_store.SUFFIX}"
    for data in [*damaged(path.read_bytes())]:
        path.write_bytes(data)
        assert code_store.load("key") is None
        code_store.store("key", "f", bytes(range(256)))
        assert code_store.load("key") == ("f", bytes(range(256)))


@pytest.mark.parametrize("where", ["", "file", "file/below", "x" * 300])
def test_without_a_place_nothing_is_kept_and_nothing_fails(tmp_path, monkeypatch, where):
    (tmp_path / "file").write_text("no folder")
    asked = str(tmp_path / where) if where else ""
    monkeypatch.setattr(os, "environ", os.environ | {code_store.VARIABLE: asked})
    code_store.folder.cache_clear()
    try:
        assert code_store.folder() is None
        code_store.store("key", "f", b"code")
        assert code_store.load("key") is None
    finally:
        code_store.folder.cache_clear()
    assert (tmp_path / "file").read_text() == "no folder"


def test_a_folder_of_somebody_elses_is_not_trusted(place, monkeypatch):
    uid = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: uid + 1)
    assert code_store.folder() is None


def test_a_disk_that_fills_up_costs_nothing_but_the_code(place, monkeypatch):
    def full(*args):
        raise OSError("no space left")

    assert code_store.folder() == place
    monkeypatch.setattr(os, "fdopen", full)
    code_store.store("key", "f", b"code")
    assert code_store.load("key") is None


def test_code_is_compiled_once_loaded_without_the_compiler_and_mended_when_damaged(tmp_path):
    first = run_script(tmp_path)
    assert [line.split()[:2] for line in first[:2]] == [["compiled", "double"], ["compiled", "the"]]
    assert first[2:] == ["True [2.0, 4.0]"]
    assert run_script(tmp_path) == ["False [2.0, 4.0]"]
    for path in tmp_path.glob("*"):
        data = path.read_bytes()
        path.write_bytes(data[: len(data) // 2])
    mended = run_script(tmp_path)
    assert [line.split()[:2] for line in mended[:2]] == [["compiled", "double"], ["compiled", "the"]]
    assert run_script(tmp_path) == ["False [2.0, 4.0]"]


def test_where_nothing_can_be_kept_everything_is_compiled(tmp_path):
    (tmp_path / "file").write_text("no folder")
    lines = run_script(tmp_path / "file")
    assert "not kept" in lines[0]
    assert lines[-1] == "True [2.0, 4.0]"
