"""Before anything flies: CPU time of the first import and of the first answer."""

from __future__ import annotations

import resource
import subprocess
import sys

import pytest
from meter import Row

pytestmark = pytest.mark.benchmark(timer=lambda: _cpu_of_children())


def _cpu_of_children():
    """CPU time of all processes that were started and have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@pytest.mark.parametrize(
    ("arguments", "must"),
    [
        (("-c", "import numpy, pinocchio"), None),
        (("-c", "import fullam"), 500e3),
        (("-m", "fullam", "--help"), 350e3),
    ],
    ids=["floor", "import", "help"],
)
def test_start(benchmark, meter, arguments, must):
    command = [sys.executable, *arguments]
    benchmark.pedantic(
        lambda: subprocess.run(command, check=True, capture_output=True), rounds=7, warmup_rounds=1
    )
    if not benchmark.enabled:
        return
    row = Row("Start, CPU time", f"python {' '.join(arguments)}", 0.0, must=must, unit="us")
    # The least of seven: what is above it, other processes on the machine cost.
    row.us = row.value = benchmark.stats.stats.min * 1e6
    meter.add(benchmark, row)
