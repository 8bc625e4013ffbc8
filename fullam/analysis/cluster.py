"""Work spread over processes by dask.distributed, which survives the loss of a worker."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any, TypeVar

from fullam.exceptions import CampaignError, MissingDependency

CONNECT_TIMEOUT = 10.0
"""How long a scheduler may take to answer [s]."""

Item = TypeVar("Item")
Result = TypeVar("Result")


def map_unordered(
    work: Callable[[Item], Result], items: list[Item], jobs: int, scheduler: str | None = None
) -> Iterator[Result]:
    """Results of `work` on every item, as they come; an item whose worker dies is done again.

    A local cluster has `jobs` processes of one thread each (BLAS and OpenMP too), listens on the
    loopback only, without a dashboard, and ends with this process even if that is killed.

    Args:
        work: A function that can be pickled and gives the same result every time.
        items: Its arguments.
        jobs: Processes of the local cluster.
        scheduler: Address of a running scheduler, instead of a local cluster.

    Raises:
        MissingDependency: distributed is not installed.
        CampaignError: No scheduler answers, or one item killed four workers.
    """
    try:
        import distributed
    except ImportError as error:
        raise MissingDependency("more than one job", "distributed", "campaign") from error
    with ExitStack() as stack:
        if scheduler is None:
            cluster = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=jobs,
                    threads_per_worker=1,
                    processes=True,
                    host="127.0.0.1",
                    dashboard_address=None,
                    silence_logs=logging.CRITICAL,
                )
            )
        address: Any = cluster if scheduler is None else scheduler
        try:
            client = stack.enter_context(
                distributed.Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
            )
        except OSError as error:
            raise CampaignError(
                str(scheduler), "scheduler", f"does not answer ({error})", "start it first"
            ) from error
        futures = client.map(work, items, pure=False)
        try:
            for future in distributed.as_completed(futures, loop=client.loop):
                yield future.result()
                future.release()
        except distributed.KilledWorker as error:
            raise CampaignError(
                "campaign", "worker", f"one task killed several ({error})", "fly it with one job"
            ) from error
