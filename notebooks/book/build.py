"""Builds the book: `python notebooks/book/build.py [FOLDER]`, into `out/docs` by default.

What Sphinx reads is laid out in `out/book`: the pages written by hand, the generated ones, the
executed notebooks and the pictures. Warnings are errors, and dead references are warnings.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
LAID_OUT = ROOT / "out" / "book"
sys.path[:0] = [str(HERE), str(ROOT)]

import nbformat
from fullam_book.cells import as_page
from fullam_book.chapters import chapters
from fullam_book.executed import FOLDER, NOTEBOOKS, executed
from sphinx.cmd.build import main as sphinx


def lay_out(site: Path) -> None:
    """Write what Sphinx reads; files whose content is the same keep their time."""
    wanted: dict[Path, bytes] = {}
    for page in (HERE / "pages").rglob("*.md"):
        wanted[LAID_OUT / page.relative_to(HERE / "pages")] = page.read_bytes()
    for name, text in chapters().items():
        wanted[LAID_OUT / f"{name}.md"] = text.encode()
    for picture in (FOLDER / "images").iterdir():
        wanted[LAID_OUT / "images" / picture.name] = picture.read_bytes()
    for notebook in NOTEBOOKS:
        page = as_page(executed(notebook), notebook, site / "views", "../views")
        wanted[LAID_OUT / "notebooks" / notebook.name] = nbformat.writes(page).encode()
    for old in [path for path in LAID_OUT.rglob("*") if path.is_file()]:
        if old not in wanted:
            old.unlink()
    for path, content in wanted.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.is_file() or path.read_bytes() != content:
            path.write_bytes(content)


def main(folder: str = str(ROOT / "out" / "docs"), *options: str) -> int:
    """Build the site; the answer is an exit code."""
    site = Path(folder).resolve()
    if "-E" in options:
        shutil.rmtree(site, ignore_errors=True)
    lay_out(site)
    # One process: forks of one that has numba and ZeroMQ's threads may wait for ever.
    known = ["-W", "--keep-going", "-n", "-q", "-c", str(HERE)]
    trees = ["-d", str(ROOT / "out" / "doctrees")]
    return sphinx([*known, *trees, *options, str(LAID_OUT), str(site)])


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
