"""Figures of campaigns: median and band over seeds, paired differences, the arm configurations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.analysis.campaign import TRACE_PERIOD
from fullam.analysis.response import coordinates
from fullam.simulation.motions.references import Step
from fullam.simulation.scenarios.scenario import load_scenario
from fullam.viz import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fullam.analysis.campaign_table import CampaignTable
    from fullam.analysis.statistics import Interval
    from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

BAND = (5.0, 95.0)
"""Percentiles between which a band is drawn."""

NAMES = ("$x$", "$y$", "$z$", r"$\phi$", r"$\psi$", r"$\gamma$")

HALVES = ((slice(0, 3), "position error [mm]"), (slice(3, 6), "Euler angle error [deg]"))

Series = Sequence[tuple[str, str]]
"""(title, contender label) of what is drawn over each other."""


def figure_configurations(vehicle: Vehicle, poses_deg: Mapping[int, Sequence[float]]) -> Figure:
    """Fig. 3: the vehicle in some arm configurations, rotors as discs, the arm as a line."""
    figure = style.new_figure(style.FULL_PAGE, 2.0)
    # Three-dimensional axes leave room that no layout engine can take away.
    figure.set_layout_engine("none")
    share = 1.0 / len(poses_deg)
    for column, (number, pose) in enumerate(poses_deg.items()):
        ax: Any = figure.add_axes((column * share, -0.08, share, 0.98), projection="3d")
        _draw_vehicle(ax, vehicle, vehicle.joints.from_typed(pose))
        angles = ", ".join(f"{angle:g}" for angle in pose)
        text = f"{number}:  ({angles})°"
        figure.text((column + 0.5) * share, 0.91, text, ha="center", fontsize=style.TEXT)
    return figure


def figure_responses(
    table: CampaignTable, scenarios: Sequence[str], contender: str, tails_mm: float | None = None
) -> Figure:
    """Figs 4, 5: errors of all axes in several scenarios, one a column; median and band.

    Args:
        table: Rows with traces.
        scenarios: One a column.
        contender: Whose flights.
        tails_mm: Half the range of the position axes [mm]; None shows the whole step.
    """
    figure = style.new_figure(style.FULL_PAGE, 3.6)
    grid = style.stack(figure, 2, len(scenarios), sharey="row")
    for column, name in enumerate(scenarios):
        error = _errors(table, name, contender)
        t = np.asarray(TRACE_PERIOD * np.arange(error.shape[1]), dtype=np.float64)
        for row, (half, text) in enumerate(HALVES):
            ax = grid[row, column]
            _zero(ax)
            for i in range(3):
                _draw_band(ax, t, error[:, :, half][:, :, i], style.PALETTE[i], NAMES[3 * row + i])
            if column == 0:
                style.label(ax, text)
                style.legend(ax, columns=3)
        grid[0, column].set_title(
            f"configuration {name[-1]}", fontsize=style.TEXT, loc="right" if not column else None,
            pad=12.0,
        )  # fmt: skip
    if tails_mm is not None:
        grid[0, 0].set_ylim(-tails_mm, tails_mm)
    return figure


def figure_task(table: CampaignTable, scenario: str, series: Series) -> Figure:
    """Figs 6, 7, 9: errors of the controlled axes, several controllers over each other."""
    axes = load_scenario(scenario).axes_mask
    figure = style.new_figure(style.FULL_PAGE, 3.4)
    grid = style.stack(figure, 2, 3)
    for k, (title, contender) in enumerate(series):
        error = _errors(table, scenario, contender)
        t = np.asarray(TRACE_PERIOD * np.arange(error.shape[1]), dtype=np.float64)
        for i in range(6):
            if axes[i]:
                _draw_band(grid[i // 3, i % 3], t, error[:, :, i], style.PALETTE[k], title)
    for i in range(6):
        ax = grid[i // 3, i % 3]
        style.label(ax, f"{NAMES[i]} [{'mm' if i < 3 else 'deg'}]")
        if axes[i]:
            _zero(ax)
            _focus(ax, 4.0 if i < 3 else 0.5)
        else:
            ax.text(
                0.5, 0.5, "not controlled", transform=ax.transAxes, ha="center",
                fontsize=style.TEXT, color=style.GREY,
            )  # fmt: skip
            ax.set_yticks([])
    shown = next(i for i in range(5, -1, -1) if axes[i])
    handles, labels = grid[shown // 3, shown % 3].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper left", ncols=3, fontsize=style.TEXT, frameon=False
    )
    return figure


def figure_paired(
    rows: Sequence[tuple[str, str, tuple[Interval, ...]]], titles: Sequence[str]
) -> Figure:
    """Paired differences with their intervals, each scaled by its larger end.

    Args:
        rows: (text, unit, intervals under the two conditions).
        titles: Names of the two conditions.
    """
    figure = style.new_figure(style.FULL_PAGE, 0.5 + 0.3 * len(rows))
    ax = figure.subplots()
    style.style(ax)
    ax.axvline(0.0, color=style.BLACK, linewidth=style.THIN)
    for row, (_, unit, intervals) in enumerate(rows):
        ends = [abs(x) for v in intervals for x in (v.low, v.high) if np.isfinite(x)]
        scale = max(ends, default=1.0) or 1.0
        for k, interval in enumerate(intervals):
            if not np.isfinite(interval.estimate):
                continue
            y = row + (0.16 if k else -0.16)
            color = style.PALETTE[k]
            ax.plot(np.array([interval.low, interval.high]) / scale, [y, y], color=color, lw=2.2)
            ax.plot(
                interval.estimate / scale, y, "o", color=color, markersize=4.0,
                label=titles[k] if row == 0 else None,
            )  # fmt: skip
            ax.annotate(
                f"{interval.estimate:+.3g} {unit}", (1.06, y), xycoords=("axes fraction", "data"),
                fontsize=style.SMALL_TEXT, va="center", color=color, annotation_clip=False,
            )  # fmt: skip
    ax.set_yticks(range(len(rows)), [row[0] for row in rows], fontsize=style.TEXT)
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.set_xlim(-1.1, 1.1)
    ax.set_xticks([-1.0, 0.0, 1.0], ["Backstepping is better", "equal", "dc-PID is better"])
    ax.grid(axis="y", visible=False)
    style.legend(ax)
    return figure


def _errors(table: CampaignTable, scenario: str, contender: str) -> Array:
    """Kept motions minus the target, shape (flights, samples, 6) [mm, deg]."""
    reference = load_scenario(scenario).reference
    assert isinstance(reference, Step), "a position test"
    target = coordinates(reference.final_pose[None, :])[0]
    error = table.traces(scenario, contender) - target
    error[:, :, 3:] = (error[:, :, 3:] + 180.0) % 360.0 - 180.0
    return error


def _draw_band(ax: Axes, t: Array, samples: Array, color: str, text: str) -> None:
    """Median over flights, and the band between `BAND`; samples of shape (flights, times)."""
    present = ~np.all(np.isnan(samples), axis=0)
    t, samples = t[present], samples[:, present]
    low, middle, high = np.nanpercentile(samples, (BAND[0], 50.0, BAND[1]), axis=0)
    ax.fill_between(t, low, high, color=color, alpha=0.22, linewidth=0.0)
    ax.plot(t, middle, color=color, linewidth=style.LINE, label=text)
    ax.margins(x=0.01)


def _zero(ax: Axes) -> None:
    ax.axhline(0.0, color=style.BLACK, linewidth=style.THIN, linestyle=(0, (5, 3)), zorder=0.5)


def _focus(ax: Axes, smallest: float) -> None:
    """Scale to what is left after the transient, which would flatten the rest."""
    tails = []
    for line in ax.get_lines():
        t, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        if t.size > 2:
            tails.append(y[t > 2.0])
    for band in ax.collections:
        vertices = band.get_paths()[0].vertices
        tails.append(np.asarray(vertices)[np.asarray(vertices)[:, 0] > 2.0, 1])
    limit = 1.25 * style.largest(tails, smallest)
    ax.set_ylim(-limit, limit)


def _draw_vehicle(ax: Any, vehicle: Vehicle, theta: Array) -> None:
    """Rotors as discs with their thrust axes, the arm as a chain of joints."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    model, data = vehicle.model, vehicle.create_data()
    pin.framesForwardKinematics(model, data, vehicle.neutral(theta))
    rotors = vehicle.rotors
    around = np.linspace(0.0, 2.0 * np.pi, 40)
    gaps = np.linalg.norm(rotors.positions - np.roll(rotors.positions, 1, axis=0), axis=1)
    radius = 0.36 * float(np.min(gaps))
    for position, axis, spin in zip(rotors.positions, rotors.axes, rotors.spins, strict=True):
        side = np.cross(axis, (0.0, 0.0, 1.0) if abs(axis[2]) < 0.9 else (1.0, 0.0, 0.0))
        side /= np.linalg.norm(side)
        rim = position + radius * (
            np.outer(np.cos(around), side) + np.outer(np.sin(around), np.cross(axis, side))
        )
        color = style.BLUE if spin > 0 else style.VERMILION
        disc = Poly3DCollection([rim], facecolor=color, edgecolor=color, alpha=0.25, linewidth=0.8)
        disc.set_clip_on(False)
        ax.add_collection3d(disc)
        _line(ax, [np.zeros(3), position], style.GREY, 0.9)
        _line(ax, [position, position + 0.1 * axis], color, 1.0)
    joints = [model.getJointId(name) for name in vehicle.arm_joints]
    arm = [np.zeros(3), *(data.oMi[j].translation for j in joints)]
    arm.append(data.oMf[model.getFrameId(vehicle.tool)].translation)
    _line(ax, arm, style.BLACK, 2.6)
    _line(ax, arm[1:-1], style.BLACK, 0.0, marker="o", markerfacecolor="white", markersize=3.6)
    _line(ax, arm[-1:], style.GREEN, 0.0, marker="o", markersize=4.5)
    reach = 0.5
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), zlim=(-0.62, 0.16))
    ax.set_box_aspect((2 * reach, 2 * reach, 0.78), zoom=1.36)
    ax.view_init(elev=20.0, azim=-68.0)
    ax.set_axis_off()
    ax.patch.set_visible(False)


def _line(ax: Any, points: Sequence[Array], color: str, width: float, **options: Any) -> None:
    ax.plot(*np.array(points).T, color=color, linewidth=width, clip_on=False, **options)
