"""Many seeds of one plan: what the flights share is prepared once."""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.model.chain import LinkChain
from fullam.simulation.compiled.allocation import Allotment
from fullam.simulation.compiled.arrays import (
    craft_of,
    draw_of,
    fresh_allotment,
    job_of,
    law_memory,
    log_of,
    start_afresh,
)
from fullam.simulation.compiled.dynamics import with_bodies, z_frames
from fullam.simulation.compiled.engine import ended
from fullam.simulation.compiled.entries import fly
from fullam.simulation.compiled.integrate import ASKED
from fullam.simulation.compiled.jit import announced
from fullam.simulation.compiled.loop import DIVERGED, Job
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.run import Run, allocate_columns

Array = NDArray[np.float64]

TOGETHER = 8
"""Flights that are prepared at a time."""

AHEAD = 2
"""So many times `TOGETHER` may a thread be ahead of the reader: what bounds the memory."""


@dataclass(frozen=True, eq=False)
class Flown:
    """One flight of a batch, before it is made a run.

    Attributes:
        plan: What was flown.
        columns: The log, velocities in body axes; see `fullam.simulation.flight.finish`.
        rows: How many rows of it are written.
        ending: How the flight ended: DIVERGED, NOT_FINITE, or FLYING to the end; see `loop`.
        asked: The wrench asked for last, shape (6,).
    """

    plan: FlightPlan
    columns: dict[str, NDArray[Any]]
    rows: int
    ending: int
    asked: Array

    @property
    def diverged(self) -> bool:
        """Whether the flight left the bounds of sense."""
        return self.ending == DIVERGED

    def run(self) -> Run:
        """The run, as `simulate(..., engine="compiled")` returns it.

        Raises:
            NonFiniteWrench: The controller returned NaN or infinity. Raised here and not when it
                flew, so that the flights beside it are not lost.
        """
        return ended(self.plan, self.columns, self.rows, self.ending, self.asked)


class Batch:
    """One plan under many seeds.

    A flight equals that of `simulate` with its seed bit for bit. Threads may share a batch: the
    compiled loop runs without Python's global lock, so they fly side by side.
    """

    def __init__(self, plan: FlightPlan) -> None:
        """Prepare what the flights share.

        Args:
            plan: The plan of any seed.

        Raises:
            SettingsError: The plan holds something that is not compiled; the message names it.
            VehicleError: The arm is not one chain of revolute joints.
        """
        self.plan = plan
        self._shared = job_of(plan)
        self._frames = z_frames(LinkChain.from_model(plan.nominal.model))
        self._local = threading.local()

    def fly(self, seed: int) -> Flown:
        """Fly one seed."""
        return self._fly(*self._prepare(seed))

    def fly_some(self, seeds: Iterable[int]) -> list[Flown]:
        """Fly a few seeds: all are prepared before the first flies.

        A flight clears the processor's caches of what prepares the next one, which then takes
        twice as long.
        """
        return [self._fly(*prepared) for prepared in [self._prepare(seed) for seed in seeds]]

    def _prepare(self, seed: int) -> tuple[FlightPlan, Job]:
        """The plan of a seed, and as arrays; the allocation is lent when it flies."""
        plan = self.plan.with_seed(seed)
        bodies = plan.true.model.inertias.tolist()[1:]
        links = with_bodies(
            self._shared.law.links,
            self._frames,
            np.array([body.mass for body in bodies]),
            np.array([body.lever for body in bodies]),
            np.array([body.inertia for body in bodies]),
        )
        return plan, self._shared._replace(
            craft=craft_of(plan, links),
            memory=law_memory(),
            draw=draw_of(plan.forecast),
            state=self._shared.state.copy(),
            speeds=self._shared.speeds.copy(),
        )

    def _fly(self, plan: FlightPlan, job: Job) -> Flown:
        job = job._replace(allotment=self._allotment())
        total = plan.t.size
        columns = allocate_columns(total, plan.nominal.n_arm, plan.nominal.rotors.count)
        with announced("the flight loop", fly):
            rows, ending = fly(job, log_of(columns), 0, total, total - 1)
        return Flown(plan, columns, rows, ending, job.state[ASKED, :6])

    def _allotment(self) -> Allotment:
        """The allocation of this thread, as before a flight; its maps of active sets stay."""
        if not hasattr(self._local, "allotment"):
            shared = self._shared.allotment
            self._local.allotment = fresh_allotment(shared.box, shared.scales)
        allotment: Allotment = self._local.allotment
        start_afresh(allotment)
        return allotment


def fly_seeds(plan: FlightPlan, seeds: Iterable[int], threads: int = 1) -> Iterator[Flown]:
    """Fly one plan under many seeds; yields the flights in the order of the seeds.

    Close the generator to stop early: flights that are in the air then land, no others start.

    Args:
        plan: The plan of any seed.
        seeds: The seeds to fly.
        threads: How many flights at a time; the flights are the same however many there are.

    Raises:
        SettingsError, VehicleError: As in `Batch`.
    """
    batch, remaining = Batch(plan), iter(seeds)
    if threads <= 1:
        while some := list(itertools.islice(remaining, TOGETHER)):
            yield from batch.fly_some(some)
        return
    yield from map(batch.fly, itertools.islice(remaining, 1))  # compiles, if it has to be
    with ThreadPoolExecutor(threads) as pool:
        waiting: deque[Future[list[Flown]]] = deque()

        def enqueue() -> None:
            if some := list(itertools.islice(remaining, TOGETHER)):
                waiting.append(pool.submit(batch.fly_some, some))

        try:
            for _ in range(AHEAD * threads):
                enqueue()
            while waiting:
                flown = waiting.popleft().result()
                enqueue()
                yield from flown
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
