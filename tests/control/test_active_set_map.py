"""Active-set maps by Jacobi against numpy's singular value decomposition and dense algebra."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np
import pytest

from fullam.control.active_set_map import (
    AT_LOWER,
    AT_UPPER,
    FREE,
    NULL_CUTOFF,
    ROOM,
    SWEEPS,
    Affine,
    active_set_map,
)
from fullam.control.allocation import Allocator
from fullam.control.box_qp import box_rows, pack_box
from fullam.model.loading import load_vehicle
from fullam.numbers.kernel import kernel
from fullam.numbers.program import Stage, program
from fullam.numbers.records import Rows

MAP_TOLERANCE = 1e-11
"""Relative to the largest entry: two ways to a singular value decomposition, 1e-13 apart, with
multipliers that are differences."""

DEGENERATE_TOLERANCE = 1e-10
"""As above, for matrices of norm 100 and eps of 1e-8."""

NULL_TOLERANCE = 1e-8
"""As above, with singular values near sqrt(eps) = 1e-4. Both ways know them to 1e-14, rounding in
a matrix of norm 100; eps / (s^2 + eps) there has a slope of 1e4, and weights of 30 come on top.
Exact fractions tell that neither way is the better one."""

DENSE_TOLERANCE = 1e-10
"""Condition number 1e4 of the normal equations times rounding."""

STATUSES = (FREE, AT_LOWER, AT_UPPER)


class MapView(NamedTuple):
    """Active sets, and their maps."""

    unknowns: Any
    scales: Any
    columns: Any
    statuses: Any
    maps: Any
    sweeps: Any


@kernel
def map_stage(view, k):
    """Map of the k-th set."""
    view.sweeps[k] = 1.0 * active_set_map(
        view.unknowns, view.scales[0], view.statuses[k], view.columns, view.maps[k]
    )


def maps_of(box, statuses, compiled):
    """Gains (N, n, 6), offsets (N, n) and sweeps (N,) of active sets, shape (N, n)."""
    N, n = statuses.shape
    view = MapView(
        box.unknowns,
        box.scales,
        Rows.empty(float, 6, n + ROOM),
        Rows(float, statuses[..., None]),
        Rows.empty(Affine, N, n),
        Rows.empty(float, N),
    )
    program([Stage(map_stage, view)], compiled).run(0, N)
    return view.maps["gain"], view.maps["offset"][..., 0], view.sweeps.array[:, 0]


def by_svd(status, A, weights, eps, prior, upper):
    """The formula of the module, with numpy's decomposition."""
    held = status != FREE
    u_held = np.where(status == AT_UPPER, upper, 0.0)
    c = A @ np.where(held, u_held, prior)
    V, s, Ut = np.linalg.svd(np.where(held, 0.0, A))
    s[s < NULL_CUTOFF * np.linalg.norm(A)] = 0.0
    left = np.ones(6)
    left[: s.size] = eps / (s * s + eps)
    residual = -(V * left) @ V.T
    solution = (Ut[: s.size].T * (s / (s * s + eps))) @ V[:, : s.size].T
    slope = np.where(status == AT_UPPER, -1.0, 1.0) / (np.einsum("ij,ij->j", A, A) + eps)
    gain = np.where(held[:, None], slope[:, None] * (A.T @ residual), solution)
    offset = np.where(held, slope * eps * (u_held - prior), prior) - gain @ c
    return gain * weights, offset


def assert_maps(box, statuses, gains, offsets, tolerance):
    """They are those of the singular value decomposition."""
    A, prior, upper = (box.unknowns[name] for name in ("column", "prior", "upper"))
    weights, eps = box.scales["weights"][0], float(box.scales["eps"][0, 0])
    for status, gain, offset in zip(statuses, gains, offsets, strict=True):
        expected = by_svd(status, A.T, weights, eps, prior[:, 0], upper[:, 0])
        for got, wanted in zip((gain, offset), expected, strict=True):
            assert np.abs(got - wanted).max() <= tolerance * max(1.0, np.abs(wanted).max())


def octorotor():
    return load_vehicle("fullam").rotors


