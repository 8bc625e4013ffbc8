"""Weather: statistics as stated, the same for everyone, streams apart."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from fullam.exceptions import ScenarioError, UnknownName
from fullam.simulation.weather import CALM, PAPER, RECORDED, Weather, forecast, weather

T = np.arange(20_001) * 0.01


def test_calm_is_calm():
    draw = forecast(CALM, 0, T)
    assert not draw.pose_noise.any()
    assert not draw.disturbance.any()


def test_noise_has_its_sigma_and_keeps_its_bound():
    """20 000 samples: the standard deviation is known to 0.5 %, four of those are allowed."""
    recorded = forecast(RECORDED, 1, T).pose_noise
    np.testing.assert_allclose(recorded[:, :3].std(0), 0.010, rtol=0.02)
    np.testing.assert_allclose(recorded[:, 3:].std(0), np.radians(1.0), rtol=0.02)
    bounded = forecast(PAPER, 1, T).pose_noise
    assert np.abs(bounded[:, :3]).max() <= 0.025
    assert np.abs(bounded[:, 3:]).max() <= np.radians(2.5)
    assert np.abs(bounded[:, :3]).max() > 0.024


def test_a_gust_a_second_for_one_sample():
    gusts = forecast(RECORDED, 2, T).disturbance
    blowing = np.flatnonzero(gusts.any(axis=1))
    np.testing.assert_array_equal(blowing, np.arange(100, 20_001, 100))
    # 200 draws: the standard deviation is known to 5 %, four of those are allowed.
    np.testing.assert_allclose(gusts[blowing, :3].std(0), 10.0, rtol=0.2)
    np.testing.assert_allclose(gusts[blowing, 3:].std(0), 1.745, rtol=0.2)


def test_a_gust_lasts_its_duration_at_any_rate():
    t = np.arange(3001) * 0.001
    gusts = forecast(replace(RECORDED, gust_duration=0.02), 2, t).disturbance
    assert gusts.any(axis=1).sum() == 20 + 20 + 1  # the third has just begun
    np.testing.assert_array_equal(gusts[1000], gusts[1019])
    with pytest.raises(ScenarioError, match="gust_duration"):
        replace(RECORDED, gust_duration=2.0)


@pytest.mark.parametrize("period", [0.001, 0.01, 0.02, 0.03, 0.04])
def test_the_impulse_of_a_gust_does_not_depend_on_the_control_rate(period):
    t = np.arange(round(12.5 / period)) * period
    impulse = np.cumsum(forecast(RECORDED, 2, t).disturbance, axis=0) * period
    fine = np.cumsum(forecast(RECORDED, 2, T[:1250]).disturbance, axis=0) * 0.01
    np.testing.assert_allclose(impulse[-1], fine[-1], atol=1e-6)


@pytest.mark.parametrize("duration", [0.01, 0.3, 0.95, 1.0])
@pytest.mark.parametrize("period", [0.01, 0.1, 0.16, 0.25, 1.5, 2.4])
def test_no_impulse_is_lost_where_a_period_touches_several_gusts(period, duration):
    """Shares are rounded to 1e-9 of some 20 N and held for seconds in all: below 1e-6."""
    stormy = replace(RECORDED, gust_duration=duration)
    t = np.arange(round(12.0 / period)) * period
    # The draws themselves: gust k blows for its duration, the last one ends within 12 s.
    draws = forecast(replace(stormy, gust_duration=1.0), 2, np.arange(12) * 1.0).disturbance
    impulse = forecast(stormy, 2, t).disturbance.sum(axis=0) * period
    np.testing.assert_allclose(impulse, draws.sum(axis=0) * duration, atol=1e-6)


def test_one_seed_one_weather_and_streams_of_their_own():
    a, b = forecast(PAPER, 7, T), forecast(replace(PAPER, force_disturbance=0.0), 7, T)
    np.testing.assert_array_equal(a.pose_noise, b.pose_noise)
    np.testing.assert_array_equal(a.disturbance[:, 3:], b.disturbance[:, 3:])
    assert a.parameters.random() == b.parameters.random()
    assert not np.array_equal(a.pose_noise, forecast(PAPER, 8, T).pose_noise)


@pytest.mark.parametrize("copied", [replace, copy.copy, copy.deepcopy])
@pytest.mark.parametrize("read_first", [True, False])
def test_a_copy_draws_the_same_inertial_noise(copied, read_first):
    draw, other = forecast(PAPER, 7, T), forecast(PAPER, 7, T)
    if read_first:
        assert draw.gyroscope_noise.any()
    twin = copied(draw)
    for d in (twin, draw):
        np.testing.assert_array_equal(d.gyroscope_noise, other.gyroscope_noise)
        np.testing.assert_array_equal(d.accelerometer_noise, other.accelerometer_noise)


def test_the_inertial_noise_of_a_seed_is_the_third_stream_of_it():
    """Runs on file fly again bit for bit, so the numbers of a seed must stay."""
    rng = np.random.default_rng(np.random.SeedSequence(7).spawn(4)[2])
    draw = forecast(PAPER, 7, T)
    gyroscope = rng.standard_normal((T.size, 3)) * PAPER.gyroscope_noise
    np.testing.assert_array_equal(draw.gyroscope_noise, gyroscope)
    accelerometer = rng.standard_normal((T.size, 3)) * PAPER.accelerometer_noise
    np.testing.assert_array_equal(draw.accelerometer_noise, accelerometer)


def test_names_and_plain_data():
    assert weather("paper") is PAPER
    for value in (CALM, RECORDED, PAPER):
        assert Weather.from_dict(value.to_dict()) == value
    with pytest.raises(UnknownName, match="recorded"):
        weather("storm")
    with pytest.raises(ScenarioError, match=r"wind.*it has position_noise"):
        Weather.from_dict({"wind": 3.0})


@pytest.mark.parametrize("field", ["position_noise", "gust_interval", "noise_bound"])
def test_bad_numbers_name_the_field(field):
    with pytest.raises(ScenarioError, match=field):
        Weather(**{field: -1.0})
