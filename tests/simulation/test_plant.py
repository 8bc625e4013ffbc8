"""The prescribed-arm plant against forward dynamics, conservation laws and its own order."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.dynamics.integrators import INTEGRATORS, integrator
from fullam.dynamics.multibody import Multibody
from fullam.dynamics.pose_space import pose_from_euler
from fullam.exceptions import UnknownName
from fullam.model.loading import load_vehicle
from fullam.simulation.arm_motion import ArmTable, HoldArm, SineRate
from fullam.simulation.plant import Plant

ABA_TOLERANCE = 1e-9
"""Relative. ABA inverts the joint-space inertia link by link and the plant the 6 x 6 base block;
with link inertias down to 1e-5 kg m^2 beside 2 kg some five digits go in the conditioning."""

SPEEDS = np.array([310.0, 420.0, 365.0, 300.0, 450.0, 380.0, 330.0, 405.0])
"""An uneven set of rotor speeds [rad/s]: all six components of the wrench are excited."""


def make_plant(vehicle, motion, duration, dt, scheme="rk4", speeds=None, commands=None):
    """A plant with a spinning start, flown for `duration`."""
    steps = round(duration / dt)
    t = np.arange(2 * steps + 1) * (0.5 * dt)
    theta = np.linspace(-0.8, 0.5, vehicle.n_arm)
    pose = pose_from_euler(np.array([1.0, -2.0, 3.0]), np.array([0.3, -0.4, 0.5]))
    speeds = np.zeros(vehicle.rotors.count) if speeds is None else speeds
    plant = Plant(vehicle, motion.tabulate(t, theta), pose, speeds, dt, scheme)
    plant.v[:6] = 0.4, -0.3, 0.2, 1.0, -1.4, 0.8
    plant.advance(speeds if commands is None else commands, None, steps)
    return plant


@pytest.mark.parametrize("name", ["fullam", "hextilt", "borinot"])
def test_agrees_with_aba_driven_by_the_joint_torques_that_rnea_asks_for(name, rng):
    vehicle = load_vehicle(name)
    model, data = vehicle.model, vehicle.create_data()
    n = vehicle.n_arm
    for _ in range(50):
        theta, dtheta, ddtheta = rng.normal(size=(3, n))
        table = ArmTable(*(np.tile(x, (3, 1)) for x in (theta, dtheta, ddtheta)))
        speeds = rng.uniform(0.0, 1.0, vehicle.rotors.count) * vehicle.rotors.max_speeds
        pose = pose_from_euler(rng.normal(size=3), rng.uniform(-1.0, 1.0, 3))
        plant = Plant(vehicle, table, pose, speeds, 0.001, "midpoint")
        plant.v[:6] = rng.normal(size=6)
        gust = rng.normal(size=6)
        plant.hold(speeds, gust)
        q, v = plant.q.copy(), plant.v.copy()
        a = plant._acceleration(0, q, v).copy()
        R = pin.Quaternion(q[3:7]).toRotationMatrix()
        wrench_A = vehicle.rotors.wrench(speeds) + (gust.reshape(2, 3) @ R).ravel()
        tau = pin.rnea(model, data, q, v, a)
        tau[:6] = wrench_A
        a_aba = pin.aba(model, data, q, v, tau)
        np.testing.assert_allclose(a, a_aba, rtol=0, atol=ABA_TOLERANCE * np.abs(a_aba).max())


@pytest.mark.parametrize("name", ["fullam", "hextilt", "borinot"])
def test_drives_of_endless_inertia_solve_the_six_rows_of_the_platform(name, rng):
    """One ABA call on the driven model against RNEA, the composite inertia and a 6 x 6 solve."""
    vehicle, n = load_vehicle(name), load_vehicle(name).n_arm
    witness = Multibody(vehicle)
    for _ in range(50):
        theta, dtheta, ddtheta = rng.normal(size=(3, n))
        table = ArmTable(*(np.tile(x, (3, 1)) for x in (theta, dtheta, ddtheta)))
        speeds = rng.uniform(0.0, 1.0, vehicle.rotors.count) * vehicle.rotors.max_speeds
        pose = pose_from_euler(rng.normal(size=3), rng.uniform(-1.0, 1.0, 3))
        plant = Plant(vehicle, table, pose, speeds, 0.001, "midpoint")
        plant.v[:6] = rng.normal(size=6)
        plant.hold(speeds, None)
        a = plant._acceleration(0, plant.q, plant.v)
        expected = witness.base_acceleration(
            plant.q, plant.v, ddtheta, vehicle.rotors.wrench(speeds)
        )
        np.testing.assert_allclose(
            a[:6], expected, rtol=0, atol=ABA_TOLERANCE * np.abs(expected).max()
        )
        np.testing.assert_allclose(a[6:], ddtheta, rtol=0, atol=ABA_TOLERANCE)


@pytest.mark.parametrize("motion", [HoldArm(), SineRate(joint=2, rate=0.7, frequency=3.0)])
def test_the_loop_written_out_is_the_midpoint_rule_bit_for_bit(motion):
    vehicle, ends = load_vehicle("fullam"), []
    for written_out in (True, False):
        table = motion.tabulate(np.arange(61) * 0.0005, np.array([0.1, -0.2, 0.3, 0.4]))
        pose = pose_from_euler(np.zeros(3), np.array([0.3, -0.4, 0.5]))
        plant = Plant(vehicle, table, pose, SPEEDS, 0.001, "midpoint")
        plant.v[:6] = 0.4, -0.3, 0.2, 1.0, -1.4, 0.8
        plant._is_midpoint = written_out
        for _ in range(3):
            plant.advance(SPEEDS * 1.1, None, 10)
        ends.append(np.concatenate([plant.q, plant.v, plant.speeds, plant.acceleration]))
    np.testing.assert_array_equal(ends[0], ends[1])


def test_momentum_is_conserved_in_free_fall_while_the_arm_moves():
    """No thrust: the momentum about the moving centre of mass is constant, the linear one falls.

    Tolerance: RK4 at 1 ms keeps the momenta to its truncation error, 1e-10 here; they are of the
    order of 1 N s and 0.1 N m s.
    """
    vehicle = load_vehicle("fullam")
    motion, dt, T = SineRate(joint=2, rate=2.0, frequency=3.0), 0.001, 0.5
    momenta = []
    for duration in (dt, T):
        plant = make_plant(vehicle, motion, duration, dt)
        h = pin.computeCentroidalMomentum(vehicle.model, vehicle.create_data(), plant.q, plant.v)
        momenta.append(np.array(h.vector))
    fall = vehicle.mass * vehicle.gravity * (T - dt)
    momenta[0][2] -= fall
    np.testing.assert_allclose(momenta[1], momenta[0], rtol=0, atol=1e-9)


def test_energy_is_conserved_in_free_fall_with_the_arm_held():
    """A held arm does no work. Tolerance: RK4 truncation at 1 ms, on 60 J."""
    vehicle = load_vehicle("fullam")
    data = vehicle.create_data()
    energies = []
    for duration in (0.001, 0.5):
        plant = make_plant(vehicle, HoldArm(), duration, 0.001)
        energies.append(
            pin.computeKineticEnergy(vehicle.model, data, plant.q, plant.v)
            + pin.computePotentialEnergy(vehicle.model, data, plant.q)
        )
    assert abs(energies[1] - energies[0]) < 1e-9 * abs(energies[0])


@pytest.mark.parametrize("scheme", sorted(INTEGRATORS))
def test_the_order_of_each_integrator_is_what_it_claims(scheme):
    """Slope of log error over log dt against an RK4 run 16 times finer; 0.1 for round numbers."""
    vehicle = load_vehicle("fullam")
    motion, T = SineRate(joint=3, rate=1.5, frequency=2.0), 0.32
    commands = 0.9 * SPEEDS

    def end(dt, name):
        plant = make_plant(vehicle, motion, T, dt, name, speeds=SPEEDS, commands=commands)
        return np.concatenate([plant.q, plant.v])

    exact = end(0.00025, "rk4")
    steps = np.array([0.016, 0.008, 0.004])
    errors = [np.linalg.norm(end(dt, scheme) - exact) for dt in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(integrator(scheme).order, abs=0.1)


def test_rotor_lag_is_exact_between_steps():
    vehicle = load_vehicle("fullam")
    plant = make_plant(vehicle, HoldArm(), 0.05, 0.005, speeds=SPEEDS, commands=0.5 * SPEEDS)
    decay = np.exp(-0.05 / vehicle.rotors.lags)
    np.testing.assert_allclose(plant.speeds, 0.5 * SPEEDS * (1.0 + decay), rtol=1e-13)


def test_unknown_integrator_lists_the_known():
    with pytest.raises(UnknownName, match="rk4"):
        integrator("rk5")
