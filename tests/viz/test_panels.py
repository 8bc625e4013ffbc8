"""Panels by name, under each other."""

import matplotlib
import numpy as np
import pytest

import fullam
from fullam.exceptions import UnknownName
from fullam.viz.panels import PANELS, plot


@pytest.fixture(scope="module")
def run():
    data = fullam.load_scenario("task-2").to_dict() | {"duration": 0.8}
    return fullam.simulate(fullam.Scenario.from_dict(data), seed=2)


@pytest.mark.parametrize("name", PANELS)
def test_every_panel_fills_its_rows(run, name):
    figure = plot(run, [name])
    axes = figure.get_axes()
    assert len(axes) == PANELS[name].rows
    for ax in axes:
        assert ax.lines
        assert "[" in ax.get_ylabel() or name == "effort"  # thrusts over weight have no unit


def test_panels_stand_in_the_order_asked_for(run):
    axes = plot(run, ["rotors", "wrench", "pose"]).get_axes()
    labels = [ax.get_ylabel() for ax in axes]
    assert labels == [
        "rotor speed [rad/s]", "rotor wrench [N]", "rotor wrench [N m]", "x [m]", "y [m]", "z [m]"
    ]  # fmt: skip
    assert axes[-1].get_xlabel() == "time [s]" and not axes[0].get_xlabel()


def test_the_wrench_panel_shows_the_wrench_of_the_rotors(run):
    force, moment = plot(run, ["wrench"]).get_axes()
    for ax, half in ((force, run.rotor_wrench[:, :3]), (moment, run.rotor_wrench[:, 3:])):
        lines = [line for line in ax.lines if len(line.get_xdata()) == len(run)]
        np.testing.assert_array_equal(np.column_stack([x.get_ydata() for x in lines]), half)


def test_an_unknown_panel_lists_the_known_ones(run):
    with pytest.raises(UnknownName, match="wrench"):
        plot(run, ["wrenches"])


def test_no_global_state_of_matplotlib_is_touched(run):
    before = dict(matplotlib.rcParams)
    plot(run)
    assert dict(matplotlib.rcParams) == before
