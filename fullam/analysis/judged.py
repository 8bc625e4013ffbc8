"""Flights of one plan under many seeds, flown and judged; of the flights themselves nothing stays.

Laws and estimators that are written as kernels fly by machine code, eight flights at a time in each
of some threads, and are judged where they were flown. All others fly one by one in Python.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.asked_motion import AskedMotion
from fullam.analysis.deviation import coordinates, track_of
from fullam.analysis.judge import Figures, Judge
from fullam.analysis.metrics import noise_floors
from fullam.analysis.swing_watch import SwingWatch
from fullam.analysis.tool_error import AskedTool
from fullam.control.controllers import controller_class
from fullam.control.estimator import flies_as_kernel
from fullam.control.estimators import estimator_class
from fullam.control.law import flies_as_kernels
from fullam.exceptions import AllocationFailed, NonFiniteWrench, UnknownName
from fullam.numbers.machine_code import available
from fullam.simulation import fused
from fullam.simulation.block import Block
from fullam.simulation.flight_plan import FlightPlan, divergence
from fullam.simulation.many import fly_blocks
from fullam.simulation.plants.settings import IN_KERNELS, in_kernels
from fullam.simulation.record.run import Run
from fullam.simulation.simulate import DRIVERS, fly_by_python

Array = NDArray[np.float64]
Trace = NDArray[np.float32]

FASTEST = "fastest"
"""Stands for the fastest driver that can fly a plan."""

FLIGHT_ENDED = (NonFiniteWrench, AllocationFailed, np.linalg.LinAlgError)
"""What ends a flight without divergence; all other errors are mistakes of whoever asked for it."""


def driver_of(
    controller: str, estimator: str | None, driver: str = FASTEST, plants: Iterable[str] = ()
) -> str:
    """The driver that is meant: machine code where law, estimator and plant are kernels.

    Args:
        controller: Name of the controller.
        estimator: Name of the estimator; None for the controller's own.
        driver: One of `DRIVERS`, or `FASTEST`.
        plants: Names of the plants that fly.

    Raises:
        UnknownName: No such controller, estimator or driver.
    """
    law = controller_class(controller)
    filtering = estimator_class(estimator or law.estimator)
    if driver in DRIVERS:
        return driver
    if driver != FASTEST:
        raise UnknownName("driver", driver, (*DRIVERS, FASTEST))
    kernels = flies_as_kernels(law) and flies_as_kernel(filtering) and not {*plants} & {*IN_KERNELS}
    return "fused" if kernels and available() else "python"


LOST = ("diverged", "failed")
"""Outcomes of a flight that did not come to its end."""


@dataclass(frozen=True, eq=False)
class Judged:
    """What stays of some flights of a plan.

    Attributes:
        seeds: Their seeds.
        outcomes: "completed", "oscillating", "diverged" or "failed".
        reasons: Why one did not complete, or how it swings.
        figures: Their figures; without rows for one that failed.
        traces: Motions [mm, deg], shape (samples, 6) each; None if they are not kept.
    """

    seeds: tuple[int, ...]
    outcomes: tuple[str, ...]
    reasons: tuple[str, ...]
    figures: Figures
    traces: tuple[Trace, ...] | None

    def __len__(self) -> int:
        """Number of flights."""
        return len(self.seeds)


def fly_judged(
    plan: FlightPlan,
    seeds: Sequence[int],
    driver: str = FASTEST,
    *,
    threads: int = 1,
    trace_every: int = 0,
) -> Iterator[Judged]:
    """Fly a plan under many seeds and judge the flights, a few at a time, in the seeds' order.

    The numbers depend on neither threads nor neighbours.

    Args:
        plan: The plan of any seed.
        seeds: Whole numbers from 0 on.
        driver: One of `DRIVERS`, or `FASTEST`.
        threads: Threads of the fused driver.
        trace_every: Control periods from one kept sample of a motion to the next; 0 keeps none.

    Raises:
        SettingsError: The driver is "fused", and law or estimator are not written as kernels.
        UnknownName: No such driver.
    """
    judge = judge_of(plan)
    simulation = plan.simulation
    named = driver_of(plan.controller, simulation.estimator, driver, [simulation.plant])
    if named == "python":
        for seed in seeds:
            yield _fly_by_python(plan, seed, judge, trace_every)
        return

    def collect(block: Block) -> Callable[[Sequence[int]], list[Judged]]:
        of_track = judge.over(block.track, block.plant.tool)
        swinging = SwingWatch(block, of_track)

        def judged(some: Sequence[int]) -> list[Judged]:
            ended = [_ended(block, lane, seed) for lane, seed in enumerate(some)]
            rows, outcomes, reasons = zip(*ended, strict=True)
            figures = of_track.figures(rows, [outcome == "diverged" for outcome in outcomes])
            traces = _traces(block.track["pose"], rows, trace_every)
            found = swinging.among(outcomes)
            outcomes = tuple("oscillating" if k in found else o for k, o in enumerate(outcomes))
            reasons = tuple(found.get(k, reason) for k, reason in enumerate(reasons))
            return [Judged(tuple(some), outcomes, reasons, figures, traces)]

        return judged

    for blocks in fly_blocks(plan, seeds, collect, keep="track", threads=threads):
        yield from blocks


def judge_of(plan: FlightPlan) -> Judge:
    """How the flights of a plan are judged; where an arm that yields holds its tool is theirs."""
    initial_pose = np.array(plan.scenario.initial_pose)
    yields = in_kernels(plan.simulation.plant, {})[0] != "prescribed"
    arm = plan.arm.theta[plan.arm_row(1) * np.arange(1 if yields else len(plan.t))]
    tool = AskedTool.of(plan.scenario, plan.nominal, plan.t, arm)
    return Judge(
        AskedMotion.of(plan.t, plan.asked.pose, initial_pose),
        np.array(plan.scenario.axes_mask),
        noise_floors(plan.weather),
        plan.nominal.mass * plan.nominal.gravity,
        tool,
    )


def figures_of(judge: Judge, run: Run, thrust_coefficients: Array) -> Figures:
    """The figures of one record, given the nominal k_f of the rotors."""
    if len(run) == 0:
        return Figures.unknown(judge.controlled, np.array([run.diverged]))
    track = track_of(run.pose, run.saturated, np.square(run.rotor_speeds) @ thrust_coefficients)
    return judge.until(len(run)).over(track).figures([len(run)], [run.diverged])


def _fly_by_python(plan: FlightPlan, seed: int, judge: Judge, trace_every: int) -> Judged:
    try:
        run = fly_by_python(plan.with_seed(seed))
    except FLIGHT_ENDED as error:
        unknown = Figures.unknown(judge.controlled, np.array([False]))
        traces = _traces(np.empty((0, 7, 1)), [0], trace_every)
        return Judged((seed,), ("failed",), (str(error),), unknown, traces)
    if judge.tool is not None and len(run):  # its arm may have yielded
        tool = AskedTool.of(plan.scenario, plan.nominal, run.t, run.arm)
        judge = replace(judge, tool=tool)
    figures = figures_of(judge, run, plan.nominal.rotors.k_f)
    traces = _traces(run.pose[..., None], [len(run)], trace_every)
    return Judged((seed,), (run.outcome,), (run.metadata["reason"],), figures, traces)


def _ended(block: Block, lane: int, seed: int) -> tuple[int, str, str]:
    """Rows, outcome and reason of a flight that has been flown by machine code."""
    plan = block.tables.plan
    rows, outcome = block.ending(lane)
    if outcome == "diverged":
        return rows, outcome, divergence(plan, rows, block.pose(lane, rows)) or "not finite"
    if outcome == "completed":
        return rows, outcome, ""
    # The block flies on after a flight has ended, for how long depends on its neighbours. What is
    # told about it shall not: it flies again, alone.
    try:
        fused.fly(plan.with_seed(seed))
    except FLIGHT_ENDED as error:
        return 0, "failed", str(error)
    raise AssertionError(f"seed {seed} fails among others and not alone")


def _traces(poses: Array, rows: Sequence[int], every: int) -> tuple[Trace, ...] | None:
    """Kept motions [mm, deg] from poses, shape (periods, 7, flights)."""
    if not every:
        return None
    kept = [poses[:count:every, :, lane] for lane, count in enumerate(rows)]
    motions = coordinates(np.concatenate(kept)).astype(np.float32)
    return tuple(np.split(motions, np.cumsum([len(part) for part in kept])[:-1]))
