"""Worker processes of this machine, spoken to through anonymous pipes.

Nothing listens: a pipe has no address, and only the two processes hold its ends. So no other user
can reach a worker, and no port is opened. A worker whose parent is gone sees its pipe end and
stops; a worker that dies is replaced and its item done again. Classes of a notebook or a script
travel by value (cloudpickle), so neither needs a main guard.

A message is its length in eight bytes, then a pickle: to a worker (pickled work or None, pickled
item), back from it (whether it went well, result or exception). The work is unpacked first, and
begins with the plugins that are loaded here (`luggage`): what follows may be of their classes.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import signal
import struct
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import IO, Any

from fullam.analysis.luggage import equipped
from fullam.exceptions import CampaignError, MissingDependency

MOST_JOBS = 256
"""More processes than this are a typing error."""

MOST_DEATHS = 4
"""An item that has taken this many workers with it is given up."""

LENGTH = struct.Struct("<Q")

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of a worker: small matrices gain nothing from threads."""


def write_message(pipe: IO[bytes], payload: bytes) -> None:
    """Send one message."""
    pipe.write(LENGTH.pack(len(payload)) + payload)
    pipe.flush()


def read_message(pipe: IO[bytes]) -> bytes:
    """Wait for one message.

    Raises:
        EOFError: The other side is gone.
    """
    head = pipe.read(LENGTH.size)
    if len(head) < LENGTH.size:
        raise EOFError
    payload = pipe.read(LENGTH.unpack(head)[0])
    if len(payload) < LENGTH.unpack(head)[0]:
        raise EOFError
    return payload


