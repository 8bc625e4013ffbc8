"""The high-pass of the jitter: its corner, and SciPy's `sosfiltfilt`."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from fullam.analysis.high_pass import PADDING, high_pass, sections
from fullam.numbers.records import Rows


def filtered(signal, frequency, period, first=0):
    out = [0.0] * (len(signal) + 2 * PADDING)
    high_pass(signal.tolist(), sections(frequency, period, len(signal)).to_list(), first, out)
    return np.array(out[PADDING + first : PADDING + len(signal)])


@pytest.mark.parametrize(("period", "rows"), [(0.01, 101), (0.01, 1200), (0.001, 3000), (0.05, 21)])
def test_it_is_scipys(period, rows):
    rng = np.random.default_rng(rows)
    signal = 1000.0 + 300.0 * np.linspace(0.0, 1.0, rows) + 10.0 * rng.standard_normal(rows)
    sos = butter(4, 2.0, "highpass", fs=1.0 / period, output="sos")
    expected = sosfiltfilt(sos, signal)
    # The gain stands elsewhere and SciPy solves for its initial state: at 1 kHz the poles are
    # 0.01 from 1, which costs each of two passes two digits of 1e-13 of the signal's 1000.
    assert filtered(signal, 2.0, period) == pytest.approx(expected, abs=1e-7)


def test_the_coefficients_are_scipys():
    expected = butter(4, 2.0, "highpass", fs=100.0, output="sos")
    found = sections(2.0, 0.01, 1000)
    # Coefficients of about 2 after a tangent and a division.
    denominators = np.sort(expected[:, 4:], axis=0)
    assert np.sort(found.array[:, 1:], axis=0) == pytest.approx(denominators, rel=1e-13)
    assert np.prod(found.array[:, 0]) == pytest.approx(np.prod(expected[:, 0]), rel=1e-12)


def test_half_the_amplitude_is_left_at_the_corner():
    """Each of the two passes has 1/sqrt(2) there."""
    t = 0.01 * np.arange(6001)
    middle = filtered(np.sin(2 * np.pi * 2.0 * t), 2.0, 0.01)[2000:4000]
    assert np.sqrt(np.mean(np.square(middle))) == pytest.approx(0.5 / np.sqrt(2.0), rel=1e-3)


def test_the_way_back_ends_where_it_is_asked_to():
    signal = np.random.default_rng(0).standard_normal(300)
    assert np.array_equal(filtered(signal, 2.0, 0.01, 150), filtered(signal, 2.0, 0.01)[150:])


@pytest.mark.parametrize(("period", "rows"), [(0.0, 500), (0.01, 100), (0.25, 500), (0.1, 15)])
def test_there_is_no_filter_where_it_could_tell_nothing(period, rows):
    """No period; 1 s of signal; 2 Hz at Nyquist's frequency; fewer values than are reflected."""
    found = sections(2.0, period, rows)
    assert isinstance(found, Rows)
    assert len(found.array) == 0
