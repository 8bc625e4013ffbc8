"""Panels by name, under each other."""

import matplotlib
import numpy as np
import pytest

import fullam
from fullam.exceptions import InvalidInput, UnknownName
from fullam.simulation.scenarios.interaction import AHEAD_DEG, HOME, YAW_DEG
from fullam.simulation.weather import CALM
from fullam.simulation.world.surfaces import Plane
from fullam.viz.figures import overview
from fullam.viz.panels import PANELS, plot

ON_SERVOS = ("contact", "joints", "torques")


@pytest.fixture(scope="module")
def run():
    data = fullam.load_scenario("task-2").to_dict() | {"duration": 0.8}
    return fullam.simulate(fullam.Scenario.from_dict(data), seed=2)


@pytest.fixture(scope="module")
def touching():
    """Stands in a soft wall, and is told to push from 0.2 s on."""
    scenario = fullam.Scenario(
        "touching",
        fullam.Step(HOME, YAW_DEG),
        initial_position=HOME,
        initial_euler_deg=YAW_DEG,
        initial_arm_deg=AHEAD_DEG,
        duration=0.5,
        weather=CALM,
        world=(Plane((0.58, 0.0, 0.0), (-1.0, 0.0, 0.0), stiffness=2e3, dissipation=5.0),),
    )
    settings = {"engage_at": 0.2, "tare": 0.1, "normal": (2.0, 0.0, 0.0)}
    return fullam.simulate(scenario, "hybrid-force", settings=settings, driver="python")


@pytest.mark.parametrize("name", PANELS)
def test_every_panel_fills_its_rows(run, touching, name):
    figure = plot(touching if name in ON_SERVOS else run, [name])
    axes = figure.get_axes()
    assert len(axes) == PANELS[name].rows
    for ax in axes:
        assert ax.lines
        assert "[" in ax.get_ylabel() or name == "effort"  # thrusts over weight have no unit


def test_the_contact_panel_shows_the_push_and_what_was_asked(touching):
    (ax,) = plot(touching, ["contact"]).get_axes()
    lines = {line.get_label(): np.asarray(line.get_ydata()) for line in ax.lines}
    np.testing.assert_allclose(lines["along the normal"], -touching.contact_force[:, 0])
    across = np.linalg.norm(touching.contact_force[:, 1:], axis=1)
    np.testing.assert_allclose(lines["across"], across, atol=1e-12)  # of rounding
    late = touching.t >= 0.2
    assert np.all(lines["asked"][late] == 3.0) and np.all(np.isnan(lines["asked"][~late]))


def test_the_overview_has_contact_and_torques_where_there_are_any(run, touching):
    labels = [ax.get_ylabel() for ax in overview(touching).get_axes()]
    assert "tool's push [N]" in labels and "torques [N m]" in labels
    assert len(labels) == len(overview(run).get_axes()) + 2


def test_a_panel_of_what_the_record_does_not_have_says_so(run):
    for name in ("contact", "torques"):
        with pytest.raises(InvalidInput, match="prescribed"):
            plot(run, [name])


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
