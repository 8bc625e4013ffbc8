"""What `fullam.view(run)` gives: shows itself in a notebook, or serves and writes itself."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path

from fullam.exceptions import InvalidInput
from fullam.model.vehicle import Vehicle
from fullam.simulation.run import Run
from fullam.viz.viewer import export
from fullam.viz.viewer.page import film_page
from fullam.viz.viewer.portrait import portrait
from fullam.viz.viewer.replay import Film, film
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


def view(
    *subjects: Run | Vehicle,
    offset: float | Sequence[float] | None = None,
    labels: Sequence[str] | None = None,
    height: int = 480,
    forces: bool = False,
) -> View:
    """Look at one record, at several side by side, or at a vehicle as it hovers.

    In a notebook the last expression of a cell shows itself; elsewhere call `serve()`,
    `html(path)`, `png(path)` or `gif(path)` of the result.

    Args:
        subjects: The record or records, which start together, or one vehicle.
        offset: How far apart they are drawn [m], to the right in the picture; or a vector [m].
        labels: Their names on the page; by default the controllers'.
        height: Of the cell [px].
        forces: For a vehicle, draw the forces that it attains about the platform.

    Raises:
        InvalidInput: No record, one without a tick, not one label a record, or a vehicle among
            records.
    """
    if len(subjects) == 1 and isinstance(subjects[0], Vehicle):
        return View(portrait(subjects[0], forces=forces), height)
    runs = [run for run in subjects if not isinstance(run, Vehicle)]
    if len(runs) < len(subjects):
        raise InvalidInput("view", "subjects", "mix vehicles and records", "give one vehicle alone")
    return View(film(runs, offset=offset, labels=labels), height)
