"""What is left without some rotors."""

import numpy as np
import pytest

from fullam.analysis.atlas.loads import load_of
from fullam.analysis.atlas.rays import attained
from fullam.analysis.remaining import remaining
from fullam.exceptions import VehicleError
from fullam.model.attainable.facets import facets_of
from fullam.model.loading import load_vehicle


@pytest.mark.parametrize("rotor", range(6))
def test_hextilt_without_a_rotor_has_five_axes_and_rests_tilted_only(rotor):
    vehicle = load_vehicle("hextilt").with_failed(rotor)
    left = remaining(vehicle)
    assert (left.rank, left.lacking, left.trim, left.holds) == (5, ("force y",), None, False)
    assert 25.0 < np.degrees(left.rest_tilt) < 30.0
    assert 0.8 < left.rest_margin < 1.3
    assert "five of six axes are left" in str(left)
    facets, load = facets_of(vehicle.rotors), load_of(vehicle)
    assert not attained(facets, load.wrench())
    # Somewhere towards an azimuth it is within reach at that tilt; in most directions it is not.
    a = np.linspace(0.0, 2.0 * np.pi, 20001)
    s, c = np.sin(left.rest_tilt), np.cos(left.rest_tilt)
    ups = np.stack([s * np.cos(a), s * np.sin(a), np.full_like(a, c)], axis=-1)
    lacking = np.abs((ups @ load.map.T - facets.center) @ facets.equalities[0])
    inside = facets.slacks(ups @ load.map.T).min(axis=1) > 0.0
    assert lacking[inside].min() < 1e-4  # of full scale, between azimuths 0.018 deg apart


@pytest.mark.parametrize(
    ("name", "rotors", "rank", "says"),
    [
        ("fullam", ("3",), 6, "position and heading are held, tilted by 19 deg"),
        ("fullam", ("rotor_1", "rotor_5"), 5, "can be at rest tilted by 6 deg"),
        ("fullam", (0, 2), 5, "there is no attitude in which it can be at rest"),
        ("quadrotor_arm", (0,), 3, "no force x, no force y, no moment z independent"),
    ],
)
def test_what_is_left_is_said(name, rotors, rank, says):
    left = remaining(load_vehicle(name).with_failed(*rotors))
    assert left.rank == rank
    assert says in str(left)
    assert left.to_dict()["says"] == str(left)


def test_four_axes_without_lateral_force_rest_level():
    """A flat vehicle: nothing has failed, but the search for its attitudes is the same."""
    left = remaining(load_vehicle("quadrotor_arm"))
    assert left.rank == 4
    assert left.rest_tilt == pytest.approx(0.0, abs=1e-6)  # an arc cosine near 1


@pytest.mark.parametrize("rotor", ["9", "0", "rotor_0", -1, 8, True, 1.0])
def test_rotors_that_are_none_are_refused(rotor):
    with pytest.raises(VehicleError, match="number from 1 to 8"):
        load_vehicle("fullam").with_failed(rotor)
