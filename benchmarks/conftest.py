"""Options, the meter, and the summary at the end."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import report
from meter import Meter
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
def smoke(request):
    """Whether the rows' work is only done once, as small as it can be, and nothing is timed."""
    return bool(request.config.getoption("benchmark_disable"))


@pytest.fixture
def flights(request, smoke):
    """How many flights a campaign has."""
    return 4 if smoke else request.config.getoption("flights")


@pytest.fixture
def steps(smoke):
    """How many steps of 1 ms a flight has."""
    return 40 if smoke else 1000


def pytest_runtest_logreport(report):
    """Rows that could not be had are named in the summary."""
    if report.skipped and isinstance(report.longrepr, tuple):
        SKIPPED.append(f"{report.nodeid.split('::')[-1]}: {report.longrepr[2]}")


SKIPPED: list[str] = []


def pytest_terminal_summary(terminalreporter, config):
    meter = config.stash[METER]
    meter.skipped += SKIPPED
    lines = [report.machine(), *report.figures(meter)]
    terminalreporter.section("fullam in RNEA equivalents")
    for line in [*lines, "", *report.bounds(meter)]:
        terminalreporter.write_line(line)
    if config.getoption("--readme"):
        write_section("bounds", "\n".join([report.processor() + ":", "", *report.bounds(meter)]))
        write_section("figures", "\n".join(["```", *lines, "```"]))
