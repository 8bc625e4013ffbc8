"""Capability: against closed forms, linear programs, and vehicles broken on purpose."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.atlas.loads import Load
from fullam.analysis.capability import assess, gravity_wrench
from fullam.exceptions import VehicleError
from fullam.model.loading import load_vehicle
from fullam.model.rotors import Rotors
from fullam.model.vehicle import Vehicle
from fullam.model.wrench_axes import full_scale

NAMES = ("fullam", "hextilt", "borinot", "quadrotor_arm")
FULLY_ACTUATED = ("fullam", "hextilt")

TILT_MARGIN = 1e-6
"""Farther than rounding moves an exit, and than the linear program's tolerance [rad]."""


def largest_multiple(rotors: Rotors, wrench_A: np.ndarray) -> float:
    """Largest t with t wrench_A within reach, by a linear program."""
    scale = full_scale(rotors)
    system = np.column_stack([rotors.normalized_coupling, -wrench_A]) / scale[:, None]
    cost = np.append(np.zeros(rotors.count), -1.0)
    bounds = [(0.0, 1.0)] * rotors.count + [(0.0, None)]
    return -float(linprog(cost, A_eq=system, b_eq=np.zeros(6), bounds=bounds).fun)


def up(azimuth: float, tilt: float) -> np.ndarray:
    return np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])


def slowed(vehicle: Vehicle, factor: float) -> Vehicle:
    """The vehicle with all largest speeds scaled."""
    rotors = replace(vehicle.rotors, max_speeds=vehicle.rotors.max_speeds * factor)
    return replace(vehicle, rotors=rotors)


def supporting_wrench(vehicle: Vehicle, up_A: np.ndarray) -> np.ndarray:
    """Force against gravity with up_A pointing up, by Pinocchio, at that attitude."""
    q = vehicle.neutral()
    rotation = pin.Quaternion.FromTwoVectors(up_A, np.array([0.0, 0.0, 1.0]))
    q[3:7] = rotation.coeffs()
    gravity = pin.computeGeneralizedGravity(vehicle.model, vehicle.create_data(), q)
    return np.array(gravity[:6])


@pytest.mark.parametrize("name", NAMES)
def test_gravity_wrench_is_weight_at_the_centre_of_mass(name: str) -> None:
    vehicle = load_vehicle(name)
    theta = np.linspace(0.3, -0.4, vehicle.n_arm)
    wrench, center = gravity_wrench(vehicle, theta)
    force = np.array([0.0, 0.0, vehicle.mass * vehicle.gravity])
    expected = np.concatenate([force, np.cross(center, force)])
    np.testing.assert_allclose(wrench, expected, atol=1e-12 * force[2])  # rounding


@pytest.mark.parametrize("name", NAMES)
def test_hover_speeds_hold_the_vehicle(name: str) -> None:
    vehicle = load_vehicle(name)
    capability = assess(vehicle)
    assert capability.can_hover
    wrench, _ = gravity_wrench(vehicle)
    np.testing.assert_array_equal(capability.hover_wrench, wrench)
    error = (vehicle.rotors.wrench(capability.hover_speeds) - wrench) / wrench[2]
    assert np.abs(error[list(capability.axes)]).max() < 1e-8  # the accuracy of `least_effort`
    shares = capability.hover_speeds / vehicle.rotors.max_speeds
    np.testing.assert_allclose(capability.hover_shares, shares)
    assert 0.0 < shares.min() <= shares.max() < 1.0


@pytest.mark.parametrize("name", FULLY_ACTUATED)
def test_largest_tilt_is_where_the_linear_program_says(name: str) -> None:
    """Just below, the weight is within reach; just above, it is not: by another method."""
    vehicle = load_vehicle(name)
    capability = assess(vehicle)
    for i in range(0, capability.tilt_directions.size, 12):
        azimuth, tilt = capability.tilt_directions[i], capability.hover_tilts[i]
        assert tilt > np.deg2rad(5.0)
        below = supporting_wrench(vehicle, up(azimuth, tilt - TILT_MARGIN))
        above = supporting_wrench(vehicle, up(azimuth, tilt + TILT_MARGIN))
        assert largest_multiple(vehicle.rotors, below) > 1.0
        assert largest_multiple(vehicle.rotors, above) < 1.0
    sampled = capability.hover_tilts
    assert sampled.min() - np.deg2rad(0.5) < capability.worst_hover_tilt <= sampled.min()
    assert sampled.max() <= capability.best_hover_tilt < sampled.max() + np.deg2rad(0.5)


def test_largest_tilt_in_a_box_of_forces() -> None:
    """Rotors along +-x, +-y, +-z through the centre: the forces in reach are a box."""
    rotors = replace(
        load_vehicle("hextilt").rotors,
        names=tuple("abcdef"),
        positions=np.zeros((6, 3)),
        axes=np.vstack([np.eye(3), -np.eye(3)]),
        spins=np.ones(6),
        k_f=np.ones(6),
        k_tau=np.zeros(6),
        max_speeds=np.ones(6),
        lags=np.full(6, 0.01),
    )
    load = Load(1.0, 1.0, np.zeros(3), np.eye(3), np.zeros(3), np.zeros(6))
    cube = Envelope.from_rotors(rotors, load)
    assert cube.rose(0.3)[0] == np.pi, "inside the cube all round"
    assert cube.worst_tilt[0] == np.pi
    heavy = Envelope.from_rotors(rotors, replace(load, mass=1.3))
    assert np.isnan(heavy.rose(0.0)[0]), "too heavy to hover level"
    flat = replace(rotors, max_speeds=np.sqrt([0.5, 0.5, 1.0, 0.5, 0.5, 1.0]))
    found = Envelope.from_rotors(flat, load).worst_tilt[0]
    assert found == pytest.approx(np.deg2rad(30.0), abs=TILT_MARGIN), "sin(tilt) = 0.5"


