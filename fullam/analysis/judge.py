"""Who judges flights: what one plan asks, tabulated once, and the figures of flights in lanes.

A campaign makes one `Judge` a plan, which threads share, and from it one `TrackJudge` for each
track that flights are written to. `metrics` defines the figures.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.asked_motion import STEP_MINIMUM, AskedMotion
from fullam.analysis.figure_records import (
    AxisFigures,
    AxisTerms,
    FlightFigures,
    FlightTerms,
    SignalFigures,
    Terms,
)
from fullam.analysis.figures import FigureProgram
from fullam.analysis.high_pass import sections
from fullam.analysis.response import JITTER_FREQUENCY, Path, path_numbers, rows_inside, window
from fullam.analysis.tool_error import AskedTool
from fullam.numbers.records import Rows, columns
from fullam.simulation.flown import Flown
from fullam.simulation.scenarios.scenario import AXES

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

NOISE_SIGMAS = 2.0
"""Narrowest settling band in standard deviations of the pose sensor's noise."""

SHARE_INSIDE = 0.95
"""Share of the rest of the response that a settled axis spends in its band, noise-aware."""

HOLD_BAND = (20.0, 2.0)
"""Settling band of an axis that does not step [mm, deg]."""

TRANSIENT = 3.0
"""Overshoot is sought at least this long after the jump, and until 1 s after settling [s]."""

ROTATION = ("rotation_x", "rotation_y", "rotation_z")
"""Names of the rotation vector of R R_d^T."""

FIGURES = (
    *(f"{name}_{figure}" for name in (*AXES, *ROTATION) for figure in columns(SignalFigures)),
    *(f"{name}_{figure}" for name in AXES for figure in columns(AxisFigures)),
    *columns(FlightFigures),
    *(f"{name}_step" for name in AXES),
    *("duration_s", "settled", "diverged", "tool_rms_mm"),
)
"""Names of the numbers of a flight, in order: those of an axis begin with its name."""

COLUMN = {name: i for i, name in enumerate(FIGURES)}
"""Where each of them stands."""


@dataclass(frozen=True, eq=False)
class Figures:
    """Figures of some flights as numbers.

    Attributes:
        controlled: Axes that count, shape (6,).
        numbers: The figures by `COLUMN`, NaN where there is none, shape (flights, numbers).
    """

    controlled: Flags
    numbers: Array

    @classmethod
    def unknown(cls, controlled: Flags, diverged: Flags) -> Figures:
        """Nothing but the outcome."""
        figures = cls(controlled, np.full((len(diverged), len(FIGURES)), np.nan))
        figures["settled"][:], figures["diverged"][:] = 0.0, diverged
        return figures

    def __getitem__(self, name: str) -> Array:
        """One figure of every flight, shape (flights,), a view."""
        return self.numbers[:, COLUMN[name]]

    @property
    def measured(self) -> Flags:
        """Which flights have rows at all, shape (flights,)."""
        return ~np.isnan(self["duration_s"])


@dataclass(frozen=True, eq=False)
class Judge:
    """How the flights of one plan are judged; may be shared by threads.

    Attributes:
        asked: The motion that the scenario asks for.
        controlled: Axes that the scenario controls, shape (6,).
        floors: Narrowest settling bands [mm, deg]; None reads everything raw.
        weight: Of the nominal vehicle [N].
        tool: What is asked of the tool, if anything is.
    """

    asked: AskedMotion
    controlled: Flags
    floors: tuple[float, float] | None
    weight: float
    tool: AskedTool | None = None

    def until(self, rows: int) -> Judge:
        """The judge of flights that end after so many rows."""
        tool = self.tool and self.tool.until(rows)
        return Judge(self.asked.until(rows), self.controlled, self.floors, self.weight, tool)

    def over(self, track: Rows, tool: Rows | None = None) -> TrackJudge:
        """The judge of what is written to a track, for one thread; see `TrackJudge`."""
        return TrackJudge(self, track, tool)

    @cached_property
    def terms(self) -> Terms:
        """What the kernels are told, the same for all flights."""
        asked, t = self.asked, self.asked.since
        before, after = window(t.size, asked.period)
        transient = math.inf if self.floors is None else TRANSIENT
        jump = np.where(self.controlled, asked.step, 0.0)
        share = 1.0 if self.floors is None else SHARE_INSIDE
        return Terms(
            asked.rows(),
            Rows(float, t[:, None]),
            Rows(float, rows_inside(t, share)[:, None]),
            Rows(float, rows_inside(t)[:, None]),
            Rows.of(AxisTerms, [self._axis(i) for i in range(6)]),
            Rows(Path, np.array([path_numbers(jump[:3]), path_numbers(jump[3:])])),
            Rows.of(
                FlightTerms,
                [FlightTerms(before, after, transient, self.weight, asked.period)],
            ),
            sections(JITTER_FREQUENCY, asked.period, t.size),
        )

    def _axis(self, i: int) -> AxisTerms:
        half, step = i // 3, float(self.asked.step[i])
        floor = 0.0 if self.floors is None else self.floors[half]
        two, five = (max(s * abs(step), floor) if step else HOLD_BAND[half] for s in (0.02, 0.05))
        setpoint = abs(float(self.asked.setpoint[i]))
        return AxisTerms(
            float(self.controlled[i]),
            step,
            two,
            five,
            0.02 * abs(step),
            setpoint if setpoint > STEP_MINIMUM[half] else math.nan,
        )


