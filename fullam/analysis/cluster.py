"""Where work is done: this process, worker processes of this machine, or a dask scheduler."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

from fullam.analysis.luggage import equipped
from fullam.analysis.worker_processes import MOST_JOBS, WorkerProcesses
from fullam.exceptions import CampaignError, FullamWarning, MissingDependency
from fullam.numbers.blas import one_blas_thread

CONNECT_TIMEOUT = 10.0
"""How long a scheduler may take to answer, and its first worker to appear [s]."""

LOOK = 0.05
"""Time between looks at what a scheduler has finished [s]."""

Item = TypeVar("Item")
Result = TypeVar("Result")
Rest = Callable[[Item, Result], Item | None]
"""What an item still needs after a result; None if nothing."""


class Workers(Protocol):
    """Something that does work on items; `open_workers` gives one."""

    def map_unordered(
        self,
        work: Callable[[Item], Result],
        items: Sequence[Item],
        rest: Rest[Item, Result] | None = None,
    ) -> Iterator[tuple[int, Result]]:
        """(index of the item, result) of `work` on every item, as they come.

        An item whose worker dies is done again by another.

        Args:
            work: A function that can be pickled and gives the same result every time.
            items: Its arguments.
            rest: For work that stops early: what the item still needs, which is then done too, and
                gives another result of the same index.

        Raises:
            CampaignError: One item killed four workers.
        """
        ...


class ThisProcess:
    """Work done here and now, item by item."""

    def map_unordered(
        self,
        work: Callable[[Item], Result],
        items: Sequence[Item],
        rest: Rest[Item, Result] | None = None,
    ) -> Iterator[tuple[int, Result]]:
        """As in `Workers`."""
        for i, item in enumerate(items):
            left: Item | None = item
            while left is not None:
                result = work(left)
                left = rest(left, result) if rest is not None else None
                yield i, result


class Threads:
    """Threads of this process: for work that leaves the interpreter's lock alone."""

    def __init__(self, pool: ThreadPoolExecutor) -> None:
        """Take a pool."""
        self._pool = pool

    def map_unordered(
        self,
        work: Callable[[Item], Result],
        items: Sequence[Item],
        rest: Rest[Item, Result] | None = None,
    ) -> Iterator[tuple[int, Result]]:
        """As in `Workers`."""
        of = {self._pool.submit(work, item): (i, item) for i, item in enumerate(items)}
        while of:
            for future in wait(of, return_when=FIRST_COMPLETED).done:
                i, item = of.pop(future)
                result = future.result()
                left = rest(item, result) if rest is not None else None
                if left is not None:
                    of[self._pool.submit(work, left)] = (i, left)
                yield i, result


def map_in_order(
    workers: Workers, work: Callable[[Item], Result], items: Sequence[Item]
) -> list[Result]:
    """Results of `work` on every item, in the items' order."""
    found = dict(workers.map_unordered(work, items))
    return [found[i] for i in range(len(items))]


@dataclass(frozen=True)
class Scheduler:
    """A running dask scheduler and the certificates that open it.

    Whoever can speak to a scheduler can run code as the owner of its workers, so it belongs behind
    TLS: `tls://host:port`. Without files here dask's own configuration (`distributed.comm.tls`) is
    asked for them.

    Attributes:
        address: As dask writes it, "tls://host:8786".
        ca_file: Certificate of the authority that signed the scheduler's.
        certificate: This client's certificate.
        key: The key of that.
    """

    address: str
    ca_file: str | None = None
    certificate: str | None = None
    key: str | None = None

    def __post_init__(self) -> None:
        """Check address and files.

        Raises:
            CampaignError: No address, or a certificate that cannot be used.
        """
        files = {"ca_file": self.ca_file, "certificate": self.certificate, "key": self.key}
        given = {name: file for name, file in files.items() if file is not None}
        if not isinstance(self.address, str) or not self.address.strip():
            raise CampaignError(
                "scheduler", "address", f"is {self.address!r}", "give tls://host:port"
            )
        if given and len(given) < 3:
            missing = ", ".join(name for name in files if name not in given)
            raise CampaignError(self.address, missing, "is not given", "give all three files")
        if given and not self.encrypted:
            raise CampaignError(
                self.address, "address", "is not encrypted", "certificates belong to tls://..."
            )
        for name, file in given.items():
            if not Path(file).is_file():
                raise CampaignError(self.address, name, f"'{file}' does not exist", "check it")

    @property
    def encrypted(self) -> bool:
        """Whether the address is one of TLS."""
        return self.address.startswith("tls://")

    @contextmanager
    def connect(self) -> Iterator[SchedulerWorkers]:
        """Connect; nothing is started or stopped there."""
        try:
            import distributed
        except ImportError as error:
            raise MissingDependency("a scheduler", "distributed", "campaign") from error
        if not self.encrypted:
            warnings.warn(
                f"{self.address} is neither encrypted nor authenticated: whoever reaches it can "
                "run code as you; start the scheduler with TLS and give its tls:// address",
                FullamWarning,
                stacklevel=4,
            )
        security = None
        if self.ca_file is not None:
            security = distributed.Security(
                require_encryption=True,
                tls_ca_file=self.ca_file,
                tls_client_cert=self.certificate,
                tls_client_key=self.key,
            )
        try:
            client = distributed.Client(
                self.address, timeout=CONNECT_TIMEOUT, set_as_default=False, security=security
            )
        except (OSError, ValueError, TypeError, RuntimeError) as error:
            raise CampaignError(
                self.address,
                "scheduler",
                f"does not answer ({error})",
                "start it first, and give its address and, for tls://, its certificates",
            ) from error
        with client:
            yield SchedulerWorkers(client, self.address)


