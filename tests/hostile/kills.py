"""Campaigns that are killed, interrupted and run twice at once, at moments drawn by a seed."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import psutil

from fullam.analysis.campaign import Campaign, sweep
from fullam.analysis.campaign_store import CampaignStore
from fullam.simulation.scenarios.scenario import load_scenario

SCRIPT = """
import signal, sys, time
# A shell starts what is in the background with interrupts ignored, children of it too.
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.path.insert(0, {here!r})
import kills, fullam.simulation.simulate
print("ready", flush=True)
out, driver, jobs = sys.argv[1:]
kills.sweep(kills.campaign(driver), out, jobs=int(jobs), progress=lambda done, total:
    print(done, time.monotonic(), flush=True))
"""

READY = "ready\n"
"""Said when all is imported: an interrupt that is raised within somebody else's extension, while it
is being imported, may be lost. The command `fullam` ends at once then; here it is a program's."""

OLD = 0.6
"""A row that was handed over so long before the kill [s] must be in a file: half a second, and a
tenth for the disk."""


DEAF = "no end within 30 s of an interrupt\n"


@dataclass
class Toll:
    """What the kills cost; all but `killed` should be 0."""

    killed: int = 0
    lost: int = 0
    different: int = 0
    orphans: int = 0
    leftovers: int = 0
    mixed: int = 0
    tracebacks: int = 0
    deaf: int = 0

    @property
    def bad(self) -> int:
        """All that should not be."""
        return sum(vars(self).values()) - self.killed


SEEDS = {"python": 10, "fused": 8000}
"""As many flights as each driver flies in some seconds."""


def campaign(driver: str) -> Campaign:
    """Some seconds of flights."""
    short = replace(load_scenario("position-1"), name="short", duration=2.0)
    return Campaign((short,), ("pid", "dc-pid"), tuple(range(SEEDS[driver])), driver=driver)


def kill_sweeps(count: int, folder: Path, seed: int = 0) -> Toll:
    """Kill sweeps at random moments, go on, and compare the end with an undisturbed one."""
    toll, draw = Toll(), random.Random(seed)
    campaigns = {driver: campaign(driver) for driver in SEEDS}
    wholes = {driver: folder / f"whole-{driver}.parquet" for driver in SEEDS}
    for driver, path in wholes.items():
        sweep(campaigns[driver], path, overwrite=True)
    for k in range(count):
        out, jobs = folder / f"killed-{k}.parquet", draw.choice((1, 2))
        driver = list(SEEDS)[k % len(SEEDS)]
        wanted, whole = campaigns[driver], wholes[driver]
        process = _start(out, driver, jobs)
        hard = draw.random() < 0.7
        told, family, complaint = _stopped(process, draw.uniform(0.0, 4.0), hard, draw)
        toll.deaf += DEAF in complaint
        toll.killed += 1
        toll.tracebacks += not hard and complaint.count("Traceback") > 1
        toll.orphans += len(psutil.wait_procs(family, timeout=10.0)[1])
        if not out.exists():
            kept = len(CampaignStore(out, wanted.identity(), False).keys)
            toll.lost += max(0, told - kept)
        sweep(wanted, out, jobs=jobs)
        toll.different += out.read_bytes() != whole.read_bytes()
        left = {p.name for p in folder.glob(f"*killed-{k}*")} - {out.name}
        toll.leftovers += len(left)
        out.unlink()
    toll.mixed = _two_at_once(folder, wholes["python"])
    return toll


def _start(out: Path, driver: str, jobs: int) -> subprocess.Popen[str]:
    code = SCRIPT.format(here=str(Path(__file__).parent))
    return subprocess.Popen(
        [sys.executable, "-c", code, str(out), driver, str(jobs)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )


def _stopped(
    process: subprocess.Popen[str], after: float, hard: bool, draw: random.Random
) -> tuple[int, list[psutil.Process], str]:
    """Rows told of long enough before the end, the processes that there were, complaints."""
    assert process.stdout is not None and process.stdout.readline() == READY
    time.sleep(after)
    try:
        family = psutil.Process(process.pid).children(recursive=True)
        if hard and family and draw.random() < 0.3:
            family[0].kill()  # a worker first
            time.sleep(0.2)
    except psutil.NoSuchProcess:
        family = []
    process.send_signal(signal.SIGKILL if hard else signal.SIGINT)
    moment = time.monotonic()
    try:
        said, complaint = process.communicate(timeout=30.0)
    except subprocess.TimeoutExpired:
        process.kill()
        said, complaint = process.communicate()
        hard, complaint = True, complaint + DEAF
        sys.stderr.write(complaint)
    lines = [line.split() for line in said.splitlines() if len(line.split()) == 2]
    told = [int(done) for done, at in lines if float(at) < moment - (OLD if hard else 0.0)]
    return max(told, default=0), family, complaint


def _two_at_once(folder: Path, whole: Path) -> int:
    """Two sweeps on one file: one says that it may not, the other's file is whole."""
    out = folder / "two.parquet"
    first, second = (_start(out, "python", 1) for _ in range(2))
    ends = [process.communicate(timeout=120.0)[1] for process in (first, second)]
    codes = sorted(process.returncode for process in (first, second))
    refused = sum("being written by another process" in end for end in ends)
    right = codes == [0, 1] and refused == 1 and out.read_bytes() == whole.read_bytes()
    out.unlink(missing_ok=True)
    return int(not right)
