"""The atlas: known answers, closed forms, and what must not depend on how it is computed."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from fullam.analysis.atlas import batches
from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.atlas.loads import center_jacobian, centers_of, load_of
from fullam.exceptions import VehicleError
from fullam.model.attainable import facets
from fullam.model.attainable.facets import facets_of
from fullam.model.design import design_vehicle
from fullam.model.loading import load_vehicle

NAMES = ("fullam", "hextilt", "borinot", "quadrotor_arm")

PRINTED = 5e-4
"""Known answers are printed with three decimals [deg]."""


def centred(vehicle) -> Envelope:
    """With the centre of mass at the origin of {A}."""
    return Envelope.from_rotors(
        vehicle.rotors, replace(load_of(vehicle), center=np.zeros(3))
    )  # fmt: skip


@pytest.mark.parametrize("count", [6, 8, 10, 12])
@pytest.mark.parametrize("cant", [10.0, 25.0, 40.0])
def test_alternating_ring_in_closed_form(count: int, cant: float) -> None:
    """With thrust to spare, tan(tilt) = tan(cant) cos(2 pi / n)."""
    envelope = centred(design_vehicle(rotor_count=count, cant_deg=cant))
    expected = np.arctan(np.tan(np.deg2rad(cant)) * np.cos(2.0 * np.pi / count))
    assert envelope.worst_tilt[0] == pytest.approx(expected, abs=1e-10)  # digits of the URDF


def test_known_tilts() -> None:
    fullam, hextilt = load_vehicle("fullam"), load_vehicle("hextilt")
    assert np.rad2deg(centred(fullam).worst_tilt[0]) == pytest.approx(35.264, abs=PRINTED)
    assert np.rad2deg(Envelope.of(fullam).worst_tilt[0]) == pytest.approx(31.578, abs=PRINTED)
    slow = replace(hextilt, rotors=replace(hextilt.rotors, min_speeds=np.full(6, 100.0)))
    azimuths = np.arange(72) * np.pi / 36.0
    for vehicle, worst, best in ((slow, 18.869, 30.847), (hextilt, 19.359, 31.594)):
        envelope = Envelope.of(vehicle)
        assert np.rad2deg(envelope.worst_tilt[0]) == pytest.approx(worst, abs=PRINTED)
        # The printed best is the best of 72 azimuths; the exact one lies between two of them.
        assert np.rad2deg(envelope.rose(azimuths).max()) == pytest.approx(best, abs=PRINTED)
        fine = envelope.rose(np.linspace(-np.pi, np.pi, 20001)).max()
        assert fine < envelope.best_tilt[0] < fine + np.deg2rad(0.02)
    six = centred(design_vehicle(rotor_count=6, cant_deg=46.75))
    assert np.rad2deg(six.worst_tilt[0]) == pytest.approx(27.975, abs=PRINTED)
    level = centred(hextilt)
    assert level.least_level_force / level.load.weight == pytest.approx(0.349, abs=PRINTED)


def test_a_vehicle_that_cannot_hover_has_no_tilt() -> None:
    heavy = Envelope.of(load_vehicle("fullam"), payload=5.0)
    assert not heavy.can_hover
    assert heavy.worst_tilt is None
    assert heavy.best_tilt is None
    assert heavy.margin.value < 0.0
    assert heavy.thrust_to_weight < 1.0
    assert heavy.hover_shares is None
    for figure in (heavy.payload, heavy.least_push, heavy.least_level_force, heavy.rose([0.0])[0]):
        assert np.isnan(figure)
    flat = Envelope.of(load_vehicle("quadrotor_arm"))
    assert flat.worst_tilt[0] == 0.0, "it can hover level, and lean no bit"


def test_what_can_be_held_may_fall_apart() -> None:
    """Half the rotors reversed: upside down it hovers as well, with a gap between."""
    rotors = load_vehicle("fullam").rotors
    up, down = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])
    axes = np.where((np.arange(8) // 2 % 2 == 0)[:, None], up, down)
    tilted = axes + 0.2 * np.column_stack([rotors.positions[:, 1], -rotors.positions[:, 0], 0 * axes[:, 0]]) / 0.35 * rotors.spins[:, None]  # fmt: skip  # noqa: E501
    both = replace(rotors, axes=tilted / np.linalg.norm(tilted, axis=1, keepdims=True))
    load = replace(load_of(load_vehicle("fullam")), center=np.zeros(3), mass=1.0)
    envelope = Envelope.from_rotors(both, load)
    intervals = envelope.intervals(0.4)
    assert len(intervals) == 2
    assert intervals[0] == pytest.approx((0.0, float(envelope.rose([0.4])[0])))
    assert intervals[1][1] == np.pi


@pytest.mark.parametrize("name", NAMES)
def test_exact_least_figures_bound_every_direction(name: str) -> None:
    """The least over all directions is below any direction tried, and some come close to it."""
    envelope = Envelope.of(load_vehicle(name))
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(20000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    azimuths = np.linspace(0.0, 2.0 * np.pi, 3601)
    worst, best = envelope.worst_tilt[0], envelope.best_tilt[0]
    rose = envelope.rose(azimuths)
    assert rose.min() == pytest.approx(worst, abs=2e-3)
    assert rose.min() >= worst - 1e-12
    assert rose.max() <= best + 1e-12
    for tried, least in (
        (envelope.level_force(azimuths), envelope.least_level_force),
        (envelope.push(directions), envelope.least_push),
        (envelope.moment(directions), envelope.least_moment),
    ):
        assert tried.min() >= least - 1e-9
        assert tried.min() == pytest.approx(least, rel=0.02, abs=1e-9)  # 20 000 directions


def test_every_figure_is_reached_and_no_more() -> None:
    """The wrench at the end is made by admissible speeds; 0.1 % beyond, by none."""
    envelope = Envelope.of(load_vehicle("fullam"), [0.2, -0.4, 0.3, 0.1], payload=0.1)
    direction = np.array([0.48, -0.6, 0.64])
    tool, center, inertia = envelope.load.tool, envelope.load.center, envelope.load.inertia
    mass = envelope.load.mass
    ends = {
        "push": float(envelope.push(direction)) * np.r_[direction, np.cross(tool, direction)],
        "force": float(envelope.force(direction)) * np.r_[direction, np.cross(center, direction)],
        "moment": float(envelope.moment(direction)) * np.r_[0, 0, 0, direction],
        "payload": envelope.payload * 9.81 * np.r_[0, 0, 1, np.cross(tool, [0, 0, 1.0])],
        "acceleration": mass * envelope.acceleration()[0, 1] * np.r_[1, 0, 0, np.cross(center, [1.0, 0, 0])],  # noqa: E501
        "angular": envelope.angular_acceleration()[2, 0] * np.r_[0, 0, 0, inertia @ [0, 0, -1.0]],
        "lift": (envelope.thrust_to_weight - 1.0) * envelope.hover_wrench,
    }  # fmt: skip
    for name, step in ends.items():
        slack = envelope.facets.slacks(envelope.hover_wrench + step).min()
        assert slack == pytest.approx(0.0, abs=1e-12), name
        assert envelope.facets.slacks(envelope.hover_wrench + 1.001 * step).min() < -1e-6, name


@pytest.mark.parametrize("name", NAMES)
def test_loads_are_pinocchios(name: str) -> None:
    vehicle = load_vehicle(name)
    theta = np.linspace(0.4, -0.3, vehicle.n_arm)
    load, data = load_of(vehicle, theta), vehicle.create_data()
    q = vehicle.neutral(theta)
    gravity = pin.computeGeneralizedGravity(vehicle.model, data, q)[:6]
    np.testing.assert_allclose(load.wrench(), gravity, atol=1e-12 * load.weight)
    mass_matrix = pin.crba(vehicle.model, data, q)[:6, :6]
    mass_matrix = np.triu(mass_matrix) + np.triu(mass_matrix, 1).T
    lever = load.mass * pin.skew(load.center)
    about_origin = load.inertia - load.mass * pin.skew(load.center) @ pin.skew(load.center)
    np.testing.assert_allclose(mass_matrix[3:, :3], lever, atol=1e-12)
    np.testing.assert_allclose(mass_matrix[3:, 3:], about_origin, atol=1e-12)
    np.testing.assert_allclose(centers_of(vehicle, [theta])[0], load.center, atol=1e-15)
    step = 1e-6
    for joint in range(vehicle.n_arm):
        shift = step * np.eye(vehicle.n_arm)[joint]
        more, less = centers_of(vehicle, [theta + shift, theta - shift])
        np.testing.assert_allclose(
            center_jacobian(vehicle, theta)[:, joint], (more - less) / (2 * step), atol=1e-9
        )


def test_a_payload_is_a_mass_at_the_tool() -> None:
    vehicle = load_vehicle("fullam")
    theta = [0.3, 0.2, -0.5, 0.1]
    load = load_of(vehicle, theta, payload=0.4)
    model, plain = vehicle.model.copy(), load_of(vehicle, theta)
    frame = model.frames[model.getFrameId(vehicle.tool)]
    point = pin.Inertia(0.4, frame.placement.translation, np.zeros((3, 3)))
    model.appendBodyToJoint(frame.parentJoint, point, pin.SE3.Identity())
    heavier = load_of(replace(vehicle, model=model), theta)
    assert load.mass == pytest.approx(heavier.mass)
    np.testing.assert_allclose(load.center, heavier.center, atol=1e-14)
    np.testing.assert_allclose(load.inertia, heavier.inertia, atol=1e-14)
    lift = 0.4 * 9.81 * np.r_[0, 0, 1, np.cross(plain.tool, [0, 0, 1.0])]
    np.testing.assert_allclose(load.wrench(), plain.wrench() + lift, atol=1e-13)


@pytest.mark.parametrize("name", ["fullam", "hextilt"])
def test_batches_agree_with_single_poses_with_and_without_numba(name, monkeypatch) -> None:
    vehicle = load_vehicle(name)
    envelope = Envelope.of(vehicle)
    thetas = np.random.default_rng(3).uniform(-2.5, 2.5, (40, vehicle.n_arm))
    centers, azimuths = centers_of(vehicle, thetas), np.linspace(0.0, 6.0, 25)
    centers[-1] = [5.0, 0.0, 0.0]  # cannot hover
    expected = [
        Envelope.from_rotors(vehicle.rotors, replace(envelope.load, center=c), envelope.facets)
        for c in centers
    ]
    roses = np.array([each.rose(azimuths) for each in expected])
    worst = np.array([np.nan if e.worst_tilt is None else e.worst_tilt[0] for e in expected])
    for _ in range(2):
        found = batches.tilt_roses(envelope.facets, envelope.load, centers, azimuths)
        np.testing.assert_allclose(found, roses, atol=1e-12)
        found = batches.worst_tilts(envelope.facets, envelope.load, centers)
        np.testing.assert_allclose(found, worst, atol=1e-12)
        assert np.isnan(found[-1])
        monkeypatch.setattr(batches, "available", lambda: False)


@pytest.mark.parametrize("name", NAMES)
def test_facets_with_and_without_numba(name, monkeypatch) -> None:
    rotors = load_vehicle(name).rotors
    for each in (rotors, rotors.with_failed(1)):
        fast = facets_of(each)
        monkeypatch.setattr(facets, "available", lambda: False)
        slow = facets_of(each)
        monkeypatch.undo()
        by_members = [np.lexsort(f.members.T) for f in (fast, slow)]
        np.testing.assert_array_equal(fast.members[by_members[0]], slow.members[by_members[1]])
        np.testing.assert_allclose(
            fast.half_widths[by_members[0]], slow.half_widths[by_members[1]], atol=1e-13
        )


def test_a_ring_has_few_facets_and_they_touch_the_set() -> None:
    rotors = load_vehicle("fullam").rotors
    found = facets_of(rotors)
    assert 2 * len(found.normals) == 24
    assert found.ties.all()
    shares = (found.normals @ rotors.normalized_coupling > 0.0).astype(float)
    for normal, width, share in zip(found.normals, found.half_widths, shares, strict=True):
        vertex = rotors.normalized_coupling @ share
        assert normal @ (vertex - found.center) == pytest.approx(width, abs=1e-14)


def test_a_failed_rotor_stands_still_whatever_its_least_speed() -> None:
    rotors = replace(load_vehicle("hextilt").rotors, min_speeds=np.full(6, 100.0))
    failed = rotors.with_failed(2)
    assert failed.least_shares[2] == 0.0
    assert (failed.least_shares[[0, 1, 3, 4, 5]] > 0.0).all()
    np.testing.assert_array_equal(failed.normalized_coupling[:, 2], 0.0)
    with pytest.raises(VehicleError, match="min_speeds"):
        replace(rotors, min_speeds=np.full(6, 5000.0))


def test_bad_loads_are_named() -> None:
    vehicle = load_vehicle("fullam")
    with pytest.raises(VehicleError, match="payload"):
        load_of(vehicle, payload=-1.0)
    with pytest.raises(VehicleError, match="theta"):
        load_of(vehicle, [0.0])


def test_kernels_of_modules_imported_after_the_first_compilation_are_known() -> None:
    code = (
        "from fullam.analysis.atlas.envelope import Envelope\n"
        "from fullam.model.loading import load_vehicle\n"
        "e = Envelope.of(load_vehicle('hextilt'))\n"
        "from fullam.analysis.atlas.batches import worst_tilts\n"
        "assert abs(worst_tilts(e.facets, e.load, [e.load.center])[0] - e.worst_tilt[0]) < 1e-12\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