class TrackJudge:
    """Judges the flights that are written to one track, again and again; belongs to one thread."""

    def __init__(
        self,
        judge: Judge,
        track: Rows,
        tool: Rows | None = None,
        compiled: bool | None = None,
    ) -> None:
        """Bind the kernels to the track.

        Args:
            judge: How flights are judged.
            track: `Flown`, as many rows as the plan has periods, in lanes or not.
            tool: Where the tool was, as many rows; None where the arm followed its motion.
            compiled: Whether to run machine code; None where that can be had.

        Raises:
            ValueError: The track has another length than the plan.
        """
        if len(track.array) != len(judge.asked.t):
            raise ValueError(
                f"the track has {len(track.array)} rows, the plan {len(judge.asked.t)} periods: "
                "give a track with one row a control period"
            )
        self._judge, self._track, self._tool = judge, track, tool
        self._compiled = compiled
        self._program = FigureProgram(judge.terms, track, compiled)

    def figures(self, rows: Sequence[int], diverged: Sequence[bool]) -> Figures:
        """The figures of what the track holds now.

        A flight that ended early is judged by what was asked until then. Such flights are rare,
        and cost as much as the whole block does, each of them that has a length of its own.

        Args:
            rows: Rows that each flight has flown; at most as many flights as lanes.
            diverged: Whether it diverged.
        """
        flown, ended = np.asarray(rows, dtype=int), np.asarray(diverged, dtype=bool)
        figures = Figures.unknown(self._judge.controlled, ended)
        for length in sorted(set(flown.tolist()) - {0}):
            self._take(figures, length, np.flatnonzero(flown == length))
        figures["settled"][:] = figures["settling_time_s"] >= 0.0
        return figures

    def errors(self, rows: slice) -> list[Array] | None:
        """Errors of the flights of full length that were judged last, in all lanes.

        Args:
            rows: Of the track.

        Returns:
            Views of p - p_d and of the rotation vector of R R_d^T, six of shape (N, lanes)
            [mm, deg]; None if they were not judged from there on.
        """
        start = self._judge.asked.start
        if rows.start < start:
            return None
        signals = self._program.view.signals.array[:, rows.start - start : rows.stop - start]
        return [signals[i].reshape(signals.shape[1], -1) for i in (0, 1, 2, 6, 7, 8)]

    def _take(self, figures: Figures, rows: int, flights: NDArray[np.intp]) -> None:
        """Judge the flights of one length."""
        judge, program = self._judge, self._program
        if rows < len(judge.asked.t):
            judge = judge.until(rows)
            part = Rows(self._track.record, self._track.array[:rows], self._track.lanes)
            program = FigureProgram(judge.terms, part, self._compiled)
        ended = np.zeros(self._track.lanes or 1)
        ended[flights] = figures["diverged"][flights]
        program.run(ended)
        found = program.numbers
        figures.numbers[flights, : found.shape[1]] = found[flights]
        step = COLUMN[f"{AXES[0]}_step"]
        figures.numbers[flights, step : step + 6] = judge.asked.step
        figures["duration_s"][flights] = judge.asked.t[-1]
        if judge.tool is not None:
            tools = self._tools(judge.tool, rows, flights)
            figures["tool_rms_mm"][flights] = judge.tool.rms_mm(tools)

    def _tools(self, asked: AskedTool, rows: int, flights: NDArray[np.intp]) -> Array:
        """Where the tools of some flights were, shape (rows, 3, flights) [m]."""
        if self._tool is not None:
            return self._tool.array[:rows].reshape(rows, 3, -1)[..., flights]
        poses = self._track.array[:rows, columns(Flown)["pose"]].reshape(rows, 7, -1)
        return np.stack([asked.held_at(poses[..., k]) for k in flights], axis=-1)
