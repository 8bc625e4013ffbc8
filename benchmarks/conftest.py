"""Options, the meter, and the summary at the end."""

from __future__ import annotations

import os
import platform
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from meter import Meter, report
from page import write_section

METER = pytest.StashKey[Meter]()


def pytest_addoption(parser):
    parser.addoption(
        "--flights", type=int, default=100, help="flights of the campaign rows (1000 in README.md)"
    )
    parser.addoption("--readme", action="store_true", help="write the summary to README.md")


def pytest_configure(config):
    config.stash[METER] = Meter()


@pytest.fixture
def meter(request):
    return request.config.stash[METER]


@pytest.fixture
def flights(request):
    """How many flights a campaign has; few when only smoke-run."""
    enabled = not request.config.getoption("benchmark_disable")
    return request.config.getoption("flights") if enabled else 4


def pytest_runtest_logreport(report):
    """Optional packages that are missing are named in the summary."""
    if report.skipped and isinstance(report.longrepr, tuple):
        SKIPPED.append(f"{report.nodeid.split('::')[-1]}: {report.longrepr[2]}")


SKIPPED: list[str] = []


def pytest_terminal_summary(terminalreporter, config):
    meter = config.stash[METER]
    meter.skipped += SKIPPED
    load = ", ".join(f"{x:.1f}" for x in os.getloadavg())
    lines = [
        f"{processor()}, {os.cpu_count()} cores, load {load}, Python {platform.python_version()}",
        *report(meter),
    ]
    terminalreporter.section("fullam: the control loop in RNEA equivalents")
    for line in lines:
        terminalreporter.write_line(line)
    if config.getoption("--readme"):
        write_section("figures", "\n".join(["```", *lines, "```"]))


def processor():
    """The processor's name, where the system tells."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
