"""What a vehicle says about itself, and that it is the same after a round trip."""

import copy
import json
import pickle
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from fullam.exceptions import NotFullyActuated, VehicleError
from fullam.model.definition_keys import GRAVITY
from fullam.model.loading import load_vehicle, vehicle_names
from fullam.model.perturbation import Uncertainty, perturb
from fullam.model.vehicle import Vehicle

ROTOR_ARRAYS = ("positions", "axes", "spins", "k_f", "k_tau", "max_speeds", "lags")


def assert_same_bits(one: Vehicle, other: Vehicle):
    assert one.model == other.model
    assert one.rotors.names == other.rotors.names
    for field in ROTOR_ARRAYS:
        np.testing.assert_array_equal(getattr(one.rotors, field), getattr(other.rotors, field))
    for field in ("name", "description", "urdf", "platform", "arm_joints", "tool", "definition"):
        assert getattr(one, field) == getattr(other, field)


@pytest.mark.parametrize("name", vehicle_names())
def test_every_registered_vehicle_keeps_the_contract(name):
    vehicle = load_vehicle(name)
    assert vehicle.name == name
    assert vehicle.description
    assert tuple(vehicle.model.names)[2:] == vehicle.arm_joints
    assert vehicle.model.existFrame(vehicle.tool)
    assert vehicle.model.nq == 7 + vehicle.n_arm
    assert vehicle.gravity == GRAVITY
    # Hover must be possible with room to steer: at least twice the weight straight up.
    lift = vehicle.rotors.axes[:, 2] @ vehicle.rotors.max_thrusts
    assert lift > 2.0 * vehicle.mass * vehicle.gravity
    assert f"{vehicle.rotors.count} rotors" in repr(vehicle)


@pytest.mark.parametrize("name", vehicle_names())
def test_data_alone_rebuild_the_vehicle_bit_for_bit(name):
    vehicle = load_vehicle(name)
    definition = json.loads(json.dumps(vehicle.definition))
    assert_same_bits(vehicle, Vehicle.from_definition(definition, vehicle.urdf))


@pytest.mark.parametrize(
    "through",
    [lambda v: pickle.loads(pickle.dumps(v)), copy.deepcopy, copy.copy],
    ids=["pickle", "deepcopy", "copy"],
)
def test_copies_keep_a_drawn_vehicle_bit_for_bit_and_read_only(through):
    true = perturb(load_vehicle("fullam"), Uncertainty(), np.random.default_rng(3))
    assert true.rotors.coupling_matrix.shape == (6, 8)  # fills the cache, which travels too
    again = through(true)
    assert_same_bits(true, again)
    with pytest.raises(ValueError, match="read-only"):
        again.rotors.k_f[0] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        again.rotors.coupling_matrix[0, 0] = 0.0


def test_the_definition_is_a_copy():
    definition = copy.deepcopy(load_vehicle("fullam").definition)
    vehicle = Vehicle.from_definition(definition, load_vehicle("fullam").urdf)
    definition["rotor_defaults"]["k_f"] = 0.0
    assert vehicle.definition["rotor_defaults"]["k_f"] > 0.0


def test_platform_includes_the_links_fixed_to_it():
    vehicle = load_vehicle("hextilt")
    # From the URDF: platform 1.0194 kg and the arm's base 0.27973 kg, 51.6 mm below.
    masses = np.array([1.0194, 0.27973])
    levers = np.array(
        [[-0.0054412, 0.003948, -0.0087555], [5.4471e-05, 0.00055544, 0.0045971 - 0.0516]]
    )
    assert vehicle.platform_mass == pytest.approx(masses.sum(), rel=1e-12)  # a sum of two
    np.testing.assert_allclose(vehicle.platform_com, masses @ levers / masses.sum(), rtol=1e-12)
    assert np.all(np.linalg.eigvalsh(vehicle.platform_inertia) > 0.0)


def test_platform_of_our_design_is_as_designed():
    vehicle = load_vehicle("fullam")
    design = vehicle.definition["design"]
    assert vehicle.platform_mass == design["platform_mass"]
    np.testing.assert_array_equal(vehicle.platform_com, np.zeros(3))
    np.testing.assert_array_equal(vehicle.platform_inertia, np.diag(design["platform_inertia"]))
    assert vehicle.mass == pytest.approx(pin.computeTotalMass(vehicle.model), rel=1e-15)


def test_accessors_own_their_memory():
    vehicle = load_vehicle("fullam")
    vehicle.platform_com[:] = 1.0
    vehicle.platform_inertia[:] = 1.0
    np.testing.assert_array_equal(vehicle.platform_com, np.zeros(3))
    assert vehicle.platform_inertia[0, 1] == 0.0


def test_neutral():
    vehicle = load_vehicle("fullam")
    np.testing.assert_array_equal(vehicle.neutral(), [0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0])
    np.testing.assert_array_equal(vehicle.neutral([1, 2, 3, 4])[7:], [1, 2, 3, 4])
    with pytest.raises(VehicleError, match="give 4 joint angles"):
        vehicle.neutral([1, 2, 3])


def test_data_are_fresh():
    vehicle = load_vehicle("fullam")
    assert vehicle.create_data() is not vehicle.create_data()


@pytest.mark.parametrize(
    ("name", "rank"), [("fullam", 6), ("hextilt", 6), ("borinot", 4), ("quadrotor_arm", 4)]
)
def test_rank_says_who_is_fully_actuated(name, rank):
    vehicle = load_vehicle(name)
    assert vehicle.actuation_rank() == rank
    if rank == 6:
        vehicle.require_full_actuation()
        return
    with pytest.raises(NotFullyActuated) as caught:
        vehicle.require_full_actuation()
    assert caught.value.vehicle == name
    assert (caught.value.rank, caught.value.asked) == (4, 6)
    vehicle.require_full_actuation([2, 3, 4, 5])
    vehicle.require_full_actuation(np.array([False, False, True, True, True, True]))
    with pytest.raises(NotFullyActuated, match="rank 4 on the 5 axes"):
        vehicle.require_full_actuation([0, 2, 3, 4, 5])


def test_failed_rotors_cost_rank():
    vehicle = load_vehicle("fullam")
    three_left = copy.copy(vehicle)
    object.__setattr__(three_left, "rotors", vehicle.rotors.with_failed(0, 1, 2, 3, 4))
    assert three_left.actuation_rank() == 3
    object.__setattr__(three_left, "rotors", vehicle.rotors.with_failed(*range(8)))
    assert three_left.actuation_rank() == 0


@pytest.mark.parametrize("length", [0.0, 2.0, 1e300])
def test_a_thrust_axis_is_a_unit_vector_whatever_its_length(length):
    rotors = load_vehicle("fullam").rotors
    with pytest.raises(VehicleError, match=r"axis of rotor 'rotor_1': has length (0|2|inf)"):
        replace(rotors, axes=rotors.axes * length)
