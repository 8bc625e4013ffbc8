"""The box solver against scipy's bounded-variable least squares, which shares no code with it."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from fullam.control import active_set_search
from fullam.control.active_set_map import AT_LOWER, AT_UPPER, FREE, value
from fullam.control.active_set_search import Held, Last, kkt_residual, map_of, solve_box
from fullam.control.box_qp import MOST_UNKNOWNS, BoxLeastSquares, box_lists, pack_box, six
from fullam.exceptions import SettingsError

OBJECTIVE_TOLERANCE = 1e-11
"""Relative excess of the cost over scipy's: both are exact up to rounding in sums of squares."""

KKT_TOLERANCE = 1e-9
"""In u; rounding leaves 1e-13, BOUND_TOLERANCE may leave 1e-10."""

WRENCH_TOLERANCE = 1e-6
"""In A u: scipy stops at 1e-12 in the cost, and the root of that is what A u may differ by."""

WEIGHTS = np.array([1.0, 1.0, 1.0, 30.0, 30.0, 30.0])

Generator = np.random.Generator


def full_rank(rng: Generator) -> np.ndarray:
    return rng.normal(size=(6, rng.integers(6, 13)))


def few_rotors(rng: Generator) -> np.ndarray:
    return rng.normal(size=(6, rng.integers(1, 6)))


def duplicates(rng: Generator) -> np.ndarray:
    B = rng.normal(size=(6, 4))
    return np.hstack([B, B, B[:, :1]])


def rank_four(rng: Generator) -> np.ndarray:
    return rng.normal(size=(6, 4)) @ rng.normal(size=(4, 8))


def nearly_parallel(rng: Generator) -> np.ndarray:
    return rng.normal(size=(6, 1)) + 1e-5 * rng.normal(size=(6, 8))


def dead_rows(rng: Generator) -> np.ndarray:
    B = rng.normal(size=(6, 6))
    B[:2] = 0.0
    return B


MATRICES: tuple[Callable[[Generator], np.ndarray], ...] = (
    full_rank,
    few_rotors,
    duplicates,
    rank_four,
    nearly_parallel,
    dead_rows,
)


def wrenches(B: np.ndarray, rng: Generator) -> list[np.ndarray]:
    """Within reach, at the edge, beyond it, exactly at vertices and faces, zero, and huge."""
    n = B.shape[1]
    inside = B @ rng.uniform(0.2, 0.8, n)
    vertex = B @ rng.integers(0, 2, n).astype(float)
    face = B @ np.clip(rng.uniform(-1.0, 2.0, n), 0.0, 1.0)
    noise = rng.normal(size=6)
    return [
        inside,
        vertex,
        face,
        vertex + noise,
        -inside,
        10.0 * noise,
        1e6 * noise,
        np.zeros(6),
    ]


def reference(box: BoxLeastSquares, wrench: np.ndarray) -> np.ndarray:
    """Answer of scipy on the stacked system, unknowns that are pinned left out."""
    loose = box.upper > 0
    stacked = np.vstack([box.A[:, loose], np.sqrt(box.eps) * np.eye(np.count_nonzero(loose))])
    right = np.concatenate([box.weights * wrench, np.sqrt(box.eps) * box.prior[loose]])
    answer = np.zeros(box.upper.size)
    found = lsq_linear(stacked, right, (0.0, box.upper[loose]), "bvls", tol=1e-15, max_iter=500)
    answer[loose] = np.clip(found.x, 0.0, box.upper[loose])
    return answer


