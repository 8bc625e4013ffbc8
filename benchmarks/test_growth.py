"""Growth with joints and rotors: a step in lanes, and a tick called from Python."""

from __future__ import annotations

import copy
import functools
import time

import pytest
import workloads
from meter import Row

from fullam.model.design import design_vehicle
from fullam.model.loading import load_vehicle
from fullam.model.vehicle import Vehicle

pytestmark = pytest.mark.benchmark(timer=time.process_time)

JOINTS = (0, 1, 2, 4, 8)
ROTORS = (4, 6, 8, 16, 31)

K_F = load_vehicle("fullam").rotors.k_f[0]


@functools.cache
def with_joints(n):
    """The default vehicle with an arm of n short, light links, its axes turned by turns."""
    rows = [(0.0, 0.0, 0.0)] + [(90.0 * (i % 2), 0.05, 0.0) for i in range(1, max(n, 1))]
    vehicle = design_vehicle(
        name=f"{n} joints",
        craig=[*rows, (0.0, 0.0, 0.06)],
        tool_length=0.03,
        link_masses=[0.02] * (len(rows) + 1),
    )
    return vehicle if n else changed(vehicle, arm=[], tool="platform")


@functools.cache
def with_rotors(n):
    """The default vehicle with n rotors of together the same thrust; one of a pair if n is odd."""
    even = n + n % 2
    ring = design_vehicle(
        name=f"{n} rotors", rotor_count=even, ring_radius=0.045 * even, k_f=K_F * 8 / n
    )
    return changed(ring, rotor=ring.definition["rotor"][:n])


def changed(vehicle, **entries):
    """The vehicle with other entries of its definition."""
    return Vehicle.from_definition({**copy.deepcopy(vehicle.definition), **entries}, vehicle.urdf)


VEHICLES = [(with_joints, n) for n in JOINTS] + [(with_rotors, n) for n in ROTORS]


@pytest.mark.parametrize(("make", "n"), VEHICLES)
def test_tick(benchmark, meter, make, n):
    states = workloads.record(make(n), hover=True)
    group = "Growth of the compiled dc-PID tick, hovering (RE is of the same vehicle and grows too)"
    row = Row(group, states.vehicle.name, 0.0, unit="RE")
    tick = states.tick()
    calls = states.calls
    meter.measure(benchmark, lambda: states.replay(tick), calls, states.vehicle, row, rounds=11)


@pytest.mark.parametrize(("make", "n"), VEHICLES)
def test_step(benchmark, meter, steps, make, n):
    flown = workloads.plan(make(n), steps, hover=True)
    fleet = workloads.Fleet(flown)
    group = "Growth of a step of dc-PID, 8 lanes, 1 thread, all realism, record, hovering"
    row = Row(group, flown.nominal.name, 0.0, unit="RE", note=f"{fleet.saturated:.0%} out of reach")
    meter.measure(benchmark, lambda: fleet.fly, fleet.steps, flown.nominal, row, rounds=11)
