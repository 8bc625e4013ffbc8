"""The filter of a load, the weight that it leads to, and what an observer makes of its end."""

import numpy as np
import pinocchio as pin

from fullam.control.caution import Halves
from fullam.control.controllers import make_controller
from fullam.control.payload_filter import begun, take_in
from fullam.control.payload_observer import Held, Tare, weighed, weight_of
from fullam.control.pid import PidMemory
from fullam.control.signals import Estimate
from fullam.control.wrench_observer import less, nothing_observed, observed, observer_numbers
from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.recursion import Chain, JointMotion, place_joints, root_wrench
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial
from fullam.model.chain import LinkChain
from fullam.model.loading import load_vehicle
from fullam.numbers.records import flat, record
from fullam.simulation.payloads.learning import learn_numbers
from fullam.simulation.tool.held import held_tool

ROWS = np.array([[1.0, 0.0, 0.0, 0.0], [0.3, 0.6, 0.0, -0.8], [-0.2, 0.0, 1.0, 0.1]])


def test_rows_taken_in_one_by_one_are_the_least_squares():
    rng = np.random.default_rng(3)
    x, P = [0.0] * 4, [[0.0] * 4 for _ in range(4)]
    begun(2.0, 0.1, x, P, 0.5, True)
    prior = np.diag([4.0, *3 * [0.05**2]])
    np.testing.assert_allclose(P, prior, rtol=1e-15)
    information, vector = np.linalg.inv(prior), np.zeros(4)
    for _ in range(5):
        for row, variance in zip(ROWS, (0.1, 0.02, 0.03), strict=True):
            value = rng.normal()
            take_in(x, P, tuple(row), value, variance, True)
            information += np.outer(row, row) / variance
            vector += row * value / variance
    # Rounding of fifteen updates, each of a few digits' cancellation.
    np.testing.assert_allclose(P, np.linalg.inv(information), atol=1e-12)
    np.testing.assert_allclose(x, np.linalg.solve(information, vector), atol=1e-12)


def test_a_frozen_row_changes_nothing():
    x, P = [0.0] * 4, [[0.0] * 4 for _ in range(4)]
    begun(2.0, 0.1, x, P, 0.5, True)
    take_in(x, P, tuple(ROWS[1]), 0.3, 0.1, True)
    before = list(x), [list(row) for row in P]
    take_in(x, P, tuple(ROWS[2]), 7.0, 0.1, False)
    begun(2.0, 0.1, x, P, 0.9, False)
    assert (x, P) == before


def test_the_tare_is_mean_and_variance():
    vehicle = load_vehicle("fullam")
    numbers = learn_numbers(vehicle, 0.01)
    rows = np.random.default_rng(1).normal(2.0, 0.5, (200, 3))
    tare = Tare((0.0,) * 3, (0.0,) * 3, 0.0)
    for row in rows:
        tare = weighed(numbers, tare, tuple(row), True)
    assert weighed(numbers, tare, (9.0,) * 3, False) is tare
    np.testing.assert_allclose(tare.mean, rows.mean(0), rtol=1e-12)
    np.testing.assert_allclose(tare.variance, rows.var(0), rtol=1e-12)


def test_the_weight_is_what_pinocchio_s_gravity_adds():
    vehicle = load_vehicle("fullam")
    links = LinkRows.of(LinkChain.from_model(vehicle.model))
    theta = np.array([-0.7, 0.4, 0.9, -0.3])
    joints = [None] * 4
    place_joints(links.rows.to_list(), [JointMotion(a, 0.0, 0.0) for a in theta.tolist()], joints)
    point, frame = held_tool(vehicle, "hold")
    center, mass = point + np.array([0.02, -0.01, 0.03]), 0.2
    model = pin.Model(vehicle.model)
    model.inertias[model.njoints - 1] += pin.Inertia(mass, center, np.zeros((3, 3)))
    q = vehicle.neutral(theta)
    q[3:7] = np.array([0.1, -0.2, 0.3, 0.9]) / np.linalg.norm([0.1, -0.2, 0.3, 0.9])
    gravity = [
        pin.computeGeneralizedGravity(m, m.createData(), q)[:6] for m in (vehicle.model, model)
    ]
    R = pin.Quaternion(q[3:7]).toRotationMatrix()
    added = gravity[0] - gravity[1]
    held = Held(mass, tuple((mass * frame.T @ center).tolist()))
    found = weight_of(held, joints, rotation_matrix(tuple(q[3:7].tolist())), 9.81)
    np.testing.assert_allclose(
        flat(found), np.concatenate([R @ added[:3], R @ added[3:]]), atol=1e-13
    )


