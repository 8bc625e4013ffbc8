"""Which flights of a block swing, told where they were judged."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fullam.analysis.judge import TrackJudge
from fullam.simulation.block import Block
from fullam.simulation.oscillation import BANDS, UNITS, flight_swing, may_swing, steady_part

SLACK = 1e-9
"""The judge's rotation vectors differ from those of `oscillation.errors` by rounding, its positions
are in mm: what is nearly large enough to swing is looked at as well."""


class SwingWatch:
    """Tells of the flights of a block that came to their end what `finish` tells of each alone.

    The judge has the errors of all lanes at hand, and most flights err too little to swing; only
    the others are taken out of the block. Belongs to the block's thread.
    """

    def __init__(self, block: Block, of_track: TrackJudge) -> None:
        """Find the errors of the steady part, which are where they are for every flight.

        Args:
            block: The flights.
            of_track: Who judges what they write.
        """
        self._block, self._plan = block, block.tables.plan
        errors = of_track.errors(steady_part(self._plan, block.tables.periods))
        bands = (1.0 - SLACK) * np.repeat(BANDS, 3) * UNITS
        axes = np.flatnonzero(self._plan.scenario.axes_mask).tolist()
        self._checks = None if errors is None else [(errors[i], float(bands[i])) for i in axes]

    def among(self, outcomes: Sequence[str]) -> dict[int, str]:
        """How the flights swing that have just been judged, by their lane.

        Args:
            outcomes: How they ended; only what is "completed" can swing.
        """
        block = self._block
        may = np.full(block.lanes or 1, self._checks is None)
        with np.errstate(invalid="ignore", over="ignore"):  # beside these flew what diverged
            for error, band in self._checks or ():
                may |= may_swing(error, band)
        poses, found = block.track["pose"], {}
        for lane, outcome in enumerate(outcomes):
            if may[lane] and outcome == "completed":
                swings = flight_swing(self._plan, poses[..., lane] if block.lanes else poses)
                if swings is not None:
                    found[lane] = str(swings)
        return found
