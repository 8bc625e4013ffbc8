"""The API: the public names, and every module by room."""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType
from typing import Any

import fullam
from fullam_book.tables import summary

ROOMS = {
    "numbers": "what a kernel computes with",
    "model": "what the vehicle is",
    "dynamics": "how it moves",
    "control": "what it is told",
    "simulation": "what happens",
    "analysis": "what it means",
    "viz": "what one sees",
}
"""The rooms of the code, from the bottom up."""

UNSHOWN = ("fullam.__main__", "fullam.cli")
"""What has a page of its own, the command line."""


def pages() -> dict[str, str]:
    """The public names, a page a room, and a page a module."""
    modules = [m for m in module_names() if not m.startswith(UNSHOWN)]
    rooms = {room: [m for m in modules if _room(m) == room] for room in ("", *ROOMS)}
    pages = {"api/index": index(rooms[""])}
    for room, about in ROOMS.items():
        pages[f"api/{room}"] = room_page(room, about, rooms[room])
    for module in modules:
        pages[f"api/{module}"] = module_page(module)
    return pages


def module_names() -> list[str]:
    """Dotted names of all modules of the package; a folder is shown by its modules."""
    found = pkgutil.walk_packages(fullam.__path__, "fullam.")
    return sorted(m.name for m in found if not m.ispkg)


def _module(name: str) -> ModuleType:
    return importlib.import_module(name)


def _room(module: str) -> str:
    parts = module.split(".")
    return parts[1] if len(parts) > 2 or parts[1] in ROOMS else ""


def index(others: list[str]) -> str:
    """What `import fullam` gives, and the rooms."""
    rows = "\n".join(f"| {link(name)} | {summary(getattr(fullam, name))} |" for name in names())
    rooms = "\n".join(f"fullam.{room} <{room}>" for room in ROOMS)
    more = "\n".join(f"| [`{m}`]({m}.md) | {summary(_module(m))} |" for m in others)
    return f"""# API

What `import fullam` gives:

| name | |
|---|---|
{rows}

Everything else, room by room; rooms import downwards only.

| room | |
|---|---|
{chr(10).join(f"| [`fullam.{room}`]({room}.md) | {what} |" for room, what in ROOMS.items())}

Beside the rooms:

| module | |
|---|---|
{more}

```{{toctree}}
:hidden:

{rooms}
```
"""


def names() -> list[str]:
    """The public names."""
    return sorted(name for name in fullam.__all__ if not name.startswith("__"))


def link(name: str) -> str:
    """A link to where a public name is explained."""
    target: Any = getattr(fullam, name)
    return f"{{py:obj}}`fullam.{name} <{target.__module__}.{target.__qualname__}>`"


def room_page(room: str, about_it: str, modules: list[str]) -> str:
    """A room and its modules."""
    rows = "\n".join(
        f"| [`{m.removeprefix('fullam.')}`]({m}.md) | {summary(_module(m))} |" for m in modules
    )
    return f"""# fullam.{room}

{about_it[0].upper()}{about_it[1:]}.

| module | |
|---|---|
{rows}
"""


def module_page(module: str) -> str:
    """A module's own page; in no table of contents, which would be on every page."""
    room = _room(module)
    above = f"[fullam.{room}]({room}.md)" if room else "[API](index.md)"
    return f"""---
orphan: true
---

{above}

# {module.rpartition(".")[2]}

```{{eval-rst}}
.. automodule:: {module}
```
"""
