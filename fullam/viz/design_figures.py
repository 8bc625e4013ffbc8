"""Figures of a design study: the front of two aims, and the layout that was found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fullam.analysis.design_search import Found
from fullam.viz import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LABELS = {
    "worst-tilt": "worst tilt [deg]",
    "level-force": "level force / weight",
    "failure-tilt": "worst tilt with a rotor stopped [deg]",
    "failure-margin": "margin with a rotor stopped / weight",
    "efficiency": "hover efficiency",
}


def figure_front(front: Sequence[Found]) -> Figure:
    """The objective over the hover efficiency: what was found, and uniform rings beside it."""
    figure = style.new_figure(style.HALF_COLUMN * 1.4, 2.8)
    ax = figure.subplots()
    style.style(ax)
    name = front[0].search.objective
    for layouts, text, colour, marker in (
        ([found.best for found in front], "found", style.BLUE, "o"),
        ([found.ring for found in front], "uniform ring", style.VERMILION, "s"),
    ):
        points = np.array([[each.merit.efficiency, each.merit.of(name)] for each in layouts])
        points = points[np.argsort(points[:, 0])]
        ax.plot(
            points[:, 0], points[:, 1], color=colour, marker=marker, markersize=3.5,
            linewidth=style.LINE, label=text,
        )  # fmt: skip
    ax.set_xlabel("hover efficiency (weight over the least sum of thrusts)", fontsize=style.TEXT)
    style.label(ax, LABELS[name])
    style.legend(ax, columns=2)
    return figure
