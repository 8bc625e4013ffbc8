"""The admittance law: it yields as its virtual spring says, and pushes with what is asked for."""

from dataclasses import replace

import numpy as np
import pytest

import fullam
from fullam.control.admittance import AdmittanceSettings, beyond
from fullam.control.controllers import make_settings
from fullam.exceptions import SettingsError
from fullam.simulation.many import fly_many
from fullam.simulation.scenarios.scenario import load_scenario
from fullam.simulation.simulate import prepare, simulate
from fullam.simulation.weather import CALM, PAPER

QUIET = replace(PAPER, force_disturbance=0.0, moment_disturbance=0.0)
PUSH = replace(load_scenario("push-wall"), weather=CALM)
FREE = replace(PUSH, world=(), duration=14.0)
HAND = {"force": 0.0, "stiffness": 40.0, "damping": 40.0}


def held(run, after=6.5):
    return -run.contact_force[run.t > after, 0]


def of_wall(scenario, **changes):
    return replace(scenario, world=(replace(scenario.world[0], **changes),))


@pytest.mark.parametrize("force", [1.5, 3.0, 5.0])
def test_in_calm_air_the_force_is_the_one_asked_for(force):
    run = simulate(PUSH, "admittance", driver="fused", settings={"force": force})
    assert run.well and not run.contact_force[run.t < 3.0].any()
    # What is left after 3 s decays with (D + m K_d) / (m K_p) = 1.1 s.
    np.testing.assert_allclose(held(run).mean(), force, atol=0.1)
    np.testing.assert_allclose(held(run, 9.0), force, atol=0.05)
    assert np.abs(run.pose[-1, 1:3] - [0.0, 1.0]).max() < 0.002  # everything else is held


@pytest.mark.parametrize("stiffness", [1e4, 1e5, 1e6])
def test_soft_and_stiff_walls_are_pushed_steadily(stiffness):
    run = simulate(of_wall(PUSH, stiffness=stiffness), "admittance", driver="fused")
    assert np.ptp(held(run, 9.0)) < 0.05  # [N]; it still creeps to 3 N


def test_a_virtual_mass_as_light_as_the_vehicle_hammers_on_the_wall():
    """The stability condition in the module's text: the margin of M = m is below 1."""
    light = {"virtual_mass": 2.25, "damping": 30.0}
    run = simulate(PUSH, "admittance", driver="fused", settings=light)
    force = held(run)
    assert force.std() > 1.0 and not force.all()
    spectrum = np.abs(np.fft.rfft(force - force.mean()))
    hertz = np.fft.rfftfreq(force.size, 0.01)[spectrum.argmax()]
    assert 5.0 < hertz < 8.0  # sqrt(k / m) = 7.3 Hz with k = 4.7e3 N/m, less when it lets go


@pytest.mark.parametrize("at", ["platform", "tool"])
def test_a_push_is_yielded_to_as_by_two_springs_in_series_and_come_back_from(at):
    flight = fullam.fly(FREE, "admittance", settings=HAND)
    flight.advance(4.0)
    flight.push([1.0, 0.0, 0.0], at=at, duration=5.0)
    run = flight.run()
    pushed, after = (run.t > 8.0) & (run.t < 9.0), run.t > 13.0
    m, k_p = fullam.load_vehicle("fullam").mass, AdmittanceSettings().position_gains[0]
    expected = 1.0 / HAND["stiffness"] + 1.0 / (m * k_p)  # 43 mm
    # It creeps to rest with D / K = 1 s.
    np.testing.assert_allclose(run.pose[pushed, 0], expected, atol=0.001)
    assert np.abs(run.pose[after, :3] - [0.0, 0.0, 1.0]).max() < 0.004
    assert np.abs(run.pose[pushed, 1:3] - [0.0, 1.0]).max() < 0.002  # it yields along n alone


