"""Allocation about the centre of mass: the fixed point, how it is reached, what if it is not."""

from __future__ import annotations

import pickle
from collections import Counter

import numpy as np
import pinocchio as pin
import pytest

from fullam.control import allocation, moment_about, proxqp_referee
from fullam.control.allocation import Allocator
from fullam.control.box_qp import six
from fullam.control.moment_about import Response
from fullam.exceptions import NonFiniteCenter, NonFiniteWrench
from fullam.model.loading import load_vehicle

FIXED_POINT_TOLERANCE = 1e-9
"""[N m]. Rounding is 1e-14; an active set may be left by 1e-10 of a rotor before it changes."""

PLAIN_TOLERANCE = 1e-8
"""Of the wrench [N, N m]: plain steps are ended at changes of 1e-11, contracting by 0.5 or less."""

VEHICLES = ("fullam", "hextilt")


def demands(vehicle, seed, number, spread=0.02):
    """Wrenches in reach and far out of it, and centres of mass over all arm poses.

    `spread` [m] is added to the centre, since an arm may carry something.
    """
    rng, B = np.random.default_rng(seed), vehicle.rotors.normalized_coupling
    data, middle, reach = vehicle.create_data(), B.sum(axis=1) / 2, np.abs(B).sum(axis=1) / 2
    for _ in range(number):
        q = vehicle.neutral(rng.uniform(-2.0, 2.0, vehicle.n_arm))
        center = pin.centerOfMass(vehicle.model, data, q) + spread * rng.normal(size=3)
        yield middle + rng.choice([0.3, 1.0, 3.0]) * reach * rng.normal(size=6), center


def off_fixed_point(allocator, wrench, center):
    """Largest entry of m - M - c x (B_f u - F)."""
    lack = (allocator.rotors.normalized_coupling @ allocator.squared - wrench)[:3]
    return np.abs(allocator.asked[3:] - wrench[3:] - np.cross(center, lack)).max()


def plain_steps(allocator, wrench, center):
    """Wrench of the fixed point by plain steps about the origin, None if they do not converge."""
    asked, B = wrench.copy(), allocator.rotors.normalized_coupling
    for _ in range(1000):
        achieved = B @ allocator.allocate(asked)
        moment = wrench[3:] + np.cross(center, (achieved - wrench)[:3])
        change = np.abs(moment - asked[3:]).max()
        asked[3:] = moment
        if change < 1e-11:
            return achieved
    return None


@pytest.mark.parametrize("name", VEHICLES)
def test_newton_reaches_the_fixed_point_of_the_plain_steps(name):
    """From the last demand's active set, however far away; none of 1700 is left unsettled.

    Every fourth is compared with the plain steps, which take dozens.
    """
    vehicle = load_vehicle(name)
    allocator, plain = Allocator(vehicle.rotors), Allocator(vehicle.rotors)
    rounds = Counter()
    for wrench, center in demands(vehicle, 7, 2000):
        if allocator.exact(wrench) is not None:
            continue
        u = allocator.allocate_about(wrench, center)
        assert allocator.settled
        assert off_fixed_point(allocator, wrench, center) < FIXED_POINT_TOLERANCE
        assert u.min() >= 0.0
        assert u.max() <= 1.0
        rounds[allocator.rounds] += 1
        if sum(rounds.values()) % 4:
            continue
        expected = plain_steps(plain, wrench, center)
        assert expected is not None
        np.testing.assert_allclose(
            vehicle.rotors.normalized_coupling @ u, expected, rtol=0, atol=PLAIN_TOLERANCE
        )
    number = sum(rounds.values())
    assert number > 1700
    assert max(rounds) < moment_about.LARGEST_ROUNDS
    assert rounds[1] + rounds[2] + rounds[3] > 0.98 * number
    assert allocator.counters.unsettled == allocator.counters.unconfirmed == 0


@pytest.mark.parametrize("name", VEHICLES)
def test_a_smooth_demand_takes_one_round(name):
    """As in flight: the active set of the period before serves."""
    vehicle = load_vehicle(name)
    allocator, B = Allocator(vehicle.rotors), vehicle.rotors.normalized_coupling
    middle, reach = B.sum(axis=1) / 2, np.abs(B).sum(axis=1) / 2
    center, phase = np.array([0.02, -0.01, -0.04]), np.arange(6.0)
    rounds = Counter()
    for t in np.linspace(0.0, 2.0 * np.pi, 1000):
        wrench = middle + 0.8 * reach * np.sin(t + phase)
        if allocator.exact(wrench) is None:
            allocator.allocate_about(wrench, center)
            rounds[allocator.rounds] += 1
    assert sum(rounds.values()) > 500
    assert rounds[1] > 0.95 * sum(rounds.values())


