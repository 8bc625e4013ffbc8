"""The README's code runs, its commands exist, its links lead somewhere."""

import re
from pathlib import Path

import pytest
from fullam_book.code_blocks import blocks

from fullam.cli import build_parser

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


BLOCKS = blocks(README)


@pytest.mark.parametrize("code", [block.code for block in BLOCKS if block.language == "python"])
def test_the_python_runs(code, capsys):
    exec(compile(code, "README.md", "exec"), {})


def test_every_command_is_one():
    typed = [command for block in BLOCKS for command in block.commands]
    assert len(typed) >= 5
    for command in typed:
        assert build_parser().parse_args(command).verb == command[0]


def test_links_and_pictures_exist():
    targets = [t for t in re.findall(r"\]\(([^)]+)\)", README) if "://" not in t]
    assert targets
    for target in targets:
        assert (ROOT / target).exists(), target


def test_make_has_the_two_commands():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert re.search(r"^run:", makefile, re.MULTILINE)
    assert re.search(r"^test:", makefile, re.MULTILINE)
    assert "make test" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
