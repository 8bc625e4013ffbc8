"""From a plan to a run: the compiled counterpart of `Flight`."""

from __future__ import annotations

from collections.abc import Callable

from fullam.exceptions import NonFiniteWrench
from fullam.simulation.compiled.arrays import job_of, log_of
from fullam.simulation.compiled.entries import fly as fly_compiled
from fullam.simulation.compiled.integrate import ASKED
from fullam.simulation.compiled.jit import announced
from fullam.simulation.compiled.loop import DIVERGED, FLYING, NOT_FINITE, Job
from fullam.simulation.flight import finish
from fullam.simulation.flight_plan import FlightPlan, divergence
from fullam.simulation.run import Run, allocate_columns

NAME = "compiled"
"""What the run's metadata calls this engine."""

Progress = Callable[[int, int], None]
"""Called with (ticks flown, ticks in all) now and then."""


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
    if ending == NOT_FINITE:
        raise NonFiniteWrench(job.state[ASKED, :6].copy())
    if ending == DIVERGED:
        reason = divergence(plan, k, columns["pose"][k])
        return finish(plan, columns, k, "diverged", reason or "", NAME)
    return finish(plan, columns, k, "completed", "", NAME)
