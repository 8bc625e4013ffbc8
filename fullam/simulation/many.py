"""Many seeds of one plan: eight flights at a time in each of some threads."""

from __future__ import annotations

import itertools
import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from fullam.checks import Checker, shown
from fullam.exceptions import SettingsError
from fullam.numbers.blas import one_blas_thread
from fullam.numbers.machine_code import available
from fullam.simulation.block import Block, Keep
from fullam.simulation.flight_plan import FlightPlan, checked_seed
from fullam.simulation.fused import Fused, run_of
from fullam.simulation.record.run import Run
from fullam.simulation.tables import Tables

Result = TypeVar("Result")
Collect = Callable[[Sequence[int]], list[Result]]

LANES = 8
"""Flights at a time: the best width with AVX-512 and with AVX2."""

MOST = 1024
"""More lanes, or threads, than this are a typing error."""

QUEUED = 4
"""Blocks that wait for each thread: enough to keep it busy, few enough to stop soon."""


def fly_many(
    plan: FlightPlan, seeds: Iterable[int], *, lanes: int = LANES, threads: int | None = None
) -> Iterator[Run]:
    """Fly a plan under many seeds by machine code; yields the records in the order of the seeds.

    Each equals that of `simulate(..., driver="fused", throw=False)` bit for bit, whatever the
    number of lanes and threads. Close the generator to stop early.

    Args:
        plan: The plan of any seed; see `prepare`.
        seeds: Whole numbers from 0 on.
        lanes: Flights at a time in a thread.
        threads: Threads; one for each processor if None.

    Raises:
        SettingsError: Lanes or threads below 1, or a law or an estimator that is not written as
            kernels; the message names it.
        ScenarioError: A seed that is no whole number from 0 on.
        NonFiniteWrench: The law returned NaN or infinity.
    """

    def collect(block: Block) -> Collect[Run]:
        return lambda some: [
            run_of(block, plan.with_seed(seed), lane) for lane, seed in enumerate(some)
        ]

    for runs in fly_blocks(plan, seeds, collect, lanes=lanes, threads=threads):
        yield from runs


def fly_blocks(
    plan: FlightPlan,
    seeds: Iterable[int],
    collect: Callable[[Block], Collect[Result]],
    *,
    keep: Keep = "record",
    lanes: int = LANES,
    threads: int | None = None,
) -> Iterator[list[Result]]:
    """Fly a plan under many seeds, and make something of each block that has been flown.

    Args:
        plan: The plan of any seed.
        seeds: Whole numbers from 0 on.
        collect: Given a block, once a thread: a function from the seeds that it has just flown, one
            a lane, to what is wanted of each. The block's rows are overwritten afterwards.
        keep: What the flights write.
        lanes: Flights at a time in a thread; one where nothing can be compiled.
        threads: Threads; one for each processor if None.

    Yields:
        What `collect` made of each block, in the order of the seeds.

    Raises:
        SettingsError, ScenarioError: As `fly_many`.
    """
    check = Checker("many flights", SettingsError)
    check.instance("plan", plan, FlightPlan)
    if not isinstance(seeds, Iterable) or getattr(seeds, "ndim", 1) != 1:
        raise check.refuse("seeds", f"is {shown(seeds)}", "give several, as in range(8)")
    lanes = check.whole("lanes", lanes, 1, MOST)
    threads = check.whole("threads", (os.cpu_count() or 1) if threads is None else threads, 1, MOST)
    lanes = lanes if available() and lanes > 1 else 0  # one at a time, as scalars
    tables, local = Tables(plan), threading.local()

    @one_blas_thread()
    def fly(some: Sequence[int]) -> list[Result]:
        if not hasattr(local, "fused"):
            local.fused = Fused(tables, lanes, keep)
            local.collect = collect(local.fused.block)
        local.fused.block.draw(some)
        local.fused.fly()
        done: list[Result] = local.collect(some)
        return done

    remaining = map(checked_seed, iter(seeds))
    blocks = iter(lambda: list(itertools.islice(remaining, lanes or 1)), [])
    yield from map(fly, itertools.islice(blocks, 1))  # compiles, if it has to be
    yield from map(fly, blocks) if threads == 1 else _in_threads(fly, blocks, threads)


def _in_threads(
    fly: Callable[[Sequence[int]], list[Result]], blocks: Iterator[list[int]], threads: int
) -> Iterator[list[Result]]:
    """Results in order; closed early, blocks in the air land and no others start."""
    with ThreadPoolExecutor(threads) as pool:
        waiting: deque[Future[list[Result]]] = deque()

        def enqueue(count: int) -> None:
            waiting.extend(pool.submit(fly, some) for some in itertools.islice(blocks, count))

        try:
            enqueue(QUEUED * threads)
            while waiting:
                done = waiting.popleft().result()
                enqueue(1)
                yield done
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
