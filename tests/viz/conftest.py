"""A browser that several files look at pages with."""

import pytest

from fullam.viz.viewer.browser import Browser


@pytest.fixture(scope="module")
def opened():
    with Browser(480, 300, network=False) as browser:
        yield browser


@pytest.fixture
def chromium(opened):
    """The browser; a test during which a page complains of anything has failed."""
    yield opened
    opened.evaluate("1")  # what happened before has been told by now
    complaints, opened.complaints = opened.complaints, []
    assert complaints == []