@pytest.mark.parametrize("name", VEHICLES)
def test_the_moment_about_the_centre_is_kept_where_force_falls_short(name):
    """Of demands whose force is the trouble, the median moment error about c falls tenfold."""
    vehicle, rng = load_vehicle(name), np.random.default_rng(11)
    B, allocator, plain = (
        vehicle.rotors.normalized_coupling,
        Allocator(vehicle.rotors),
        Allocator(vehicle.rotors),
    )
    without, errors = [], []
    for _, center in demands(vehicle, 11, 400, 0.05):
        wrench = np.concatenate([rng.normal(scale=25.0, size=3), rng.normal(scale=0.5, size=3)])
        at_origin = plain.solve(wrench)
        if not at_origin.saturated:
            continue
        allocator.allocate_about(wrench, center)
        assert allocator.saturated
        for u, into in ((at_origin.squared, without), (allocator.squared, errors)):
            error = B @ u - wrench
            into.append(np.linalg.norm(error[3:] - np.cross(center, error[:3])))
    assert len(errors) > 300
    assert np.median(errors) < 0.1 * np.median(without)


def test_within_reach_of_the_bounded_rotors_nothing_is_given_up():
    """A rotor at its bound for which the others make up does not saturate, and m is M."""
    vehicle = load_vehicle("fullam")
    allocator, rng = Allocator(vehicle.rotors), np.random.default_rng(3)
    B, made_up_for = vehicle.rotors.normalized_coupling, 0
    for _ in range(300):
        wrench = B @ rng.uniform(0.0, 1.0, 8)
        if allocator.exact(wrench) is None:
            u = allocator.allocate_about(wrench, np.array([0.05, 0.0, -0.05]))
            assert not allocator.saturated
            np.testing.assert_allclose(
                B @ u, wrench, rtol=0, atol=1e-4
            )  # what the regulariser costs
            np.testing.assert_allclose(allocator.asked, wrench, rtol=0, atol=1e-5)
            made_up_for += 1
    assert made_up_for > 20


def test_heavy_loads_far_out_are_settled_but_for_one_in_hundreds():
    """A centre 60 mm away from any that the arm alone can make: some sets turn back on themselves.

    What does not settle is within the bounds, optimal for its own moment, counted, and measured
    against the moment that it should have had.
    """
    vehicle = load_vehicle("hextilt")
    allocator, number, unsettled = Allocator(vehicle.rotors), 0, 0
    for wrench, center in demands(vehicle, 7, 3000, 0.06):
        if allocator.exact(wrench) is not None:
            continue
        allocator.allocate_about(wrench, center)
        number += 1
        unsettled += not allocator.settled
        assert off_fixed_point(allocator, wrench, center) < FIXED_POINT_TOLERANCE
    assert unsettled == allocator.counters.unsettled
    assert 0 < unsettled < 0.005 * number


def test_without_the_plain_steps_newton_cycles(monkeypatch):
    """Sets of negative determinant send it back: the planted fault leaves twice as many or more."""
    vehicle = load_vehicle("hextilt")
    unsettled = []
    for least in (moment_about.LEAST_DETERMINANT, -np.inf):
        monkeypatch.setattr(moment_about, "LEAST_DETERMINANT", least)
        allocator = Allocator(vehicle.rotors)
        for wrench, center in demands(vehicle, 7, 2000, 0.06):
            if allocator.exact(wrench) is None:
                allocator.allocate_about(wrench, center)
        unsettled.append(allocator.counters.unsettled)
    assert unsettled[1] > 2 * max(1, unsettled[0])


@pytest.mark.parametrize("name", VEHICLES)
def test_the_referee_agrees(name):
    """method="proxqp" repeats plain steps until they are below a thousandth of a newton-metre."""
    vehicle = load_vehicle(name)
    ladder, referee = Allocator(vehicle.rotors), Allocator(vehicle.rotors, method="proxqp")
    compared = 0
    for wrench, center in demands(vehicle, 5, 60):
        if ladder.exact(wrench) is not None:
            assert referee.exact(wrench) is None
            continue
        ladder.allocate_about(wrench, center)
        referee.allocate_about(wrench, center)
        assert referee.rung == "proxqp"
        assert referee.saturated == ladder.saturated
        assert off_fixed_point(referee, wrench, center) < FIXED_POINT_TOLERANCE
        np.testing.assert_allclose(
            referee.asked, ladder.asked, rtol=0, atol=2.0 * moment_about.SETTLED_MOMENT
        )
        compared += 1
    assert compared > 40


