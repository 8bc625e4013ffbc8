"""Eqs. (27)-(35), each against the words around it in the paper."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.model import rotors as r

N = 5

ROUNDING = 1e-14
"""Relative: sums of five products."""


@pytest.fixture(scope="module")
def table():
    rng = np.random.default_rng(0)
    axes = rng.normal(size=(N, 3))
    return {
        "positions": rng.uniform(-0.4, 0.4, (N, 3)),
        "axes": axes / np.linalg.norm(axes, axis=1, keepdims=True),
        "spins": rng.choice([-1.0, 1.0], N),
        "k_f": rng.uniform(1e-6, 1e-5, N),
        "k_tau": rng.uniform(1e-8, 1e-6, N),
    }


@pytest.fixture(scope="module")
def squared():
    return np.random.default_rng(1).uniform(1e4, 1e6, N)


def moments(table, squared):
    return r.rotor_moments(
        *(table[k] for k in ("positions", "axes", "spins", "k_f", "k_tau")), squared
    )


def test_thrust_27_grows_with_the_square():
    np.testing.assert_allclose(r.thrust(2e-6, [100.0, 200.0]), [0.02, 0.08], rtol=ROUNDING)


def test_forces_28_lie_along_the_axes_and_sum_to_29(table, squared):
    forces = r.rotor_forces(table["axes"], table["k_f"], squared)
    lengths = np.sum(forces * table["axes"], axis=1)
    np.testing.assert_allclose(lengths, table["k_f"] * squared, rtol=ROUNDING)
    np.testing.assert_allclose(forces, lengths[:, None] * table["axes"], rtol=ROUNDING)
    total = r.net_force(table["axes"], table["k_f"], squared)
    np.testing.assert_allclose(total, forces.sum(axis=0), atol=ROUNDING * np.abs(forces).sum())


def test_moment_30_is_lever_arm_plus_drag(table, squared):
    forces = r.rotor_forces(table["axes"], table["k_f"], squared)
    for k, moment in enumerate(moments(table, squared)):
        drag = table["spins"][k] * table["k_tau"][k] * squared[k] * table["axes"][k]
        lever = pin.skew(table["positions"][k]) @ forces[k]
        np.testing.assert_allclose(moment, lever + drag, atol=ROUNDING * 10)


def test_drag_moment_turns_against_the_spin_sign(table, squared):
    at_origin = {**table, "positions": np.zeros((N, 3)), "spins": np.ones(N)}
    along = np.sum(moments(at_origin, squared) * table["axes"], axis=1)
    np.testing.assert_allclose(along, table["k_tau"] * squared, rtol=ROUNDING)


def test_moment_map_31_32_times_axis_is_the_moment_30(table, squared):
    expected = moments(table, squared)
    for k in range(N):
        s_tau = r.moment_map(*(table[name][k] for name in ("positions", "spins", "k_f", "k_tau")))
        found = s_tau @ table["axes"][k] * squared[k]
        np.testing.assert_allclose(found, expected[k], atol=ROUNDING * 10)
        drag = table["spins"][k] * table["k_tau"][k]
        symmetric = 0.5 * (s_tau + s_tau.T)
        np.testing.assert_allclose(symmetric, drag * np.eye(3), atol=1e-20)


def test_moment_matrix_33_sums_the_moments_30(table, squared):
    total = r.moment_matrix(**table) @ squared
    np.testing.assert_allclose(total, moments(table, squared).sum(axis=0), atol=ROUNDING * 10)


def test_coupling_matrix_34_stacks_29_and_33(table, squared):
    wrench = r.coupling_matrix(**table) @ squared
    force = r.net_force(table["axes"], table["k_f"], squared)
    moment = r.moment_matrix(**table) @ squared
    np.testing.assert_allclose(wrench, np.concatenate([force, moment]), atol=ROUNDING * 10)


def test_world_wrench_35_turns_both_halves():
    R = pin.exp3(np.array([0.3, -0.4, 0.5]))
    wrench = np.arange(6.0)
    turned = r.world_wrench(R, wrench)
    np.testing.assert_allclose(R.T @ turned[:3], wrench[:3], atol=ROUNDING * 10)
    np.testing.assert_allclose(R.T @ turned[3:], wrench[3:], atol=ROUNDING * 10)
