"""Figures: what they show, where, in which unit, and that they leave no half-written file."""

import threading

import numpy as np
import pytest

from fullam.exceptions import InvalidInput
from fullam.simulation.motions.references import Step
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.simulate import simulate
from fullam.viz import style
from fullam.viz.figures import FIGURES, compare, figure_pose, figure_residual, save_figure

SCENARIO = Scenario(
    "short",
    reference=Step((0.3, 0.0, 1.0), (0.0, 10.0, 0.0)),
    initial_arm_deg=(-90.0, 0.0, -45.0, 0.0),
    duration=0.8,
)


@pytest.fixture(scope="module")
def run():
    return simulate(SCENARIO, "dc-pid", seed=1, throw=False)


def lines(ax):
    return {line.get_label(): line for line in ax.get_lines()}


@pytest.mark.parametrize("name", FIGURES)
def test_every_axis_has_its_unit_and_only_the_lowest_names_the_time(run, name):
    figure = FIGURES[name](run)
    figure.draw_without_rendering()
    for ax in figure.axes:
        label = ax.get_ylabel()
        assert label.endswith("]") or "/" in label, f"'{label}' has no unit"
    assert any(ax.get_xlabel() == "time [s]" for ax in figure.axes)
    shared = figure.axes[0].get_shared_x_axes()
    assert all(shared.joined(figure.axes[0], ax) for ax in figure.axes[1:])


@pytest.mark.parametrize("name", FIGURES)
def test_legends_stand_above_the_axes_and_cover_no_data(run, name):
    figure = FIGURES[name](run)
    figure.draw_without_rendering()
    for ax in figure.axes:
        if legend := ax.get_legend():
            # One pixel: the legend rests on the frame.
            assert legend.get_window_extent().y0 >= ax.get_window_extent().y1 - 1.0


def test_pose_shows_truth_measurement_and_dashed_reference(run):
    figure = figure_pose(run)
    shown = lines(figure.axes[0])
    np.testing.assert_array_equal(shown["true"].get_ydata(), run.pose[:, 0] * 1e3 * 1e-3)
    np.testing.assert_allclose(shown["measured"].get_ydata(), run.measured_pose[:, 0])
    np.testing.assert_allclose(shown["reference"].get_ydata(), run.reference_pose[:, 0])
    assert shown["reference"].is_dashed()
    assert not shown["true"].is_dashed()


def test_attitude_is_drawn_in_degrees_of_the_papers_euler_angles(run):
    figure = FIGURES["attitude"](run)
    psi = lines(figure.axes[1])["true"].get_ydata()
    np.testing.assert_allclose(psi, np.degrees(run.euler_xyz[:, 1]))


def test_rotor_speeds_come_with_their_bounds(run):
    ax = FIGURES["rotors"](run).axes[0]
    rotors = run.vehicle.rotors
    level = [np.unique(line.get_ydata()) for line in ax.get_lines()]
    constant = {float(value[0]) for value in level if value.size == 1}
    assert {0.0, float(rotors.max_speeds.max())} <= constant
    low, high = ax.get_ylim()
    assert low < 0.0
    assert high > rotors.max_speeds.max()
    assert {str(i + 1) for i in range(rotors.count)} <= lines(ax).keys()


def test_saturated_spans_are_shaded_where_the_record_says(run):
    columns = {name: np.array(column) for name, column in run.columns.items()}
    columns["saturated"][:] = False
    columns["saturated"][10:20] = columns["saturated"][30:31] = True
    shaded = figure_residual(type(run)(columns, run.metadata)).axes[0].collections
    spans = [path.get_extents() for path in shaded[0].get_paths()]
    period = run.t[1]
    found = [(span.x0 / period, span.x1 / period) for span in spans]
    np.testing.assert_allclose(found, [(10, 20), (30, 31)])


def test_nothing_is_shaded_without_saturation():
    from matplotlib.figure import Figure

    ax = Figure().subplots()
    style.shade(ax, np.arange(5.0), np.zeros(5, dtype=bool), "saturated")
    assert not ax.collections


def test_compare_draws_each_controller_in_its_own_colour(run):
    other = simulate(SCENARIO, "pid", seed=1, throw=False)
    figure = compare([run, other])
    shown = lines(figure.axes[0])
    assert {"dc-pid", "pid", "reference"} <= shown.keys()
    assert shown["dc-pid"].get_color() != shown["pid"].get_color()
    np.testing.assert_allclose(shown["pid"].get_ydata(), other.pose[:, 0])
    named = lines(compare([run, run], labels=["first", "second"]).axes[0])
    assert {"first", "second"} <= named.keys()


def test_small_motion_does_not_fill_the_axis(run):
    columns = {name: np.array(column) for name, column in run.columns.items()}
    for name in ("pose", "measured_pose"):
        columns[name][:] = columns["reference_pose"]
    low, high = figure_pose(type(run)(columns, run.metadata)).axes[1].get_ylim()
    assert high - low == pytest.approx(0.05)


def test_diverged_run_is_marked_at_its_end(run):
    ended = type(run)(dict(run.columns), {**run.metadata, "outcome": "diverged"})
    for figure in (f(ended) for f in FIGURES.values()):
        for ax in figure.axes:
            ends = [line for line in ax.get_lines() if set(line.get_xdata()) == {run.t[-1]}]
            assert len(ends) == 1


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_save_figure_writes_the_format_of_the_suffix(run, tmp_path, suffix):
    path = save_figure(figure_pose(run), tmp_path / f"figure{suffix}", dpi=50)
    start = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}[suffix]
    assert path.read_bytes().startswith(start)
    assert [p.name for p in tmp_path.iterdir()] == [path.name], "no temporary is left"


def test_unknown_suffix_is_refused_with_the_known_ones(run, tmp_path):
    with pytest.raises(InvalidInput, match=r"'\.xyz' names no format.*png"):
        save_figure(figure_pose(run), tmp_path / "figure.xyz")
    assert not list(tmp_path.iterdir())


def test_figures_can_be_drawn_in_threads(run, tmp_path):
    paths = [tmp_path / f"{k}.png" for k in range(3)]
    threads = [
        threading.Thread(target=lambda p=p: save_figure(figure_pose(run), p, dpi=60)) for p in paths
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({p.read_bytes() for p in paths}) == 1


def test_colours_differ_in_lightness_or_hue_for_every_reader():
    """Simulated deuteranopia (Machado 2009) keeps every pair of the first six colours apart."""
    matrix = np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    )
    values = np.array([[int(c[i : i + 2], 16) / 255 for i in (1, 3, 5)] for c in style.PALETTE[:6]])
    seen = values**2.2 @ matrix.T
    apart = np.linalg.norm(seen[:, None] - seen[None], axis=2)[np.triu_indices(6, 1)]
    # The closest pair of Okabe and Ito's palette is about 0.15 apart in linear light.
    assert apart.min() > 0.1
