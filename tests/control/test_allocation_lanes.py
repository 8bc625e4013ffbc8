"""The ladder in flight: Python, machine code for one flight and lanes give the same bits."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from fullam.control.active_set_search import Held
from fullam.control.allocation import Allocator, allocation_memory
from fullam.control.box_qp import SMALL_STORE, STORE
from fullam.control.ladder import (
    AllocationMemory,
    AllocationProblem,
    Counts,
    allocate,
    opposite,
)
from fullam.dynamics.spatial import Spatial
from fullam.model.loading import load_vehicle
from fullam.model.rotors import Rotors
from fullam.numbers.kernel import kernel, select
from fullam.numbers.program import Stage, program
from fullam.numbers.records import Rows
from fullam.numbers.vectors import Vector

LANES = 8


class Delivered(NamedTuple):
    """What `allocate` returned."""

    achieved: Spatial
    missing: Spatial
    saturated: float


class FlightView(NamedTuple):
    """A sequence of wrenches and centres, and which are not allocated; what comes out."""

    problem: AllocationProblem
    memory: AllocationMemory
    wrenches: Any
    centers: Any
    landed: Any
    delivered: Any
    speeds: Any


@kernel
def flight_stage(view, k):
    """Allocate the k-th wrench."""
    flying = opposite(view.landed[k] > 0.0)
    achieved, missing, saturated = allocate(
        view.problem, view.memory, view.wrenches[k], view.centers[k], flying
    )
    view.delivered[k] = Delivered(achieved, missing, select(saturated, 1.0, 0.0))
    for i in range(len(view.memory.speeds)):
        view.speeds[k][i] = view.memory.speeds[i]


def flown(problem, wrenches, centers, landed, mode):
    """Views of the flights, shapes (N, 6, L), (N, 3, L), (N, 1, L): one with lanes, or L of one."""
    n, N, L = len(problem.rotors.array), *wrenches.shape[::2]
    lanes, flights = (L, [slice(None)]) if mode == "lanes" else (0, range(L))
    views = []
    for flight in flights:
        view = FlightView(
            problem,
            allocation_memory(n, lanes),
            Rows(Spatial, wrenches[..., flight], lanes),
            Rows(Vector, centers[..., flight], lanes),
            Rows(float, landed[..., flight], lanes),
            Rows.empty(Delivered, N, lanes=lanes),
            Rows.empty(float, N, n, lanes=lanes),
        )
        program([Stage(flight_stage, view)], mode != "python").run(0, N)
        views.append(view)
    return views


def results(views, mode):
    """Deliveries, speeds, last shares, answers and counts, the last axis by flight."""
    rows = [
        (v.delivered, v.speeds, v.memory.shares, v.memory.answer, v.memory.counts) for v in views
    ]
    if mode == "lanes":
        return [part.array for part in rows[0]]
    return [np.stack([part.array for part in parts], axis=-1) for parts in zip(*rows, strict=True)]


def counted(parts):
    """The counts among `results`, by name."""
    return dict(zip(Counts._fields, parts[-1][0], strict=True))


def ring(number):
    """A ring of tilted rotors."""
    angle = 2.0 * np.pi * np.arange(number) / number
    tilt = np.where(np.arange(number) % 2, 0.5, -0.5)
    around = np.stack([-np.sin(angle), np.cos(angle), np.zeros(number)], axis=1)
    return Rotors(
        names=tuple(f"rotor {i}" for i in range(number)),
        positions=0.3 * np.stack([np.cos(angle), np.sin(angle), np.zeros(number)], axis=1),
        axes=np.cos(tilt)[:, None] * [0.0, 0.0, 1.0] + np.sin(tilt)[:, None] * around,
        spins=np.where(np.arange(number) % 2, 1.0, -1.0),
        k_f=np.full(number, 1e-5),
        k_tau=np.full(number, 1e-7),
        max_speeds=np.full(number, 800.0),
        lags=np.full(number, 0.05),
    )


def octorotor():
    return load_vehicle("fullam").rotors


FLEET = {
    "octorotor": lambda: Allocator(octorotor()),
    "one failed": lambda: Allocator(octorotor().with_failed(3)),
    "preferred speeds": lambda: Allocator(
        octorotor(), preferred_speeds=octorotor().max_speeds * np.linspace(0.2, 0.9, 8)
    ),
    "quadrotor": lambda: Allocator(ring(4), axes=[False, False, True, True, True, True]),
    "other weights": lambda: Allocator(octorotor(), weights=[3.0, 1.0, 2.0, 1.0, 5.0, 1.0]),
    "hextilt": lambda: Allocator(load_vehicle("hextilt").rotors),
    "50 rotors": lambda: Allocator(ring(50)),
}


def demands(rotors, seed, number):
    """Smooth wrenches in reach and out of it, leaps among them; centres; who has landed when."""
    rng, B = np.random.default_rng(seed), rotors.normalized_coupling
    middle, reach = B.sum(axis=1)[:, None] / 2, np.abs(B).sum(axis=1)[:, None] / 2
    t = np.linspace(0.0, 6.0, number)[:, None, None]
    phase, rate = rng.uniform(0.0, 6.0, (6, LANES)), rng.uniform(0.5, 2.0, (6, LANES))
    swing = np.linspace(0.1, 0.9, LANES) * reach * np.sin(phase + rate * t)
    leap = 2.0 * reach * rng.normal(size=swing.shape) * (rng.random((number, 1, LANES)) < 0.1)
    centers = 0.04 * rng.normal(size=(3, LANES)) + 0.005 * np.sin(t)
    landed = np.zeros((number, 1, LANES))
    landed[number // 2 :, :, 3] = 1.0
    return middle + swing + leap, centers, landed


@pytest.mark.parametrize("name", FLEET)
def test_python_machine_code_and_lanes_give_the_same_bits(name):
    """Over sequences with warm starts, one of which ends early; the store of maps is shared."""
    allocator = FLEET[name]()
    number = 120 if allocator.rotors.count < 10 else 20
    inputs = demands(allocator.rotors, 1, number)
    expected = results(flown(allocator.problem(SMALL_STORE), *inputs, "python"), "python")
    for mode in ("scalar", "lanes"):
        got = results(flown(allocator.problem(), *inputs, mode), mode)
        for one, other in zip(got, expected, strict=True):
            assert np.array_equal(one, other)
    assert 0.1 < expected[0][:, -1].mean() < 0.95, "some saturated, some not"
    counts = counted(expected)
    assert counts["exact"].sum() > 20
    assert not counts["clip"].any()
    in_flight = np.where(np.arange(8) == 3, number // 2, number)
    np.testing.assert_array_equal(counts["exact"] + counts["active_set"], in_flight)


def test_a_small_store_changes_nothing():
    """Two sets at a time for eight flights: they take each other's maps away."""
    allocator = FLEET["octorotor"]()
    inputs = demands(allocator.rotors, 2, 400)
    large, small = allocator.problem(), allocator.problem(5)
    expected = results(flown(large, *inputs, "lanes"), "lanes")
    for one, other in zip(results(flown(small, *inputs, "lanes"), "lanes"), expected, strict=True):
        assert np.array_equal(one, other)
    assert small.box.used.array[0, 0] <= 2 < large.box.used.array[0, 0]


