"""dc-PID+: what the model has wrong is cancelled, and a poor estimate does not shake it apart."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import fullam
from fullam.control.caution import caution_factors, caution_numbers, felt, trusted
from fullam.control.controller import Measurement, ReferencePoint
from fullam.control.controllers import make_controller, make_settings
from fullam.control.dc_pid import COMPENSATIONS
from fullam.control.dc_pid_plus import DcPidPlus, DcPidPlusSettings
from fullam.control.law import estimate_of, motions_of
from fullam.control.wrench_observer import asked, nothing_observed, observed, observer_numbers
from fullam.dynamics.multibody import rotation_of
from fullam.dynamics.spatial import Spatial
from fullam.exceptions import SettingsError
from fullam.model.loading import load_vehicle
from fullam.model.perturbation import Uncertainty
from fullam.numbers.records import flat, record
from fullam.simulation.weather import CALM

T = 0.01
"""Control period [s]."""

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
        integrals = plus._memory.nominal.integral, plain._memory.integral
        np.testing.assert_allclose(*([*flat(i)] for i in integrals), atol=1e-12)


GAINS = {"position_gains": (25.0, 3.0, 10.0), "attitude_gains": (60.0, 5.0, 15.0)}


BOUNDS = [
    None,
    *(
        np.array(b)
        for b in (
            [6, 6, 30, 0.8, 0.8, 0.6],
            [6, 6, 30, 9e9, 9e9, 9e9],
            [9e9, 9e9, 9e9, 0.8, 0.8, 0.6],
        )
    ),
]


class Assembled:
    """dc-PID+ put together from dc-PID, observer and caution, as the module's text has it."""

    def __init__(self, law, bounds):
        vehicle, self.s, self.bounds = law.vehicle, law.settings, bounds
        self.mask = np.array(law.axes, dtype=float)
        self.k_p = np.repeat([GAINS["position_gains"][0], GAINS["attitude_gains"][0]], 3)
        self.k_d = np.repeat([GAINS["position_gains"][2], GAINS["attitude_gains"][2]], 3)
        self.plain = make_controller(
            "dc-pid", vehicle, axes=law.axes, compensation=law.settings.compensation, **GAINS
        )
        self.lag = float(vehicle.rotors.lags.mean())
        self.ahead = self.lag / self.s.actuation_speedup + 0.5 * T
        self.observer = observer_numbers(vehicle, T, self.s.observer_rates, self.lag)
        self.caution = caution_numbers(T, self.s.roughness_limits)
        self.seen = None

    def turn(self, wrench, ref, sign):
        t = sign * self.ahead * ref.velocity[3:]
        return wrench + np.concatenate([np.cross(t, wrench[:3]), np.cross(t, wrench[3:])])

    def wrench(self, m, ref, chain):
        self.R, self.ref = rotation_of(m.q), ref
        estimate, v = estimate_of(m), record(Spatial, m.v[:6])
        if self.seen is None:
            self.seen = nothing_observed(self.observer, chain, estimate)
            self.roughness = trusted(v)
        else:
            self.roughness = felt(self.caution, self.roughness, v)
        factors = caution_factors(self.caution, self.roughness.roughness)
        if self.asked:
            self.seen = observed(self.observer, factors, chain, estimate, self.seen)
        f = np.repeat(factors, 3)
        law = self.plain
        gains = [np.sqrt(f) * self.k_p * self.mask, f**0.25 * self.k_d * self.mask]
        paced = law._numbers.gains._replace(
            proportional=record(Spatial, gains[0]), derivative=record(Spatial, gains[1])
        )
        law._numbers = law._numbers._replace(gains=paced)
        nominal = law.wrench(0.0, m, ref).copy()
        d = np.array([*flat(self.seen.wrench)])
        actual = (np.array([*flat(self.seen.actual)]).reshape(2, 3) @ self.R.T).ravel()
        u = nominal - self.mask * d
        lead = self.mask * (self.s.actuation_speedup - 1.0) * f
        u = u + lead * (u - self.turn(actual, ref, 1.0))
        self.beside = nominal - u
        self.tell(u)
        if self.bounds is not None:
            within = np.clip(u, -self.bounds * [1, 1, 0, 1, 1, 1], self.bounds)
            if np.any(within != u):
                self.delivered(within, within - u)
            u = within
        return u, d

    asked = False

    def tell(self, wrench):
        wrench_A = (self.turn(wrench, self.ref, -1.0).reshape(2, 3) @ self.R).ravel()
        self.seen, self.asked = asked(self.seen, record(Spatial, wrench_A)), True

    def delivered(self, wrench, missing):
        self.tell(wrench)
        self.plain.delivered(wrench + self.beside, missing)


@pytest.mark.parametrize("compensation", COMPENSATIONS)
@pytest.mark.parametrize("bounds", BOUNDS, ids=["none", "all", "force", "moment"])
def test_is_dc_pid_less_the_observed_wrench_and_a_lead(vehicle, rng, compensation, bounds):
    """Period by period, smooth and rough, delivered and not. Rounding grows in the observer."""
    plus = make_controller(
        "dc-pid-plus",
        vehicle,
        axes=(True, True, True, True, True, False),
        compensation=compensation,
        wrench_bounds=None if bounds is None else tuple(bounds),
        **GAINS,
    )
    assembled = Assembled(plus, bounds)
    m, ref = Measurement(vehicle), ReferencePoint()
    m.q[:] = pin.integrate(vehicle.model, m.q, 0.3 * rng.normal(size=vehicle.model.nv))
    plus.reset(m, ref)
    factors = []
    for k in range(60):
        rough = 0.3 if 20 < k < 40 else 0.003
        m.v[:] = rough * rng.normal(size=vehicle.model.nv) + np.sin(0.1 * k)
        m.q[:] = pin.integrate(vehicle.model, m.q, T * m.v)
        m.arm_acceleration[:] = rng.normal(size=vehicle.n_arm)
        ref.pose = pin.integrate(vehicle.model, m.q, 0.05 * rng.normal(size=vehicle.model.nv))[:7]
        ref.velocity, ref.acceleration = rng.normal(size=(2, 6))
        if k == 0:
            plus.reset(m, ref)
        found = plus.wrench(0.0, m, ref)
        expected, d = assembled.wrench(m, ref, plus.chain(motions_of(m)))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
        np.testing.assert_allclose(plus.observed_wrench, d, rtol=0, atol=1e-9)
        np.testing.assert_allclose(plus.u_pid, assembled.plain.u_pid, rtol=0, atol=1e-9)
        factors.append(caution_factors(assembled.caution, assembled.roughness.roughness))
        if k % 4 == 3:
            got = 0.9 * expected + rng.normal(size=6)
            plus.delivered(got, got - expected)
            assembled.delivered(got, got - expected)
    assert factors[0] == (1.0, 1.0)
    assert max(factors[35]) < 0.5


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
        settings = make_settings("dc-pid-plus", {"actuation_speedup": speedup})
        controller = DcPidPlus(vehicle, settings, axes=axes, anticipated=False)
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
