"""What many tests share."""

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

# Small matrices: more threads than idle processors take up to fifty times as long.
threadpool_limits(1)


@pytest.fixture
def rng():
    """A generator that is the same in every run."""
    return np.random.default_rng(20260101)