def test_it_is_what_the_allocator_answers():
    """Speeds, wrench, what is missing about the centre, and the flag."""
    allocator = FLEET["hextilt"]()
    wrenches, centers, landed = (part[..., 2:3] for part in demands(allocator.rotors, 3, 300))
    (view,) = flown(allocator.problem(), wrenches, centers, landed, "scalar")
    B, saturated = allocator.rotors.normalized_coupling, 0
    for k, (wrench, center) in enumerate(zip(wrenches[..., 0], centers[..., 0], strict=True)):
        u = allocator.exact(wrench)
        missing = np.zeros(6)
        if u is None:
            u = allocator.allocate_about(wrench, center)
            missing = allocator.saturated * (B @ u - allocator.asked)
        np.testing.assert_array_equal(
            view.speeds.array[k, :, 0], np.sqrt(u) * allocator.rotors.max_speeds
        )
        # Sums in another order, of a hundred newtons.
        np.testing.assert_allclose(view.delivered["achieved"][k], B @ u, rtol=0, atol=1e-12)
        np.testing.assert_allclose(view.delivered["missing"][k], missing, rtol=0, atol=1e-12)
        assert view.delivered["saturated"][k] == allocator.saturated
        saturated += allocator.saturated
    assert 50 < saturated < 250
    counts = view.memory.counts
    for name in ("exact", "active_set", "rounds", "pivots", "returns", "unsettled"):
        assert counts[name][0, 0] == getattr(allocator.counters, name)


