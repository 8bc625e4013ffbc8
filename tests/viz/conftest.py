"""What the tests of pages share: without a browser there is nothing to look with."""

import pytest

from fullam.viz.viewer.browser import chromium_path


def pytest_runtest_setup(item):
    """Skip what is marked `browser` where there is none; `.ci/run` sees to it that there is."""
    if item.get_closest_marker("browser") and chromium_path() is None:
        pytest.skip("no Chromium on this machine to look with (Debian: apt install chromium)")
