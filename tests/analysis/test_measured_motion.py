"""What a vehicle knows of its flight."""

import numpy as np

from fullam.analysis.measured_motion import mean_squares


def test_mean_squares_of_lagging_rotors():
    lags, commands = np.array([0.03, 0.01, 0.0]), np.array([[300.0] * 3, [500.0] * 3, [500.0] * 3])
    period, steps = 0.01, 20_000
    t = (np.arange(steps) + 0.5) * period / steps
    with np.errstate(divide="ignore"):
        speeds = 500.0 - 200.0 * np.exp(-t[:, None] / lags)
    # The midpoint rule is right to the square of its step.
    squares = mean_squares(lags, commands, period)
    np.testing.assert_allclose(squares[0], 300.0**2, rtol=1e-12)
    np.testing.assert_allclose(squares[1], np.mean(speeds**2, axis=0), rtol=1e-7)
    assert squares[1, 0] < squares[2, 0] < 500.0**2