BEYOND = np.array([30.0, 1.0, 52.0, 3.0, -0.1, 0.05])
CENTER = np.array([0.03, 0.02, -0.04])


def test_when_the_active_set_does_not_answer_the_ladder_goes_on(monkeypatch):
    """Referee, then clip: both measured against the moment of the force that they give."""
    allocator = Allocator(load_vehicle("fullam").rotors)
    allocator.allocate_about(BEYOND, CENTER)
    expected, B = allocator.asked.copy(), allocator.rotors.normalized_coupling
    monkeypatch.setattr(moment_about, "solve_box", lambda *_: (False, 0.0, 0.0))
    u = allocator.allocate_about(BEYOND, CENTER)  # the set at hand is right, the search is not
    assert allocator.rung == "proxqp"
    assert allocator.is_cold, "what was not confirmed is no start for the next search"
    np.testing.assert_allclose(allocator.asked, expected, atol=1e-3)
    assert np.linalg.norm(B @ u - allocator.asked) > 1.0
    assert off_fixed_point(allocator, BEYOND, CENTER) < FIXED_POINT_TOLERANCE
    monkeypatch.setattr(proxqp_referee, "LARGEST_ITERATIONS", 1)
    clipped = Allocator(allocator.rotors)
    u = clipped.allocate_about(BEYOND, CENTER)
    assert clipped.rung == "clip"
    assert clipped.saturated
    assert u.min() >= 0.0
    assert u.max() <= 1.0
    assert off_fixed_point(clipped, BEYOND, CENTER) < FIXED_POINT_TOLERANCE
    assert (clipped.counters.clip, clipped.counters.unsettled) == (1, 1)


@pytest.mark.parametrize("place", range(9))
def test_non_finite_input_touches_no_solver(place, monkeypatch):
    for solver in ("exact", "search_about", "search_at_origin"):
        monkeypatch.setattr(allocation, solver, lambda *_: pytest.fail("a solver was touched"))
    both = np.concatenate([BEYOND, CENTER])
    both[place] = np.nan
    allocator = Allocator(load_vehicle("fullam").rotors)
    with pytest.raises(NonFiniteWrench) as caught:
        allocator.allocate_about(both[:6], both[6:])
    assert isinstance(caught.value, NonFiniteCenter) == (place >= 6)
    assert ("centre of mass" in str(caught.value)) == (place >= 6)
    assert allocator.counters.refused == 1


def test_answers_depend_on_the_history_only_through_rounding():
    """Reset makes them the same bit for bit; a copy goes on as the original does."""
    vehicle = load_vehicle("fullam")
    allocator = Allocator(vehicle.rotors)
    first = allocator.allocate_about(BEYOND, CENTER).tobytes()
    for wrench, center in demands(vehicle, 1, 20):
        allocator.allocate_about(wrench, center)
    twin = pickle.loads(pickle.dumps(allocator))
    for one in (allocator, twin):
        np.testing.assert_allclose(
            one.allocate_about(BEYOND, CENTER), np.frombuffer(first), atol=1e-7
        )  # rounding over eps
        one.reset()
        assert one.allocate_about(BEYOND, CENTER).tobytes() == first


def test_newton_step_against_dense_algebra():
    rng = np.random.default_rng(0)
    for _ in range(100):
        P, Q, r = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.normal(size=3)
        F, M, c = rng.normal(size=(3, 3))
        c *= 0.2
        left = np.eye(3) - pin.skew(c) @ Q
        columns = (tuple(map(tuple, matrix.T.tolist())) for matrix in (P, Q))
        response = Response(*columns, tuple(r.tolist()))
        wrench, center = six(np.concatenate([F, M])), tuple(c.tolist())
        determinant, m = moment_about.newton_step(response, wrench, center)
        assert determinant == pytest.approx(np.linalg.det(left), rel=1e-9)
        right = M + pin.skew(c) @ (P @ F - F + r)
        # Rounding, magnified by a condition number of up to a thousand.
        np.testing.assert_allclose(m, np.linalg.solve(left, right), rtol=1e-9, atol=1e-9)


def test_newton_step_of_a_singular_system_is_a_number():
    """[c]x Q with the eigenvalue 1; Python would stop at a division by zero, lanes would not."""
    turn = Response(
        ((0.0,) * 3,) * 3, ((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)), (0.0,) * 3
    )
    determinant, m = moment_about.newton_step(turn, six(BEYOND), (1.0, 0.0, 0.0))
    assert determinant == 0.0
    assert np.isfinite(m).all()
