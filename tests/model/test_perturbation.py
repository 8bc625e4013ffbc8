"""A drawn vehicle is near the nominal one, possible, and the same for the same seed."""

import json

import numpy as np
import pytest

from fullam.exceptions import SettingsError, UnknownName
from fullam.model.loading import load_vehicle, vehicle_names
from fullam.model.perturbation import PARAMETERS, Uncertainty, perturb
from fullam.model.physics import inertia_problem

ALL = Uncertainty(0.10, PARAMETERS)
ROUNDING = 1e-12
"""Products and quotients of a few numbers."""


def factors(nominal, true) -> dict[str, np.ndarray]:
    """Ratio true / nominal of every parameter."""
    bodies = list(zip(nominal.model.inertias[1:], true.model.inertias[1:], strict=True))
    masses = np.array([b.mass / a.mass for a, b in bodies])
    inertias = np.array([np.trace(b.inertia) / np.trace(a.inertia) for a, b in bodies]) / masses
    levers = np.array([np.linalg.norm(b.lever) / np.linalg.norm(a.lever) for a, b in bodies[1:]])
    return {
        "platform_mass": masses[:1],
        "platform_inertia": inertias[:1],
        "link_masses": masses[1:],
        "link_inertias": inertias[1:],
        "link_coms": levers,
        "k_f": true.rotors.k_f / nominal.rotors.k_f,
        "k_tau": true.rotors.k_tau / nominal.rotors.k_tau,
        "lag": true.rotors.lags / nominal.rotors.lags,
    }


@pytest.mark.parametrize("name", vehicle_names())
def test_every_parameter_of_every_part_gets_its_own_factor(name):
    nominal = load_vehicle(name)
    drawn = factors(nominal, perturb(nominal, ALL, np.random.default_rng(0)))
    assert set(drawn) == set(PARAMETERS)
    every = np.concatenate([drawn[key] for key in PARAMETERS])
    assert np.all(np.abs(every - 1.0) <= 0.10 + ROUNDING)
    assert np.all(np.abs(every - 1.0) > 0.0)
    assert len(np.unique(np.round(every, 10))) == len(every)


def test_the_factors_fill_the_whole_range():
    nominal = load_vehicle("fullam")
    rng = np.random.default_rng(1)
    every = np.concatenate(
        [np.concatenate(list(factors(nominal, perturb(nominal, ALL, rng)).values()))
         for _ in range(100)]
    )  # fmt: skip
    # 3800 uniform draws on +-0.1: mean within 5 standard errors, extremes within 1 % of the edge.
    assert abs(every.mean() - 1.0) < 5 * 0.1 / np.sqrt(3 * len(every))
    assert every.min() < 0.902
    assert every.max() > 1.098


def test_the_order_of_the_draws_is_the_documented_one():
    nominal = load_vehicle("fullam")
    drawn = factors(nominal, perturb(nominal, ALL, np.random.default_rng(7)))
    rng = np.random.default_rng(7)
    for key in PARAMETERS:
        expected = 1.0 + 0.10 * rng.uniform(-1.0, 1.0, len(drawn[key]))
        np.testing.assert_allclose(drawn[key], expected, rtol=ROUNDING)


@pytest.mark.parametrize("named", PARAMETERS)
def test_only_named_parameters_change_and_the_others_draws_stay(named):
    nominal = load_vehicle("hextilt")
    one = factors(nominal, perturb(nominal, Uncertainty(0.1, (named,)), np.random.default_rng(2)))
    both = factors(nominal, perturb(nominal, ALL, np.random.default_rng(2)))
    for key in PARAMETERS:
        expected = both[key] if key == named else np.ones_like(both[key])
        np.testing.assert_allclose(one[key], expected, rtol=ROUNDING)


@pytest.mark.parametrize("name", vehicle_names())
def test_possible_bodies_stay_possible(name):
    nominal = load_vehicle(name)
    rng = np.random.default_rng(3)
    for _ in range(20):
        true = perturb(nominal, Uncertainty(0.5, PARAMETERS), rng)
        for body in true.model.inertias[1:]:
            assert body.mass > 0.0
            assert inertia_problem(body.inertia) is None


def test_the_same_seed_gives_the_same_vehicle_bit_for_bit():
    nominal = load_vehicle("fullam")
    one, other = (perturb(nominal, ALL, np.random.default_rng(11)) for _ in range(2))
    assert one.model == other.model
    for field in ("axes", "positions", "k_f", "k_tau", "lags"):
        np.testing.assert_array_equal(getattr(one.rotors, field), getattr(other.rotors, field))
    third = perturb(nominal, ALL, np.random.default_rng(12))
    assert third.model != one.model


def test_the_nominal_vehicle_stays_and_no_share_changes_nothing():
    nominal, untouched = load_vehicle("fullam"), load_vehicle("fullam")
    perturb(nominal, ALL, np.random.default_rng(4))
    assert nominal.model == untouched.model
    same = perturb(nominal, Uncertainty(0.0), np.random.default_rng(4))
    assert same.model == nominal.model
    assert same.model is not nominal.model
    np.testing.assert_array_equal(same.rotors.k_f, nominal.rotors.k_f)


def test_an_uncertainty_survives_a_file():
    data = json.loads(json.dumps(ALL.to_dict()))
    assert Uncertainty(**data) == ALL


@pytest.mark.parametrize("share", [-0.1, 1.0, float("nan")])
def test_a_bad_share_is_named(share):
    with pytest.raises(SettingsError, match="uncertainty: share"):
        Uncertainty(share)


def test_an_unknown_parameter_lists_the_known_ones():
    with pytest.raises(UnknownName, match="Did you mean 'link_masses'"):
        Uncertainty(parameters=("link_mass",))
