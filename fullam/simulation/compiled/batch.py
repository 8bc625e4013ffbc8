"""Many seeds of one plan: what the flights share is prepared once."""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.exceptions import NonFiniteWrench
from fullam.model.perturbation import perturb
from fullam.simulation.compiled.allocation import Allotment
from fullam.simulation.compiled.arrays import (
    craft_of,
    draw_of,
    fresh_allotment,
    job_of,
    law_memory,
    links_of,
    log_of,
    rules_of,
    start_afresh,
    state_at,
)
from fullam.simulation.compiled.engine import NAME
from fullam.simulation.compiled.entries import fly
from fullam.simulation.compiled.integrate import ASKED
from fullam.simulation.compiled.jit import announced
from fullam.simulation.compiled.loop import DIVERGED, NOT_FINITE, Job
from fullam.simulation.flight import finish
from fullam.simulation.flight_plan import FlightPlan, divergence
from fullam.simulation.run import Run, allocate_columns
from fullam.simulation.weather import forecast

AHEAD = 2
"""Flights a thread may be ahead of the reader: what bounds the memory."""


@dataclass(frozen=True, eq=False)
class Flown:
    """One flight of a batch, before it is made a run.

    Attributes:
        plan: What was flown.
        columns: The log, velocities in body axes; see `fullam.simulation.flight.finish`.
        rows: How many rows of it are written.
        diverged: Whether the flight left the bounds of sense.
    """

    plan: FlightPlan
    columns: dict[str, NDArray[Any]]
    rows: int
    diverged: bool

    def run(self) -> Run:
        """The run, as `simulate(..., engine="compiled")` returns it."""
        if not self.diverged:
            return finish(self.plan, self.columns, self.rows, "completed", "", NAME)
        reason = divergence(self.plan, self.rows, self.columns["pose"][self.rows])
        return finish(self.plan, self.columns, self.rows, "diverged", reason or "", NAME)


def with_seed(plan: FlightPlan, seed: int) -> FlightPlan:
    """The same plan in the weather, and with the true vehicle, of another seed."""
    draw = forecast(plan.weather, seed, plan.t)
    true = perturb(plan.nominal, plan.weather.uncertainty, draw.parameters)
    return replace(plan, seed=seed, forecast=draw, true=true)


def fly_seeds(plan: FlightPlan, seeds: Iterable[int], threads: int = 1) -> Iterator[Flown]:
    """Fly one plan under many seeds; yields the flights in the order of the seeds.

    Each flight equals that of `simulate` with its seed bit for bit, however many threads there
    are. The compiled loop runs without Python's global lock, so threads fly side by side.

    Args:
        plan: The plan of any seed.
        seeds: The seeds to fly.
        threads: How many flights at a time.

    Raises:
        SettingsError: The plan holds something that is not compiled; the message names it.
        NonFiniteWrench: The controller returned NaN or infinity.
    """
    shared, local = job_of(plan), threading.local()

    def one(seed: int) -> Flown:
        if not hasattr(local, "allotment"):
            local.allotment = fresh_allotment(shared.allotment.box, shared.allotment.scales)
        return _fly_one(with_seed(plan, seed), shared, local.allotment)

    remaining = iter(seeds)
    with announced("the flight loop", fly):
        yield from map(one, itertools.islice(remaining, 1))
    if threads <= 1:
        yield from map(one, remaining)
        return
    with ThreadPoolExecutor(threads) as pool:
        waiting = deque(pool.submit(one, s) for s in itertools.islice(remaining, AHEAD * threads))
        while waiting:
            flown = waiting.popleft().result()
            waiting.extend(pool.submit(one, s) for s in itertools.islice(remaining, 1))
            yield flown


def _fly_one(plan: FlightPlan, shared: Job, allotment: Allotment) -> Flown:
    s, n = plan.simulation, plan.nominal
    start_afresh(allotment)
    job = shared._replace(
        craft=craft_of(plan.true, links_of(plan.true), s.integrator, s.plant_period, s.substeps),
        memory=law_memory(),
        allotment=allotment,
        draw=draw_of(plan.forecast),
        rules=rules_of(plan),
        state=state_at(plan.scenario.initial_pose),
        speeds=shared.speeds.copy(),
    )
    total = plan.t.size
    columns = allocate_columns(total, n.n_arm, n.rotors.count)
    rows, ending = fly(job, log_of(columns), 0, total, total - 1)
    if ending == NOT_FINITE:
        raise NonFiniteWrench(np.array(job.state[ASKED, :6]))
    return Flown(plan, columns, rows, ending == DIVERGED)
