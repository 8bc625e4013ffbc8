"""Allocation: against scipy, at the bounds, with failed rotors, with broken solvers."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from fullam.control import allocation, ladder, proxqp_referee
from fullam.control.active_set_map import value
from fullam.control.allocation import Allocator
from fullam.control.allocation_answer import Allocation, Counters
from fullam.exceptions import (
    AllocationFailed,
    NonFiniteWrench,
    NotFullyActuated,
    SettingsError,
)
from fullam.model.rotors import Rotors
from fullam.model.wrench_axes import AXES, controllable_axes, full_scale, rank_on

WRENCH_TOLERANCE = 1e-6
"""Share of full scale: what the regulariser (1e-8 over the weakest axis) may leave."""

PROXQP_TOLERANCE = 1e-5
"""Share of full scale: ProxQP stops at 1e-9 in the gradient, whose Hessian goes down to 1e-3."""

KKT_TOLERANCE = {"ladder": 1e-9, "proxqp": 2e-6}
"""The active set is exact to rounding; ProxQP stops at 1e-9 relative in the scaled gradient."""

OBJECTIVE_TOLERANCE = 1e-8
"""Relative excess of the cost over scipy's, what ProxQP's duality gap of 1e-9 may leave."""

VERTICAL = (False, False, True, True, True, True)
HOVER = np.array([0.0, 0.0, 22.0, 0.0, 0.0, 0.0])
SPREAD = np.array([20.0, 20.0, 20.0, 2.0, 2.0, 2.0])
BEYOND = np.array([30.0, 1.0, 52.0, 3.0, -0.1, 0.05])


def ring(n: int = 8, cant: float = 45.0) -> Rotors:
    """Rotors on a ring of 0.35 m, canted by turns to either side about their arm [deg]."""
    azimuth = np.arange(n) * 2.0 * np.pi / n
    spins = np.where(np.arange(n) % 2 == 0, 1.0, -1.0)
    tilt = np.deg2rad(cant) * spins[:, None]
    radial = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(n)], axis=1)
    tangent = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros(n)], axis=1)
    one = np.ones(n)
    return Rotors(
        names=tuple(f"rotor_{i}" for i in range(n)),
        positions=0.35 * radial,
        axes=np.cos(tilt) * np.array([0.0, 0.0, 1.0]) + np.sin(tilt) * tangent,
        spins=spins,
        k_f=3.16e-5 * one,
        k_tau=3.12e-7 * one,
        max_speeds=np.sqrt(3e5) * one,
        lags=0.02 * one,
    )


def doubled() -> Rotors:
    """A hexarotor with every rotor there twice: the wrench never fixes the speeds."""
    one = ring(6)
    return Rotors(
        names=tuple(f"rotor_{i}" for i in range(12)),
        **{
            field: np.concatenate([getattr(one, field)] * 2)
            for field in ("positions", "axes", "spins", "k_f", "k_tau", "max_speeds", "lags")
        },
    )


FLEET: dict[str, tuple[Rotors, tuple[bool, ...]]] = {
    "octorotor": (ring(8), (True,) * 6),
    "hexarotor": (ring(6, 36.0), (True,) * 6),
    "sixteen": (ring(16, 30.0), (True,) * 6),
    "doubled": (doubled(), (True,) * 6),
    "one-failed": (ring(8).with_failed(3), (True,) * 6),
    "hexarotor-one-failed": (ring(6).with_failed(0), (False, False, True, True, True, True)),
    "quadrotor": (ring(4, 0.0), VERTICAL),
    "position-only": (ring(8), (True, True, True, False, False, False)),
}


def sample(rotors: Rotors, rng: np.random.Generator) -> list[np.ndarray]:
    """Wrenches in reach, out of it, on the edge of it (vertex and face), none, and absurd."""
    B, n = rotors.normalized_coupling, rotors.count
    noise = rng.normal(size=6) * SPREAD
    return [
        HOVER + 0.1 * noise,
        HOVER + noise,
        HOVER + 10.0 * noise,
        1e4 * noise,
        B @ rng.integers(0, 2, n).astype(float),
        B @ np.clip(rng.uniform(-1.0, 2.0, n), 0.0, 1.0),
        np.zeros(6),
    ]


def reference(allocator: Allocator, wrench: np.ndarray) -> np.ndarray:
    """Answer of scipy, built here from the rotors alone; failed rotors are left out."""
    rotors = allocator.rotors
    working = rotors.max_speeds > 0
    rows = np.where(allocator.axes, allocator.weights / full_scale(rotors), 0.0)
    stacked = np.vstack(
        [
            rows[:, None] * rotors.normalized_coupling[:, working],
            1e-4 * np.eye(np.count_nonzero(working)),
        ]
    )
    right = np.concatenate([rows * wrench, np.zeros(np.count_nonzero(working))])
    u = np.zeros(rotors.count)
    u[working] = lsq_linear(stacked, right, (0.0, 1.0), "bvls", tol=1e-15, max_iter=500).x
    return np.clip(u, 0.0, 1.0)


def cost(allocator: Allocator, u: np.ndarray, wrench: np.ndarray) -> float:
    rows = np.where(allocator.axes, allocator.weights / full_scale(allocator.rotors), 0.0)
    error = rows * (allocator.rotors.normalized_coupling @ u - wrench)
    return 0.5 * float(error @ error) + 0.5e-8 * float(u @ u)


@pytest.mark.parametrize("name", FLEET)
@pytest.mark.parametrize("method", ["ladder", "proxqp"])
def test_agrees_with_scipy(name: str, method: str) -> None:
    rotors, axes = FLEET[name]
    allocator = Allocator(rotors, axes=axes, method=method)
    B, scale = rotors.normalized_coupling, full_scale(rotors)
    tolerance = WRENCH_TOLERANCE if method == "ladder" else PROXQP_TOLERANCE
    rng = np.random.default_rng(1)
    solved = 0
    for _ in range(25):
        for wrench in sample(rotors, rng):
            answer, expected = allocator.solve(wrench), reference(allocator, wrench)
            size = 1.0 + float(np.sum((allocator.weights * wrench / scale) ** 2))
            excess = cost(allocator, answer.squared, wrench) - cost(allocator, expected, wrench)
            assert excess <= OBJECTIVE_TOLERANCE * size
            assert answer.kkt_residual() <= KKT_TOLERANCE[method]
            error = (answer.wrench - B @ expected)[allocator.axes] / scale[allocator.axes]
            assert np.abs(error).max() <= tolerance * np.sqrt(size)
            np.testing.assert_allclose(  # the speeds are what gives the wrench, eq. (34)
                rotors.wrench(answer.speeds), answer.wrench, atol=1e-12 * scale.max()
            )
            solved += 1
    counters = allocator.counters
    assert counters.clip == counters.unconfirmed == 0
    if method == "ladder":
        assert counters.exact + counters.active_set == solved
        assert counters.exact > 0
        assert counters.active_set > 0
    else:
        assert counters.proxqp == solved


def test_within_reach_the_wrench_is_met() -> None:
    allocator = Allocator(ring())
    rng = np.random.default_rng(2)
    for _ in range(200):
        wrench = HOVER + 0.1 * rng.normal(size=6) * SPREAD
        answer = allocator.solve(wrench)
        assert answer.method == "exact"
        assert not answer.saturated
        assert not answer.lower_active.any()
        assert not answer.upper_active.any()
        assert np.abs(answer.residual / full_scale(allocator.rotors)).max() < WRENCH_TOLERANCE
        np.testing.assert_array_equal(answer.residual, answer.wrench - wrench)
    assert allocator.counters == Counters(exact=200)


def test_saturated_means_that_bounds_cost_wrench() -> None:
    """A bound that the other rotors make up for is active, and does not saturate."""
    rotors = ring()
    allocator = Allocator(rotors)
    rng = np.random.default_rng(3)
    made_up_for = 0
    for _ in range(300):
        within = rotors.normalized_coupling @ rng.uniform(0.0, 1.0, 8)
        answer = allocator.solve(within)
        assert not answer.saturated
        if answer.method == "active-set":
            made_up_for += 1
            assert answer.lower_active.any() or answer.upper_active.any()
            assert np.abs(answer.residual / full_scale(rotors)).max() < 1e-5
        beyond = allocator.solve(within + np.array([0.0, 0.0, 100.0, 0.0, 0.0, 0.0]))
        assert beyond.saturated
        assert beyond.upper_active.any()
    assert made_up_for > 20


@pytest.mark.parametrize("method", ["ladder", "proxqp"])
def test_the_edge_of_reach_is_not_saturated(method: str) -> None:
    """Wrenches of full and of stopped rotors can be had, just so."""
    rotors = ring(6, 36.0)
    allocator = Allocator(rotors, method=method)
    rng = np.random.default_rng(4)
    for _ in range(64):
        u = rng.integers(0, 2, 6).astype(float)
        answer = allocator.solve(rotors.normalized_coupling @ u)
        # The regulariser pulls each rotor off its bound by eps over the weakest axis.
        np.testing.assert_allclose(answer.squared, u, atol=1e-4)
        assert not answer.saturated


def test_moment_goes_before_force() -> None:
    """Out of reach, the default gives up force; equal weights give up moment, which tumbles."""
    first, equal = Allocator(ring()), Allocator(ring(), weights=np.ones(6))
    rng = np.random.default_rng(5)
    moment_first, moment_equal, force_first = [], [], []
    for _ in range(200):
        wrench = HOVER + rng.normal(size=6) * SPREAD
        a, b = first.solve(wrench), equal.solve(wrench)
        if a.saturated:
            moment_first.append(np.linalg.norm(a.residual[3:]))
            moment_equal.append(np.linalg.norm(b.residual[3:]))
            force_first.append(np.linalg.norm(a.residual[:3]))
    assert len(moment_first) > 50
    assert np.mean(moment_first) < 0.05 * np.mean(moment_equal)
    assert np.median(force_first) > 1.0, "newtons are what is given up"


def test_only_ratios_of_weights_count() -> None:
    rotors = ring()
    one = Allocator(rotors, weights=[1, 2, 3, 4, 5, 6])
    other = Allocator(rotors, weights=np.arange(1.0, 7.0) * 1e-3)
    assert one.solve(BEYOND).residual == pytest.approx(other.solve(BEYOND).residual, abs=1e-9)
    force_first = Allocator(rotors, weights=[30, 30, 30, 1, 1, 1])
    lost = np.linalg.norm(force_first.solve(BEYOND).residual[:3])
    assert lost < np.linalg.norm(Allocator(rotors).solve(BEYOND).residual[:3])


@pytest.mark.parametrize("method", ["ladder", "proxqp"])
def test_failed_rotors_stand_still(method: str) -> None:
    rotors = ring().with_failed(1, 6)
    allocator = Allocator(rotors, axes=VERTICAL, method=method, preferred_speeds=[200.0] * 8)
    rng = np.random.default_rng(6)
    for _ in range(50):
        answer = allocator.solve(HOVER + rng.normal(size=6) * SPREAD)
        assert answer.speeds[1] == answer.speeds[6] == 0.0
        assert answer.lower_active[[1, 6]].all()
        assert answer.kkt_residual() <= KKT_TOLERANCE[method]
    easy = allocator.solve(0.5 * HOVER)
    assert not easy.saturated
    assert np.abs(easy.residual[2:]).max() < 1e-3


def test_preferred_speeds_fill_the_null_space() -> None:
    """In reach, the answer is the preferred speeds' projection onto those giving the wrench."""
    rotors = ring()
    B = rotors.normalized_coupling
    preferred = np.linspace(250.0, 400.0, 8)
    u_0 = np.square(preferred / rotors.max_speeds)
    answer = Allocator(rotors, preferred_speeds=preferred).solve(HOVER)
    expected = u_0 + np.linalg.pinv(B) @ (HOVER - B @ u_0)
    assert answer.method == "exact"
    np.testing.assert_allclose(answer.squared, expected, atol=1e-6)  # eps over the weakest axis
    assert np.abs(answer.residual).max() < 1e-4
    at_rest = Allocator(rotors, preferred_speeds=preferred).solve(B @ u_0)
    np.testing.assert_allclose(at_rest.speeds, preferred, rtol=1e-9)