@pytest.mark.parametrize("mode", ["python", "lanes"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused_and_leaves_nothing_behind(mode, bad):
    """Wrench or centre: flagged, counted, rotors at their preferred speeds; the others fly on."""
    allocator = FLEET["preferred speeds"]()
    wrenches, centers, landed = demands(allocator.rotors, 4, 60)
    wrenches[:, 2] += 100.0  # out of reach, all of them
    hit = np.zeros((60, 8), dtype=bool)
    hit[30, :7] = True
    skipped = np.where(hit[:, None], 1.0, landed)
    slots = SMALL_STORE if mode == "python" else STORE
    expected = results(flown(allocator.problem(slots), wrenches, centers, skipped, mode), mode)
    for lane in range(6):
        wrenches[30, lane, lane] = bad
    centers[30, 1, 6] = bad
    got = results(flown(allocator.problem(slots), wrenches, centers, landed, mode), mode)
    speeds, others = (part[1][:, :, 0].transpose(0, 2, 1) for part in (got, expected))
    assert np.array_equal(speeds[~hit], others[~hit])
    preferred = allocator.rotors.max_speeds * np.linspace(0.2, 0.9, 8)
    hit[30, 3] = False  # it has landed
    np.testing.assert_allclose(speeds[hit], np.tile(preferred, (6, 1)), rtol=1e-15)  # a rounding
    assert got[0][:, -1][hit].all(), "flagged"
    np.testing.assert_array_equal(counted(got)["refused"], [1, 1, 1, 0, 1, 1, 1, 0])


@pytest.mark.parametrize("mode", ["python", "lanes"])
def test_the_clip_answers_when_the_search_does_not(mode):
    """A search that may not change its set even once: clipped, flagged and counted."""
    allocator = FLEET["octorotor"]()
    wrenches, centers, landed = demands(allocator.rotors, 5, 20)
    wrenches[:, 2] += 100.0
    problem = allocator.problem(SMALL_STORE)
    problem = problem._replace(box=problem.box._replace(reached=Rows.empty(Held, 0)))
    views = flown(problem, wrenches, centers, 0.0 * landed, mode)
    delivered, speeds, *_ = results(views, mode)
    assert delivered[:, -1].all(), "flagged"
    largest = allocator.rotors.max_speeds[:, None]
    assert np.all((speeds[:, :, 0] >= 0.0) & (speeds[:, :, 0] <= largest))
    counts = counted(results(views, mode))
    for name in ("clip", "unconfirmed", "unsettled"):
        np.testing.assert_array_equal(counts[name], 20)
    assert not any(view.memory.search.last["is_warm"].any() for view in views)
    K, B = (
        np.linalg.pinv(allocator.rotors.normalized_coupling),
        allocator.rotors.normalized_coupling,
    )
    u = np.clip(K @ wrenches[7, :, 2], 0.0, 1.0)
    np.testing.assert_allclose(np.square(speeds[7, :, 0, 2] / largest[:, 0]), u, atol=1e-4)  # eps
    lack = (B @ np.square(speeds[7, :, 0, 2] / largest[:, 0]) - wrenches[7, :, 2])[:3]
    moment = np.cross(centers[7, :, 2], lack)
    np.testing.assert_allclose(  # of newton-metres, rounding
        delivered[7, 9:12, 2], delivered[7, 3:6, 2] - wrenches[7, 3:, 2] - moment, atol=1e-9
    )
