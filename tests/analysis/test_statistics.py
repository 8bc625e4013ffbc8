import numpy as np
import pytest

from fullam.analysis.statistics import (
    mean_interval,
    middle,
    paired_difference,
    quantile_interval,
    share_interval,
)
from fullam.exceptions import SettingsError


def test_intervals_cover_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(1)
    hits = 0
    trials = 200
    for k in range(trials):
        interval = quantile_interval(rng.normal(size=60), resamples=400, seed=k)
        hits += interval.low <= 0.0 <= interval.high
    # 95 % nominal; the percentile bootstrap of a median of 60 errs by a few percent, and 200
    # trials have a standard deviation of 1.5 %.
    assert 0.90 <= hits / trials <= 0.995


def test_a_median_lives_with_flights_that_never_settle():
    values = np.array([1.0, 1.1, 1.2, 1.3, np.inf])
    assert middle(values) == 1.2
    interval = quantile_interval(values)
    assert interval.estimate == 1.2
    assert interval.high == np.inf
    assert quantile_interval(np.full(5, np.inf)).low == np.inf


def test_unmeasured_values_are_left_out_and_counted():
    interval = quantile_interval([1.0, np.nan, 3.0, 2.0])
    assert (interval.estimate, interval.count) == (2.0, 3)
    with pytest.raises(SettingsError, match="empty"):
        quantile_interval([np.nan])


def test_pairing_finds_a_difference_that_the_weather_hides():
    rng = np.random.default_rng(2)
    weather = rng.normal(scale=10.0, size=50)
    better, worse = weather, weather + 1.0 + rng.normal(scale=0.1, size=50)
    paired = paired_difference(worse, better)
    assert paired.excludes_zero
    assert paired.low < 1.0 < paired.high
    shuffled = paired_difference(worse, rng.permutation(better))
    assert not shuffled.excludes_zero


def test_a_pair_with_one_missing_value_is_dropped_as_a_pair():
    difference = paired_difference([1.0, np.nan, 5.0, 2.0], [0.0, 9.0, np.inf, 1.0])
    assert (difference.estimate, difference.count) == (1.0, 2)
    with pytest.raises(SettingsError, match="pairs"):
        paired_difference([1.0], [1.0, 2.0])


def test_a_share_of_none_is_not_zero():
    share = share_interval(0, 200)
    assert share.estimate == share.low == 0.0
    assert 0.018 < share.high < 0.02  # Wilson: z^2 / (n + z^2) with z = 1.96
    with pytest.raises(SettingsError):
        share_interval(3, 2)


def test_the_same_sample_gives_the_same_interval():
    sample = np.random.default_rng(3).normal(size=40)
    assert mean_interval(sample) == mean_interval(sample)
    assert mean_interval(sample) != mean_interval(sample, seed=1)
