"""The sections of README.md that measurements write."""

from __future__ import annotations

from pathlib import Path

README = Path(__file__).parent / "README.md"


def write_section(name: str, text: str) -> None:
    """Replace what stands between the marks `<!-- name -->` and `<!-- end of name -->`.

    Raises:
        ValueError: The page has no such section.
    """
    page = README.read_text(encoding="utf-8")
    head, opened, rest = page.partition(f"<!-- {name} -->\n")
    _, closed, tail = rest.partition(f"<!-- end of {name} -->")
    if not opened or not closed:
        raise ValueError(f"{README}: section '{name}': its marks are missing; put them back")
    README.write_text(f"{head}{opened}{text.rstrip()}\n{closed}{tail}", encoding="utf-8")
