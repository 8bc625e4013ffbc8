"""Work spread over processes by dask.distributed, which survives the loss of a worker."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

from fullam.exceptions import CampaignError, MissingDependency

CONNECT_TIMEOUT = 10.0
"""How long a scheduler may take to answer [s]."""

Item = TypeVar("Item")
Result = TypeVar("Result")


class Workers:
    """Where work is done: this process, or a cluster's; see `open_workers`."""

    def __init__(self, client: Any = None) -> None:
        """Take a connected client; None works in this process."""
        self._client = client

    def map_unordered(
        self, work: Callable[[Item], Result], items: Sequence[Item]
    ) -> Iterator[tuple[int, Result]]:
        """(index, result) of `work` on every item, as they come.

        An item whose worker dies is done again by another.

        Args:
            work: A function that can be pickled and gives the same result every time.
            items: Its arguments.

        Raises:
            CampaignError: One item killed four workers.
        """
        if self._client is None:
            yield from ((i, work(item)) for i, item in enumerate(items))
            return
        import distributed

        futures = self._client.map(work, items, pure=False)
        index = {future.key: i for i, future in enumerate(futures)}
        try:
            for future in distributed.as_completed(futures, loop=self._client.loop):
                yield index[future.key], future.result()
                future.release()
        except distributed.KilledWorker as error:
            raise CampaignError(
                "campaign", "worker", f"one task killed several ({error})", "fly it with one job"
            ) from error

    def map(self, work: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
        """Results of `work` on every item, in the items' order."""
        found = dict(self.map_unordered(work, items))
        return [found[i] for i in range(len(items))]


@contextmanager
def open_workers(jobs: int = 1, scheduler: str | None = None) -> Iterator[Workers]:
    """Workers for the length of a `with` block.

    A local cluster has `jobs` processes of one thread each (BLAS and OpenMP too), listens on the
    loopback only, without a dashboard, and ends with this process even if that is killed.

    Args:
        jobs: Processes of the local cluster; 1 works in this process, with one thread, and needs
            no cluster.
        scheduler: Address of a running dask scheduler, instead of a local cluster.

    Raises:
        MissingDependency: distributed is not installed.
        CampaignError: Fewer than one job, or no scheduler answers.
    """
    if jobs < 1:
        raise CampaignError("campaign", "jobs", f"is {jobs}", "give 1 or more")
    if jobs == 1 and scheduler is None:
        # Small matrices gain nothing from threads, and on a busy machine they lose tenfold.
        with threadpool_limits(1):
            yield Workers()
        return
    try:
        import distributed
    except ImportError as error:
        raise MissingDependency("more than one job", "distributed", "campaign") from error
    with ExitStack() as stack:
        address: Any = scheduler
        if scheduler is None:
            address = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=jobs,
                    threads_per_worker=1,
                    processes=True,
                    host="127.0.0.1",
                    dashboard_address=None,
                    silence_logs=logging.CRITICAL,
                )
            )
        try:
            client = stack.enter_context(
                distributed.Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
            )
        except OSError as error:
            raise CampaignError(
                str(scheduler), "scheduler", f"does not answer ({error})", "start it first"
            ) from error
        yield Workers(client)
