"""The notebooks, executed; anew only when they or the code that they run have changed."""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import nbclient
import nbformat

ROOT = Path(__file__).resolve().parents[3]
FOLDER = ROOT / "notebooks"
NOTEBOOKS = tuple(sorted(FOLDER.glob("*.ipynb")))
KEPT = ROOT / "out" / "executed"

LONGEST = 60.0
"""No cell may keep its reader waiting longer than this [s]."""

RUN = ("*.py", "*.toml", "*.urdf", "*.js", "*.css", "*.html")
"""Files of the package and the vehicles that a notebook's outputs depend on."""


def digest(notebook: Path) -> str:
    """Of the notebook and of all that it may run: this code, the packages, Python."""
    packages = sorted(f"{d.name} {d.version}" for d in importlib.metadata.distributions())
    found = hashlib.sha256("\n".join([sys.version, *packages]).encode())
    files = {path for room in ("fullam", "urdf") for g in RUN for path in (ROOT / room).rglob(g)}
    for path in (notebook, *sorted(files)):
        found.update(path.read_bytes())
    return found.hexdigest()[:16]


def executed(notebook: Path) -> Any:
    """A notebook with the outputs of this code, run from top to bottom in an empty folder.

    Raises:
        nbclient.exceptions.CellExecutionError: A cell raised.
    """
    kept = KEPT / f"{notebook.stem}-{digest(notebook)}.ipynb"
    if kept.is_file():
        return nbformat.read(kept, as_version=4)
    content = nbformat.read(notebook, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        environment = {k: v for k, v in os.environ.items() if k != "DISPLAY"}
        environment |= {"IPYTHONDIR": folder, "PYTHONPATH": str(ROOT)}
        client = nbclient.NotebookClient(
            content,
            kernel_name="python3",
            timeout=LONGEST,
            extra_arguments=["--log-level=ERROR"],
            resources={"metadata": {"path": folder}},
        )
        client.execute(env=environment)
    keep(content, kept)
    return content


def keep(content: Any, path: Path) -> None:
    """Write it where the next one finds it, in place of older ones of the same notebook."""
    path.parent.mkdir(parents=True, exist_ok=True)
    for old in path.parent.glob(f"{path.stem.rpartition('-')[0]}-*.ipynb"):
        old.unlink(missing_ok=True)
    unfinished = path.with_suffix(f".{os.getpid()}")
    nbformat.write(content, unfinished)
    unfinished.replace(path)
