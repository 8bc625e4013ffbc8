"""The box solver against scipy's bounded-variable least squares, which shares no code with it."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from fullam.control import box_qp
from fullam.control.box_qp import AT_LOWER, AT_UPPER, FREE, BoxLeastSquares, active_set_map

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
    """`solution` is in the box, optimal, and no worse than scipy's, with the same wrench."""
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
        assert box.cycles == 0


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


def test_every_stale_start_leads_to_the_same_minimiser() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        B = full_rank(rng)
        n = B.shape[1]
        box = BoxLeastSquares(B, WEIGHTS, 1e-8, np.zeros(n), np.ones(n))
        status = rng.integers(0, 3, n).astype(np.uint8)
        box.active = box._set(status.tobytes())
        box.solution[:] = np.clip(rng.uniform(-0.5, 1.5, n), box.active.least, box.active.most)
        np.testing.assert_array_equal(box.status, status)
        assert np.all(box.solution[status == AT_UPPER] == 1.0)
        assert np.all(box.solution[status == AT_LOWER] == 0.0)
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


@pytest.mark.parametrize("matrix", [full_rank, few_rotors, duplicates])
def test_active_set_map_is_the_dense_solution(matrix: Callable[[Generator], np.ndarray]) -> None:
    """Against the normal equations, at an eps for which they are well conditioned."""
    rng = np.random.default_rng(5)
    for _ in range(50):
        A = matrix(rng)
        n, eps = A.shape[1], 1e-2
        prior, upper, d = rng.uniform(size=n), np.ones(n), rng.normal(size=6)
        status = rng.integers(0, 3, n).astype(np.uint8)
        gain, offset = active_set_map(status, A, eps, prior, upper)
        z = gain @ d + offset
        H, g = A.T @ A + eps * np.eye(n), -A.T @ d - eps * prior
        free = status == FREE
        u = (status == AT_UPPER).astype(float)
        if free.any():
            u[free] = np.linalg.solve(H[np.ix_(free, free)], -(g + H @ u)[free])
        slope = (H @ u + g) / np.diag(H)
        expected = np.where(free, u, np.where(status == AT_UPPER, -slope, slope))
        np.testing.assert_allclose(z, expected, atol=1e-10)  # condition 1e4 times rounding


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
        clipped = np.clip(box.gain @ wrench + box.offset, 0.0, 1.0)
        clips.append(box.kkt_residual(clipped, wrench))
    assert np.median(clips) > 0.05, "clipping a pseudo-inverse is badly wrong"


def test_cycling_is_noticed_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a planted tolerance that frees bounds which must hold, a set comes back."""
    monkeypatch.setattr(box_qp, "MULTIPLIER_TOLERANCE", -1e3)
    rng = np.random.default_rng(7)
    B = full_rank(rng)
    n = B.shape[1]
    box = BoxLeastSquares(B, WEIGHTS, 1e-8, np.zeros(n), np.ones(n))
    assert not box.solve(5.0 * rng.normal(size=6))
    assert box.cycles == 1
    assert np.all((box.solution >= 0.0) & (box.solution <= 1.0)), "feasible all the same"


def test_store_of_sets_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(box_qp, "LARGEST_STORE", 5)
    rng = np.random.default_rng(8)
    B = full_rank(rng)
    n = B.shape[1]
    box = BoxLeastSquares(B, WEIGHTS, 1e-8, np.zeros(n), np.ones(n))
    for _ in range(50):
        wrench = 3.0 * rng.normal(size=6)
        assert box.solve(wrench)
        assert_minimiser(box, wrench)
    assert len(box._sets) <= 5


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
