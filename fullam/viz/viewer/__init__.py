"""The three-dimensional viewer: live flights, replays, pages, pictures, sliders.

Nothing heavy is imported here; Meshcat's page, tornado and Pillow wait until they are used.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fullam.exceptions import InvalidInput

if TYPE_CHECKING:
    from fullam.model.vehicle import Vehicle
    from fullam.simulation.run import Run
    from fullam.viz.viewer.view import View
    from fullam.viz.viewer.widgets import Explorer


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
    from fullam.model.vehicle import Vehicle
    from fullam.viz.viewer.portrait import portrait
    from fullam.viz.viewer.replay import film
    from fullam.viz.viewer.view import View

    if len(subjects) == 1 and isinstance(subjects[0], Vehicle):
        return View(portrait(subjects[0], forces=forces), height)
    runs = [run for run in subjects if not isinstance(run, Vehicle)]
    if len(runs) < len(subjects):
        raise InvalidInput("view", "subjects", "mix vehicles and records", "give one vehicle alone")
    return View(film(runs, offset=offset, labels=labels), height)


def explore(vehicle: Vehicle | str = "fullam", height: int = 480) -> Explorer:
    """Sliders for arm, tilt and cant of a vehicle, with hover speeds and feasibility, live.

    Args:
        vehicle: A vehicle or its name; cant has a slider only for vehicles made from a design.
        height: Of the scene [px].

    Raises:
        MissingDependency: ipywidgets is not installed.
    """
    from fullam.viz.viewer.widgets import Explorer

    return Explorer(vehicle, height)
