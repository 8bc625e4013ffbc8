"""The hybrid law: the force that is asked for, and nothing else given up."""

from dataclasses import replace

import numpy as np
import pytest

from fullam.control.controllers import make_settings
from fullam.exceptions import SettingsError
from fullam.simulation.many import fly_many
from fullam.simulation.motions.references import Step
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.simulate import prepare, simulate
from fullam.simulation.weather import CALM, PAPER
from fullam.simulation.world.surfaces import Plane

QUIET = replace(PAPER, force_disturbance=0.0, moment_disturbance=0.0)
YAW = (0.0, 0.0, -45.0)
PUSH = Scenario(
    "push",
    Step((0.0, 0.0, 1.0), YAW),
    initial_position=(0.0, 0.0, 1.0),
    initial_euler_deg=YAW,
    initial_arm_deg=(0.0, 0.0, -90.0, 0.0),
    duration=9.0,
    weather=CALM,
    world=(Plane((0.65, 0.0, 0.0), (-1.0, 0.0, 0.0)),),
)


def held(run, after=6.5):
    return -run.contact_force[run.t > after, 0]


@pytest.mark.parametrize("force", [1.5, 3.0, 5.0])
def test_in_calm_air_the_force_is_the_one_asked_for(force):
    run = simulate(PUSH, "hybrid-force", driver="fused", settings={"force": force})
    assert run.well
    np.testing.assert_allclose(held(run).mean(), force, atol=0.02)
    before = run.t < 3.0
    assert not run.contact_force[before].any()  # dc-PID+ until it engages
    assert np.abs(run.pose[-1, 1:3] - [0.0, 1.0]).max() < 0.002  # everything else is held


def test_a_slanted_wall_is_pushed_along_its_normal():
    normal = np.array([1.0, 0.3, -0.2]) / np.linalg.norm([1.0, 0.3, -0.2])
    wall = Plane(tuple(np.array([0.6, 0.0, 0.94]) + 0.05 * normal), tuple(-normal), friction=0.0)
    run = simulate(
        replace(PUSH, world=(wall,)), "hybrid-force", driver="fused",
        settings={"normal": tuple(2.0 * normal)},
    )  # fmt: skip
    np.testing.assert_allclose(run.contact_force[-50:].mean(axis=0), -3.0 * normal, atol=0.05)


def test_with_rotors_ten_percent_off_it_is_met_to_a_tenth_of_a_newton():
    plan = prepare(replace(PUSH, weather=QUIET), "hybrid-force")
    means = np.array([held(run).mean() for run in fly_many(plan, range(16))])
    # Of the seeds 0..63: 0.083 N RMS, 0.2 N at worst.
    assert np.sqrt(np.mean((means - 3.0) ** 2)) < 0.15 and np.abs(means - 3.0).max() < 0.4


def test_gusts_do_not_tear_it_off():
    plan = prepare(replace(PUSH, weather=PAPER), "hybrid-force")
    forces = np.array([held(run) for run in fly_many(plan, range(16))])
    assert np.mean(forces > 0.0) > 0.95 and abs(forces.mean() - 3.0) < 0.3


def test_a_wall_that_is_not_there_is_approached_for_ever_at_the_same_speed():
    run = simulate(replace(PUSH, world=(), duration=6.0), "hybrid-force", driver="fused")
    np.testing.assert_allclose(run.velocity[-100:, 0], 0.06, atol=0.003)


def test_before_it_engages_and_after_its_release_it_is_dc_pid_plus():
    brief = replace(PUSH, duration=3.0)
    ours, plus = (
        simulate(brief, law, driver="fused", plant="servo")
        for law in ("hybrid-force", "dc-pid-plus")
    )
    rows = ours.t < 2.99
    np.testing.assert_array_equal(ours.pose[rows], plus.pose[rows])
    released = simulate(
        replace(PUSH, duration=12.0), "hybrid-force", driver="fused", settings={"release_at": 6.0}
    )
    assert np.linalg.norm(released.pose[-1, :3] - [0.0, 0.0, 1.0]) < 0.003
    assert not released.contact_force[-100:].any()


def test_a_planted_wrong_sign_of_the_normal_flies_away_from_the_wall():
    run = simulate(PUSH, "hybrid-force", driver="fused", settings={"normal": (-1.0, 0.0, 0.0)})
    assert not run.contact_force.any() and run.pose[-1, 0] < -0.2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"normal": (0.0, 0.0, 0.0)}, "normal"),
        ({"force": -1.0}, "force"),
        ({"engage_at": 1.0}, "engage_at"),
        ({"release_at": 1.0}, "engage_at"),
    ],
)
def test_nonsense_is_refused(changes, message):
    with pytest.raises(SettingsError, match=message):
        make_settings("hybrid-force", changes)
