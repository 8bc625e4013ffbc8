"""The compiled allocation is the reference allocator over again, ProxQP apart."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from fullam.control import box_qp as reference_box
from fullam.control.allocation import Allocator
from fullam.control.moment_about import MomentAbout
from fullam.control.pid import Pid
from fullam.exceptions import NonFiniteWrench
from fullam.model.loading import load_vehicle
from fullam.model.rotors import Rotors

pytest.importorskip("numba", reason="the compiled engine needs the extra 'fast'")

from fullam.simulation.compiled import arrays, entries
from fullam.simulation.compiled.box_qp import (
    CLIP,
    CYCLES,
    FORCE_ROWS,
    PRIOR,
    ROUNDS,
    SOLUTION,
    STATUS,
    UNCONFIRMED,
    UNSETTLED,
    WANTED,
    U,
    active_set_map,
)
from fullam.simulation.compiled.integrate import ASKED
from fullam.simulation.compiled.moment_about import allocate_about
from fullam.simulation.compiled.tick import CompiledTick

U_TOLERANCE = 1e-9
"""Rounding 1e-16 over eps = 1e-8: what the null space of the coupling may turn it into."""

MAP_TOLERANCE = 1e-11
"""Relative to the largest entry: two ways to a singular value decomposition, 1e-13 apart, with
multipliers that are differences."""

FAR = np.array([30.0, 1.0, 200.0, 3.0, -0.1, 0.05])
"""Out of reach [N, N m]."""


def ring(number):
    """A ring of tilted rotors."""
    angle = 2.0 * np.pi * np.arange(number) / number
    tilt = np.where(np.arange(number) % 2, 0.5, -0.5)
    around = np.stack([-np.sin(angle), np.cos(angle), np.zeros(number)], axis=1)
    axes = np.cos(tilt)[:, None] * [0.0, 0.0, 1.0] + np.sin(tilt)[:, None] * around
    return Rotors(
        names=tuple(f"rotor {i}" for i in range(number)),
        positions=0.3 * np.stack([np.cos(angle), np.sin(angle), np.zeros(number)], axis=1),
        axes=axes,
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
    "other weights": lambda: Allocator(octorotor(), weights=[3.0, 1.0, 2.0, 1.0, 5.0, 1.0]),
    "regularised": lambda: Allocator(octorotor(), regularization=1e-4),
    "hextilt": lambda: Allocator(load_vehicle("hextilt").rotors),
    "31 rotors": lambda: Allocator(ring(31)),
}


def ticks_of(allocator):
    """A compiled tick that allocates as `allocator` does; its law is not used."""
    vehicle = load_vehicle("fullam")
    return CompiledTick(Pid(vehicle), allocator)


def demands(rotors, seed, number):
    """Wrenches, most of them out of reach."""
    rng, B = np.random.default_rng(seed), rotors.normalized_coupling
    scale, largest = B.sum(axis=1), np.abs(B).sum(axis=1)
    for _ in range(number):
        yield 0.3 * scale + 0.4 * largest * rng.normal(size=6)


def check_allocations(tick, allocator, wrenches):
    """Squared speeds and flags are the reference allocator's; most are saturated."""
    saturated = number = 0
    for wrench in wrenches:
        u, out_of_reach = tick.allocate(wrench)
        expected = allocator.solve(wrench)
        assert expected.method in ("exact", "active-set")
        assert out_of_reach == expected.saturated
        assert np.abs(u - expected.squared).max() < U_TOLERANCE
        saturated += expected.saturated
        number += 1
    assert saturated > number / 2


@pytest.mark.parametrize("name", FLEET)
def test_saturated_allocations_are_the_reference_allocators(name):
    allocator = FLEET[name]()
    tick = ticks_of(allocator)
    check_allocations(tick, allocator, demands(allocator.rotors, 2, 2000))
    assert not tick.allotment.counters[[CLIP, CYCLES, UNCONFIRMED]].any()


def test_a_table_that_is_emptied_now_and_then_changes_nothing(monkeypatch):
    """Nor do counters that somebody sets to zero: a full table would be searched for ever."""
    monkeypatch.setattr(arrays, "SLOTS", 8)
    allocator = FLEET["octorotor"]()
    tick, fullest = ticks_of(allocator), 0
    for wrench in demands(allocator.rotors, 3, 500):
        check_allocations(tick, allocator, [FAR, wrench, -FAR])
        tick.allotment.counters[:] = 0
        *keys, stored = tick.allotment.keys
        assert stored == np.count_nonzero(np.array(keys) >= 0)
        fullest = max(fullest, stored)
    assert fullest == 4


