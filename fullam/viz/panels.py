"""Figures put together from panels by name: what `fullam plot --what` draws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fullam.exceptions import UnknownName
from fullam.viz import figures, style, touch_figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fullam.simulation.record.run import Run

ROW_HEIGHT, EXTRA_HEIGHT = 0.95, 0.75
"""Height of an axes, and of title and time axis together [inch]."""

Draw = Callable[[NDArray[np.object_], "Run"], None]


@dataclass(frozen=True)
class Panel:
    """Some axes under each other.

    Attributes:
        rows: How many axes it takes.
        draw: Draws a run on them.
    """

    rows: int
    draw: Draw


def _pose(axes: NDArray[np.object_], run: Run) -> None:
    figures.draw_coordinates(axes, run, range(3))


def _attitude(axes: NDArray[np.object_], run: Run) -> None:
    figures.draw_coordinates(axes, run, range(3, 6))


def _errors(axes: NDArray[np.object_], run: Run) -> None:
    figures.draw_error(axes[0], run, range(3), "error [mm]")
    figures.draw_error(axes[1], run, range(3, 6), "error [deg]")


def _rotors(axes: NDArray[np.object_], run: Run) -> None:
    figures.draw_rotors(axes[0], run)


def _effort(axes: NDArray[np.object_], run: Run) -> None:
    figures.draw_effort(axes[0], run)


def _wrench(axes: NDArray[np.object_], run: Run) -> None:
    figures.draw_wrench(axes, run, run.rotor_wrench, "rotor wrench", saturation=True)


def _command(axes: NDArray[np.object_], run: Run) -> None:
    figures.draw_wrench(axes, run, run.command, "command", saturation=True)


def _compensation(axes: NDArray[np.object_], run: Run) -> None:
    figures.draw_wrench(axes, run, run.u_dc, r"$u_{dc}$")


def _residual(axes: NDArray[np.object_], run: Run) -> None:
    figures.draw_wrench(axes, run, run.residual, "residual", saturation=True)


def _contact(axes: NDArray[np.object_], run: Run) -> None:
    touch_figures.draw_contact(axes[0], run)


def _joints(axes: NDArray[np.object_], run: Run) -> None:
    touch_figures.draw_arm(axes[0], run)


def _torques(axes: NDArray[np.object_], run: Run) -> None:
    touch_figures.draw_torques(axes[0], run)


PANELS = {
    "pose": Panel(3, _pose),
    "attitude": Panel(3, _attitude),
    "errors": Panel(2, _errors),
    "rotors": Panel(1, _rotors),
    "effort": Panel(1, _effort),
    "wrench": Panel(2, _wrench),
    "command": Panel(2, _command),
    "compensation": Panel(2, _compensation),
    "residual": Panel(2, _residual),
    "contact": Panel(1, _contact),
    "joints": Panel(1, _joints),
    "torques": Panel(1, _torques),
}
"""Panels by name: position, Euler angles, errors of both, rotor speeds, thrusts over weight, the
true wrench of the rotors, the commanded one, the compensation, what was not delivered; and of
flights on servos the tool's push, the errors of the joints and their torques."""


def plot(run: Run, what: Sequence[str] = ("pose", "rotors", "wrench")) -> Figure:
    """Panels under each other over one time axis, half a column wide.

    Args:
        run: The record.
        what: Names out of `PANELS`, from the top.

    Raises:
        UnknownName: There is no such panel.
        InvalidInput: The record does not have what a panel shows.
    """
    for name in what:
        if name not in PANELS:
            raise UnknownName("panel", name, PANELS)
    chosen = [PANELS[name] for name in what]
    rows = sum(panel.rows for panel in chosen)
    height = EXTRA_HEIGHT + ROW_HEIGHT * max(rows, 2)
    figure = style.new_figure(style.HALF_COLUMN, height, figures.caption(run))
    grid = style.stack(figure, rows)[:, 0]
    at = 0
    for panel in chosen:
        panel.draw(grid[at : at + panel.rows], run)
        at += panel.rows
    return figure
