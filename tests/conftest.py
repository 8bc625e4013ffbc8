"""What many tests share."""

import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from fullam.viz.viewer.browser import chromium_path

# What writes the book also reads the code in it.
sys.path.insert(0, str(Path(__file__).parents[1] / "notebooks" / "book"))
sys.path.insert(0, str(Path(__file__).parent / "support"))

# Small matrices: more threads than idle processors take up to fifty times as long.
threadpool_limits(1)

# A shell that runs the tests in the background has interrupts ignored, and what they start too.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def rng():
    """A generator that is the same in every run."""
    return np.random.default_rng(20260101)


def pytest_runtest_setup(item):
    """Skip what is marked `browser` where there is none; `.ci/run` sees to it that there is."""
    if item.get_closest_marker("browser") and chromium_path() is None:
        pytest.skip("no Chromium on this machine to look with (Debian: apt install chromium)")