def test_an_observer_that_is_told_of_the_end_observes_it_no_more():
    vehicle = load_vehicle("fullam")
    links = LinkRows.of(LinkChain.from_model(vehicle.model)).rows.to_list()
    joints = [None] * 4
    place_joints(links, [JointMotion(a, 0.0, 0.0) for a in (-1.5, 0.0, -0.7, 0.0)], joints)
    chain, T = Chain(links, joints), 0.01
    numbers = observer_numbers(vehicle, T, (20.0, 18.0), 0.03)
    none, place = Spatial((0.0,) * 3, (0.0,) * 3), Pose((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))
    pull, estimate = Spatial((0.3, -0.2, -1.9), (0.2, 0.1, -0.05)), Estimate(place, none)
    # It has long been pulled, and is at rest after a period in which it was pulled, too.
    memory = nothing_observed(numbers, chain, estimate)
    about = np.subtract(pull.angular, np.cross(memory.center, pull.linear))
    before = Spatial(tuple(-T * np.array(pull.linear)), tuple(-T * about))
    memory = memory._replace(wrench=pull, momentum=before)
    goes_on = observed(numbers, Halves(1.0, 1.0), chain, estimate, memory)
    np.testing.assert_allclose(flat(goes_on.wrench), flat(pull), atol=1e-12)
    told = observed(numbers, Halves(1.0, 1.0), chain, estimate, less(numbers, memory, pull))
    np.testing.assert_allclose(flat(told.wrench), 0.0, atol=1e-12)  # rounding of 24 N of weight


def test_an_integrator_is_relieved_of_what_it_holds_and_of_no_more():
    vehicle = load_vehicle("fullam")
    law = make_controller("dc-pid", vehicle)
    joints = [None] * 4
    place_joints(law.links, [JointMotion(a, 0.0, 0.0) for a in (-1.5, 0.0, -0.7, 0.0)], joints)
    chain = Chain(law.links, joints)
    attitude = np.array([0.1, -0.2, 0.3, 0.9]) / np.linalg.norm([0.1, -0.2, 0.3, 0.9])
    none = Spatial((0.0,) * 3, (0.0,) * 3)
    estimate = Estimate(Pose((0.0,) * 3, tuple(attitude.tolist())), none)
    R = rotation_matrix(estimate.pose.attitude)
    held = np.array([0.2, -0.1, 0.8, 1.0, -2.0, 0.3])
    # The wrench that an integrator of this acceleration gives, of the vehicle as one body.
    given, _ = root_wrench(chain, R, none.angular, record(Spatial, held), 0.0)
    pull = record(Spatial, -np.array(flat(given)))
    memory = PidMemory(record(Spatial, held))
    relieved = law.kernels.relieved
    left = relieved(None, chain, estimate, memory, pull).integral
    np.testing.assert_allclose(flat(left), 0.0, atol=1e-13)
    half = record(Spatial, 0.5 * np.array(flat(pull)))
    left = relieved(None, chain, estimate, memory, half).integral
    np.testing.assert_allclose(flat(left), 0.5 * held, atol=1e-13)
    other = PidMemory(record(Spatial, -held))  # holds against something else
    assert relieved(None, chain, estimate, other, pull) == other
    small = PidMemory(record(Spatial, 0.3 * held))
    np.testing.assert_array_equal(flat(relieved(None, chain, estimate, small, pull).integral), 0.0)
