"""What `fullam.view(run)` gives: shows itself in a notebook, or serves and writes itself."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path

from fullam.exceptions import FullamError, InvalidInput
from fullam.model.vehicle import Vehicle
from fullam.simulation.record.run import Run
from fullam.viz.viewer import export
from fullam.viz.viewer.frame import in_a_frame
from fullam.viz.viewer.page import film_page
from fullam.viz.viewer.portrait import portrait
from fullam.viz.viewer.replay import Film, film
from fullam.viz.viewer.server import ViewerServer
from fullam.viz.viewer.sketch import sketch_page

MOST_SERVED = 16
"""Views that are served to cells at a time."""

SERVED: deque[ViewerServer] = deque()
"""Who serves them, the oldest first. A view that was displayed may be gone when its page asks."""


class View:
    """A film that can be looked at.

    Attributes:
        film: The scene and its frames.
        height: Of the notebook cell [px].
        embed: Whether a cell holds the whole page, above a megabyte, which plays in 3D anywhere.
    """

    def __init__(self, film: Film, height: int = 480, embed: bool = False) -> None:
        """Keep the film; nothing is drawn yet."""
        self.film, self.height, self.embed = film, height, embed
        self._served: ViewerServer | None = None

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
        """A page in a frame of its own: below 100 kB, unless all is to be embedded.

        In a live notebook it shows the scene, which this process serves to this machine, as it does
        the last `MOST_SERVED` ones. Elsewhere, as in an exported notebook, it plays as a line
        drawing.
        """
        if self.embed:
            return in_a_frame(film_page(self.film), self.height)
        return in_a_frame(sketch_page(self.film, self._server()), self.height)

    def _server(self) -> ViewerServer | None:
        """Who plays the film to cells; None where nothing can be served."""
        if self._served not in SERVED:
            try:
                # A notebook's page may come through its server, under that one's name.
                self._served = ViewerServer(0, hosts=("*",))
            except (FullamError, OSError):
                return None
            self._served.play(self.film)
            SERVED.append(self._served)
            while len(SERVED) > MOST_SERVED:
                SERVED.popleft().close()
        return self._served

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
    embed: bool = False,
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
        embed: In a notebook, put the whole page into the cell, above a megabyte: it shows the
            scene in exported notebooks, too, where otherwise a line drawing plays.

    Raises:
        InvalidInput: No record, one without a tick, not one label a record, or a vehicle among
            records.
    """
    if len(subjects) == 1 and isinstance(subjects[0], Vehicle):
        return View(portrait(subjects[0], forces=forces), height, embed)
    runs = [run for run in subjects if not isinstance(run, Vehicle)]
    if len(runs) < len(subjects):
        raise InvalidInput("view", "subjects", "mix vehicles and records", "give one vehicle alone")
    return View(film(runs, offset=offset, labels=labels), height, embed)