def serve() -> None:
    """What a worker process does until its parent closes the pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its workers
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever the work prints must not look like a message
    inbox: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(sys.stdin.buffer, inbox), daemon=True).start()
    work: Callable[[Any], Any] | None = None
    while True:
        try:
            new, item = pickle.loads(inbox.get())
            work = pickle.loads(new) if new is not None else work
            assert work is not None
            answer = (True, work(pickle.loads(item)))
        except Exception as error:  # noqa: BLE001 - every error is the parent's to raise
            answer = (False, error)
        write_message(out, _packed(answer))


def _listen(pipe: IO[bytes], inbox: queue.SimpleQueue[bytes]) -> None:
    """Hand on what comes; end the process when the parent is gone, whatever it is doing."""
    try:
        while True:
            inbox.put(read_message(pipe))
    except (EOFError, OSError):
        os._exit(0)


def _packed(answer: tuple[bool, Any]) -> bytes:
    import cloudpickle

    try:
        payload: bytes = cloudpickle.dumps(answer)
        pickle.loads(payload)
    except Exception as error:  # noqa: BLE001 - exceptions of others often cannot be copied
        problem = f"{type(answer[1]).__name__}: {answer[1]} (cannot be sent: {error})"
        payload = pickle.dumps((False, CampaignError("worker", "result", problem, "see there")))
    return payload


@dataclass
class _Task:
    """One item on its way: which map it belongs to, its place, how many workers it has cost."""

    of: int
    index: int
    item: Any
    deaths: int = 0


class _Worker:
    """One child process; `ask` is called by one thread at a time."""

    def __init__(self) -> None:
        code = f"import sys; sys.path[:] = {sys.path!r}; "
        code += f"from {__name__} import serve; serve()"
        self.process = subprocess.Popen(
            [sys.executable, "-c", code],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | ONE_THREAD,
            start_new_session=True,  # Ctrl-C at the terminal is the parent's to handle
        )
        self.knows = -1

    def ask(self, work: bytes, task: _Task) -> tuple[bool, Any]:
        """Result of one item.

        Raises:
            EOFError: The process has died.
        """
        import cloudpickle

        assert self.process.stdin is not None
        assert self.process.stdout is not None
        new = None if self.knows == task.of else work
        try:
            write_message(self.process.stdin, pickle.dumps((new, cloudpickle.dumps(task.item))))
        except OSError as error:
            raise EOFError from error
        self.knows = task.of
        answer: tuple[bool, Any] = pickle.loads(read_message(self.process.stdout))
        return answer

    def kill(self) -> None:
        """End the process, whatever it does."""
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            with contextlib.suppress(OSError, ValueError):
                if pipe is not None:
                    pipe.close()


class WorkerProcesses:
    """A number of worker processes, started when there is work; see the module's text."""

    def __init__(self, jobs: int) -> None:
        """Start the threads that look after the processes, one each.

        Args:
            jobs: Number of processes, 1 to `MOST_JOBS`.

        Raises:
            CampaignError: No sensible number.
            MissingDependency: cloudpickle is not installed.
        """
        if not 1 <= jobs <= MOST_JOBS:
            raise CampaignError("campaign", "jobs", f"is {jobs}", f"give 1 to {MOST_JOBS}")
        try:
            import cloudpickle  # noqa: F401
        except ImportError as error:
            raise MissingDependency("more than one job", "cloudpickle", "campaign") from error
        self._tasks: queue.SimpleQueue[_Task | None] = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[tuple[_Task, bool, Any]] = queue.SimpleQueue()
        self._work, self._map, self._closing = b"", 0, False
        self._workers: dict[int, _Worker] = {}
        self._hiring = threading.Lock()
        self._threads = [
            threading.Thread(target=self._look_after, args=(k,), daemon=True) for k in range(jobs)
        ]
        for thread in self._threads:
            thread.start()

    @property
    def pids(self) -> list[int]:
        """Process numbers of the workers that run now."""
        return [worker.process.pid for worker in list(self._workers.values())]

    def _look_after(self, k: int) -> None:
        while (task := self._tasks.get()) is not None and not self._closing:
            if task.of != self._map:
                continue  # of a map that nobody waits for
            try:
                well, result = self._worker(k).ask(self._work, task)
                self._answers.put((task, well, result))
            except EOFError:
                self._bury(k, task)
            except Exception as error:  # noqa: BLE001 - raised where the map is waited for
                self._answers.put((task, False, error))

    def _worker(self, k: int) -> _Worker:
        """The process of thread k, started when it is first needed."""
        with self._hiring:
            if self._closing:
                raise EOFError
            if k not in self._workers:
                self._workers[k] = _Worker()
            return self._workers[k]

    def _bury(self, k: int, task: _Task) -> None:
        """A worker has died: its item goes to another, unless it has killed too many."""
        with self._hiring:  # `close` goes through them
            worker = self._workers.pop(k, None)
        if worker is None:
            return
        worker.kill()
        if self._closing:
            return
        task.deaths += 1
        if task.deaths < MOST_DEATHS:
            self._tasks.put(task)
            return
        ended = f"one item ended {task.deaths} of them (last exit code {worker.process.returncode})"
        problem = CampaignError("campaign", "worker", ended, "fly it with one job to see why")
        self._answers.put((task, False, problem))

    def map_unordered(
        self,
        work: Callable[[Any], Any],
        items: Sequence[Any],
        rest: Callable[[Any, Any], Any] | None = None,
    ) -> Iterator[tuple[int, Any]]:
        """As `fullam.analysis.cluster.Workers.map_unordered`."""
        import cloudpickle

        self._map += 1
        self._work = cloudpickle.dumps(equipped(work))
        for i, item in enumerate(items):
            self._tasks.put(_Task(self._map, i, item))
        due = len(items)
        while due:
            task, well, result = self._answers.get()
            if task.of != self._map:
                continue
            if not well:
                raise result
            left = rest(task.item, result) if rest is not None else None
            if left is None:
                due -= 1
            else:
                self._tasks.put(_Task(task.of, task.index, left))
            yield task.index, result

    def close(self) -> None:
        """End all workers at once; what they do is dropped."""
        with self._hiring:
            self._closing = True
            for worker in self._workers.values():
                worker.process.kill()
        for _ in self._threads:
            self._tasks.put(None)
        for thread in self._threads:
            thread.join()
        for worker in self._workers.values():
            worker.kill()
        self._workers.clear()
