"""The prescribed-arm plant against forward dynamics, conservation laws and its own order."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.dynamics.integrators import INTEGRATORS, integrator
from fullam.dynamics.pose_space import pose_from_euler
from fullam.exceptions import UnknownName
from fullam.model.loading import load_vehicle
from fullam.simulation.motions.arm_motion import ArmTable, HoldArm, SineRate

ABA_TOLERANCE = 1e-9
"""Relative. ABA inverts the joint-space inertia link by link, the plant solves six rows;
with link inertias down to 1e-5 kg m^2 beside 2 kg some five digits go in the conditioning."""

SPEEDS = np.array([310.0, 420.0, 365.0, 300.0, 450.0, 380.0, 330.0, 405.0])
"""An uneven set of rotor speeds [rad/s]: all six components of the wrench are excited."""


@pytest.fixture
def make_plant(plant_of):
    """Makes a plant with a spinning start, flown for a while."""

    def make(
        vehicle, motion, duration, dt, scheme="rk4", route="pinocchio", speeds=None, commands=None
    ):
        steps = round(duration / dt)
        t = np.arange(2 * steps + 1) * (0.5 * dt)
        theta = np.linspace(-0.8, 0.5, vehicle.n_arm)
        pose = pose_from_euler(np.array([1.0, -2.0, 3.0]), np.array([0.3, -0.4, 0.5]))
        speeds = np.zeros(vehicle.rotors.count) if speeds is None else speeds
        plant = plant_of(vehicle, motion.tabulate(t, theta), pose, speeds, dt, scheme, route)
        plant.v = np.array([0.4, -0.3, 0.2, 1.0, -1.4, 0.8])
        plant.advance(speeds if commands is None else commands, None, steps)
        return plant

    return make


def whole(vehicle, motion, plant, t):
    """Configuration and velocity of the vehicle at time t."""
    arm = motion.tabulate(np.array([0.0, t]), np.linspace(-0.8, 0.5, vehicle.n_arm))
    return np.append(plant.q, arm.theta[1]), np.append(plant.v, arm.dtheta[1])


@pytest.mark.parametrize("name", ["fullam", "hextilt", "borinot"])
def test_agrees_with_aba_driven_by_the_joint_torques_that_rnea_asks_for(name, route, plant_of, rng):
    """Some rates are evaluated by one step of Euler's rule, at its start, rotors without lag."""
    vehicle = load_vehicle(name)
    model, data = vehicle.model, vehicle.create_data()
    n = vehicle.n_arm
    for _ in range(50):
        theta, dtheta, ddtheta = rng.normal(size=(3, n))
        table = ArmTable(*(np.tile(x, (3, 1)) for x in (theta, dtheta, ddtheta)))
        speeds = rng.uniform(0.0, 1.0, vehicle.rotors.count) * vehicle.rotors.max_speeds
        pose = pose_from_euler(rng.normal(size=3), rng.uniform(-1.0, 1.0, 3))
        plant = plant_of(vehicle, table, pose, speeds, 0.001, "semi-implicit-euler", route)
        plant.v = rng.normal(size=6)
        gust = rng.normal(size=6)
        q, v = np.append(plant.q, theta), np.append(plant.v, dtheta)
        plant.advance(speeds, gust)
        a = np.append(plant.acceleration, ddtheta)
        R = pin.Quaternion(q[3:7]).toRotationMatrix()
        wrench_A = vehicle.rotors.wrench(speeds) + (gust.reshape(2, 3) @ R).ravel()
        tau = pin.rnea(model, data, q, v, a)
        tau[:6] = wrench_A
        a_aba = pin.aba(model, data, q, v, tau)
        np.testing.assert_allclose(a, a_aba, rtol=0, atol=ABA_TOLERANCE * np.abs(a_aba).max())


def test_momentum_is_conserved_in_free_fall_while_the_arm_moves(make_plant, route):
    """No thrust: the momentum about the moving centre of mass is constant, the linear one falls.

    Tolerance: RK4 at 1 ms keeps the momenta to its truncation error, 1e-10 here; they are of the
    order of 1 N s and 0.1 N m s.
    """
    vehicle = load_vehicle("fullam")
    motion, dt, T = SineRate(joint=2, rate=2.0, frequency=3.0), 0.001, 0.5
    momenta = []
    for duration in (dt, T):
        plant = make_plant(vehicle, motion, duration, dt, route=route)
        q, v = whole(vehicle, motion, plant, duration)
        h = pin.computeCentroidalMomentum(vehicle.model, vehicle.create_data(), q, v)
        momenta.append(np.array(h.vector))
    fall = vehicle.mass * vehicle.gravity * (T - dt)
    momenta[0][2] -= fall
    np.testing.assert_allclose(momenta[1], momenta[0], rtol=0, atol=1e-9)


def test_energy_is_conserved_in_free_fall_with_the_arm_held(make_plant, route):
    """A held arm does no work. Tolerance: RK4 truncation at 1 ms, on 60 J."""
    vehicle = load_vehicle("fullam")
    data = vehicle.create_data()
    energies = []
    for duration in (0.001, 0.5):
        plant = make_plant(vehicle, HoldArm(), duration, 0.001, route=route)
        q, v = whole(vehicle, HoldArm(), plant, duration)
        energies.append(
            pin.computeKineticEnergy(vehicle.model, data, q, v)
            + pin.computePotentialEnergy(vehicle.model, data, q)
        )
    assert abs(energies[1] - energies[0]) < 1e-9 * abs(energies[0])


@pytest.mark.parametrize("scheme", sorted(INTEGRATORS))
def test_the_order_of_each_integrator_is_what_it_claims(scheme, make_plant):
    """Slope of log error over log dt against an RK4 run 16 times finer; 0.1 for round numbers."""
    vehicle = load_vehicle("fullam")
    motion, T = SineRate(joint=3, rate=1.5, frequency=2.0), 0.32
    commands = 0.9 * SPEEDS

    def end(dt, name):
        plant = make_plant(vehicle, motion, T, dt, name, "recursion", SPEEDS, commands)
        return np.concatenate([plant.q, plant.v])

    exact = end(0.00025, "rk4")
    steps = np.array([0.016, 0.008, 0.004])
    errors = [np.linalg.norm(end(dt, scheme) - exact) for dt in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(integrator(scheme).order, abs=0.1)


def test_rotor_lag_is_exact_between_steps(make_plant):
    vehicle = load_vehicle("fullam")
    plant = make_plant(vehicle, HoldArm(), 0.05, 0.005, speeds=SPEEDS, commands=0.5 * SPEEDS)
    decay = np.exp(-0.05 / vehicle.rotors.lags)
    np.testing.assert_allclose(plant.speeds, 0.5 * SPEEDS * (1.0 + decay), rtol=1e-13)


def test_unknown_integrator_lists_the_known():
    with pytest.raises(UnknownName, match="rk4"):
        integrator("rk5")
