"""One look for every figure: colours for all eyes, sizes for half a column, units on the axes.

matplotlib is imported when the first figure is made, not before, and only its object-oriented
half: no display, no global state, so figures can be drawn in any thread.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK, GREY = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#E69F00",
    "#CC79A7",
    "#56B4E9",
    "#000000",
    "#8C8C8C",
)
"""Okabe and Ito's colours, told apart by all eyes; grey stands for their yellow, faint on white."""

PALETTE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK, GREY)
"""Order in which lines take their colours."""

SATURATED = "#DDDDDD"
"""Background of the spans in which the allocation met a bound."""

HALF_COLUMN, FULL_PAGE = 3.5, 7.2
"""Widths of figures [inch]."""

TEXT, SMALL_TEXT = 8.0, 7.0
"""Font sizes [pt]; readable when the figure is printed at its own size."""

LINE, THIN = 1.2, 0.7
"""Line widths [pt]."""


def new_figure(width: float, height: float, title: str = "") -> Figure:
    """An empty figure, sizes in inches."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    layout = ConstrainedLayoutEngine(w_pad=0.04, h_pad=0.03, hspace=0.02, wspace=0.03)
    figure = Figure(figsize=(width, height), dpi=150, layout=layout)
    if title:
        figure.suptitle(title, fontsize=TEXT + 1.0, x=0.01, ha="left", parse_math=False)
    return figure


def plain(text: str) -> str:
    """A name as matplotlib's text: its dollar signs are no TeX."""
    return text.replace("$", r"\$")


def stack(figure: Figure, rows: int, columns: int = 1, **options: Any) -> NDArray[Any]:
    """A grid of axes that share the time axis, styled, shape (rows, columns)."""
    grid: NDArray[Any] = figure.subplots(rows, columns, sharex=True, squeeze=False, **options)
    for ax in grid.flat:
        style(ax)
    for ax in grid[-1]:
        ax.set_xlabel("time [s]", fontsize=TEXT)
    figure.align_ylabels(grid)
    return grid


def style(ax: Axes) -> None:
    """Quiet frame, fine grid, small ticks."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(color="#E6E6E6", linewidth=0.5)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=SMALL_TEXT, length=2.5, width=0.6, pad=2.0)
    ax.locator_params(axis="y", nbins=5)
    for spine in ax.spines.values():
        spine.set_linewidth(0.6)


def label(ax: Axes, text: str) -> None:
    """Name and unit of the vertical axis."""
    ax.set_ylabel(text, fontsize=TEXT, labelpad=2.0)


def legend(ax: Axes, columns: int = 4) -> None:
    """A legend above the axes, where it covers no data; read by rows."""
    handles, labels = ax.get_legend_handles_labels()
    # matplotlib fills column by column: hand over the entries transposed.
    rows = -(-len(handles) // columns)
    columns = -(-len(handles) // rows) if rows else 1
    order = [k for c in range(columns) for k in range(c, len(handles), columns)]
    ax.legend(
        [handles[k] for k in order],
        [labels[k] for k in order],
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns,
        fontsize=SMALL_TEXT,
        frameon=False,
        handlelength=1.4,
        handletextpad=0.4,
        columnspacing=0.9,
        borderaxespad=0.0,
        borderpad=0.1,
    )


def shade(ax: Axes, t: Array, where: NDArray[np.bool_], text: str = "") -> None:
    """Shade the full height of the axes wherever `where` holds, each tick for one period."""
    if not np.any(where):
        return
    period = t[1] - t[0] if t.size > 1 else 0.0
    edges = np.flatnonzero(np.diff(np.r_[False, where, False].astype(int)))
    spans = [(t[a], t[b - 1] + period - t[a]) for a, b in edges.reshape(-1, 2)]
    ax.broken_barh(
        spans,
        (0.0, 1.0),
        transform=ax.get_xaxis_transform(),
        color=SATURATED,
        linewidth=0.0,
        zorder=0.0,
        label=text or "_",
    )


def widen(ax: Axes, smallest: float) -> None:
    """Give the vertical axis at least this range, so that a micrometre does not fill it."""
    low, high = (float(value) for value in ax.dataLim.intervaly)
    if high - low < smallest:
        middle = 0.5 * (low + high)
        ax.set_ylim(middle - 0.5 * smallest, middle + 0.5 * smallest)
    ax.ticklabel_format(axis="y", useOffset=False)


def largest(values: Sequence[Array], smallest: float) -> float:
    """Largest magnitude in any of the arrays, at least `smallest`."""
    return max([float(np.max(np.abs(v), initial=0.0)) for v in values] + [smallest])
