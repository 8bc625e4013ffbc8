"""What the machine code costs before it flies, under AVX2, and how much code it takes."""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path

import pytest
from apart import HERE, apart, environment, first_times
from meter import Row
from test_campaign import FLOWN

FIRST = "The first flight and the first campaign of a process, s of processor time"

COMPILED_BEFORE = 36e6
"""The first compiled flight before there was one source, measured once [RE]."""

ROOMS = ("control", "dynamics", "simulation", "numbers")

PROCESSOR = pytest.mark.benchmark(timer=time.process_time)


@PROCESSOR
def test_first_flights(benchmark, meter, smoke, tmp_path):
    """Nothing on disk; then another law, the rest on disk; then all of it from disk."""
    cache = None if smoke else tmp_path

    def work():
        return [first_times(law, cache) for law in ("dc-pid", "pid", "dc-pid")]

    cold, other, warm = benchmark.pedantic(work, rounds=1)
    if smoke:
        return
    first = cold["flight"] / cold["re"] / COMPILED_BEFORE
    rows = [
        Row(FIRST, "one flight, all compiled", 0.0, value=cold["flight"], unit="s"),
        Row(FIRST, "and then a campaign, lanes compiled", 0.0, value=cold["campaign"]),
        Row(FIRST, "one flight, another law compiled", 0.0, value=other["flight"]),
        Row(FIRST, "and then a campaign, its lanes compiled", 0.0, value=other["campaign"]),
        Row(FIRST, "one flight, from disk", 0.0, value=warm["flight"], unit="s"),
        Row(FIRST, "and then a campaign, from disk", 0.0, value=warm["campaign"]),
        Row(
            "First compile of one law",
            "share of what it took before",
            0.0,
            value=first,
            unit="of it",
        ),
    ]
    compiled, from_disk = rows[6], rows[4]
    compiled.promise, compiled.must, compiled.aim = (
        "first compile of one law, CPU, as a share of what it was",
        0.6,
        0.35,
    )
    from_disk.promise, from_disk.must, from_disk.aim = (
        "first flight of a process, code from disk, CPU",
        0.5,
        0.3,
    )
    for row in rows:
        meter.add(benchmark, row)


@pytest.mark.benchmark(timer=time.perf_counter)
def test_avx2(benchmark, meter, smoke, steps, tmp_path):
    """Machine code for a processor without AVX-512, in a process of its own."""
    env = environment() if smoke else environment(tmp_path, avx2=True)
    command = [sys.executable, str(HERE / "apart.py"), "campaign", str(steps), "2"]
    row = Row(
        FLOWN,
        "dc-pid, first-order, 2 threads by the clock, AVX2",
        0.0,
        unit="RE",
    )
    bursts = []
    with apart(command, env) as process:
        process.burst()
        benchmark.pedantic(lambda: bursts.append(process.burst()), rounds=25)
    if smoke:
        return
    row.us = statistics.median(burst["step"] for burst in bursts) * 1e6
    row.re = row.value = statistics.median(burst["step"] / burst["re"] for burst in bursts)
    meter.add(benchmark, row)


@PROCESSOR
def test_lines(benchmark, meter):
    rooms = [Path(HERE.parent / "fullam" / room) for room in ROOMS]

    def count():
        files = (path for room in rooms for path in room.rglob("*.py"))
        return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)

    lines = benchmark.pedantic(count, rounds=1)
    row = Row("Size", " + ".join(ROOMS), 0.0, must=8300, aim=7500, value=lines, unit="lines")
    row.promise = "lines of control + dynamics + simulation + numbers"
    meter.add(benchmark, row)
