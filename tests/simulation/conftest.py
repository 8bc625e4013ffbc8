"""What the tests of the simulation share: the plant alone, its rotors told what to do."""

import numpy as np
import pytest

from fullam.dynamics.integrators import integrator
from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.placing import PlaceView, place
from fullam.dynamics.recursion import Joint, JointMotion
from fullam.dynamics.spatial import Pose, Spatial
from fullam.model.chain import LinkChain
from fullam.numbers.records import Rows, flat, record
from fullam.numbers.vectors import ZERO
from fullam.simulation.plant import (
    PinocchioRate,
    PlantView,
    State,
    Stepping,
    advance,
    twist_rate,
)
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


@pytest.fixture
def plant_of():
    """Makes a `Plant`."""
    return Plant


@pytest.fixture(params=ROUTES)
def route(request):
    return request.param
