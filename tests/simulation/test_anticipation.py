"""Anticipation takes known lags off a commanded motion, and leaves the rest alone."""

from dataclasses import replace

import numpy as np
import pytest

import fullam
from fullam.control.controller import Measurement
from fullam.control.estimator import estimator_class
from fullam.dynamics.pose_space import pose_from_euler
from fullam.model.loading import load_vehicle
from fullam.simulation.anticipation import Anticipation
from fullam.simulation.blending import blend_jumps
from fullam.simulation.references import Step, tabulate

T = np.arange(301) * 0.01
START = pose_from_euler(np.zeros(3), np.zeros(3))


@pytest.fixture
def table():
    step = tabulate(Step((1.0, 0.5, -0.2), (15.0, -10.0, 5.0)), T, START)
    return blend_jumps(step, START, 2.6, 8.0)


def test_the_estimate_of_a_vehicle_on_the_reference_becomes_the_reference(table):
    """The filter sees the reference late; advanced, it stands on it. Rounding of two maps."""
    estimator = estimator_class("first-order")(0.01, 0.01, 18.0)
    anticipation = Anticipation.of(table, estimator, 0.035)
    seen, rates = estimator.as_seen(table.pose, table.velocity)
    m = Measurement(load_vehicle("fullam"))
    for k in range(0, 301, 10):
        R = fullam.dynamics.pose_space.AttitudeView().look(seen[k]).copy()
        m.q[:7] = seen[k]
        m.v[:6] = (rates[k].reshape(2, 3) @ R).ravel()
        anticipation.advance(k, m)
        np.testing.assert_allclose(m.q[:3], table.pose[k, :3], atol=1e-12)
        assert abs(m.q[3:7] @ table.pose[k, 3:]) == pytest.approx(1.0, abs=1e-12)
        R = fullam.dynamics.pose_space.AttitudeView().look(m.q[:7])
        world = (m.v[:6].reshape(2, 3) @ R.T).ravel()
        np.testing.assert_allclose(world, table.velocity[k], atol=1e-9)


def test_an_estimator_without_lag_is_left_alone(table):
    anticipation = Anticipation.of(table, estimator_class("truth")(0.01, 0.01, 18.0), 0.0)
    assert not any(anticipation.moving)
    np.testing.assert_array_equal(anticipation.reference.acceleration, table.acceleration)


def test_a_reference_at_rest_needs_nothing():
    table = tabulate(Step((0.0, 0.0, 0.0)), T, START)
    estimator = estimator_class("first-order")(0.01, 0.01, 18.0)
    assert not any(Anticipation.of(table, estimator, 0.035).moving)


def test_late_and_slow_poses_are_anticipated_too():
    """A commanded motion does not overshoot for the age of its poses, which is known."""
    simulation = fullam.SimulationSettings(pose_period=0.02, delay=0.02)
    for estimator in ("first-order", "truth"):
        chosen = replace(simulation, estimator=estimator)
        run = fullam.simulate("position-1", calm=True, simulation=chosen)
        without = fullam.simulate(
            "position-1", calm=True, simulation=chosen, settings={"anticipate": False}
        )
        assert fullam.measure(run).overshoot_percent < 1.0
        assert fullam.measure(run).overshoot_percent < fullam.measure(without).overshoot_percent


NO_LIMITS = {"max_acceleration": None, "max_angular_acceleration": None}
TURN = fullam.Step((0, 0, 1), (10, 0, 0), at=0.2)
SIDEWAYS = fullam.Step((1, 0, 1), at=0.2)


@pytest.mark.parametrize(
    ("reference", "limits", "anticipated"),
    [
        (TURN, NO_LIMITS, False),
        (TURN, {"max_angular_acceleration": None}, False),
        (TURN, {"max_acceleration": None}, True),
        (SIDEWAYS, {"max_acceleration": None}, False),
        (SIDEWAYS, {"max_angular_acceleration": None}, True),
        (SIDEWAYS, {}, True),
    ],
)
def test_jumps_that_are_left_in_are_not_anticipated(reference, limits, anticipated):
    scenario = fullam.Scenario("jump", reference=reference, duration=1.0)
    a, b = (
        fullam.simulate(scenario, calm=True, settings=limits | {"anticipate": wanted})
        for wanted in (True, False)
    )
    assert np.array_equal(a.pose, b.pose) is not anticipated


def test_a_smooth_reference_is_anticipated_without_limits_too():
    """It has no jumps, so a limit on their acceleration makes no difference."""
    scenario = fullam.Scenario(
        "circle",
        initial_position=(1.0, 0.0, 1.0),
        reference=fullam.Circle((0.0, 0.0, 1.0), radius=1.0, period=6.0),
        duration=2.0,
    )
    limited = fullam.simulate(scenario, calm=True)
    free = fullam.simulate(scenario, calm=True, settings=NO_LIMITS)
    late = fullam.simulate(scenario, calm=True, settings=NO_LIMITS | {"anticipate": False})
    np.testing.assert_array_equal(free.pose, limited.pose)
    errors = [np.linalg.norm(r.pose[-1, :3] - r.reference_pose[-1, :3]) for r in (free, late)]
    assert errors[0] < 0.5 * errors[1]


def test_it_is_what_keeps_the_step_from_overshooting():
    scenario = fullam.load_scenario("position-1")
    with_it = fullam.measure(fullam.simulate(scenario, calm=True))
    without = fullam.measure(fullam.simulate(scenario, calm=True, settings={"anticipate": False}))
    assert with_it.overshoot_percent < 0.5 < without.overshoot_percent
