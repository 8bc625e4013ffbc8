"""From the rows of campaigns to verdicts on claims.

A verdict needs the whole interval: a claim *holds* if all of it is on the right side, *fails* if
all of it is on the wrong side, and is *undecided* if the interval straddles the threshold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from fullam.analysis.campaign_table import CampaignTable
from fullam.analysis.claims import SUBJECT, Bound, Claim, Paired, Side
from fullam.analysis.judged import LOST
from fullam.analysis.statistics import (
    Interval,
    mean_interval,
    quantile_interval,
    share_interval,
)
from fullam.dynamics.pose_space import pose_from_euler
from fullam.exceptions import CampaignError
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

HOLDS, FAILS, UNDECIDED = "holds", "fails", "undecided"

NEGLIGIBLE = {"mm": 0.1, "deg": 0.01}
"""A difference below this, a hundredth of the sensor's standard deviation, may be certain and still
is of no consequence; the finding says so."""

Figure = Callable[[CampaignTable, str, str], Array]


def _never(column: str) -> Figure:
    """A column in which a missing value means "never": infinitely late or large."""

    def read(table: CampaignTable, scenario: str, contender: str) -> Array:
        values = table.column(column, scenario, contender)
        return np.where(np.isnan(values), np.inf, values)

    return read


def _largest(*columns: str, size: bool = False) -> Figure:
    """The largest of some columns; of their sizes, if asked. Infinite for a diverged flight."""

    def read(table: CampaignTable, scenario: str, contender: str) -> Array:
        values = np.stack([table.column(name, scenario, contender) for name in columns])
        values = np.max(np.abs(values) if size else values, axis=0)
        return np.where(np.isnan(values) | _lost(table, scenario, contender), np.inf, values)

    return read


def _lost(table: CampaignTable, scenario: str, contender: str) -> NDArray[np.bool_]:
    return np.isin(table.column("outcome", scenario, contender), LOST)


FIGURES: dict[str, Figure] = {
    "settling": _never("settling_time_s"),
    "position overshoot": _largest(*(f"{a}_overshoot_percent" for a in "xyz")),
    "set point overshoot": _largest(*(f"{a}_overshoot_setpoint_percent" for a in "xyz")),
    "xy excursion": _largest("x_max_excursion_mm", "y_max_excursion_mm"),
    "z excursion": _largest("z_max_excursion_mm"),
    "position RMS": _largest("rms_position_mm"),
    "attitude RMS": _largest("rms_attitude_deg"),
    "z RMS": _largest("z_rms_mm"),
    "psi RMS": _largest("psi_rms_deg"),
    "position jitter": _largest("jitter_position_mm"),
    "attitude jitter": _largest("jitter_attitude_deg"),
    "z steady error": _largest("z_steady_error_mm", size=True),
    "phi steady error": _largest("phi_steady_error_deg", size=True),
    "psi steady error": _largest("psi_steady_error_deg", size=True),
    "diverged": lambda *where: _lost(*where).astype(float),
}
"""What claims are judged by, per flight; a flight that was lost counts as infinitely bad."""


@dataclass(frozen=True)
class Finding:
    """A claim after the flights.

    Attributes:
        interval: What was measured, and how well.
        verdict: `HOLDS`, `FAILS` or `UNDECIDED`.
        where: The scenario that decided, if it was the worst of several.
        note: What the interval does not say.
    """

    interval: Interval
    verdict: str
    where: str = ""
    note: str = ""


def judge(claim: Claim, table: CampaignTable, contender: str, rivals: dict[str, str]) -> Finding:
    """Judge a claim for one contender.

    Args:
        claim: A claim whose test is a `Bound` or `Paired`.
        table: Rows of one campaign.
        contender: Label of the contender judged.
        rivals: Label of the contender that flies a controller named in the claim.

    Raises:
        CampaignError: The table lacks flights that the claim needs, or the claim needs none.
    """
    test = claim.test
    if isinstance(test, Bound):
        return _judge_bound(test, table, contender)
    if isinstance(test, Paired):
        return _judge_paired(test, table, contender, rivals)
    raise CampaignError(f"claim '{claim.key}'", "test", "needs no flights", "see its proof")


def _judge_bound(test: Bound, table: CampaignTable, contender: str) -> Finding:
    samples = {s: _values(test.figure, table, s, contender) for s in test.scenarios}
    if test.quantile is None:
        pooled = np.concatenate(list(samples.values()))
        share = share_interval(int(pooled.sum()), pooled.size)
        # "None" can only be refuted; that there is none in n flights is all that n flights say.
        return Finding(share, FAILS if pooled.any() else HOLDS, note=f"{int(pooled.sum())} flights")
    found = {s: quantile_interval(v, test.quantile) for s, v in samples.items()}
    where = max(found, key=lambda s: (found[s].estimate, found[s].high))
    worst = found[where]
    verdict = UNDECIDED
    if max(i.high for i in found.values()) < test.threshold:
        verdict = HOLDS
    elif max(i.low for i in found.values()) >= test.threshold:
        verdict = FAILS
    passing = [s for s, i in found.items() if i.estimate < test.threshold]
    note = "" if len(found) == 1 else f"{len(passing)} of {len(found)} scenarios below"
    return Finding(worst, verdict, where if len(found) > 1 else "", note)


def _judge_paired(
    test: Paired, table: CampaignTable, contender: str, rivals: dict[str, str]
) -> Finding:
    def side(side: Side) -> Array:
        label = contender if side.contender == SUBJECT else rivals[side.contender]
        return np.mean([_values(test.figure, table, s, label) for s in side.scenarios], axis=0)

    more, less = side(test.more), side(test.less)
    complete = np.isfinite(more) & np.isfinite(less)
    if not complete.any():
        never = Interval(np.nan, np.nan, np.nan, 0)
        return Finding(never, UNDECIDED, note="no pair of flights was completed")
    interval = mean_interval(more[complete] - less[complete])
    verdict = UNDECIDED
    if interval.low > -test.tolerance:
        verdict = HOLDS
    elif interval.high < -test.tolerance:
        verdict = FAILS
    lost = int((~complete).sum())
    notes = [f"{lost} pairs incomplete"] if lost else []
    if max(abs(interval.low), abs(interval.high)) < NEGLIGIBLE.get(test.unit, 0.0):
        notes.append("too little to matter")
    return Finding(interval, verdict, note="; ".join(notes))


def _values(figure: str, table: CampaignTable, scenario: str, contender: str) -> Array:
    values = FIGURES[figure](table, scenario, contender)
    if values.size == 0:
        raise CampaignError(
            "campaign", "rows", f"has no flight of {contender} in {scenario}", "fly it first"
        )
    return values


@dataclass(frozen=True)
class TiltProof:
    """How far any allocation stays from holding a vehicle still at a tilt.

    Attributes:
        vehicle: Its name.
        rank: Rank of the coupling matrix.
        euler_deg: The attitude.
        tilt_deg: Angle of the platform's z axis to the vertical.
        missing_share: Least ||wrench error|| over the weight, over all 0 <= u <= 1; a moment counts
            like a force at a lever of 1 m; 0 if the attitude can be held.
    """

    vehicle: str
    rank: int
    euler_deg: tuple[float, float, float]
    tilt_deg: float
    missing_share: float


def prove_no_tilted_hover(
    vehicle: Vehicle, euler_deg: tuple[float, float, float], arm_deg: tuple[float, ...]
) -> TiltProof:
    """The least wrench error over ALL rotor speeds: a proof, not the habit of one allocator.

    min ||B u - w|| over the box 0 <= u <= 1 is convex, so its minimum is global: where it is not
    0, no allocation whatever holds the attitude at rest.
    """
    q = vehicle.neutral(vehicle.joints.from_typed(arm_deg))
    q[:7] = pose_from_euler(np.zeros(3), np.radians(np.array(euler_deg)))
    wrench = pin.computeGeneralizedGravity(vehicle.model, vehicle.create_data(), q)[:6]
    coupling = vehicle.rotors.normalized_coupling
    best = lsq_linear(coupling, wrench, (0.0, 1.0), method="bvls", tol=1e-14)
    weight = vehicle.mass * vehicle.gravity
    up = pin.XYZQUATToSE3(q[:7]).rotation[2, 2]
    return TiltProof(
        vehicle.name,
        int(np.linalg.matrix_rank(coupling, tol=1e-9 * np.linalg.norm(coupling))),
        euler_deg,
        float(np.degrees(np.arccos(min(1.0, up)))),
        float(np.linalg.norm(coupling @ best.x - wrench)) / weight,
    )
