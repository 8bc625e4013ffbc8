"""Scenarios that touch: what their texts say is what they ask for."""

import numpy as np

import fullam


def test_slide_wall_waits_and_then_slides_evenly():
    scenario = fullam.load_scenario("slide-wall")
    t = np.arange(0.0, scenario.duration, 0.01)
    table = scenario.reference.tabulate(t, scenario.initial_pose)
    y, speed = table.pose[:, 1], table.velocity[:, 1]
    # Half a millimetre before, and 4 % of the speed: what the quintics ring about their knots.
    assert np.abs(y[t <= 6.0]).max() < 1e-3
    np.testing.assert_allclose(speed[(t > 6.5) & (t < 11.0)], 0.1, rtol=0.05)
    np.testing.assert_allclose(y[t >= 11.5], 0.5, atol=1e-12)  # rounding
