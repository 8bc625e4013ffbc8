"""Executed notebooks as pages of the book.

A view of a flight is a whole page, of some megabytes, in a frame; in the book it becomes a file of
its own, which a still (the one that the committed notebook keeps) stands for until it is clicked.
What cells say on stderr stays out: once on each machine, that machine code is compiled. A test
refuses whatever else they say there.
"""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import Any

import nbformat

WIDGET = "application/vnd.jupyter.widget-view+json"
FRAME = re.compile(r'<iframe srcdoc="([^"]*)" style="([^"]*)"[^>]*></iframe>')


def as_page(executed: Any, committed: Path, views: Path, root: str) -> Any:
    """The notebook with its views moved out, and without stderr.

    Args:
        executed: The notebook with fresh outputs; it is changed.
        committed: The notebook as committed, with its stills.
        views: Folder for the views.
        root: How a page reaches that folder.
    """
    cells = nbformat.read(committed, as_version=4).cells
    stills = {cell["id"]: picture for cell in cells if (picture := still(cell))}
    for cell in executed.cells:
        if "outputs" in cell:
            cell["outputs"] = [o for o in cell["outputs"] if o.get("name") != "stderr"]
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            if data.pop(WIDGET, None) and cell["id"] in stills:  # sliders need a kernel
                data["image/jpeg"] = stills[cell["id"]]
            match = FRAME.search("".join(data.get("text/html", "")))
            if match is None:
                continue
            views.mkdir(parents=True, exist_ok=True)
            name = f"{committed.stem}-{cell['id']}.html"
            (views / name).write_text(html.unescape(match[1]), encoding="utf-8")
            data.clear()
            data["text/html"] = frame(f"{root}/{name}", match[2], stills.get(cell["id"]))
    executed.metadata.pop("widgets", None)
    return executed


def still(cell: Any) -> str | None:
    """The picture that a committed cell keeps, as base64."""
    found = [o["data"]["image/jpeg"] for o in cell.get("outputs", ()) if "image/jpeg" in
             o.get("data", {})]  # fmt: skip
    return "".join(found[0]).replace("\n", "") if found else None


def frame(address: str, style: str, picture: str | None) -> str:
    """A still that becomes the view on a click, or the view at once where there is no still."""
    if picture is None:
        return f'<iframe class="view" src="{address}" style="{style}" loading="lazy"></iframe>'
    return (
        f'<button class="view" data-view="{address}" data-style="{html.escape(style)}">'
        f'<img alt="A still of the view" src="data:image/jpeg;base64,{picture}">'
        "<span>&#9654; Open the view: turn it, play it</span></button>"
    )
