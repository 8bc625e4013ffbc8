"""Our dc-PID under the published runs' settings reproduces the published runs."""

import os
from pathlib import Path

import numpy as np
import pytest

from fullam.analysis import recorded
from fullam.analysis.recorded import (
    MEASURED,
    PUBLISHED,
    STATED,
    STATED_WITH_GUSTS,
    TASKS,
    Figures,
    compare,
    fly,
    recorded_figures,
    recorded_folder,
)

SHARED = Path(__file__).parents[2] / "shared" / "reference_runs"


@pytest.fixture
def folder():
    found = recorded_folder() or (SHARED if SHARED.is_dir() else None)
    if found is None:
        pytest.skip(f"the recorded runs are not here; {recorded.ENVIRONMENT} names their folder")
    return found


@pytest.fixture(scope="module")
def ours():
    return {task.name: compare(task, MEASURED, range(5))[0] for task in TASKS}


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
def test_rms_is_within_a_factor_of_one_and_a_half(ours, task):
    ratios = np.array(ours[task.name].rms) / np.array(PUBLISHED[task.name].rms)
    assert np.all(ratios < 1.5), ratios
    assert np.all(ratios > 1.0 / 1.5), ratios


def test_settling_and_overshoot_of_the_step_agree(ours):
    step, theirs = ours["step"], PUBLISHED["step"]
    assert np.allclose(step.settling_s, theirs.settling_s, rtol=0.0, atol=0.2)
    # In percent of 1 m, so 10 mm: the noise left after the filter has 4 mm.
    assert np.allclose(step.overshoot_percent, theirs.overshoot_percent, rtol=0.0, atol=1.0)


def test_one_model_error_explains_the_offsets_of_both_runs(ours):
    for name in ("hover", "step"):
        mean, theirs = np.array(ours[name].mean), np.array(PUBLISHED[name].mean)
        # The mean of 6 s of correlated noise scatters by 1 mm and 0.1 deg.
        assert abs(mean[2] - theirs[2]) < 1.0
        assert abs(mean[4] - theirs[4]) < 0.1
        assert abs(mean[0] - theirs[0]) < 1.5


def test_only_fifty_hertz_gives_the_recorded_noise_of_the_command(ours):
    theirs = np.array(PUBLISHED["step"].command_noise)
    assert np.all(np.array(ours["step"].command_noise)[:3] < 1.5 * theirs[:3])
    stated = np.array(fly(TASKS[1], STATED, 0).command_noise)
    assert np.all(stated[:3] > 2.0 * theirs[:3])


def test_with_the_stated_gusts_the_attitude_would_have_been_thrown(ours):
    gusty = fly(TASKS[1], STATED_WITH_GUSTS, 0)
    theirs = PUBLISHED["step"].rms
    assert gusty.rms[3] > 2.0 * theirs[3]
    assert gusty.rms[5] > 2.0 * theirs[5]


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
def test_the_quoted_figures_are_those_of_the_files(folder, task):
    found, quoted = recorded_figures(folder, task), PUBLISHED[task.name]
    for name in Figures.__dataclass_fields__:
        value, expected = getattr(found, name), getattr(quoted, name)
        if expected is None:
            assert value is None
        else:
            # Quoted to two or three digits after the point.
            assert np.allclose(value, expected, rtol=0.0, atol=0.0051), name


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
def test_the_files_show_what_the_reading_says_of_them(folder, task):
    with np.load(folder / task.file) as data:
        wrench, pose, gusts = data["wrench"], data["pose"], data["disturbance"]
    # 50 Hz: pairs of equal commands.
    assert np.array_equal(wrench[2:-1:2], wrench[3::2])
    # No trace of the gusts: a force F over one sample would change the velocity by F T / m.
    rows = np.flatnonzero(np.abs(gusts).sum(axis=1))[:-1]
    velocity = np.diff(pose, axis=0) / 0.01
    change = (velocity[rows + 1] - velocity[rows - 2])[:, :3].ravel()
    expected = gusts[rows, :3].ravel() * 0.01 / 2.25
    slope = float(change @ expected / (expected @ expected))
    # It would be 1; the commanded acceleration's own scatter (0.5 m/s^2 for 30 ms against gusts of
    # 44 mm/s, 33 of them) leaves 0.06.
    assert abs(slope) < 0.2
    # No rotor lag: acceleration and command agree in the same sample.
    acceleration = np.diff(pose[:, 0], n=2)[50:]
    assert np.corrcoef(acceleration, wrench[51:-1, 0])[0, 1] > 0.98


def test_the_folder_is_named_by_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv(recorded.ENVIRONMENT, str(tmp_path))
    assert recorded_folder() == tmp_path
    monkeypatch.setenv(recorded.ENVIRONMENT, os.fspath(tmp_path / "none"))
    assert recorded_folder() is None
