"""Flights flown by machine code: one, or one in each lane of a vector register.

The same stages as `flight` has, all of them kernels. A flight is flown in stretches, so that it can
be watched and interrupted.
"""

from __future__ import annotations

from collections.abc import Callable

from fullam.exceptions import NonFiniteWrench
from fullam.numbers.blas import one_blas_thread
from fullam.numbers.machine_code import available
from fullam.numbers.program import Program, program
from fullam.simulation.block import Block, Keep
from fullam.simulation.flight_plan import FlightPlan, divergence
from fullam.simulation.progress import Progress
from fullam.simulation.record.finish import finish
from fullam.simulation.record.run import Run
from fullam.simulation.tables import Tables

STRETCH = 500
"""Control periods between looks at whether anybody still flies."""


class Fused:
    """Flies blocks of a plan; belongs to one thread.

    Attributes:
        block: The rows.
    """

    def __init__(
        self,
        tables: Tables,
        lanes: int = 0,
        keep: Keep = "record",
        make_block: Callable[[Tables, int, Keep], Block] = Block,
    ) -> None:
        """Compile the stages, or load them from disk.

        Args:
            tables: What the flights share.
            lanes: Flights at a time; 0 for one, as scalars.
            keep: What the flights write; see `Block`.
            make_block: Makes the rows and stages; a study may have stages of its own.

        Raises:
            SettingsError: Law or estimator are not written as kernels; the message names it.
        """
        self.block = make_block(tables, lanes, keep)
        compiled = available()
        stages = self.block.stages()
        self._whole: Program = program(list(stages.values()), compiled)
        del stages["move"]
        self._last: Program = program(list(stages.values()), compiled)

    def fly(self, progress: Progress | None = None) -> None:
        """Fly the block, whose weather and vehicles have been loaded or drawn."""
        block, periods = self.block, self.block.tables.periods
        block.begin()
        ends = block.status["end"]
        for start in range(0, periods - 1, STRETCH):
            stop = min(start + STRETCH, periods - 1)
            self._whole.run(start, stop)
            if progress is not None:
                progress(stop, periods)
            if (ends < stop).all():
                return
        self._last.run(periods - 1, periods)
        if progress is not None:
            progress(periods, periods)


@one_blas_thread()
def fly(plan: FlightPlan, progress: Progress | None = None) -> Run:
    """Fly one plan by machine code; see `simulate`."""
    fused = Fused(Tables(plan))
    fused.block.load(plan)
    fused.fly(progress)
    return run_of(fused.block, plan, owned=True)


def run_of(block: Block, plan: FlightPlan, lane: int = 0, owned: bool = False) -> Run:
    """The record of a flight of a block.

    Args:
        block: The block, flown.
        plan: The plan under the flight's seed.
        lane: Which of the flights.
        owned: Whether the run may have the block's rows, which then flies no more.

    Raises:
        NonFiniteWrench: The law returned NaN or infinity.
    """
    rows, outcome = block.ending(lane)
    if outcome == "not finite":
        raise NonFiniteWrench(block.last_command(lane))
    reason = ""
    if outcome == "diverged":
        reason = divergence(plan, rows, block.pose(lane, rows)) or "not finite"
    log = block.columns(rows, lane, copy=not owned)
    return finish(plan, log, outcome, reason, "fused")
