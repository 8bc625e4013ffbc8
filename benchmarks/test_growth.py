"""Growth of a tick with joints and rotors."""

from __future__ import annotations

import functools
import time

import pytest
import workloads
from meter import Row
from workloads import compiled_replay, compiled_tick, replay

from fullam.model.design import design_vehicle
from fullam.model.loading import load_vehicle

pytestmark = pytest.mark.benchmark(timer=time.process_time)

JOINTS = (1, 2, 4, 8, 12)
ROTORS = (4, 6, 8, 12, 16)


K_F = load_vehicle("fullam").rotors.k_f[0]


@functools.cache
def with_joints(n):
    """The default vehicle with an arm of n short, light links, its axes turned by turns."""
    rows = [(0.0, 0.0, 0.0)] + [(90.0 * (i % 2), 0.05, 0.0) for i in range(1, n)]
    vehicle = design_vehicle(
        name=f"{n} joints",
        craig=[*rows, (0.0, 0.0, 0.06)],
        tool_length=0.03,
        link_masses=[0.02] * (n + 1),
    )
    return workloads.record(vehicle, hover=True)


@functools.cache
def with_rotors(n):
    """The default vehicle with n rotors of together the same thrust."""
    vehicle = design_vehicle(
        name=f"{n} rotors", rotor_count=n, ring_radius=0.045 * n, k_f=K_F * 8 / n
    )
    return workloads.record(vehicle, hover=True)


def tick_row(benchmark, meter, states, compiled):
    row = Row(
        "Growth of the dc-PID tick, hovering (RE is of the same vehicle and grows too)",
        f"{states.vehicle.name}, {'compiled' if compiled else 'numpy'}",
        0.0,
        unit="RE",
    )

    def prepare():
        if compiled:
            return compiled_replay(compiled_tick(states, "dc-pid"), states)
        return replay(states.tick("dc-pid"), states)

    meter.measure(benchmark, prepare, states.calls, states.vehicle, row, rounds=11)


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("joints", JOINTS)
def test_joints(benchmark, meter, joints, compiled):
    tick_row(benchmark, meter, with_joints(joints), compiled)


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("rotors", ROTORS)
def test_rotors(benchmark, meter, rotors, compiled):
    tick_row(benchmark, meter, with_rotors(rotors), compiled)
