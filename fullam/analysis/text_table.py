"""Tables as text and as HTML."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape


def table(rows: Sequence[Sequence[str]], header: Sequence[str] = (), left: int = 1) -> str:
    """Rows as text in aligned columns.

    Args:
        rows: Cells; every row as long as the header.
        header: Names of the columns, underlined; none by default.
        left: How many columns, from the first, are aligned to the left; the others are numbers.
    """
    lines = [list(row) for row in ([header] if header else []) + list(rows)]
    if not lines:
        return ""
    widths = [max(len(cell) for cell in column) for column in zip(*lines, strict=True)]
    text = [
        "  ".join(
            cell.ljust(width) if k < left else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]
    if header:
        text.insert(1, "-" * (sum(widths) + 2 * (len(widths) - 1)))
    return "\n".join(text)


def html_table(rows: Sequence[Sequence[str]], header: Sequence[str] = ()) -> str:
    """Rows as an HTML table, every cell escaped; the first column is aligned to the left."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join(
        "<tr>"
        + "".join(
            f'<td style="text-align: {"right" if k else "left"}">{escape(cell)}</td>'
            for k, cell in enumerate(row)
        )
        + "</tr>"
        for row in rows
    )
    return f"<table>{f'<tr>{head}</tr>' if header else ''}{body}</table>"


def number(value: float | bool | None, digits: int = 2) -> str:
    """A cell: fixed digits, yes or no, or a dash for what does not exist."""
    if value is None or value != value:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.{digits}f}"