@pytest.mark.parametrize("method", ["ladder", "proxqp"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_non_finite_wrenches_touch_no_solver(
    method: str, bad: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    allocator = Allocator(ring(), axes=VERTICAL, method=method)
    before = allocator.solve(BEYOND).squared

    def touched(*_: object) -> bool:
        raise AssertionError("a solver was touched")

    with monkeypatch.context() as patch:
        for solver in ("exact", "search_about", "search_at_origin"):
            patch.setattr(allocation, solver, touched)
        patch.setattr(proxqp_referee.ProxQPReferee, "solve", touched)
        for axis in range(6):  # the masked ones too
            wrench = HOVER.copy()
            wrench[axis] = bad
            with pytest.raises(NonFiniteWrench, match="not finite") as caught:
                allocator.solve(wrench)
            np.testing.assert_array_equal(caught.value.wrench, wrench)
    assert allocator.counters.refused == 6
    np.testing.assert_allclose(allocator.solve(BEYOND).squared, before, atol=1e-6)


def test_kkt_residual_exposes_a_planted_error() -> None:
    """An allocation whose speeds were tampered with, and the clipped pseudo-inverse."""
    rotors = ring()
    answer = Allocator(rotors).solve(BEYOND)
    assert answer.kkt_residual() < 1e-12
    wrong = copy.deepcopy(answer)
    wrong.squared[int(np.argmin(np.abs(wrong.squared - 0.5)))] += 1e-3
    assert wrong.kkt_residual() > 0.9e-3
    clipped = Allocation(
        answer._problem,
        BEYOND,
        np.clip(np.linalg.pinv(rotors.normalized_coupling) @ BEYOND, 0.0, 1.0),
        "clip",
        True,
    )
    assert clipped.kkt_residual() > 0.05
    assert np.linalg.norm(clipped.residual[3:]) > 10.0 * np.linalg.norm(answer.residual[3:])


def test_referee_answers_when_the_active_set_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = Allocator(ring()).solve(BEYOND)
    allocator = Allocator(ring())
    with monkeypatch.context() as patch:
        patch.setattr(ladder, "solve_box", lambda *_: (False, 0.0, 0.0))
        answer = allocator.solve(BEYOND)
    assert answer.method == allocator.rung == "proxqp"
    assert answer.saturated
    np.testing.assert_allclose(answer.residual, expected.residual, atol=1e-4)
    assert allocator.counters == Counters(proxqp=1, unconfirmed=1)


def test_wrong_answers_of_the_active_set_are_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says settled, its KKT residual says otherwise: the referee decides."""

    def wrong(box: Any, search: Any, wrench: Any) -> tuple[bool, float, float]:
        for i, unknown in enumerate(box.unknowns):
            search.solution[i] = min(max(value(unknown, wrench), 0.0), 1.0)
        return True, 0.0, 0.0

    allocator = Allocator(ring())
    monkeypatch.setattr(ladder, "solve_box", wrong)
    answer = allocator.solve(BEYOND)
    assert answer.method == "proxqp"
    assert answer.kkt_residual() < KKT_TOLERANCE["proxqp"]


def test_when_everything_fails_the_clip_is_flagged(monkeypatch: pytest.MonkeyPatch) -> None:
    allocator = Allocator(ring())
    with monkeypatch.context() as patch:
        patch.setattr(ladder, "solve_box", lambda *_: (False, 0.0, 0.0))
        patch.setattr(proxqp_referee, "LARGEST_ITERATIONS", 1)
        answer = allocator.solve(BEYOND)
    assert answer.method == "clip"
    assert answer.saturated
    expected = np.clip(np.linalg.pinv(ring().normalized_coupling) @ BEYOND, 0.0, 1.0)
    np.testing.assert_allclose(answer.squared, expected, atol=1e-5)  # but for the regulariser
    assert allocator.counters == Counters(clip=1, unconfirmed=1)
    assert allocator.solve(BEYOND).method == "active-set", "the next wrench is solved again"


def test_failure_of_the_referee_carries_the_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    """The evidence is enough to solve the problem elsewhere, and the allocator recovers."""
    allocator = Allocator(ring(), method="proxqp")
    with monkeypatch.context() as patch:
        patch.setattr(proxqp_referee, "LARGEST_ITERATIONS", 1)
        with pytest.raises(AllocationFailed, match="MAX_ITER") as caught:
            allocator.solve(BEYOND)
    problem = caught.value.problem
    np.testing.assert_array_equal(caught.value.wrench, BEYOND)
    factor = np.linalg.cholesky(problem["H"])
    bounds = (problem["lower"], problem["upper"])
    elsewhere = lsq_linear(factor.T, -np.linalg.solve(factor, problem["g"]), bounds, "bvls")
    answer = allocator.solve(BEYOND)
    np.testing.assert_allclose(
        problem["coupling"] @ elsewhere.x, answer.wrench, atol=1e-4
    )  # 1e-6 of full scale


@pytest.mark.parametrize("method", ["ladder", "proxqp"])
@pytest.mark.parametrize("used", [False, True])
def test_copies_and_pickles_work_on_their_own(method: str, used: bool) -> None:
    allocator = Allocator(ring(), method=method)
    if used:
        allocator.solve(BEYOND)
    twins = (copy.deepcopy(allocator), pickle.loads(pickle.dumps(allocator)))
    for twin in twins:
        assert twin.counters == Counters() if not used else twin.counters != Counters()
        answer = twin.solve(BEYOND)
        first = answer.squared.copy()
        allocator.solve(HOVER)
        np.testing.assert_array_equal(answer.squared, first)
        np.testing.assert_array_equal(twin.squared, first)
        np.testing.assert_allclose(first, Allocator(ring(), method=method).solve(BEYOND).squared)
    twice = pickle.loads(pickle.dumps(allocator.solve(BEYOND)))
    np.testing.assert_array_equal(twice.residual, allocator.solve(BEYOND).residual)


def test_an_allocation_owns_its_memory_and_allocate_does_not() -> None:
    allocator = Allocator(ring())
    wrench = HOVER.copy()
    kept = allocator.solve(wrench)
    speeds, live = kept.speeds.copy(), allocator.allocate(BEYOND)
    wrench[:] = 0.0
    assert live is allocator.squared
    assert allocator.saturated
    np.testing.assert_array_equal(kept.speeds, speeds)
    np.testing.assert_array_equal(kept.asked, HOVER)
    assert "saturated=False" in repr(kept)


def test_a_flight_through_saturation_and_back() -> None:
    """Smooth wrenches: every rung answers in its place, the same as from a cold start."""
    rotors = ring()
    allocator = Allocator(rotors)
    t = np.linspace(0.0, 4.0 * np.pi, 400)
    for angle in t:
        wrench = HOVER + 0.6 * SPREAD * np.sin(angle * np.arange(1.0, 2.5, 0.25))
        answer, cold = allocator.solve(wrench), Allocator(rotors).solve(wrench)
        np.testing.assert_allclose(answer.squared, cold.squared, atol=1e-7)  # rounding over eps
        assert answer.saturated == cold.saturated
    counters = allocator.counters
    assert counters.exact + counters.active_set == 400
    assert min(counters.exact, counters.active_set) > 50


def test_rank_and_axes() -> None:
    assert rank_on(ring(), np.ones(6, dtype=bool)) == 6
    assert rank_on(ring(4, 0.0), np.ones(6, dtype=bool)) == 4
    assert controllable_axes(ring()) == (True,) * 6
    assert controllable_axes(ring(4, 0.0)) == VERTICAL
    assert controllable_axes(ring(6, 0.0)) == VERTICAL
    dead = ring(4, 0.0).with_failed(0, 1, 2, 3)
    assert controllable_axes(dead) == (False,) * 6
    assert len(AXES) == 6


def test_too_many_axes_are_refused_with_the_remedy() -> None:
    with pytest.raises(
        NotFullyActuated, match=r"rank 4 on the 6 axes.*axes=\(False, False, True"
    ) as e:
        Allocator(ring(6, 0.0), vehicle_name="borinot")
    assert (e.value.vehicle, e.value.rank, e.value.asked) == ("borinot", 4, 6)
    with pytest.raises(NotFullyActuated, match="rank 5"):
        Allocator(ring(6).with_failed(0))
    with pytest.raises(NotFullyActuated, match="rank 0"):
        Allocator(ring(4).with_failed(0, 1, 2, 3), axes=VERTICAL)


@pytest.mark.parametrize(
    ("field", "settings"),
    [
        ("method", {"method": "guess"}),
        ("regularization", {"regularization": 0.0}),
        ("regularization", {"regularization": np.nan}),
        ("weights", {"weights": [1, 1, 1]}),
        ("weights", {"weights": [1, 1, 1, 1, 1, 0]}),
        ("weights", {"weights": [1, 1, 1, 1, 1, np.nan]}),
        ("axes", {"axes": [1, 1, 1, 1, 1, 0]}),
        ("axes", {"axes": [False] * 6}),
        ("axes", {"axes": [True] * 4}),
        ("preferred_speeds", {"preferred_speeds": [100.0]}),
        ("preferred_speeds", {"preferred_speeds": [-1.0] * 8}),
    ],
)
def test_bad_settings_are_named(field: str, settings: dict[str, object]) -> None:
    with pytest.raises(SettingsError, match=f"allocator: {field}") as caught:
        Allocator(ring(), **settings)
    assert caught.value.field == field
