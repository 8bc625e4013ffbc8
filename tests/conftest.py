"""What many tests share."""

import numpy as np
import pytest


@pytest.fixture
def rng():
    """A generator that is the same in every run."""
    return np.random.default_rng(20260101)
