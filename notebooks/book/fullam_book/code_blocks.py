"""The code in hand-written Markdown, and a way to run a page of it: `python code_blocks.py PAGE`.

Python and `fullam` commands run in the order in which they stand, in one process and the folder at
hand, as a reader would type them. A block that begins with `# NAME.py`, `# NAME.toml`, `# NAME.csv`
or `<!-- NAME.urdf -->` is a file.
What a page cannot show within a test's time stands below a comment `<!-- not run: REASON -->`, and
is read only.
"""

from __future__ import annotations

import re
import shlex
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fullam.cli import build_parser, main

FENCE = re.compile(
    r"^(<!-- not run: [^>]+ -->\n+)?```([^\n`]*)\n(.*?)^```$", re.DOTALL | re.MULTILINE
)
FILE = re.compile(r"(?:# |<!-- )([\w-]+\.(?:py|toml|csv|urdf))(?: -->)?\n")
"""First line of a block that is a file."""

NO_CODE = re.compile(r"\{[\w-]+\}.*|text")
"""Fences that hold directives, or output."""

OTHERS = ("make", "pip", "python", "dask", "openssl", "chmod", "cd", "fullam", "pytest", "apt")
"""What lines of a shell begin with. Of these only `fullam` is run."""


@dataclass(frozen=True)
class Block:
    """A block of code: its language, its text, and whether a test runs it."""

    language: str
    code: str
    run: bool

    @property
    def commands(self) -> list[list[str]]:
        """The arguments of each `fullam` command of a shell block."""
        lines = self.code.replace("\\\n", " ").splitlines() if self.language == "sh" else []
        typed = [shlex.split(line, comments=True) for line in lines]
        for words in filter(None, typed):
            if words[0] not in OTHERS:
                raise ValueError(f"'{words[0]}' is no command that this book knows")
        return [words[1:] for words in typed if words and words[0] == "fullam"]


def blocks(text: str) -> list[Block]:
    """The code blocks of a page, in order.

    Raises:
        ValueError: A block in a language that nobody runs or reads.
    """
    found = [Block(name, code, not mark) for mark, name, code in FENCE.findall(text)]
    found = [block for block in found if not NO_CODE.fullmatch(block.language)]
    for block in found:
        if block.language not in ("python", "sh", "toml", "csv", "xml"):
            known = "python, sh, toml, csv, xml or text"
            raise ValueError(f"a block of '{block.language}': give {known}")
    return found


def run_page(text: str, where: str) -> None:
    """Run what stands on a page.

    Raises:
        Exception: What the code raises; SystemExit if a command does not end well.
    """
    names: dict[str, Any] = {"__name__": "__main__"}
    for block in blocks(text):
        for command in block.commands:
            build_parser().parse_args(command)
            if block.run and main(command) != 0:
                raise SystemExit(f"{where}: fullam {shlex.join(command)} did not end well")
        if block.language == "toml":
            tomllib.loads(block.code)
        if file := FILE.match(block.code):
            Path(file[1]).write_text(block.code, encoding="utf-8")
        elif block.language == "python":
            code = compile(block.code, where, "exec")
            if block.run:
                exec(code, names)


if __name__ == "__main__":
    sys.path.insert(0, "")
    run_page(Path(sys.argv[1]).read_text(encoding="utf-8"), sys.argv[1])
