"""The figures of a flight as tables, in a terminal and in a notebook."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fullam.analysis.text_table import html_table, number, table

if TYPE_CHECKING:
    from fullam.analysis.metrics import Metrics

AXIS_ROWS = (
    ("step", "step", 2),
    ("settling time, 2 % [s]", "settling_time_s", 2),
    ("settling time, 5 % [s]", "settling_time_5_s", 2),
    ("overshoot [% of the step]", "overshoot_percent", 2),
    ("overshoot [% of the set point]", "overshoot_setpoint_percent", 2),
    ("steady error", "steady_error", 2),
    ("RMS error", "rms", 2),
    ("largest excursion", "max_excursion", 2),
    ("jitter above 2 Hz", "jitter", 3),
)
"""Rows of the table of one flight: text, field of `AxisMetrics`, digits."""

FLIGHT_ROWS = (
    ("settled", "settled", "", 0),
    ("diverged", "diverged", "", 0),
    ("settling time, 2 %", "settling_time_s", "s", 2),
    ("settling time, 5 %", "settling_time_5_s", "s", 2),
    ("settling time, 2 %, raw", "settling_time_raw_s", "s", 2),
    ("overshoot, of the step", "overshoot_percent", "%", 2),
    ("overshoot, of the step, raw", "overshoot_raw_percent", "%", 2),
    ("overshoot, of the set point", "overshoot_setpoint_percent", "%", 2),
    ("RMS position", "rms_position_mm", "mm", 2),
    ("RMS attitude", "rms_attitude_deg", "deg", 3),
    ("steady position error", "steady_position_mm", "mm", 2),
    ("steady attitude error", "steady_attitude_deg", "deg", 3),
    ("largest excursion, position", "max_excursion_mm", "mm", 2),
    ("largest excursion, attitude", "max_excursion_deg", "deg", 2),
    ("jitter above 2 Hz, position", "jitter_position_mm", "mm", 3),
    ("jitter above 2 Hz, attitude", "jitter_attitude_deg", "deg", 3),
    ("saturated ticks", "saturated_share", "%", 1),
    ("thrust sum over weight", "effort", "", 3),
    ("RMS of the tool from its path", "tool_rms_mm", "mm", 2),
)
"""Rows of a table of flights: text, field of `Metrics`, unit, digits."""


def axes_rows(metrics: Metrics) -> tuple[list[str], list[list[str]]]:
    """Header and rows of one flight, one column a controlled axis."""
    header = ["", *(f"{name} [{axis.unit}]" for name, axis in metrics.axes.items())]
    rows = [
        [text, *(number(getattr(axis, field), digits) for axis in metrics.axes.values())]
        for text, field, digits in AXIS_ROWS
    ]
    return header, rows


def figures_of(flights: Sequence[Metrics]) -> list[tuple[str, str, str, int]]:
    """`FLIGHT_ROWS`, the tool's only where one of the flights has a task for it."""
    has_tool = any(metrics.tool_rms_mm is not None for metrics in flights)
    return [row for row in FLIGHT_ROWS if has_tool or row[1] != "tool_rms_mm"]


def flight_rows(metrics: Metrics) -> list[list[str]]:
    """One flight as a whole: text, figure, unit."""
    return [
        [text, cell(metrics, field, digits), unit]
        for text, field, unit, digits in figures_of([metrics])
    ]


def axes_table(metrics: Metrics) -> str:
    """One flight, one column a controlled axis."""
    header, rows = axes_rows(metrics)
    return table(rows, header)


def summary(metrics: Metrics) -> str:
    """One flight as a whole, one figure a line."""
    rows = flight_rows(metrics)
    width = max(len(value) for _, value, _ in rows)
    return table([(text, value.rjust(width), unit) for text, value, unit in rows], left=3)


def as_text(metrics: Metrics) -> str:
    """Both tables."""
    return f"{axes_table(metrics)}\n\n{summary(metrics)}"


def as_html(metrics: Metrics) -> str:
    """Both tables, for a notebook."""
    header, rows = axes_rows(metrics)
    return f"{html_table(rows, header)}{html_table(flight_rows(metrics))}"


def cell(metrics: Metrics, field: str, digits: int) -> str:
    """A figure of a flight; shares in percent."""
    value = getattr(metrics, field)
    return number(100.0 * value if field.endswith("_share") else value, digits)