FLEET = {
    "octorotor": lambda: Allocator(octorotor()),
    "one failed": lambda: Allocator(octorotor().with_failed(3)),
    "preferred speeds": lambda: Allocator(
        octorotor(), preferred_speeds=octorotor().max_speeds * np.linspace(0.2, 0.9, 8)
    ),
    "masked axes": lambda: Allocator(octorotor(), axes=[False, False, True, True, True, True]),
    "hextilt": lambda: Allocator(load_vehicle("hextilt").rotors),
}


@pytest.mark.parametrize("name", FLEET)
def test_every_active_set_of_a_vehicle(name):
    """Those of deficient rank among them, whose null columns are rounding and never orthogonal.

    Python and machine code give the same bits.
    """
    box = FLEET[name]().problem(1).box
    statuses = np.array(list(itertools.product(STATUSES, repeat=len(box.unknowns.array))))
    gains, offsets, sweeps = maps_of(box, statuses, compiled=True)
    assert 1 < sweeps.max() <= 10 < SWEEPS
    chosen = np.random.default_rng(0).choice(len(statuses), 500, replace=False)
    assert_maps(box, statuses[chosen], gains[chosen], offsets[chosen], MAP_TOLERANCE)
    some = chosen[:60]
    for got, wanted in zip(
        maps_of(box, statuses[some], compiled=False), (gains, offsets, sweeps), strict=True
    ):
        assert np.array_equal(got, wanted[some])


def generic(rng):
    return rng.normal(size=(6, rng.integers(1, 13)))


def duplicates(rng):
    B = rng.normal(size=(6, 4))
    return np.hstack([B, B, B[:, :1]])


def rank_four(rng):
    return rng.normal(size=(6, 4)) @ rng.normal(size=(4, 8))


def nearly_parallel(rng):
    return rng.normal(size=(6, 1)) + 1e-5 * rng.normal(size=(6, 8))


def dead_rows(rng):
    B = rng.normal(size=(6, 6))
    B[:2] = 0.0
    return B


@pytest.mark.parametrize(
    ("matrix", "tolerance"),
    [
        (generic, DEGENERATE_TOLERANCE),
        (duplicates, DEGENERATE_TOLERANCE),
        (rank_four, DEGENERATE_TOLERANCE),
        (dead_rows, DEGENERATE_TOLERANCE),
        (nearly_parallel, NULL_TOLERANCE),
    ],
)
@pytest.mark.parametrize("eps", [1e-8, 1e-3])
def test_degenerate_matrices(matrix, tolerance, eps):
    """Weights of 30 and of 0 among the rows; all free, all held and anything between."""
    rng = np.random.default_rng(1)
    for _ in range(8):
        B = matrix(rng)
        n = B.shape[1]
        weights = np.array([1.0, 1.0, 1.0, 30.0, 30.0, 30.0]) * (rng.random(6) < 0.8)
        weights[0] = 1.0
        upper = np.ones(n) if rng.random() < 0.5 else rng.integers(0, 2, n).astype(float)
        box = box_rows(*pack_box(B, weights, eps, rng.uniform(size=n), upper))
        statuses = rng.choice(STATUSES, size=(6, n))
        statuses[0], statuses[1], statuses[2] = STATUSES
        assert_maps(box, statuses, *maps_of(box, statuses, False)[:2], tolerance)


@pytest.mark.parametrize("matrix", [generic, duplicates])
def test_the_map_is_the_dense_solution(matrix):
    """Against the normal equations, at an eps for which they are well conditioned."""
    rng, eps = np.random.default_rng(5), 1e-2
    for _ in range(50):
        A = matrix(rng)
        n = A.shape[1]
        prior, d = rng.uniform(size=n), rng.normal(size=6)
        box = box_rows(*pack_box(A, np.ones(6), eps, prior, np.ones(n)))
        status = rng.choice(STATUSES, size=n)
        gain, offset, _ = maps_of(box, status[None], compiled=False)
        H, g = A.T @ A + eps * np.eye(n), -A.T @ d - eps * prior
        free, u = status == FREE, (status == AT_UPPER).astype(float)
        if free.any():
            u[free] = np.linalg.solve(H[np.ix_(free, free)], -(g + H @ u)[free])
        slope = (H @ u + g) / np.diag(H)
        expected = np.where(free, u, np.where(status == AT_UPPER, -slope, slope))
        np.testing.assert_allclose(gain[0] @ d + offset[0], expected, atol=DENSE_TOLERANCE)
