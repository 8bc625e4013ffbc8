"""What has to be timed in a process of its own; each burst is asked for, so that rounds alternate.

    python benchmarks/apart.py first LAW     the first flight and the first campaign of a process
    python benchmarks/apart.py campaign      bursts of a campaign, and of RNEA, line by line

Both print JSON. The folder of the machine code is that of FULLAM_CODE_CACHE; for which processor it
is compiled, NUMBA_CPU_NAME and NUMBA_CPU_FEATURES can say.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent

NOT_IN_AVX2 = ("avx512", "avx10", "amx", "evex512")
"""Beginnings of the names of features that a processor with AVX2 does not have."""


def environment(cache: Path | None = None, avx2: bool = False) -> dict[str, str]:
    """Variables of a process that keeps its machine code in a folder of its own.

    Args:
        cache: The folder; the user's own if None.
        avx2: Compile for a processor without AVX-512. The code of this processor must not be in
            the folder: its key knows nothing of the two variables.
    """
    found = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    if cache is not None:
        found["FULLAM_CODE_CACHE"] = str(cache)
    if avx2:
        from llvmlite import binding

        features = binding.get_host_cpu_features().items()
        kept = {name: on and not name.startswith(NOT_IN_AVX2) for name, on in features}
        found["NUMBA_CPU_NAME"] = "haswell"
        found["NUMBA_CPU_FEATURES"] = ",".join(f"{'+-'[not on]}{n}" for n, on in kept.items())
    return found


def first_times(law: str, cache: Path | None) -> dict[str, float]:
    """Seconds of processor time of the first flights of a new process; see `time_first`."""
    command = [sys.executable, str(HERE / "apart.py"), "first", law]
    done = subprocess.run(
        command, env=environment(cache), capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr}")
    times: dict[str, float] = json.loads(done.stdout)
    return times


class Apart:
    """A process that is asked for one burst after the other, and answers each in a line."""

    def __init__(
        self, command: list[str], env: dict[str, str] | None = None, cwd: Path | None = None
    ) -> None:
        """Start it, in a folder if one is given, and wait until it is ready.

        Raises:
            RuntimeError: It ended.
        """
        self._process = subprocess.Popen(
            command,
            env=env,
            cwd=cwd,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self.ready = self._read()

    def burst(self, *words: str) -> dict[str, Any]:
        """Have it do a burst."""
        assert self._process.stdin is not None
        print(*words, file=self._process.stdin, flush=True)
        return self._read()

    def _read(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("{"):  # packages may have something to say
                answer: dict[str, Any] = json.loads(line)
                return answer
        self.close()
        raise RuntimeError(f"{self._process.args} ended with {self._process.returncode}")

    def close(self) -> None:
        """End it."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()


@contextmanager
def apart(
    command: list[str], env: dict[str, str] | None = None, cwd: Path | None = None
) -> Iterator[Apart]:
    """A process for as long as it is needed."""
    process = Apart(command, env, cwd)
    try:
        yield process
    finally:
        process.close()


def answer_bursts(ready: dict[str, Any], burst: Any) -> None:
    """The other side of `Apart`: do what is asked for, line by line, until nobody asks."""
    print(json.dumps(ready), flush=True)  # noqa: T201
    for line in sys.stdin:
        print(json.dumps(burst(*line.split())), flush=True)  # noqa: T201


def time_first(law: str) -> dict[str, float]:
    """Processor seconds of the first flight and of the first campaign, and an RE beside them."""
    import workloads
    from meter import processor_time, rnea_timer

    from fullam.analysis.judged import fly_judged

    flown = workloads.plan(steps=50, law=law)
    unit = rnea_timer(flown.nominal, time.process_time)
    before = unit()
    flight = processor_time(lambda: workloads.fused.fly(flown), 1)
    campaign = processor_time(lambda: list(fly_judged(flown, range(8))), 1)
    return {"flight": flight, "campaign": campaign, "re": 0.5 * (before + unit())}


def serve_campaign(steps: int, threads: int) -> None:
    """Answer with seconds a step, and an RE, of flights in lanes that are drawn before."""
    import workloads
    from meter import rnea_timer

    flown = workloads.plan(steps=steps)
    fleet, unit = (
        workloads.Fleet(flown, threads=threads),
        rnea_timer(flown.nominal, time.perf_counter),
    )

    def burst() -> dict[str, float]:
        re, start = unit(), time.perf_counter()
        fleet.fly()
        return {"step": (time.perf_counter() - start) / fleet.steps, "re": re}

    answer_bursts({}, burst)


if __name__ == "__main__":
    sys.path.insert(0, str(HERE))
    if sys.argv[1] == "first":
        print(json.dumps(time_first(sys.argv[2])))  # noqa: T201
    else:
        serve_campaign(*map(int, sys.argv[2:]))