def test_a_push_within_the_dead_band_meets_the_position_loop_alone():
    flight = fullam.fly(replace(FREE, duration=9.0), "admittance", settings=HAND)
    flight.advance(4.0)
    flight.push([0.3, 0.0, 0.0], at="platform", duration=5.0)
    run = flight.run()
    np.testing.assert_allclose(run.pose[-50:, 0], 0.3 / (2.25 * 25.0), atol=5e-4)


def test_without_a_spring_free_air_is_crossed_at_f_over_d():
    run = simulate(replace(FREE, duration=8.0), "admittance", driver="fused")
    np.testing.assert_allclose(run.velocity[-100:, 0], 3.0 / 40.0, atol=0.001)


def test_before_it_engages_and_after_its_release_it_is_dc_pid_plus():
    ours, plus = (
        simulate(replace(PUSH, weather=PAPER), law, driver="fused", seed=2, settings=settings)
        for law, settings in (("admittance", {"engage_at": 5.0}), ("dc-pid-plus", {}))
    )
    rows = ours.t < 4.99
    assert np.ptp(plus.pose[rows, 0]) > 0.001  # something is going on
    np.testing.assert_array_equal(ours.pose[rows], plus.pose[rows])
    released = simulate(
        replace(PUSH, duration=12.0), "admittance", driver="fused", settings={"release_at": 6.0}
    )
    assert np.linalg.norm(released.pose[-1, :3] - [0.0, 0.0, 1.0]) < 0.003
    assert not released.contact_force[-100:].any()


def test_with_rotors_ten_percent_off_and_in_gusts_it_stays_at_the_wall():
    quiet, paper = (
        np.array(
            [
                held(run)
                for run in fly_many(prepare(replace(PUSH, weather=w), "admittance"), range(16))
            ]
        )
        for w in (QUIET, PAPER)
    )
    means = quiet.mean(axis=1) - 3.0
    # Of the seeds 0..15: 0.07 N in the mean, 0.18 N at worst, and 98 % of the time in gusts.
    assert np.sqrt(np.mean(means**2)) < 0.15 and np.abs(means).max() < 0.4
    assert np.mean(paper > 0.0) > 0.95 and abs(paper.mean() - 3.0) < 0.3


def test_a_planted_wrong_sign_of_the_normal_flies_away_from_the_wall():
    run = simulate(PUSH, "admittance", driver="fused", settings={"normal": (-1.0, 0.0, 0.0)})
    assert not run.contact_force.any() and run.pose[-1, 0] < -0.2


def test_a_planted_wrong_sign_of_what_is_felt_does_not_hold_the_force(monkeypatch):
    """A law that leans into what pushes back: the mean force runs away from the one wanted."""
    monkeypatch.setattr("fullam.control.admittance.beyond", lambda band, f: -beyond(band, f))
    run = simulate(PUSH, "admittance", driver="python")
    assert run.outcome == "diverged" or abs(held(run, 9.0).mean() - 3.0) > 3.0


def test_the_dead_band_is_continuous_and_leaves_no_offset():
    forces = np.linspace(-2.0, 2.0, 401)
    found = np.array([beyond(0.4, f) for f in forces])
    np.testing.assert_array_equal(found[np.abs(forces) < 0.4], 0.0)
    whole = np.abs(forces) > 0.8
    np.testing.assert_array_equal(found[whole], forces[whole])
    assert np.abs(np.diff(found)).max() < 0.0201  # 2 b / b times the spacing of 0.01


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"normal": (0.0, 0.0, 0.0)}, "normal"),
        ({"force": 0.5}, "force.*twice the dead band"),
        ({"force": -3.0}, "force"),
        ({"force": 0.0}, "stiffness.*spring"),
        ({"virtual_mass": 0.0}, "virtual_mass"),
        ({"damping": -1.0}, "damping"),
        ({"stiffness": -1.0}, "stiffness"),
        ({"dead_band": float("nan")}, "dead_band"),
        ({"engage_at": 1.0}, "engage_at"),
        ({"release_at": 1.0}, "engage_at"),
    ],
)
def test_nonsense_is_refused(changes, message):
    with pytest.raises(SettingsError, match=message):
        make_settings("admittance", changes)
