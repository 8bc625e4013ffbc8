# mypy: disallow-untyped-defs=False
"""What of a signal moves fast: a Butterworth high-pass of order 4, run forth and back.

Two sections of H(z) = g (1 - 2 z^-1 + z^-2) / (1 + a_1 z^-1 + a_2 z^-2). Run forth and back they
shift nothing and pass |H|^2. Before it is filtered, the signal is continued at both ends by its
reflection in the end point, and each pass begins at rest under the first value: what SciPy's
`sosfiltfilt` does, and a test holds this to it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fullam.numbers.kernel import Number, kernel
from fullam.numbers.records import Rows

PADDING = 15
"""Reflected values at either end: three times the coefficients of a filter of order 4."""

QUALITY = (1.0 / (2.0 * math.cos(math.pi / 8.0)), 1.0 / (2.0 * math.cos(3.0 * math.pi / 8.0)))
"""Of the two pole pairs of a Butterworth filter of order 4."""


class Section(NamedTuple):
    """Half of the filter: gain g, and the denominator's a_1 and a_2."""

    gain: Number
    a_1: Number
    a_2: Number


def sections(frequency: float, period: float, length: int) -> Rows:
    """The filter, or no section where a signal is too short to tell jitter from a transient.

    The bilinear transform of s^2 / (s^2 + s / Q + 1), the corner kept in place: K = tan(pi f T).

    Args:
        frequency: Corner, where one pass leaves 1 / sqrt(2) [Hz].
        period: Time between samples [s].
        length: Samples of the signal; below 1 s, or `PADDING`, there is no section.
    """
    if period <= 0.0 or 0.5 / period <= frequency or length <= max(1.0 / period, PADDING):
        return Rows(Section, np.zeros((0, 3)))
    k = math.tan(math.pi * frequency * period)
    found = []
    for quality in QUALITY:
        gain = 1.0 / (1.0 + k / quality + k * k)
        found.append(Section(gain, 2.0 * (k * k - 1.0) * gain, (1.0 - k / quality + k * k) * gain))
    return Rows.of(Section, found)


@kernel
def run_sections(signal, filter_, first, stop, step):
    """Both sections over signal[first], signal[first + step], ... in place.

    Transposed direct form II, at rest under the first value.
    """
    a, b = filter_[0], filter_[1]
    rest = a.gain * signal[first]
    p, q = -rest, rest  # what a constant signal leaves in the first section; nothing passes it
    r, s = 0.0, 0.0
    for k in range(first, stop, step):
        x = a.gain * signal[k]
        y = x + p
        p = q - 2.0 * x - a.a_1 * y
        q = x - a.a_2 * y
        x = b.gain * y
        y = x + r
        r = s - 2.0 * x - b.a_1 * y
        s = x - b.a_2 * y
        signal[k] = y


@kernel
def high_pass(signal, filter_, first, out):
    """The fast part of a signal's samples from `first` on, in out[PADDING + k].

    `out` has 2 `PADDING` more samples than the signal, which is longer than `PADDING`.
    """
    n = len(signal)
    for k in range(PADDING):
        out[k] = 2.0 * signal[0] - signal[PADDING - k]
        out[PADDING + n + k] = 2.0 * signal[n - 1] - signal[n - 2 - k]
    for k in range(n):
        out[PADDING + k] = signal[k]
    end = n + 2 * PADDING
    run_sections(out, filter_, 0, end, 1)
    run_sections(out, filter_, end - 1, PADDING + first - 1, -1)
