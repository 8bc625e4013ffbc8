"""The trim attitude: its margin, against the atlas; what is said of it."""

from dataclasses import replace

import numpy as np
import pytest

from fullam.analysis.atlas.loads import load_of
from fullam.analysis.atlas.rays import margin
from fullam.control.trim import HoverMargins, rotation_between
from fullam.model.attainable.facets import facets_of
from fullam.model.loading import load_vehicle
from fullam.simulation.trimmed import trim_of

LEVEL = np.array([0.0, 0.0, 1.0])
POSES = np.radians([(-90.0, -90.0, 0.0, 0.0), (0.0, 0.0, -90.0, 0.0), (-90.0, 0.0, -90.0, 0.0)])


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("fullam")


def length_of(vehicle):
    return float(np.linalg.norm(vehicle.rotors.positions, axis=1).mean())


def hover(vehicle, theta):
    load = load_of(vehicle, theta)
    facets = facets_of(vehicle.rotors)
    return facets, load, HoverMargins.of(facets, load.weight, load.center, length_of(vehicle))


@pytest.mark.parametrize("rotor", range(8))
@pytest.mark.parametrize("pose", range(3))
def test_margins_are_those_of_the_atlas_and_none_is_larger_than_the_best(vehicle, rotor, pose, rng):
    facets, load, margins = hover(vehicle.with_failed(rotor), POSES[pose])
    up, best = margins.best()
    for u in (up, LEVEL):
        expected = margin(facets, load.wrench(u), length_of(vehicle)).value
        # Rounding of sums of some ten newtons.
        assert margins.at(u) == pytest.approx(expected, abs=1e-10)
    others = rng.normal(size=(20000, 3))
    others[:, 2] = np.abs(others[:, 2])
    others /= np.linalg.norm(others, axis=1, keepdims=True)
    near = up + 0.02 * rng.normal(size=(2000, 3))
    near /= np.linalg.norm(near, axis=1, keepdims=True)
    # The last grid is 1e-8 wide, and a margin changes by the weight, 22 N, a radian.
    assert margins.at(np.vstack([others, near])).max() <= best + 1e-6


@pytest.mark.parametrize("rotor", range(8))
def test_without_a_rotor_level_has_nothing_to_spare_and_a_tilt_has(vehicle, rotor):
    """With the centre of mass on the axis, level takes the opposite rotor to a stop, exactly.

    Half of what the whole vehicle has to spare is there at 18 deg.
    """
    whole = hover(vehicle, POSES[2])[2].at(LEVEL)
    up, best = (margins := hover(vehicle.with_failed(rotor), POSES[2])[2]).best()
    assert margins.at(LEVEL) == pytest.approx(0.0, abs=0.02)  # the centre is 0.1 mm off
    assert best > 0.5 * whole
    assert 15.0 < np.degrees(np.arccos(up[2])) < 20.0


def test_the_least_over_several_arm_poses(vehicle):
    failed = vehicle.with_failed(3)
    each = [hover(failed, pose)[2] for pose in POSES]
    centers = np.array([load_of(failed, pose).center for pose in POSES])
    weight = load_of(failed).weight
    together = HoverMargins.of(facets_of(failed.rotors), weight, centers, length_of(vehicle))
    up, _ = together.best()
    assert together.at(up) == pytest.approx(min(m.at(up) for m in each), abs=1e-10)  # rounding


def test_the_smallest_rotation_between_two_vectors(rng):
    for a, b in rng.normal(size=(50, 2, 3)):
        a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
        R = rotation_between(a, b)
        # Rounding, which grows as the two become opposite.
        np.testing.assert_allclose(R @ a, b, atol=1e-12 / (1.0 + a @ b))
        np.testing.assert_allclose(R @ np.cross(a, b), np.cross(a, b), atol=1e-12 / (1.0 + a @ b))


def test_what_is_held_is_said(vehicle):
    tilted = np.array([[0.0, 0.0, 0.0, 1.0]])
    trim = trim_of(vehicle.with_failed("rotor_3"), POSES[:1], tilted)
    assert trim.holds
    assert trim.is_needed
    assert str(trim) == (
        "rotor_3 stopped: position and heading are held, tilted by 18 deg, with 4.6 N to spare "
        "(level -0.2 N, as asked -0.2 N); the tilt asked for is given up"
    )
    R = trim.rotation
    np.testing.assert_allclose(R @ trim.up, LEVEL, atol=1e-12)  # rounding


def test_a_target_with_enough_to_spare_is_kept(vehicle):
    failed = vehicle.with_failed(2)
    up = trim_of(failed, POSES[:1]).up
    v = np.cross(LEVEL, up)
    half = 0.5 * np.arcsin(np.linalg.norm(v))
    # R^T e_z = up: the rotation by the opposite of the one from e_z to up.
    attitude = np.append(-np.sin(half) * v / np.linalg.norm(v), np.cos(half))[None]
    trim = trim_of(failed, POSES[:1], attitude)
    assert trim.asked == pytest.approx(trim.margin, abs=1e-3)  # attitudes are told to 1e-6
    assert not trim.is_needed
    assert "position and attitude are held" in str(trim)


def test_what_cannot_be_held_sinks(vehicle):
    weak = replace(
        vehicle, rotors=replace(vehicle.rotors, max_speeds=0.7 * vehicle.rotors.max_speeds)
    )
    trim = trim_of(weak.with_failed(2), POSES[:1])
    assert not trim.holds
    assert trim.level < trim.margin < 0.0
    assert "no attitude can be held; it sinks" in str(trim)


def test_whole_vehicles_and_those_that_lack_an_axis_have_no_trim(vehicle):
    assert trim_of(vehicle, POSES[:1]) is None
    assert trim_of(vehicle.with_failed(0, 4), POSES[:1]) is None
