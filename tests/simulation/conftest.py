"""What the tests of the simulation share: the plants alone, rotors or servos told what to do."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.dynamics.articulated import ArmRows
from fullam.dynamics.integrators import integrator
from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.placing import PlaceView, place
from fullam.dynamics.recursion import Joint, JointMotion
from fullam.dynamics.servo import ServoNumbers
from fullam.dynamics.spatial import Pose, Spatial
from fullam.model.chain import LinkChain
from fullam.numbers.records import Rows, flat, record
from fullam.numbers.vectors import ZERO
from fullam.simulation.plants.plant import (
    PinocchioRate,
    PlantView,
    State,
    Stepping,
    advance,
    twist_rate,
)
from fullam.simulation.plants.servo_motion import NoWorld, ServoView, Slope, servo_stage
from fullam.simulation.true_vehicle import RotorFactors, nominal_rows, rotor_row

ROUTES = ("pinocchio", "recursion")
"""What yields the derivative of the twist: what Python flies with, and what machine code does."""


class Plant:
    """The plant's kernels in Python, one step a call, on the half-step rows of an arm's table."""

    def __init__(self, vehicle, arm, pose, speeds, period, scheme="midpoint", route="pinocchio"):
        motion = np.stack([arm.theta, arm.dtheta, arm.ddtheta], axis=-1)
        motions, links = Rows(JointMotion, motion), LinkRows.of(LinkChain.from_vehicle(vehicle))
        self._rate, arm_rows = PinocchioRate(vehicle), motions.to_list()
        if route == "recursion":
            self._rate, arm_rows = twist_rate, self._placed(links.rows, motions)
        own, nominal = RotorFactors(1.0, 1.0, 1.0), nominal_rows(vehicle, period)
        rotors = [rotor_row(r, own, period) for r in nominal.rotors.to_list()]
        at_rest, still = Spatial(ZERO, ZERO), [Spatial(ZERO, ZERO)] * (len(motion) // 2 + 1)
        self.view = PlantView(
            [State(record(Pose, pose), at_rest, at_rest)],
            links.rows.to_list(),
            arm_rows,
            rotors,
            [Stepping(period, 1.0, 1.0, vehicle.gravity)],
            still,
            speeds.tolist(),
            speeds.tolist(),
        )
        self._rule, self._k = integrator(scheme).step, 0

    @staticmethod
    def _placed(links, motions):
        joints = Rows.empty(Joint, *motions.array.shape[:2]).to_list()
        view = PlaceView(links.to_list(), motions.to_list(), joints, {})
        for k in range(len(joints)):
            place(view, k)
        return joints

    def advance(self, commands, gust=None, steps=1):
        """Some steps under commanded speeds, and a gust in world axes."""
        self.view.commands[:] = commands.tolist()
        for _ in range(steps):
            if gust is not None:
                self.view.gusts[self._k] = record(Spatial, gust)
            advance(self._rule, self._rate, self.view, self._k)
            self._k += 1

    @property
    def state(self):
        return self.view.state[0]

    @property
    def q(self):
        """Pose, shape (7,)."""
        return np.array([*flat(self.state.pose)])

    @property
    def v(self):
        """Twist in body axes, shape (6,)."""
        return np.array([*flat(self.state.twist)])

    @v.setter
    def v(self, twist):
        self.view.state[0] = self.state._replace(twist=record(Spatial, twist))

    @property
    def acceleration(self):
        """Derivative of the twist evaluated last, shape (6,)."""
        return np.array([*flat(self.state.acceleration)])

    @property
    def speeds(self):
        return np.array(self.view.speeds)


class Free:
    """A vehicle in motion without thrust, its servos as given; the plant's kernels in Python."""

    def __init__(self, vehicle, scheme, step, servo, gravity=9.81, move=None):
        n, rng = vehicle.n_arm, np.random.default_rng(7)
        self.model, self.n = vehicle.model, n
        still = Spatial(ZERO, ZERO)
        twist = Spatial((0.3, -0.2, 0.5), (0.4, 0.9, -0.6))
        rows = [ServoNumbers(*row) for row in vehicle.servos.rows.tolist()]
        servos = [servo(row) for row in rows]
        self.armature = np.array([s.armature for s in servos])
        moves = rng.uniform(-1.0, 1.0, (n, 2)).tolist()
        self.view = ServoView(
            [State(Pose((0.0, 0.0, 2.0), (0.0, 0.0, 0.0, 1.0)), twist, still)],
            LinkRows.of(LinkChain.from_vehicle(vehicle)).rows.to_list(),
            [],
            [Stepping(step, 1.0, 0.0, gravity)],
            [still] * 4000,
            [],
            [],
            servos,
            rng.uniform(-1.0, 1.0, n).tolist(),
            [JointMotion(q, v, 0.0) for q, v in moves],
            [Slope(0.0, 0.0)] * n,
            [Slope(0.0, 0.0)] * n,
            [0.0] * n,
            ArmRows(*(r.to_list() for r in ArmRows.empty(n))),
            NoWorld(),
        )
        self.move = move or servo_stage(scheme)
        self.step, self.gravity = step, gravity

    def fly(self, time):
        for k in range(round(time / self.step)):
            self.move(self.view, k)
        return self

    @property
    def q(self):
        return np.array([*flat(self.view.state[0].pose), *(m.position for m in self.view.arm)])

    @property
    def v(self):
        return np.array([*flat(self.view.state[0].twist), *(m.rate for m in self.view.arm)])

    @property
    def energy(self):
        data = self.model.createData()
        rotors = 0.5 * self.armature @ self.v[6:] ** 2
        kinetic = pin.computeKineticEnergy(self.model, data, self.q, self.v)
        mass, center = pin.computeTotalMass(self.model), pin.centerOfMass(self.model, data, self.q)
        return kinetic + rotors + mass * self.gravity * center[2]

    @property
    def momentum(self):
        data = self.model.createData()
        return np.array(pin.computeCentroidalMomentum(self.model, data, self.q, self.v))


def no_servo(row):
    """A joint that turns freely, its motor's rotor on it."""
    return ServoNumbers(0.0, 0.0, 0.0, row.armature, 0.0, -np.inf, np.inf, 0.0)


@pytest.fixture
def plant_of():
    """Makes a `Plant`."""
    return Plant


@pytest.fixture(params=ROUTES)
def route(request):
    return request.param


@pytest.fixture
def free_of():
    """Makes a `Free`."""
    return Free


@pytest.fixture
def free_joint():
    """A servo without torque."""
    return no_servo
