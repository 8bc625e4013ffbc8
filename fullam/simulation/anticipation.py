"""Taking known lags off a motion that was commanded and is therefore known.

The estimate trails the vehicle (its filter), and the thrust trails the command (rotor lag, and half
a control period of holding it). Neither can be helped for what is unknown; but by how much the
reference moves meanwhile can be told before take-off.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.control.estimator import Estimator
from fullam.control.signals import Ahead, Estimate
from fullam.dynamics.so3 import boxminus, boxplus, rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial, add_spatial, subtract_spatial
from fullam.numbers.kernel import kernel
from fullam.numbers.program import Stage, program
from fullam.numbers.records import Rows
from fullam.numbers.vectors import add, rotate_back, scale, subtract
from fullam.simulation.motions.references import ReferenceTable

Array = NDArray[np.float64]

STILL = 1e-9
"""Below this [m, rad, m/s, rad/s] a row of the table counts as zero."""


class AheadView(NamedTuple):
    """Rows: the reference as seen, the reference, by period; the rotors' lag; what results."""

    seen: Any
    asked: Any
    lag: Any
    ahead: Any


@kernel
def look_ahead(view, k):
    """One row of the table."""
    seen, asked = view.seen[k], view.asked[k]
    way = subtract(asked.pose.position, seen.pose.position)
    turn = boxminus(asked.pose.attitude, seen.pose.attitude)
    w = rotate_back(rotation_matrix(asked.pose.attitude), asked.velocity.angular)
    faster = subtract_spatial(asked.velocity, seen.velocity)
    view.ahead[k] = Ahead(Spatial(way, turn), faster, scale(view.lag[0], w))


@kernel
def advance(estimate, ahead):
    """The estimate with the estimator's lag taken off."""
    pose = estimate.pose
    position = add(pose.position, ahead.pose.linear)
    attitude = boxplus(pose.attitude, ahead.pose.angular)
    return Estimate(Pose(position, attitude), add_spatial(estimate.velocity, ahead.velocity))


@dataclass(frozen=True, eq=False)
class Anticipation:
    """By how much the reference runs ahead of what is estimated and of what the rotors do.

    Attributes:
        rows: `Ahead`, one row a control period; read-only.
        reference: The reference with its acceleration taken one rotor lag ahead.
        moves: Whether any row differs from zero.
    """

    rows: Rows
    reference: ReferenceTable
    moves: bool

    @classmethod
    def of(
        cls, reference: ReferenceTable, estimator: Estimator, actuation_lag: float
    ) -> Anticipation:
        """Tabulate it for a reference on the control grid.

        Args:
            reference: What the vehicle should follow.
            estimator: The estimator, for its lag.
            actuation_lag: Time from a command to the thrust [s].
        """
        seen = np.hstack(estimator.as_seen(reference.pose, reference.velocity))
        asked = np.hstack([reference.pose, reference.velocity])
        rows = Rows.empty(Ahead, len(asked))
        view = AheadView(
            Rows(Estimate, seen), Rows(Estimate, asked), Rows(float, [[actuation_lag]]), rows
        )
        program([Stage(look_ahead, view)]).run(0, len(asked))
        moving = np.abs(rows.array).max(axis=1) > STILL
        rows.array[~moving] = 0.0
        rows.array.flags.writeable = False
        later = reference.t + actuation_lag
        columns = [np.interp(later, reference.t, column) for column in reference.acceleration.T]
        shifted = replace(reference, acceleration=np.stack(columns, axis=1))
        return cls(rows, shifted, bool(moving.any()))