class SchedulerWorkers:
    """The workers of a dask scheduler."""

    def __init__(self, client: Any, address: str) -> None:
        """Take a connected client."""
        self._client, self._address = client, address

    def map_unordered(
        self,
        work: Callable[[Item], Result],
        items: Sequence[Item],
        rest: Rest[Item, Result] | None = None,
    ) -> Iterator[tuple[int, Result]]:
        """As in `Workers`."""
        import distributed

        work = equipped(work)
        of: dict[str, tuple[int, Item]] = {}

        def submit(i: int, item: Item) -> Any:
            future = self._client.submit(work, item, pure=False)
            of[future.key] = (i, item)
            return future

        finished = distributed.as_completed(
            [submit(i, item) for i, item in enumerate(items)], loop=self._client.loop
        )
        try:
            while of:
                self._wait(finished)
                future = next(finished)
                i, item = of.pop(future.key)
                result = future.result()
                future.release()
                left = rest(item, result) if rest is not None else None
                if left is not None:
                    finished.add(submit(i, left))
                yield i, result
        except distributed.KilledWorker as error:
            raise CampaignError(
                "campaign", "worker", f"one task killed several ({error})", "fly it with one job"
            ) from error

    def _wait(self, finished: Any) -> None:
        """Wait for a result; say so if nobody is there to work for it."""
        since, said = time.monotonic(), False
        while not finished.has_ready():
            time.sleep(LOOK)
            if said or time.monotonic() - since < CONNECT_TIMEOUT:
                continue
            if self._client.scheduler_info(n_workers=-1)["workers"]:
                since = time.monotonic()
                continue
            warnings.warn(
                f"{self._address} has had no workers for {CONNECT_TIMEOUT:g} s; still waiting: "
                f"start some (dask worker {self._address}), or interrupt",
                FullamWarning,
                stacklevel=2,
            )
            said = True


def checked_jobs(jobs: int) -> int:
    """The number of jobs.

    Raises:
        CampaignError: It is none.
    """
    if isinstance(jobs, bool) or not isinstance(jobs, int) or not 1 <= jobs <= MOST_JOBS:
        raise CampaignError("campaign", "jobs", f"is {jobs!r}", f"give 1 to {MOST_JOBS}")
    return jobs


@contextmanager
def open_workers(
    jobs: int = 1, scheduler: Scheduler | str | None = None, threads: bool = False
) -> Iterator[Workers]:
    """Workers for the length of a `with` block.

    Args:
        jobs: Worker processes of this machine, one thread each, reached through pipes that nobody
            else can open; 1 works in this process, with one thread.
        scheduler: A running dask scheduler, or its address, instead.
        threads: Take threads of this process in the place of processes.

    Raises:
        MissingDependency: cloudpickle or distributed is not installed.
        CampaignError: Not a sensible number of jobs, or no scheduler answers.

    Warns:
        FullamWarning: The scheduler's address is not encrypted; or it has no workers.
    """
    checked_jobs(jobs)
    with ExitStack() as stack:
        if scheduler is not None:
            if isinstance(scheduler, str):
                scheduler = Scheduler(scheduler)
            yield stack.enter_context(scheduler.connect())
        elif threads and jobs > 1:
            stack.enter_context(one_blas_thread())
            pool = ThreadPoolExecutor(jobs)
            stack.callback(pool.shutdown, wait=False, cancel_futures=True)
            yield Threads(pool)
        elif jobs > 1:
            processes = WorkerProcesses(jobs)
            stack.callback(processes.close)
            yield processes
        else:
            stack.enter_context(one_blas_thread())
            yield ThisProcess()