def assert_minimiser(box: BoxLeastSquares, wrench: np.ndarray) -> None:
    """`solution` is in the box, optimal, and no worse than scipy's, with the same wrench.

    And the active set is named as it is: another name would find another set's map.
    """
    bits, held = 2.0 ** np.arange(box.upper.size), box.search.last[0].held
    assert held.lower == bits @ (box.status == AT_LOWER)
    assert held.upper == bits @ (box.status == AT_UPPER)
    u, expected = box.solution, reference(box, wrench)
    assert np.all(u >= 0.0)
    assert np.all(u <= box.upper)
    size = 1.0 + float(np.sum((box.weights * wrench) ** 2))
    excess = box.objective(u, wrench) - box.objective(expected, wrench)
    assert excess <= OBJECTIVE_TOLERANCE * size
    assert box.kkt_residual(u, wrench) <= KKT_TOLERANCE
    assert np.abs(box.A @ (u - expected)).max() <= WRENCH_TOLERANCE * np.sqrt(size)


@pytest.mark.parametrize("matrix", MATRICES)
@pytest.mark.parametrize("eps", [1e-8, 1e-3])
def test_agrees_with_scipy(matrix: Callable[[Generator], np.ndarray], eps: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(15):
        B = matrix(rng)
        n = B.shape[1]
        prior = np.zeros(n) if rng.random() < 0.5 else rng.uniform(0.0, 1.0, n)
        upper = np.ones(n) if rng.random() < 0.5 else rng.integers(0, 2, n).astype(float)
        box = BoxLeastSquares(B, WEIGHTS, eps, prior, upper)
        for wrench in wrenches(B, rng):
            assert box.solve(wrench)
            assert_minimiser(box, wrench)
        assert box.returns == 0


def test_warm_start_does_not_change_the_answer() -> None:
    """A smooth sequence through saturation, against a fresh solver at every step."""
    rng = np.random.default_rng(2)
    B = full_rank(rng)
    n = B.shape[1]
    make = lambda: BoxLeastSquares(B, WEIGHTS, 1e-6, np.zeros(n), np.ones(n))  # noqa: E731
    warm = make()
    t = np.linspace(0.0, 2.0 * np.pi, 300)
    centre, swing = B @ np.full(n, 0.5), rng.normal(size=(6, 2)) * 4.0
    for angle in t:
        wrench = centre + swing @ np.array([np.cos(angle), np.sin(2.0 * angle)])
        cold = make()
        assert warm.solve(wrench)
        assert cold.solve(wrench)
        # Rounding 1e-16 of the wrench over eps: what the null space of A may turn it into.
        np.testing.assert_allclose(warm.solution, cold.solution, atol=1e-7)
    assert 0 < warm.pivots < 300, "the last set should serve most steps"


def start_at(box: BoxLeastSquares, status: np.ndarray, solution: np.ndarray) -> None:
    """Let a search start from an active set and a point that fits it."""
    bits = 2.0 ** np.arange(status.size)
    held = Held(float(bits @ (status == AT_LOWER)), float(bits @ (status == AT_UPPER)))
    box.search.status[:], box.search.solution[:] = status.tolist(), solution.tolist()
    box.search.last[0] = Last(held, 1.0)


def test_every_stale_start_leads_to_the_same_minimiser() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        B = full_rank(rng)
        n = B.shape[1]
        box = BoxLeastSquares(B, WEIGHTS, 1e-8, np.zeros(n), np.ones(n))
        status = rng.choice([FREE, AT_LOWER, AT_UPPER], size=n)
        free, at_upper, bits = status == FREE, status == AT_UPPER, 2.0 ** np.arange(n)
        start_at(box, status, np.where(free, rng.uniform(0.0, 1.0, n), at_upper))
        np.testing.assert_array_equal(box.status, status)
        held = box.search.last[0].held
        assert (held.lower, held.upper) == (bits @ (status == AT_LOWER), bits @ at_upper)
        wrench = 3.0 * rng.normal(size=6)
        assert box.solve(wrench)
        assert_minimiser(box, wrench)


def test_reset_makes_answers_independent_of_history() -> None:
    rng = np.random.default_rng(4)
    B = duplicates(rng)
    n = B.shape[1]
    box = BoxLeastSquares(B, WEIGHTS, 1e-8, np.zeros(n), np.ones(n))
    wrench = 3.0 * rng.normal(size=6)
    box.solve(wrench)
    first = box.solution.copy()
    for _ in range(20):
        box.solve(5.0 * rng.normal(size=6))
    box.reset()
    box.solve(wrench)
    assert first.tobytes() == box.solution.tobytes()


def test_kkt_residual_by_hand() -> None:
    """One unknown, cost (u - 2)^2 / 2: the minimiser in the box is 1; at 0.25 it is 0.75 off."""
    B = np.zeros((6, 1))
    B[0] = 1.0
    box = BoxLeastSquares(B, np.ones(6), 1e-12, np.zeros(1), np.ones(1))
    wrench = np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert box.kkt_residual(np.array([1.0]), wrench) == 0.0
    assert box.kkt_residual(np.array([0.25]), wrench) == pytest.approx(0.75)
    assert box.kkt_residual(np.array([1.5]), wrench) == pytest.approx(0.5), "outside the box"
    assert box.objective(np.array([0.25]), wrench) == pytest.approx(0.5 * 1.75**2)


def test_kkt_residual_exposes_planted_errors() -> None:
    """A wrong u shows: any single entry moved by 1e-3, and the clipped unconstrained minimiser."""
    rng = np.random.default_rng(6)
    B = full_rank(rng)
    n = B.shape[1]
    box = BoxLeastSquares(B, WEIGHTS, 1e-8, np.zeros(n), np.ones(n))
    clips = []
    for _ in range(100):
        wrench = 3.0 * rng.normal(size=6)
        box.solve(wrench)
        u = box.solution.copy()
        wrong = u.copy()
        i = rng.integers(n)
        wrong[i] += 1e-3 if u[i] < 0.5 else -1e-3
        assert box.kkt_residual(wrong, wrench) > 0.9e-3
        clipped = np.clip(box.packed().unknowns["gain"] @ wrench, 0.0, 1.0)
        clips.append(box.kkt_residual(clipped, wrench))
    assert np.median(clips) > 0.05, "clipping a pseudo-inverse is badly wrong"


def test_a_set_that_comes_back_raises_the_tolerances(monkeypatch: pytest.MonkeyPatch) -> None:
    """Planted: a tolerance below zero frees bounds that must hold. Without end, it is noticed."""
    monkeypatch.setattr(active_set_search, "MULTIPLIER_TOLERANCE", -1e3)
    rng = np.random.default_rng(7)
    B = full_rank(rng)
    n = B.shape[1]
    box = BoxLeastSquares(B, WEIGHTS, 1e-8, np.zeros(n), np.ones(n))
    wrench = 5.0 * rng.normal(size=6)
    assert not box.solve(wrench)
    assert box.returns == active_set_search.MOST_RETURNS + 1
    assert np.all((box.solution >= 0.0) & (box.solution <= 1.0)), "feasible all the same"


def test_raised_tolerances_settle_what_rounding_keeps_open(monkeypatch: pytest.MonkeyPatch) -> None:
    """Planted rounding, a hundred times the true one, makes sets come back; no answer is lost."""
    rng, rounding, exactly = np.random.default_rng(0), np.random.default_rng(1), value
    monkeypatch.setattr(
        active_set_search, "value", lambda *of: exactly(*of) + 1e-11 * rounding.uniform(-1.0, 1.0)
    )
    wrenches, unsettled = 3.0 * rng.normal(size=(30, 6)), {}
    for most in (0, active_set_search.MOST_RETURNS):
        monkeypatch.setattr(active_set_search, "MOST_RETURNS", most)
        unsettled[most] = 0
        for wrench in wrenches:
            B = rng.normal(size=(6, 20))
            box = BoxLeastSquares(B, WEIGHTS, 1e-8, np.zeros(20), np.ones(20))
            unsettled[most] += not box.solve(wrench)
            if most > 0:
                assert_minimiser(box, wrench)
    assert unsettled[active_set_search.MOST_RETURNS] == 0 < unsettled[0]


def test_a_full_store_is_emptied_and_changes_nothing() -> None:
    """Five slots, of which two are used, against a store that holds every set; the same bits."""
    rng = np.random.default_rng(8)
    B = full_rank(rng)
    n = B.shape[1]
    box = BoxLeastSquares(B, WEIGHTS, 1e-8, np.zeros(n), np.ones(n))
    small, fullest = BoxLeastSquares(B, WEIGHTS, 1e-8, np.zeros(n), np.ones(n)), 0
    small.box = box_lists(*pack_box(B, WEIGHTS, 1e-8, np.zeros(n), np.ones(n)), 5)
    for _ in range(50):
        wrench = 3.0 * rng.normal(size=6)
        assert box.solve(wrench)
        assert small.solve(wrench)
        assert_minimiser(small, wrench)
        np.testing.assert_array_equal(small.solution, box.solution)
        used = sum(slot.used for slot in small.box.slots)
        assert used == small.box.used[0]
        fullest = max(fullest, used)
    assert fullest == 2


def test_maps_in_the_store_are_told_apart_up_to_fifty_unknowns() -> None:
    """Sets that differ in one unknown, the last ones too, and each is found where it was put."""
    rng, n = np.random.default_rng(10), MOST_UNKNOWNS
    box = BoxLeastSquares(rng.normal(size=(6, n)), WEIGHTS, 1e-6, np.zeros(n), np.ones(n))
    home = {}
    for i in range(n):
        status = [FREE] * n
        for code, place in ((AT_LOWER, "lower"), (AT_UPPER, "upper")):
            status[i] = code
            held = Held(0.0, 0.0)._replace(**{place: 2.0**i})
            home[held] = map_of(box.box, status, held)
    assert len(set(home.values())) == 2 * n
    for held, slot in home.items():
        assert box.box.slots[slot].held == held
        assert map_of(box.box, None, held) == slot, "no map is computed again"
    for _ in range(20):
        wrench = 20.0 * rng.normal(size=6)
        assert box.solve(wrench)
        assert_minimiser(box, wrench)
    with pytest.raises(SettingsError, match="at most 50"):
        BoxLeastSquares(np.ones((6, 51)), WEIGHTS, 1e-6, np.zeros(51), np.ones(51))


@pytest.mark.parametrize("place", range(6))
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_search_for_what_is_not_finite_ends_and_nan_is_not_believed(
    place: int, bad: float
) -> None:
    rng = np.random.default_rng(11)
    B = full_rank(rng)
    n = B.shape[1]
    box = BoxLeastSquares(B, WEIGHTS, 1e-8, np.zeros(n), np.ones(n))
    for warm in (False, True):
        wrench = 3.0 * rng.normal(size=6)
        wrench[place] = bad
        solve_box(box.box, box.search, six(wrench))
        believed = kkt_residual(box.box, box.search.solution, six(wrench))[0] <= KKT_TOLERANCE
        # For infinity, full speed or none is the limit; NaN shows, and is not clipped to a bound.
        inside = (box.solution >= 0.0) & (box.solution <= 1.0)
        assert np.all(inside | (np.isnan(bad) & np.isnan(box.solution)))
        assert np.isinf(bad) or not believed
        if not warm:
            box.reset()
            box.solve(3.0 * rng.normal(size=6))
    box.reset()
    wrench = 3.0 * rng.normal(size=6)
    assert box.solve(wrench)
    assert_minimiser(box, wrench)


def test_pickle_carries_the_warm_start() -> None:
    rng = np.random.default_rng(9)
    B = full_rank(rng)
    n = B.shape[1]
    box = BoxLeastSquares(B, WEIGHTS, 1e-8, np.zeros(n), np.ones(n))
    wrench = 3.0 * rng.normal(size=6)
    box.solve(wrench)
    twin = pickle.loads(pickle.dumps(box))
    pivots = twin.pivots
    assert twin.solve(wrench)
    assert twin.pivots == pivots
    np.testing.assert_allclose(twin.solution, box.solution, atol=1e-12)
    assert twin.solve(-wrench)
    assert_minimiser(twin, -wrench)
