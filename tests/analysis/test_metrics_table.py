"""What `measure` gives reads well where it is printed, and says the same as its numbers."""

import re
from dataclasses import replace
from html import unescape

import pytest

import fullam
from fullam.analysis.metrics_table import AXIS_ROWS, figures_of
from fullam.cli import main


@pytest.fixture(scope="module")
def metrics():
    data = fullam.load_scenario("position-1").to_dict() | {"duration": 1.0}
    return fullam.measure(fullam.simulate(fullam.Scenario.from_dict(data), seed=2))


def cells_of(page):
    rows = re.findall(r"<tr>(.*?)</tr>", page)
    return [[unescape(c) for c in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row)] for row in rows]


def test_a_terminal_shows_every_figure_in_a_line(metrics):
    lines = repr(metrics).splitlines()
    assert len(lines) == 2 + len(AXIS_ROWS) + 1 + len(figures_of([metrics]))
    assert all(len(line) <= 100 for line in lines)
    assert f"{metrics.rms_position_mm:.2f}  mm" in repr(metrics)
    assert str(metrics) == repr(metrics)


def test_the_command_prints_the_same_tables(capsys):
    assert main(["run", "position-1", "--seed", "2", "--driver", "fused"]) == 0
    flown = fullam.measure(fullam.simulate("position-1", seed=2, driver="fused"))
    assert repr(flown) in capsys.readouterr().out


def test_a_notebook_shows_the_same_cells(metrics):
    header, *rows = cells_of(metrics._repr_html_())
    assert header[1:] == [f"{name} [{axis.unit}]" for name, axis in metrics.axes.items()]
    assert len(rows) == len(AXIS_ROWS) + len(figures_of([metrics]))
    for cells in rows:
        assert " ".join(cells).split() in [line.split() for line in repr(metrics).splitlines()]


def test_what_comes_from_elsewhere_is_escaped(metrics):
    axes = {"<b>x": replace(metrics.axes["x"], unit="<i>")}
    page = replace(metrics, axes=axes)._repr_html_()
    assert "&lt;b&gt;x [&lt;i&gt;]" in page
    assert "<b>" not in page and "<i>" not in page


def test_a_flight_without_a_row_has_a_table_too():
    nothing = replace(
        fullam.measure(fullam.simulate("hextilt-step", driver="fused")), axes={}, settled=False
    )
    assert "settled" in repr(nothing)
    assert "<table>" in nothing._repr_html_()
