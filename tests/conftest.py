"""What many tests share."""

import signal

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

# Small matrices: more threads than idle processors take up to fifty times as long.
threadpool_limits(1)

# A shell that runs the tests in the background has interrupts ignored, and what they start too.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def rng():
    """A generator that is the same in every run."""
    return np.random.default_rng(20260101)
