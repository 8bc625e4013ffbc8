import numpy as np
import pytest

from fullam.analysis import agreement as table
from fullam.analysis import random_states as rs
from fullam.dynamics import matrix_system
from fullam.exceptions import UnknownName
from fullam.model.loading import load_vehicle

AGREEMENT = 1e-10
"""As in tests/dynamics/test_witnesses.py."""


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("fullam")


def test_table_has_every_quantity_and_agrees(vehicle):
    found = table.agreement(vehicle, samples=60, seed=3)
    assert (found.vehicle, found.samples, found.seed, found.unknowns) == ("fullam", 60, 3, 66)
    assert [row.quantity for row in found.rows] == ["acceleration", "f_1", "tau_1", "u_dc"]
    assert 0.0 < found.largest < AGREEMENT
    # Measured 200 to 400; M has rows of kg m^2 beside rows of ones.
    assert 50.0 < found.condition_number < 2000.0


def test_same_seed_same_table(vehicle):
    assert table.agreement(vehicle, 12, 1) == table.agreement(vehicle, 12, 1)
    assert table.agreement(vehicle, 12, 1) != table.agreement(vehicle, 12, 2)


def test_fewer_samples_than_categories_still_try_each(vehicle):
    assert table.agreement(vehicle, 1).samples == len(rs.CATEGORIES)


def test_a_wrong_sign_shows_in_its_row(vehicle, monkeypatch):
    right = matrix_system.compensation

    def printed(chain, motion, f_1, tau_1, tool_wrench):
        return right(chain, motion, -f_1, tau_1)

    monkeypatch.setattr(matrix_system, "compensation", printed)
    rows = {row.quantity: row for row in table.agreement(vehicle, 12).rows}
    assert rows["u_dc"].recursion_pinocchio > 0.01
    assert rows["f_1"].recursion_pinocchio < AGREEMENT


def test_text_names_vehicle_quantities_and_numbers(vehicle):
    text = str(table.agreement(vehicle, 12))
    for word in ("'fullam'", "f_1", "tau_1", "u_dc", "acceleration", "66 unknowns", "12 random"):
        assert word in text


def test_relative_difference_of_nothing_is_nothing():
    zero, one = np.zeros((2, 3)), np.ones((2, 3))
    np.testing.assert_array_equal(table.relative_difference(zero, zero), [0.0, 0.0])
    np.testing.assert_allclose(table.relative_difference(2 * one, one), [1.0, 1.0])


@pytest.mark.parametrize("category", rs.CATEGORIES)
def test_states_are_what_their_category_says(category):
    rng = np.random.default_rng(0)
    states = rs.random_states(4, category, 200, rng)
    quaternion = states.q[:, 3:7]
    np.testing.assert_allclose(np.linalg.norm(quaternion, axis=1), 1.0, atol=1e-14)
    x, y, z, w = quaternion.T
    sine_of_psi = 2 * (x * z + w * y)  # R[0, 2] of the quaternion
    assert (np.abs(sine_of_psi).min() > 1 - 1e-6) == (category == "singular")
    assert (np.abs(states.v).max() > 10.0) == (category == "fast")
    assert np.any(states.tool_wrench) == (category == "external")
    quarter_turns = states.q[:, 7:] / (np.pi / 2)
    assert (np.abs(quarter_turns - quarter_turns.round()).max() < 1e-7) == (category == "stretched")


def test_unknown_category_is_refused():
    with pytest.raises(UnknownName, match="singular"):
        rs.random_states(4, "singuler", 1, np.random.default_rng(0))


def test_random_inertias_are_physical_and_leave_the_model_alone(vehicle):
    before = [body.mass for body in vehicle.model.inertias]
    drawn = rs.randomized_inertias(vehicle.model, np.random.default_rng(0))
    assert [body.mass for body in vehicle.model.inertias] == before
    for body in list(drawn.inertias)[1:]:
        moments = np.linalg.eigvalsh(body.inertia)
        assert moments[0] > 0.0
        assert moments[2] <= moments[0] + moments[1] + 1e-12
