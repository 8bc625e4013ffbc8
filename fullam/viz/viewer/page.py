"""The page: Meshcat's viewer with fullam's scene, as one text or as files to serve."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

from fullam.exceptions import MissingDependency
from fullam.viz.viewer.replay import Film

HERE = Path(__file__).resolve().parent
SCRIPTS = (
    *("shapes.js", "quality.js", "camera.js", "page.js", "charts.js", "layers.js", "gizmo.js"),
    *("hands.js", "panel.js"),
)


def meshcat_script() -> Path:
    """Meshcat's viewer, as its package brings it.

    Only the file is wanted: importing the package would pull in IPython and a server that listens
    on every interface.

    Raises:
        MissingDependency: Meshcat is not installed.
    """
    found = importlib.util.find_spec("meshcat")
    for folder in (found and found.submodule_search_locations) or ():
        path = Path(folder) / "viewer" / "dist" / "main.min.js"
        if path.is_file():
            return path
    raise MissingDependency("the three-dimensional viewer", "meshcat", "notebook")


def served_page() -> str:
    """The page whose scripts the server brings and which connects to the server."""
    names = ("meshcat.js", *SCRIPTS)
    tags = [f'<script src="{name}"></script>' for name in names]
    return _fill([*tags, "<script>fullam.connect();</script>"])


def film_page(film: Film, *, play: bool = True, mode: str = "") -> str:
    """One self-contained page that plays a film; it needs no network.

    Args:
        film: The film.
        play: Start when the page is opened.
        mode: "still" leaves out the player, "bare" heading and legend as well.
    """
    scripts = [meshcat_script(), *(HERE / name for name in SCRIPTS)]
    tags = [f"<script>{_inline(path.read_text(encoding='utf-8'))}</script>" for path in scripts]
    start = [f"fullam.load({_json(film.scene)});", f"fullam.film({_json(film.to_dict())});"]
    start.append("fullam.play();" if play else "")
    start.append(f"document.body.classList.add({_json(mode)});" if mode else "")
    return _fill([*tags, f"<script>{''.join(start)}</script>"])


def _fill(scripts: list[str]) -> str:
    page = (HERE / "page.html").read_text(encoding="utf-8")
    style = (HERE / "page.css").read_text(encoding="utf-8")
    return page.replace("{{style}}", style).replace("{{scripts}}", "\n".join(scripts))


def _inline(script: str) -> str:
    return script.replace("</script", "<\\/script")


def _json(value: Any) -> str:
    """JSON inside a <script>: "<!--<script>" in a name must not open a comment there."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")
