"""The figures of `benchmarks/README.md`, as they stand there."""

from __future__ import annotations

import re
from pathlib import Path

README = Path(__file__).resolve().parents[3] / "benchmarks" / "README.md"


def pages() -> dict[str, str]:
    """The page as it is, without the marks between which measurements write."""
    text = README.read_text(encoding="utf-8")
    return {"reference/benchmarks": re.sub(r"<!--.*?-->\n?", "", text)}
