"""Figures of flights: pose, attitude, rotors, compensation, residual, all at once, side by side.

Each `figure_...` function takes a run and returns a matplotlib figure, half a column wide;
`overview` and `compare` fill a page's width. `FIGURES` lists those of one run by name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.captions import caption, weather_caption
from fullam.analysis.response import Response, coordinates
from fullam.exceptions import InvalidInput
from fullam.files import atomic_path
from fullam.simulation.scenarios.scenario import AXES
from fullam.viz import style, touch_figures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fullam.simulation.record.run import Run

Array = NDArray[np.float64]

AXIS_LABELS = ("x [m]", "y [m]", "z [m]", r"$\phi$ [deg]", r"$\psi$ [deg]", r"$\gamma$ [deg]")

SMALLEST_RANGE = (0.05, 2.0)
"""Smallest range that an axis shows of a coordinate [m, deg]."""

ERROR_FLOOR = (0.1, 0.01)
"""Smallest error that `compare` shows on its logarithmic axes [mm, deg]."""


def figure_pose(run: Run) -> Figure:
    """Position against its reference, and the error."""
    figure = style.new_figure(style.HALF_COLUMN, 4.6, caption(run))
    grid = style.stack(figure, 4)[:, 0]
    draw_coordinates(grid[:3], run, range(3))
    draw_error(grid[3], run, range(3), "error [mm]")
    return figure


def figure_attitude(run: Run) -> Figure:
    """Euler angles against their reference, and the error."""
    figure = style.new_figure(style.HALF_COLUMN, 4.6, caption(run))
    grid = style.stack(figure, 4)[:, 0]
    draw_coordinates(grid[:3], run, range(3, 6))
    draw_error(grid[3], run, range(3, 6), "error [deg]")
    return figure


def figure_rotors(run: Run) -> Figure:
    """Rotor speeds between their bounds."""
    figure = style.new_figure(style.HALF_COLUMN, 2.6, caption(run))
    draw_rotors(style.stack(figure, 1)[0, 0], run)
    return figure


def figure_compensation(run: Run) -> Figure:
    """The compensation wrench u_dc, eq. (20)."""
    figure = style.new_figure(style.HALF_COLUMN, 3.2, caption(run))
    grid = style.stack(figure, 2)[:, 0]
    draw_wrench(grid, run, run.u_dc, r"$u_{dc}$")
    return figure


def figure_residual(run: Run) -> Figure:
    """What the allocation could not deliver, delivered minus commanded, in {A} axes."""
    figure = style.new_figure(style.HALF_COLUMN, 3.2, caption(run))
    grid = style.stack(figure, 2)[:, 0]
    draw_wrench(grid, run, run.residual, "residual", saturation=True)
    return figure


def overview(run: Run) -> Figure:
    """Everything about one flight on one page; joints and contact where a record has them."""
    free = touch_figures.has_servos(run)
    figure = style.new_figure(style.FULL_PAGE, 9.8 if free else 8.6, caption(run))
    rows = 8 if free else 7
    grid = style.stack(figure, rows, 2, height_ratios=[1.0] * (rows - 1) + [1.4])
    draw_coordinates(grid[:3, 0], run, range(3))
    draw_coordinates(grid[:3, 1], run, range(3, 6))
    draw_error(grid[3, 0], run, range(3), "error [mm]")
    draw_error(grid[3, 1], run, range(3, 6), "error [deg]")
    draw_wrench(grid[4], run, run.u_dc, r"$u_{dc}$")
    draw_wrench(grid[5], run, run.residual, "residual", saturation=True)
    if free:
        touches = touch_figures.has_contact(run)
        draw = touch_figures.draw_contact if touches else touch_figures.draw_arm
        draw(grid[6, 0], run)
        touch_figures.draw_torques(grid[6, 1], run)
    draw_rotors(grid[-1, 0], run)
    draw_effort(grid[-1, 1], run)
    return figure


def compare(runs: Sequence[Run], labels: Sequence[str] | None = None) -> Figure:
    """Several flights of one scenario over each other: pose, attitude and the size of the errors.

    Args:
        runs: The flights, at least one; the first one's reference is drawn.
        labels: One name a run; by default the controllers' names.
    """
    names = list(labels or [run.controller for run in runs])
    title = f"{runs[0].scenario.name}: {weather_caption(runs[0])}"
    figure = style.new_figure(style.FULL_PAGE, 6.0, title)
    grid = style.stack(figure, 4, 2, height_ratios=(1, 1, 1, 1.4))
    for j, run in enumerate(runs):
        color = style.PALETTE[j % len(style.PALETTE)]
        pose, response = _shown(run.pose), Response.of(run)
        for i in range(6):
            grid[i % 3, i // 3].plot(
                run.t, pose[:, i], color=color, linewidth=style.LINE, label=style.plain(names[j])
            )
        for k, error in enumerate((response.error[:, :3], response.rotation)):
            size = np.maximum(np.linalg.norm(error, axis=1), ERROR_FLOOR[k])
            grid[3, k].semilogy(
                response.start + response.t, size, color=color, linewidth=style.LINE
            )
    reference = _shown(runs[0].reference_pose)
    for i in range(6):
        ax = grid[i % 3, i // 3]
        _draw_reference(ax, runs[0].t, reference[:, i])
        style.label(ax, AXIS_LABELS[i])
        style.widen(ax, SMALLEST_RANGE[i // 3])
    style.legend(grid[0, 1], columns=len(runs) + 1)
    style.label(grid[3, 0], "position error [mm]")
    style.label(grid[3, 1], "attitude error [deg]")
    return figure


FIGURES: dict[str, Callable[[Run], Figure]] = {
    "overview": overview,
    "pose": figure_pose,
    "attitude": figure_attitude,
    "rotors": figure_rotors,
    "compensation": figure_compensation,
    "residual": figure_residual,
}
"""Figures of one run, by name."""


def save_figure(figure: Figure, path: str | Path, dpi: float = 200.0) -> Path:
    """Write a figure, atomically; the suffix chooses the format.

    Raises:
        InvalidInput: No format has that suffix; the message lists the known ones.
    """
    path = Path(path)
    known = sorted(figure.canvas.get_supported_filetypes())
    if path.suffix.lower().removeprefix(".") not in known:
        raise InvalidInput(
            str(path),
            "suffix",
            f"'{path.suffix}' names no format",
            f"use one of {', '.join(known)}",
        )
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=dpi, facecolor="white")
    return path


def _shown(pose: Array) -> Array:
    """Coordinates in the units of `AXIS_LABELS` [m, deg], shape (N, 6)."""
    return coordinates(pose) * np.repeat([1e-3, 1.0], 3)


def _draw_reference(ax: Axes, t: Array, values: Array) -> None:
    ax.plot(
        t,
        values,
        color=style.BLACK,
        linewidth=style.THIN,
        linestyle=(0, (5, 3)),
        label="reference",
        zorder=3.0,
    )


def draw_coordinates(axes: NDArray[np.object_], run: Run, which: range) -> None:
    """Measured, true and reference values of three coordinates, one each."""
    told, true, asked = (_shown(pose) for pose in (run.measured_pose, run.pose, run.reference_pose))
    for ax, i in zip(axes, which, strict=True):
        color = style.PALETTE[i % 3]
        ax.plot(run.t, told[:, i], color=style.GREY, linewidth=style.THIN, label="measured")
        ax.plot(run.t, true[:, i], color=color, linewidth=style.LINE, label="true")
        _draw_reference(ax, run.t, asked[:, i])
        style.label(ax, AXIS_LABELS[i])
        style.widen(ax, SMALLEST_RANGE[i // 3])
        _mark_end(ax, run)
    style.legend(axes[0])


def draw_error(ax: Axes, run: Run, which: range, text: str) -> None:
    """Errors of the controlled coordinates, scaled to their steady part."""
    response, axes = Response.of(run), run.scenario.axes
    shown = [i for i in which if AXES[i] in axes]
    ax.axhline(0.0, color=style.BLACK, linewidth=style.THIN, linestyle=(0, (5, 3)))
    for i in shown:
        ax.plot(
            response.start + response.t,
            response.error[:, i],
            color=style.PALETTE[i % 3],
            linewidth=style.LINE,
            label=AXIS_LABELS[i].split(" [")[0],
        )
    # A step starts far outside; what is held is shown in full.
    parts = [response.error[response.steady if response.step[i] else slice(None), i] for i in shown]
    limit = 1.5 * style.largest(parts, smallest=0.4 if which.start == 0 else 0.04)
    ax.set_ylim(-limit, limit)
    style.label(ax, text)
    style.legend(ax)
    _mark_end(ax, run)


def draw_wrench(
    axes: NDArray[np.object_], run: Run, wrench: Array, name: str, saturation: bool = False
) -> None:
    """Force on the first, moment on the second of two axes."""
    for ax, half, unit in zip(axes, (wrench[:, :3], wrench[:, 3:]), ("N", "N m"), strict=True):
        if saturation:
            style.shade(ax, run.t, run.saturated, "saturated")
        for i, letter in enumerate("xyz"):
            ax.plot(run.t, half[:, i], color=style.PALETTE[i], linewidth=style.THIN, label=letter)
        if not np.any(np.abs(half) > 1e-6):
            ax.set_ylim(-1.0, 1.0)
        style.label(ax, f"{name} [{unit}]")
        style.legend(ax)
        _mark_end(ax, run)


def draw_rotors(ax: Axes, run: Run) -> None:
    """Rotor speeds, their bounds, and when a bound was met."""
    speeds, bounds = run.rotor_speeds, run.vehicle.rotors.max_speeds
    for i in range(speeds.shape[1]):
        ax.plot(
            run.t,
            speeds[:, i],
            color=style.PALETTE[i % len(style.PALETTE)],
            linestyle="-" if i < len(style.PALETTE) else ":",
            linewidth=style.THIN,
            label=f"{i + 1}",
        )
    for k, bound in enumerate(np.unique(np.r_[0.0, bounds])):
        _draw_bound(ax, bound, "_" if k else "bounds")
    style.shade(ax, run.t, run.saturated, "saturated")
    ax.set_ylim(-0.04 * bounds.max(), 1.05 * bounds.max())
    style.label(ax, "rotor speed [rad/s]")
    style.legend(ax, columns=5)
    _mark_end(ax, run)


def draw_effort(ax: Axes, run: Run) -> None:
    """Sum of the thrusts over the weight, and what all rotors at their largest speed give."""
    vehicle = run.vehicle
    thrusts = np.square(run.rotor_speeds) * vehicle.rotors.k_f
    style.shade(ax, run.t, run.saturated)
    total = thrusts.sum(axis=1) / (vehicle.mass * vehicle.gravity)
    available = vehicle.rotors.max_thrusts.sum() / (vehicle.mass * vehicle.gravity)
    ax.plot(run.t, total, color=style.BLUE, linewidth=style.LINE, label="used")
    _draw_bound(ax, available, "available")
    ax.set_ylim(0.0, 1.05 * available)
    style.label(ax, "thrust sum / weight")
    style.legend(ax)
    _mark_end(ax, run)


def _draw_bound(ax: Axes, value: float, text: str) -> None:
    ax.axhline(value, color=style.BLACK, linewidth=style.THIN, linestyle=(0, (1, 1.5)), label=text)


def _mark_end(ax: Axes, run: Run) -> None:
    """Where a diverged flight broke off."""
    if run.diverged:
        ax.axvline(run.t[-1], color=style.VERMILION, linewidth=style.LINE)
    ax.margins(x=0.01)
