"""What `fullam.view(run)` gives: shows itself in a notebook, or serves and writes itself."""

from __future__ import annotations

import html
from pathlib import Path

from fullam.viz.viewer import export
from fullam.viz.viewer.page import film_page
from fullam.viz.viewer.replay import Film
from fullam.viz.viewer.server import ViewerServer


class View:
    """A film that can be looked at.

    Attributes:
        film: The scene and its frames.
        height: Of the notebook cell [px].
    """

    def __init__(self, film: Film, height: int = 480) -> None:
        """Keep the film; nothing is drawn yet."""
        self.film, self.height = film, height

    def html(self, path: str | Path) -> Path:
        """Write one self-contained page; see `export.write_html`."""
        return export.write_html(self.film, path)

    def png(self, path: str | Path, at: float | None = None) -> Path:
        """Write a still; see `export.write_png`."""
        return export.write_png(self.film, path, at)

    def gif(self, path: str | Path) -> Path:
        """Write an animation; see `export.write_gif`."""
        return export.write_gif(self.film, path)

    def serve(self, port: int | None = None) -> ViewerServer:
        """Show it to browsers of this machine until the server is closed; see its `url`."""
        server = ViewerServer(port)
        server.play(self.film)
        return server

    def _repr_html_(self) -> str:
        """The page in a frame of its own: it works in saved and exported notebooks, too."""
        page = html.escape(film_page(self.film), quote=True)
        return (
            f'<iframe srcdoc="{page}" style="width: 100%; height: {self.height}px; border: 0" '
            'allow="fullscreen"></iframe>'
        )

    def __repr__(self) -> str:
        """What it shows, and how."""
        return (
            f"<View of {self.film.scene['title']}, {self.film.duration:g} s: "
            ".serve(), .html(path), .png(path), .gif(path)>"
        )
