"""Mass properties that a definition states itself."""

import numpy as np
import pytest

from fullam.exceptions import VehicleError
from fullam.model.bodies import body_tables
from fullam.model.loading import load_vehicle
from fullam.model.perturbation import Uncertainty, perturb
from fullam.model.vehicle import Vehicle
from fullam.model.writing import write_vehicle

BODY = {"link": "link_2", "mass": 0.2, "center": [0.0, 0.1, 0.0],
        "inertia": [1e-3, 1e-4, 0.0, 1e-3, 0.0, 1.5e-3]}  # fmt: skip


def with_bodies(*tables, **more):
    vehicle = load_vehicle("fullam")
    definition = {k: v for k, v in vehicle.definition.items() if k != "mass"}
    return Vehicle.from_definition({**definition, "body": list(tables), **more}, vehicle.urdf)


def test_a_body_has_what_the_definition_says():
    body = with_bodies(BODY).model.inertias[3]
    assert body.mass == 0.2
    np.testing.assert_array_equal(body.lever, BODY["center"])
    np.testing.assert_allclose(body.inertia, [[1e-3, 1e-4, 0], [1e-4, 1e-3, 0], [0, 0, 1.5e-3]])


def test_what_rounding_left_below_zero_is_taken_and_nonsense_on_trust():
    rod = {**BODY, "inertia": [-5e-94, 0.0, 0.0, 1e-3, 0.0, 1e-3]}
    vehicle = with_bodies(rod)
    assert vehicle.model.inertias[3].inertia[0, 0] == -5e-94
    again = Vehicle.from_data(vehicle.to_data())
    for other in (again, perturb(again, Uncertainty(), np.random.default_rng(0))):
        assert other.model.inertias[3].inertia[0, 0] < 0.0
    nobody = {**BODY, "inertia": [1e-3, 0.0, 0.0, 1e-3, 0.0, -1e-3]}
    trusted = with_bodies(nobody, physics="trust")
    assert trusted.model.inertias[3].inertia[2, 2] == -1e-3


def test_the_tables_of_a_model_rebuild_it():
    vehicle = load_vehicle("hextilt")
    definition = {**vehicle.definition, "body": body_tables(vehicle.model)}
    again = Vehicle.from_definition(definition, vehicle.urdf)
    for mine, other in zip(again.model.inertias, vehicle.model.inertias, strict=True):
        # An inertia is kept as six numbers of a symmetric matrix, about the same centre.
        np.testing.assert_allclose(mine.matrix(), other.matrix(), atol=1e-15)


def test_it_is_written_and_read(tmp_path):
    path, _ = write_vehicle(with_bodies(BODY), tmp_path / "v.toml")
    assert load_vehicle(path).model.inertias[3].mass == 0.2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"link": "nobody"}, "not a link"),
        ({"mass": 0.0}, "mass"),
        ({"center": [0.0]}, "center"),
        ({"inertia": [1.0, 0.0, 0.0, 1.0, 0.0, 9.0]}, "belongs to no body"),
        ({"colour": 1}, "not a known key"),
    ],
)
def test_nonsense_is_refused(changes, message):
    with pytest.raises(VehicleError, match=message):
        with_bodies({**BODY, **changes})


def test_a_body_is_stated_once():
    with pytest.raises(VehicleError, match="is one body with"):
        with_bodies(BODY, BODY)


def test_a_body_is_stated_whole():
    with pytest.raises(VehicleError, match=r"inertia.*is missing"):
        with_bodies({k: v for k, v in BODY.items() if k != "inertia"})
