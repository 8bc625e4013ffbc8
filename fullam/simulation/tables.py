"""What the flights of a plan share whatever their seed: the tables of the plan as rows.

Made once, read by every thread, written by none.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fullam.control.allocation import Allocator
from fullam.control.controller import Controller
from fullam.control.estimator import Estimator
from fullam.control.governor import Governor
from fullam.control.signals import Ahead, Target
from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.placing import PlaceView, place
from fullam.dynamics.recursion import Joint, JointMotion
from fullam.model.chain import LinkChain
from fullam.numbers.program import Stage, program
from fullam.numbers.records import Rows
from fullam.numbers.vectors import Vector
from fullam.simulation.draws import Draws
from fullam.simulation.flight_plan import (
    DIVERGENCE_PERIOD,
    FlightPlan,
    hover_speeds,
    make_estimator,
)
from fullam.simulation.plants.plant import Stepping
from fullam.simulation.stages import Bounds, Rates

Array = NDArray[np.float64]


class Tables:
    """A plan as rows.

    Attributes:
        plan: The plan, under any seed.
        links: The nominal vehicle's links.
        targets: What the law is asked to follow, a row a control period.
        ahead: The anticipation, a row a control period; zeros if the plan has none.
        motions: The arm's motion, `arm_stride` rows a half step of the plant (a still arm has one
            row and stride 0).
        arm_stride: 1, or 0 for a still arm.
        joint_rows: Rows of the arm in a control period.
        stepping: How the plant is integrated.
        rates: How the sensors are read.
        governor: The governor's numbers, and whether it is on.
        thrust_coefficients: k_f of the nominal rotors, n_r numbers.
        bounds: Bounds of sense.
    """

    def __init__(self, plan: FlightPlan) -> None:
        """Lay out the rows."""
        self.plan = plan
        s, nominal, reference, arm = plan.simulation, plan.nominal, plan.reference, plan.arm
        self.link_rows = LinkRows.of(LinkChain.from_model(nominal.model))
        self.links = self.link_rows.rows
        targets = [reference.pose, reference.velocity, reference.acceleration]
        self.targets = Rows(Target, np.hstack(targets))
        ahead = plan.anticipation
        rows = Rows.empty(Ahead, len(plan.t)) if ahead is None else ahead.rows
        self.ahead: Rows = rows
        motion = np.stack([arm.theta, arm.dtheta, arm.ddtheta], axis=-1)
        self.arm_stride = int(bool(np.any(motion != motion[0])))
        self.motions = Rows(JointMotion, motion if self.arm_stride else motion[:1])
        self.joint_rows = Rows(float, [[2 * s.substeps * self.arm_stride]])
        numbers = [s.plant_period, s.substeps, self.arm_stride, nominal.gravity]
        self.stepping = Rows(Stepping, [numbers])
        half_angle = 0.5 * np.radians(min(s.max_attitude_error_deg, 360.0))
        every = max(1, round(DIVERGENCE_PERIOD / s.control_period))
        self.thrust_coefficients = Rows(float, nominal.rotors.k_f[:, None])
        governor: Governor = s.governor or Governor()
        self.is_governed = s.governor is not None
        self.governor = governor.numbers(
            nominal.mass * nominal.gravity,
            s.control_period,
            None if plan.trim is None else plan.trim.up,
        )
        self.rates = Rows(Rates, [[s.pose_every, nominal.gravity]])
        mask = np.array(plan.scenario.axes_mask[:3], dtype=float)
        cosine = np.cos(half_angle) if half_angle < 0.5 * np.pi else 0.0
        self.bounds = Rows(Bounds, [[s.max_position_error**2, cosine, *mask, every]])

    @property
    def periods(self) -> int:
        """Control periods of the flight."""
        return len(self.plan.t)

    def controller(self) -> Controller:
        """A fresh law on the nominal vehicle."""
        return self.plan.make_controller()

    def estimator(self) -> Estimator:
        """A fresh estimator."""
        return make_estimator(self.plan.simulation, self.plan.weather, self.plan.nominal.gravity)

    @cached_property
    def allocator(self) -> Allocator:
        """The allocation of the nominal rotors, packed; what flies has memories of its own."""
        plan = self.plan
        axes = np.array(plan.scenario.axes_mask)
        return Allocator(plan.nominal.rotors, axes=axes, vehicle_name=plan.nominal.name)

    @cached_property
    def draws(self) -> Draws:
        """Draws the weather and the true vehicle of any seed."""
        plan = self.plan
        return Draws.of(plan.nominal, plan.weather, plan.t, plan.simulation.plant_period)

    @cached_property
    def initial_pose(self) -> Array:
        """Where the flight begins, [p, quaternion xyzw], shape (7,)."""
        return np.array(self.plan.scenario.initial_pose)

    @cached_property
    def hover(self) -> Array:
        """Rotor speeds at take-off, shape (n_r,) [rad/s]."""
        return hover_speeds(self.plan, self.allocator)

    @cached_property
    def placed(self) -> tuple[Rows, Rows]:
        """Joints of the nominal arm on the half-step grid, and the centres of mass with them."""
        rows, n = self.motions.array.shape[:2]
        joints, centers = Rows.empty(Joint, rows, n), Rows.empty(Vector, rows)
        view = PlaceView(self.links, self.motions, joints, centers)
        program([Stage(place, view)]).run(0, rows)
        return joints, centers
