"""Honest statistics of a campaign: bootstrap intervals, paired differences, shares.

Flights that never settle count as infinitely late, so quantiles are taken without interpolation
(inverted empirical distribution): they stay meaningful as long as enough flights are finite. All
intervals are percentile bootstraps over seeds, from a fixed stream, so a report repeats exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import binomtest

from fullam.exceptions import SettingsError

Array = NDArray[np.float64]

CONFIDENCE = 0.95
"""Level of every interval unless the caller says otherwise."""

RESAMPLES = 2000
"""Bootstrap resamples: the 2.5 % and 97.5 % ends then rest on 50 resamples each."""


@dataclass(frozen=True)
class Interval:
    """An estimate and its confidence interval.

    Attributes:
        estimate: The statistic of the sample.
        low: Lower end.
        high: Upper end.
        count: How many values it rests on.
    """

    estimate: float
    low: float
    high: float
    count: int

    @property
    def excludes_zero(self) -> bool:
        """Whether 0 is outside."""
        return self.low > 0.0 or self.high < 0.0


def quantile(values: ArrayLike, q: float, axis: int = -1) -> Any:
    """Quantile q without interpolation: the least value with a share q at or below it."""
    return np.quantile(np.asarray(values, dtype=float), q, axis=axis, method="inverted_cdf")


def middle(values: ArrayLike, axis: int = -1) -> Any:
    """Median without interpolation; see `quantile`."""
    return quantile(values, 0.5, axis)


def quantile_interval(
    values: ArrayLike,
    q: float = 0.5,
    confidence: float = CONFIDENCE,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Interval:
    """Quantile of a sample with its bootstrap interval.

    Args:
        values: The sample, shape (n,); infinity stands for "never", NaN is left out.
        q: Which quantile, 0 to 1; 0.5 is the median.
        confidence: Level of the interval.
        resamples: Number of bootstrap resamples.
        seed: Seed of the resampling.

    Raises:
        SettingsError: No value is left.
    """
    sample = _present(values)
    low, high = _ends(
        quantile(_resample(sample, resamples, seed), q), confidence
    )  # quantiles of quantiles: no arithmetic on infinities
    return Interval(float(quantile(sample, q)), low, high, sample.size)


def mean_interval(
    values: ArrayLike,
    confidence: float = CONFIDENCE,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Interval:
    """Mean of a finite sample with its bootstrap interval; arguments as in `quantile_interval`.

    Raises:
        SettingsError: No value is left.
    """
    sample = _present(values)
    low, high = _ends(_resample(sample, resamples, seed).mean(axis=1), confidence)
    return Interval(float(sample.mean()), low, high, sample.size)


def paired_difference(
    first: ArrayLike,
    second: ArrayLike,
    confidence: float = CONFIDENCE,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Interval:
    """Mean of first - second over pairs that met the same weather, with its bootstrap interval.

    Pairs are resampled as pairs, so what a seed does to both cancels. A pair of which one value is
    missing or infinite has no difference and is left out; `count` tells how many were not.

    Args:
        first: Shape (n,), one value a seed.
        second: The same seeds in the same order.
        confidence: Level of the interval.
        resamples: Number of bootstrap resamples.
        seed: Seed of the resampling.

    Raises:
        SettingsError: The lengths differ, or no pair is left.
    """
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    if a.shape != b.shape:
        raise SettingsError(
            "paired difference", "samples", f"have {a.size} and {b.size} values", "give pairs"
        )
    complete = np.isfinite(a) & np.isfinite(b)
    return mean_interval(a[complete] - b[complete], confidence, resamples, seed)


def share_interval(hits: int, total: int, confidence: float = CONFIDENCE) -> Interval:
    """A share with its Wilson interval: 0 of 200 is "below 1.9 %", never "0 %".

    Raises:
        SettingsError: More hits than trials, or no trial.
    """
    if not 0 <= hits <= total or total == 0:
        raise SettingsError("share", "hits", f"{hits} of {total}", "give 0 <= hits <= total > 0")
    ends = binomtest(hits, total).proportion_ci(confidence, method="wilson")
    return Interval(hits / total, float(ends.low), float(ends.high), total)


def _present(values: ArrayLike) -> Array:
    sample = np.asarray(values, dtype=float).ravel()
    sample = sample[~np.isnan(sample)]
    if sample.size == 0:
        raise SettingsError("statistics", "sample", "is empty", "give at least one value")
    return sample


def _resample(sample: Array, resamples: int, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    return sample[rng.integers(sample.size, size=(resamples, sample.size))]


def _ends(statistics: Array, confidence: float) -> tuple[float, float]:
    tail = 0.5 * (1.0 - confidence)
    return float(quantile(statistics, tail)), float(quantile(statistics, 1.0 - tail))