@pytest.mark.parametrize("name", ["octorotor", "one failed", "preferred speeds", "hextilt"])
def test_every_active_set_has_the_references_map_after_few_sweeps(name):
    """Those of deficient rank among them, whose null columns are rounding and never orthogonal."""
    allocator = FLEET[name]()
    box, allotment, n = allocator._box, arrays.allotment_of(allocator), allocator.rotors.count
    maps, sets, most = np.zeros((n + FORCE_ROWS, 7)), np.zeros((2, n), dtype=np.int64), 0
    for status in itertools.product(range(3), repeat=n):
        sets[STATUS] = status
        most = max(most, active_set_map(allotment.box, allotment.scales, sets, STATUS, maps, 0))
        gain, offset = reference_box.active_set_map(
            np.array(status, dtype=np.uint8), box.A, box.eps, box.prior, box.upper
        )
        gain = gain * box.weights
        assert np.abs(maps[:n, :6] - gain).max() <= MAP_TOLERANCE * max(1.0, np.abs(gain).max())
        assert np.abs(maps[:n, 6] - offset).max() <= MAP_TOLERANCE * max(1.0, np.abs(offset).max())
    assert 1 < most <= 10


def heavy_loads(vehicle, number):
    """Wrenches out of reach, and centres of mass far from any that the arm alone can make."""
    rng, B = np.random.default_rng(7), vehicle.rotors.normalized_coupling
    data, middle, reach = vehicle.create_data(), B.sum(axis=1) / 2, np.abs(B).sum(axis=1) / 2
    for _ in range(number):
        q = vehicle.neutral(rng.uniform(-2.0, 2.0, vehicle.n_arm))
        center = pin.centerOfMass(vehicle.model, data, q) + 0.06 * rng.normal(size=3)
        yield middle + rng.choice([0.3, 1.0, 3.0]) * reach * rng.normal(size=6), center


@pytest.mark.parametrize("name", ["fullam", "hextilt"])
def test_about_the_centre_of_mass_round_by_round(name, monkeypatch):
    """Plain steps and answers that do not settle included: answer, moment and number of rounds."""
    vehicle = load_vehicle(name)
    allocator, plain = Allocator(vehicle.rotors), []
    allotment, state = arrays.allotment_of(allocator), np.zeros((8, 7))
    corrected = MomentAbout.corrected
    monkeypatch.setattr(MomentAbout, "corrected", lambda *all: plain.append(1) or corrected(*all))
    for wrench, center in heavy_loads(vehicle, 3000):
        if allocator.exact(wrench) is not None:
            continue
        u = allocator.allocate_about(wrench, center)
        state[ASKED, :6] = allotment.sixes[WANTED] = wrench
        before = allotment.counters[ROUNDS]
        short = allocate_about(*allotment, state, tuple(center.tolist()))
        assert short == allocator.saturated
        assert allotment.counters[ROUNDS] - before == allocator.moment.rounds
        assert np.abs(allotment.unknowns[U] - u).max() < U_TOLERANCE
        assert np.abs(allotment.sixes[WANTED] - allocator.asked).max() < U_TOLERANCE
    unsettled = allocator.counters.unsettled
    assert allotment.counters[UNSETTLED] == unsettled
    assert len(plain) > unsettled, "some rounds should be plain steps"
    if name == "hextilt":
        assert unsettled > 0
    assert not allotment.counters[[CLIP, CYCLES, UNCONFIRMED]].any()


def test_the_clip_answers_when_nothing_else_does():
    """And where the search that failed ended is no start for the next."""
    allocator = FLEET["preferred speeds"]()
    tick = ticks_of(allocator)
    tick.allocate(FAR)
    # A search that may not change its active set once cannot settle.
    whole = tick.allotment
    tick.allotment = whole._replace(minimisers=np.zeros(0, dtype=np.int64))
    u, out_of_reach = tick.allocate(-FAR)
    assert out_of_reach
    assert u.min() >= 0.0
    assert u.max() <= 1.0
    assert tick.allotment.counters[CLIP] == 1
    assert not whole.sets[STATUS].any()
    np.testing.assert_array_equal(whole.unknowns[SOLUTION], whole.box[:, PRIOR])


@pytest.mark.parametrize("place", [0, 2, 5])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_wrench_that_is_not_finite_is_refused(place, value):
    allocator = FLEET["octorotor"]()
    tick, wrench = ticks_of(allocator), FAR.copy()
    wrench[place] = value
    with pytest.raises(NonFiniteWrench):
        tick.allocate(wrench)
    check_allocations(tick, allocator, [FAR])


@pytest.mark.parametrize("place", [0, 2, 5])
def test_nan_behind_that_guard_is_not_believed_and_leaves_nothing_behind(place):
    """Its KKT residual is NaN, which is not within the tolerance; then a wrench out of reach."""
    allocator = FLEET["octorotor"]()
    tick, wrench = ticks_of(allocator), FAR.copy()[None]
    wrench[0, place] = np.nan
    assert entries.allot(tick.allotment, wrench)
    assert tick.allotment.counters[UNCONFIRMED] == tick.allotment.counters[CLIP] == 1
    check_allocations(tick, allocator, [FAR, -FAR])


def test_a_tick_begins_with_its_counters_at_zero():
    """Although compiling it takes a call."""
    assert not ticks_of(FLEET["hextilt"]()).allotment.counters.any()


def test_more_rotors_than_a_word_has_bits_for_are_named():
    vehicle = load_vehicle("fullam")
    with pytest.raises(Exception, match=r"32.* vehicles of up to 31 rotors"):
        arrays.check_rotors(replace(vehicle, rotors=ring(32)))
