"""What the paper promises, in calm air: every scenario, both compensations; and rough weather."""

import numpy as np
import pytest

import fullam
from fullam.control.dc_pid import COMPENSATIONS
from fullam.simulation.many import fly_many
from fullam.simulation.scenarios.scenario import load_scenario, scenario_names
from fullam.simulation.simulate import prepare

POSITION = [f"position-{i}" for i in range(1, 5)]
TILT = [f"tilt-hover-{i}" for i in range(1, 5)]


@pytest.mark.parametrize("compensation", COMPENSATIONS)
@pytest.mark.parametrize("name", POSITION)
def test_position_settles_within_two_seconds_without_overshoot(name, compensation):
    metrics = fullam.measure(
        fullam.simulate(name, calm=True, settings={"compensation": compensation})
    )
    assert metrics.settled
    assert metrics.settling_time_s < 2.0
    assert metrics.overshoot_percent < 0.5


@pytest.mark.parametrize("compensation", COMPENSATIONS)
@pytest.mark.parametrize("name", TILT)
def test_tilted_hover_settles_within_two_seconds_and_keeps_its_height(name, compensation):
    run = fullam.simulate(name, calm=True, settings={"compensation": compensation})
    metrics = fullam.measure(run)
    assert metrics.settled
    assert metrics.settling_time_s < 2.0
    dip_mm = 1e3 * np.abs(run.pose[:, 2] - run.reference_pose[:, 2]).max()
    assert dip_mm < 25.0


@pytest.mark.parametrize("compensation", COMPENSATIONS)
@pytest.mark.parametrize("name", ["task-1", "task-2"])
def test_tasks_hold_their_pose_while_the_arm_moves(name, compensation):
    """1 mm and 0.1 deg: the model is exact, only the filter's lag on the arm's motion is left."""
    run = fullam.simulate(name, calm=True, settings={"compensation": compensation})
    metrics = fullam.measure(run)
    assert metrics.rms_position_mm < 1.0
    assert metrics.rms_attitude_deg < 0.1


def test_hextilt_hovers_and_steps_with_nothing_but_its_toml():
    metrics = fullam.measure(fullam.simulate("hextilt-step", calm=True))
    assert metrics.settled
    assert metrics.overshoot_percent < 0.5


@pytest.mark.parametrize(
    "name", [n for n in scenario_names() if load_scenario(n).world_file is None]
)
def test_no_scenario_diverges_in_its_own_weather(name):
    """Sixteen seeds here; `fullam sweep` flies as many as one likes.

    Scenes of MuJoCo's, which machine code does not fly, have tests of their own.
    """
    assert not any(run.diverged for run in fly_many(prepare(name), range(16), threads=1))


def test_a_quadrotor_keeps_its_attitude_while_its_arm_moves():
    run = fullam.simulate("quadrotor-arm", calm=True)
    assert load_scenario("quadrotor-arm").axes == ("z", "phi", "psi", "gamma")
    assert np.degrees(np.abs(run.euler_xyz)).max() < 0.5
    assert np.abs(run.pose[:, 2] - 9.0).max() < 0.005
