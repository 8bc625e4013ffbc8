"""Facets against linear programs (HiGHS): a thousand random vehicles, the degenerate ones included.

A wrong or superfluous normal can only let too much through, so every answer is tried from both
sides: what the facets allow must be feasible, and a hair more must not be.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import linprog

from fullam.analysis.atlas.loads import Load, load_of
from fullam.analysis.atlas.rays import margin, multiples, reach
from fullam.analysis.atlas.tilt import attitude_bounds, tilt_intervals, tilt_rose, worst_tilt
from fullam.model.attainable.facets import facets_of
from fullam.model.loading import load_vehicle
from fullam.model.rotors import Rotors
from fullam.model.wrench_axes import full_scale

VEHICLES = 1000
KINDS = (
    "generic", "ring", "least speeds", "parallel", "coincident", "duplicated", "reversed",
    "failed", "coplanar axes", "few",
)  # fmt: skip

EXACT = 1e-9
"""A rank tolerance far below what a linear program resolves: weak axes count as axes here."""

FORCE_TOLERANCE = 1e-7
"""Of the weight; HiGHS is asked for 1e-10 of the full scale."""

TILT_TOLERANCE = 1e-6
"""Between the facets' exit and the linear program's [rad]."""


def unit(rows: np.ndarray) -> np.ndarray:
    return rows / np.linalg.norm(rows, axis=-1, keepdims=True)


def random_rotors(kind: str, rng: np.random.Generator) -> Rotors:
    n = int(rng.integers(4, 17 if kind in ("generic", "least speeds") else 11))
    positions = rng.uniform(-0.5, 0.5, (n, 3)) * [1.0, 1.0, 0.3]
    axes = unit(np.array([0.0, 0.0, 1.0]) + rng.normal(0.0, 0.6, (n, 3)))
    spins = rng.choice([-1.0, 1.0], n)
    top, low = rng.uniform(300.0, 900.0, n), np.zeros(n)
    k_f, k_tau = rng.uniform(0.5, 2.0, n) * 1e-5, rng.uniform(0.0, 3.0, n) * 1e-7
    if kind in ("ring", "parallel"):
        n -= n % 2
        angle = (np.arange(n) + 0.5) * 2.0 * np.pi / n
        spins = np.where(np.arange(n) % 2 == 0, 1.0, -1.0)
        cant = rng.uniform(0.2, 1.0) * spins if kind == "ring" else np.zeros(n)
        positions = 0.35 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
        tangent = np.column_stack([-np.sin(angle), np.cos(angle), 0.0 * angle])
        axes = np.cos(cant)[:, None] * [0.0, 0.0, 1.0] + np.sin(cant)[:, None] * tangent
        top, k_f, k_tau = np.full(n, 600.0), np.full(n, 2e-5), np.full(n, 2e-7)
        low = np.zeros(n)
    if kind == "least speeds":
        low = top * rng.uniform(0.05, 0.5, n)
    if kind == "coincident":
        positions[: n // 2] = positions[0]
    if kind == "duplicated":
        twins = rng.integers(0, n, n // 2)
        for column in (positions, axes, spins, k_f, k_tau, top):
            column[: n // 2] = column[twins]
    if kind == "reversed":
        half = n // 2
        axes[half : 2 * half], positions[half : 2 * half] = -axes[:half], positions[:half]
    if kind == "failed":
        gone = int(rng.integers(n))
        low = top * rng.uniform(0.0, 0.3, n)
        top[gone] = 0.0
    if kind == "coplanar axes":
        axes = unit(axes * [1.0, 0.0, 1.0])
        positions[:, 1] *= float(rng.integers(2))
    if kind == "few":
        n = int(rng.integers(1, min(6, n + 1)))
    columns = (positions, axes, spins, k_f, k_tau, top, np.full(len(top), 0.03), low)
    names = tuple(f"r{i}" for i in range(n))
    return Rotors(names, *(column[:n] for column in columns))


def random_load(rotors: Rotors, rng: np.random.Generator) -> Load:
    thrusts = rng.uniform(0.3, 0.7) * rotors.max_thrusts
    lift = float(thrusts @ rotors.axes[:, 2])
    center = (thrusts * rotors.axes[:, 2]) @ rotors.positions / lift if lift > 0.0 else np.zeros(3)
    if rng.uniform() < 0.5:
        center = center + rng.normal(0.0, 0.02, 3)
    mass = max(lift, 0.1 * float(rotors.max_thrusts.sum())) / 9.81
    load = Load(mass, 9.81, center, 0.02 * np.eye(3), center, np.zeros(6))
    if rng.uniform() < 0.6:  # something at the tool makes up what random rotors lack to hover
        shares = rng.uniform(rotors.least_shares, 1.0)
        load = replace(load, extra=rotors.normalized_coupling @ shares - load.wrench())
    return load


def program(
    rotors: Rotors, start: np.ndarray, direction: np.ndarray, scale: np.ndarray
) -> float | None:
    """Largest t >= 0 with start + t direction = B u, least <= u <= top; None if there is none."""
    system = np.column_stack([rotors.normalized_coupling, -direction]) / scale[:, None]
    bounds = [
        (low, float(top > 0.0))
        for low, top in zip(rotors.least_shares, rotors.max_speeds, strict=True)
    ]
    cost = np.zeros(rotors.count + 1)
    cost[-1] = -float(direction.any())
    options = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    found = linprog(
        cost, A_eq=system, b_eq=start / scale, bounds=[*bounds, (0.0, None)], options=options
    )
    return float(found.x[-1]) if found.status == 0 else None


@pytest.mark.parametrize("kind", KINDS)
def test_exits_forces_and_lift(kind: str) -> None:
    rng = np.random.default_rng(KINDS.index(kind))
    hovering = 0
    for _ in range(VEHICLES // len(KINDS)):
        rotors = random_rotors(kind, rng)
        load, facets, scale = random_load(rotors, rng), facets_of(rotors, EXACT), full_scale(rotors)
        weight, level = load.weight, load.wrench()
        bounds = attitude_bounds(facets, load)
        toward = np.zeros(6)
        azimuth = float(rng.uniform(0.0, 2.0 * np.pi))
        heading = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        toward[:3], toward[3:] = heading, np.cross(load.center, heading)
        found = reach(facets, level, weight * toward)[0]
        expected = program(rotors, level, weight * toward, scale)
        if program(rotors, level, np.zeros(6), scale) is None:
            assert np.isnan(found)
            assert worst_tilt(bounds) is None
            assert np.isnan(tilt_rose(bounds, [azimuth])[0]).all()
        else:
            hovering += 1
            assert found == pytest.approx(expected, abs=FORCE_TOLERANCE)
            check_exit(rotors, load, azimuth, scale)
            worst = worst_tilt(bounds)
            assert worst is not None
            check_exit(rotors, load, worst[1], scale)
            assert tilt_rose(bounds, [worst[1]])[0] == pytest.approx(worst[0], abs=1e-7)
        lift = program(rotors, np.zeros(6), level, scale)
        answer = multiples(facets, level)
        assert (answer is None) == (lift is None)
        if answer is not None:
            assert answer[1] == pytest.approx(lift, abs=FORCE_TOLERANCE)
    assert hovering > 0.4 * VEHICLES / len(KINDS)


def check_exit(rotors: Rotors, load: Load, azimuth: float, scale: np.ndarray) -> None:
    """Just inside, the attitude can be held; just outside, it cannot."""
    facets = facets_of(rotors, EXACT)
    bounds = attitude_bounds(facets, load)
    tilt = float(tilt_rose(bounds, [azimuth])[0][0])
    intervals = tilt_intervals(bounds, azimuth)
    assert intervals[0] == pytest.approx((0.0, tilt), abs=1e-7)

    def holds(t: float) -> bool:
        up = np.array([np.sin(t) * np.cos(azimuth), np.sin(t) * np.sin(azimuth), np.cos(t)])
        return program(rotors, load.wrench(up), np.zeros(6), scale) is not None

    for share in (0.25, 0.75, 1.0):
        assert holds(share * max(tilt - TILT_TOLERANCE, 0.0))
    if tilt < np.pi - TILT_TOLERANCE:
        after = [low for low, _ in intervals[1:]]
        if not after or min(after) > tilt + TILT_TOLERANCE:
            assert not holds(tilt + TILT_TOLERANCE)
    for low, high in intervals[1:]:
        assert holds(0.5 * (low + high))


@pytest.mark.parametrize("kind", KINDS)
def test_margins(kind: str) -> None:
    """The ball ends where the program says, and no other direction ends before."""
    rng = np.random.default_rng(100 + KINDS.index(kind))
    for _ in range(VEHICLES // len(KINDS)):
        rotors = random_rotors(kind, rng)
        load, facets, scale = random_load(rotors, rng), facets_of(rotors, EXACT), full_scale(rotors)
        level, length = load.wrench(), 0.2
        found = margin(facets, level, length)
        weights = np.array([1.0, 1.0, 1.0, length, length, length])
        expected = brute_margin(rotors, level, weights)
        if facets.rank < 6:
            assert found.value <= 0.0
            assert expected <= FORCE_TOLERANCE * load.weight
            continue
        assert found.value == pytest.approx(expected, abs=FORCE_TOLERANCE * load.weight)
        if found.value > 0.0:
            ray = found.side * facets.normals[found.facet] * weights**2
            ray *= load.weight / np.linalg.norm(ray / weights)
            reached = program(rotors, level, ray, scale)
            assert reached == pytest.approx(found.value / load.weight, abs=FORCE_TOLERANCE)


def brute_margin(rotors: Rotors, wrench: np.ndarray, weights: np.ndarray) -> float:
    """Least distance to a bound over the normals of ALL choices of five columns, by SVD."""
    least = rotors.least_shares
    matrix = rotors.normalized_coupling / weights[:, None]
    generators = matrix * (1.0 - least)
    offset = wrench / weights - matrix @ (0.5 * (least + (rotors.max_speeds > 0.0)))
    chosen = np.array(list(combinations(range(max(rotors.count, 5)), 5)))
    padded = np.zeros((6, max(rotors.count, 5)))
    padded[:, : rotors.count] = generators
    stacks = np.moveaxis(padded[:, chosen], 1, 0)
    turns, sizes, _ = np.linalg.svd(stacks)
    solid = sizes[:, 4] > 1e-9 * sizes[:, 0]
    if rotors.count < 6 or not solid.any():
        return 0.0
    normals = turns[solid, :, 5]
    return float((0.5 * np.abs(normals @ generators).sum(axis=1) - np.abs(normals @ offset)).min())


def test_a_lost_facet_is_noticed() -> None:
    """The tests above can fail: without one of its facets, a vehicle leans where it cannot."""
    vehicle = load_vehicle("hextilt")
    load, facets, scale = load_of(vehicle), facets_of(vehicle.rotors), full_scale(vehicle.rotors)
    worst = worst_tilt(attitude_bounds(facets, load))
    assert worst is not None
    lost = worst[2] % len(facets.normals)
    fewer = replace(
        facets,
        normals=np.delete(facets.normals, lost, axis=0),
        half_widths=np.delete(facets.half_widths, lost),
    )
    azimuth = worst[1]
    tilt = float(tilt_rose(attitude_bounds(fewer, load), [azimuth])[0][0])
    assert tilt > worst[0] + 0.01
    up = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    assert program(vehicle.rotors, 0.999 * load.wrench(up), np.zeros(6), scale) is None