def test_thrust_to_weight_in_closed_form() -> None:
    """Parallel rotors around the centre of mass lift the sum of their thrusts."""
    vehicle = load_vehicle("fullam")
    total = vehicle.rotors.max_thrusts.sum() / (vehicle.mass * vehicle.gravity)
    capability = assess(vehicle)
    assert capability.total_thrust_to_weight == pytest.approx(total)
    upright = replace(vehicle.rotors, axes=np.tile([0.0, 0.0, 1.0], (vehicle.rotors.count, 1)))
    straight_up = np.array([0.0, 0.0, vehicle.mass * vehicle.gravity, 0.0, 0.0, 0.0])
    assert largest_multiple(upright, straight_up) == pytest.approx(total, rel=1e-6)
    vertical = vehicle.rotors.axes[:, 2] @ vehicle.rotors.max_thrusts
    assert capability.thrust_to_weight < vertical / (vehicle.mass * vehicle.gravity)
    assert capability.thrust_to_weight > 1.0


def test_speeds_scale_lift_and_tilt() -> None:
    """Lift goes with the square of the speeds, and tilt with it; too slow, it says so."""
    vehicle = load_vehicle("fullam")
    full, tired, dead = (assess(slowed(vehicle, factor)) for factor in (1.0, 0.8, 0.5))
    assert tired.thrust_to_weight == pytest.approx(0.64 * full.thrust_to_weight, rel=1e-6)
    assert 0.0 < tired.worst_hover_tilt < full.worst_hover_tilt
    assert not dead.can_hover
    assert dead.worst_hover_tilt is None
    assert np.isnan(dead.hover_tilts).all()
    assert dead.thrust_to_weight < 1.0
    assert dead.limits[0].startswith("cannot hover level: it lifts 0.5")
    assert ("hovers level", "NO", "") in dead.rows()
    assert any(label == "problem" for label, _, _ in dead.rows())


@pytest.mark.parametrize("name", NAMES)
def test_axes_are_named_in_human_words(name: str) -> None:
    capability = assess(load_vehicle(name))
    if name in FULLY_ACTUATED:
        assert capability.rank == 6
        assert capability.axes == (True,) * 6
        assert capability.limits == ()
        assert capability.worst_hover_tilt > 0.0
    else:
        assert capability.rank == 4
        assert capability.axes == (False, False, True, True, True, True)
        assert capability.limits == ("no lateral force: it must tilt to move sideways",)
        assert np.rad2deg(capability.best_hover_tilt) < 0.1, "level only, but for rounding"
    nonzero = capability.singular_values[: capability.rank]
    assert capability.condition_number == pytest.approx(nonzero[0] / nonzero[-1])


def test_failed_rotors_count() -> None:
    vehicle = load_vehicle("hextilt")
    broken = assess(replace(vehicle, rotors=vehicle.rotors.with_failed(0)))
    assert broken.rank == 5
    assert not broken.can_hover
    assert np.isnan(broken.hover_speeds).all()
    assert "do not balance" in broken.limits[0]
    assert any("independent of the other axes" in text for text in broken.limits)
    assert broken.thrust_to_weight < assess(vehicle).thrust_to_weight
    none = assess(replace(vehicle, rotors=vehicle.rotors.with_failed(*range(6))))
    assert none.rank == 0
    assert not none.can_hover
    assert none.thrust_to_weight == 0.0


def test_the_arm_matters() -> None:
    vehicle = load_vehicle("fullam")
    theta = np.array([0.0, np.pi / 2, 0.0, 0.0])
    moved, rest = assess(vehicle, theta), assess(vehicle)
    np.testing.assert_array_equal(moved.arm, theta)
    assert not np.allclose(moved.hover_wrench, rest.hover_wrench)
    assert not np.allclose(moved.hover_speeds, rest.hover_speeds)
    assert moved.mass == rest.mass


@pytest.mark.parametrize("name", NAMES)
def test_report_has_every_figure(name: str) -> None:
    capability = assess(load_vehicle(name))
    rows = capability.rows()
    labels = [label for label, _, _ in rows]
    assert len(set(labels)) == len(labels)
    assert all(isinstance(part, str) for row in rows for part in row)
    table = {label: (value, unit) for label, value, unit in rows}
    assert table["mass"] == (f"{capability.mass:.3f}", "kg")
    assert table["rank of the coupling matrix"][0] == f"{capability.rank} of 6"
    assert table["hovers level"][0] == "yes"
    degrees = np.rad2deg(capability.worst_hover_tilt)
    assert table["hover tilt, every direction"] == (f"{degrees:.1f}", "deg")
    figures = json.loads(json.dumps(capability.to_dict()))
    assert figures["worst_hover_tilt_deg"] == pytest.approx(degrees)
    assert figures["rank"] == capability.rank
    assert len(figures["failed_tilts_deg"]) == capability.n_rotors


def test_results_are_read_only_and_bad_input_is_named() -> None:
    vehicle = load_vehicle("fullam")
    capability = assess(vehicle)
    with pytest.raises(ValueError, match="read-only"):
        capability.hover_speeds[0] = 0.0
    with pytest.raises(VehicleError, match="theta"):
        assess(vehicle, [0.0])
    model = vehicle.model.copy()
    model.gravity.linear = np.zeros(3)
    with pytest.raises(VehicleError, match="gravity"):
        assess(replace(vehicle, model=model))
