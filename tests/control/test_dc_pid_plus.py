"""dc-PID+: what the model has wrong is cancelled, and a poor estimate does not shake it apart."""

from dataclasses import replace

import numpy as np
import pytest

import fullam
from fullam.control.controller import Measurement, ReferencePoint
from fullam.control.controllers import make_controller
from fullam.control.dc_pid_plus import DcPidPlusSettings
from fullam.exceptions import SettingsError
from fullam.model.loading import load_vehicle
from fullam.model.perturbation import Uncertainty
from fullam.simulation.weather import CALM

KALMAN = fullam.SimulationSettings(estimator="kalman")
WRONG = replace(CALM, uncertainty=Uncertainty(0.10))
"""Exact sensors, no gusts, every parameter up to 10 % off."""


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("fullam")


def test_without_observer_and_lead_it_is_dc_pid(vehicle, rng):
    off = {"observer_rates": (0.0, 0.0), "actuation_speedup": 1.0}
    gains = {"position_gains": (9.6, 1.0, 6.0), "attitude_gains": (30.0, 2.0, 10.0)}
    plus = make_controller("dc-pid-plus", vehicle, **off, **gains)
    plain = make_controller("dc-pid", vehicle, **gains)
    m, ref = Measurement(vehicle), ReferencePoint()
    ref.pose = np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.1, np.sqrt(0.99)])
    for controller in (plus, plain):
        controller.reset(m, ref)
    for _ in range(10):
        m.v[:] = 1e-3 * rng.normal(size=vehicle.model.nv)
        expected = plain.wrench(0.0, m, ref)
        np.testing.assert_allclose(plus.wrench(0.0, m, ref), expected, atol=1e-12)
        for controller in (plus, plain):
            controller.delivered(0.9 * expected, -0.1 * expected)
        np.testing.assert_allclose(plus.law.integral, plain.law.integral, atol=1e-12)


@pytest.mark.parametrize("seed", [0, 1])
def test_cancels_what_the_model_has_wrong(vehicle, seed):
    """PD alone stands off by centimetres under the same errors; the observer leaves 0.2 mm."""
    errors = []
    for settings in ({}, {"observer_rates": (0.0, 0.0)}):
        run = fullam.simulate(
            "tilt-hover-1",
            "dc-pid-plus",
            vehicle=vehicle,
            seed=seed,
            weather=WRONG,
            settings=settings,
            simulation=KALMAN,
        )
        errors.append(fullam.measure(run, vehicle))
    assert errors[0].steady_position_mm < 0.2
    assert errors[0].steady_attitude_deg < 0.02
    assert errors[1].steady_position_mm > 5.0


def test_settles_the_step_in_the_paper_s_weather(vehicle):
    run = fullam.simulate("position-1", "dc-pid-plus", vehicle=vehicle, seed=0, simulation=KALMAN)
    metrics = fullam.measure(run, vehicle)
    assert metrics.settling_time_s is not None
    assert metrics.settling_time_s < 2.0
    assert max(metrics.axes[axis].overshoot_percent for axis in "xyz") < 2.0


@pytest.mark.parametrize("scenario", ["task-2", "quadrotor-arm"])
def test_keeps_calm_behind_the_first_order_filter(scenario):
    """Thirty times the noise on the velocity: as good as dc-PID within a factor of four."""
    runs = [fullam.simulate(scenario, name, seed=2) for name in ("dc-pid-plus", "dc-pid")]
    plus, plain = (fullam.measure(run) for run in runs)
    assert plus.rms_position_mm < 4.0 * plain.rms_position_mm
    assert plus.rms_attitude_deg < 4.0 * plain.rms_attitude_deg


def test_the_lead_asks_for_more_and_only_on_controlled_axes(vehicle):
    axes = (False, False, True, True, True, True)
    asked = {}
    for speedup in (1.0, 3.0):
        controller = make_controller(
            "dc-pid-plus", vehicle, axes=axes, actuation_speedup=speedup, anticipate=False
        )
        m, ref = Measurement(vehicle), ReferencePoint()
        controller.reset(m, ref)
        ref.acceleration = np.ones(6)
        asked[speedup] = controller.wrench(0.0, m, ref).copy()
    hover = asked[1.0] - (asked[3.0] - asked[1.0]) / 2.0
    np.testing.assert_allclose(asked[3.0][:2], asked[1.0][:2], atol=1e-12)
    assert hover[2] == pytest.approx(vehicle.mass * vehicle.gravity, rel=1e-9)


def test_bounds_hold_for_the_whole_wrench(vehicle):
    bounds = (6.0, 6.0, 23.0, 0.9, 0.9, 9.0)
    controller = make_controller("dc-pid-plus", vehicle, wrench_bounds=bounds)
    m, ref = Measurement(vehicle), ReferencePoint()
    controller.reset(m, ref)
    ref.pose = np.array([9.0, -9.0, 9.0, 0.0, 0.0, 1.0, 0.0])
    for _ in range(3):
        assert np.all(np.abs(controller.wrench(0.0, m, ref)) <= bounds)


@pytest.mark.parametrize(
    "bad",
    [
        {"observer_rates": (1.0, -1.0)},
        {"observer_rates": (1.0,)},
        {"roughness_limits": (np.inf, 1.0)},
        {"actuation_lag": -0.1},
        {"actuation_speedup": 0.5},
    ],
)
def test_refuses_bad_settings(bad):
    with pytest.raises(SettingsError, match=next(iter(bad))):
        DcPidPlusSettings(**bad)
