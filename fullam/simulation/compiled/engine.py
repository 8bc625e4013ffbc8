"""From a plan to a run: the compiled counterpart of `Flight`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.exceptions import NonFiniteWrench
from fullam.simulation.compiled.arrays import job_of, log_of
from fullam.simulation.compiled.entries import fly as fly_compiled
from fullam.simulation.compiled.integrate import ASKED
from fullam.simulation.compiled.jit import announced
from fullam.simulation.compiled.loop import DIVERGED, FLYING, NOT_FINITE, Job
from fullam.simulation.flight import finish
from fullam.simulation.flight_plan import FlightPlan, divergence
from fullam.simulation.progress import Progress
from fullam.simulation.run import Run, allocate_columns

Array = NDArray[np.float64]

NAME = "compiled"
"""What the run's metadata calls this engine."""


def fly(plan: FlightPlan, progress: Progress | None = None) -> Run:
    """Fly a plan.

    Args:
        plan: What to fly.
        progress: Told how far the flight is, about a hundred times.

    Raises:
        SettingsError: The plan holds something that is not compiled; the message names it.
        VehicleError: The arm is not one chain of revolute joints.
        NonFiniteWrench: The controller returned NaN or infinity.
    """
    return fly_job(plan, job_of(plan), progress)


def fly_job(plan: FlightPlan, job: Job, progress: Progress | None = None) -> Run:
    """Fly a plan that is arrays already; `job` is spent."""
    total = plan.t.size
    columns = allocate_columns(total, plan.nominal.n_arm, plan.nominal.rotors.count)
    log = log_of(columns)
    stride = total if progress is None else max(1, total // 100)
    k, ending = 0, FLYING
    with announced("the flight loop", fly_compiled):
        while k < total and ending == FLYING:
            k, ending = fly_compiled(job, log, k, min(k + stride, total), total - 1)
            if progress is not None:
                progress(k, total)
    return ended(plan, columns, k, ending, job.state[ASKED, :6])


def ended(
    plan: FlightPlan, columns: dict[str, NDArray[Any]], rows: int, ending: int, asked: Array
) -> Run:
    """The run of a flight that has ended.

    Args:
        plan: What was flown.
        columns: The log, velocities in body axes; see `fullam.simulation.flight.finish`.
        rows: How many rows of it are written.
        ending: How it ended, as `loop.fly` says.
        asked: The wrench asked for last, shape (6,).

    Raises:
        NonFiniteWrench: The controller returned NaN or infinity.
    """
    if ending == NOT_FINITE:
        raise NonFiniteWrench(asked.copy())
    if ending == DIVERGED:
        reason = divergence(plan, rows, columns["pose"][rows])
        return finish(plan, columns, rows, "diverged", reason or "", NAME)
    return finish(plan, columns, rows, "completed", "", NAME)
