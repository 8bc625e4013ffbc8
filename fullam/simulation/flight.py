"""One flight, flown by Python: any law, any estimator, Pinocchio as dynamics.

The flight is the list of stages that `stages` tells of. Those of law, estimator and plant are
Python's here: a law of the user's own class, the compensation read from Pinocchio's joint 1, the
true vehicle moved by Pinocchio. All others are the kernels that machine code flies, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.control.controller import Controller, Measurement
from fullam.control.estimator import Estimator, KernelEstimator, flies_as_kernel
from fullam.control.law_stage import LawStage
from fullam.control.signals import NOT_FINITE, Estimate
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial, rotate_spatial
from fullam.exceptions import NonFiniteWrench
from fullam.numbers.program import Lists
from fullam.numbers.records import flat, record
from fullam.simulation.block import Block, in_order
from fullam.simulation.flight_plan import FlightPlan, divergence
from fullam.simulation.plants.kind import PythonStage
from fullam.simulation.record.finish import finish
from fullam.simulation.record.run import Run
from fullam.simulation.tables import Tables

Array = NDArray[np.float64]


class Flight:
    """Flies a plan period by period, in Python.

    Iterate over `ticks()`; after each of them the row of that period is in the record and the
    vehicle stands at the next one. A viewer may stop at any tick; `run()` gives the record so far.

    Attributes:
        plan: What is flown.
        controller: The law.
        estimator: The estimator.
        stages: Name to (function, view): what each control period calls, in order. A study may put
            another function in the place of one.
        block: The rows that it flies on.
        lists: The same as Python reads them.
        outcome: "flying", "completed" or "diverged".
        reason: Why it diverged.
        ticks_flown: Rows of the record that are written.
    """

    def __init__(self, plan: FlightPlan) -> None:
        """Place the vehicle at the scenario's start, at rest, its rotors at hover speed."""
        self.plan = plan
        block = Block(Tables(plan))
        block.begin()
        block.load(plan)
        self.block, self.lists = block, Lists()
        self.controller: Controller = block.law
        self.estimator: Estimator = block.estimator
        self.stages = self._stages(block)
        self.outcome, self.reason = "flying", ""
        self.ticks_flown = 0

    def _stages(self, block: Block) -> dict[str, PythonStage]:
        look = self.lists.of
        law, estimator = LawStage(block.law), EstimateStage(block.estimator, self.plan)
        motions = block.plant.seen.motions
        stages: dict[str, PythonStage] = {
            name: (stage.kernel, look(stage.view)) for name, stage in block.common_stages().items()
        }
        stages |= {
            "estimate": (estimator, look(block.estimate_view())),
            "command": (law.command, look(block.command_view(motions))),
            "inform": (law.inform, look(block.share)),
        }
        if block.learns:
            stages["relieve"] = law.relieve, look(block.relieve_view())
        return in_order(stages | block.plant.python_stages(look))

    def ticks(self) -> Iterator[int]:
        """Fly; yields the number of each period once its row is written and it is flown."""
        while self.step():
            yield self.ticks_flown - 1

    def step(self) -> bool:
        """Fly the next period; whether there was one to fly, and its row is written."""
        k, last = self.ticks_flown, len(self.plan.t) - 1
        if self.outcome != "flying":
            return False
        if k > last:
            self.outcome = "completed"
            return False
        status = self.lists.of(self.block.status)
        for name, (stage, view) in self.stages.items():
            if k < last or name != "move":
                stage(view, k)
            if status[0].end <= k:
                self._end(k, status[0].cause)
                return False
        self.ticks_flown = k + 1
        return True

    def _end(self, k: int, cause: float) -> None:
        if cause == NOT_FINITE:
            command = self.lists.of(self.block.command)[0]
            raise NonFiniteWrench(np.array(flat(command.wrench)))
        self.outcome = "diverged"
        self.reason = divergence(self.plan, k, self.pose) or "not finite"

    # What one sees of it.

    @property
    def pose(self) -> Array:
        """True pose now, [p, quaternion xyzw], shape (7,)."""
        return np.array([*flat(self.lists.of(self.block.state)[0].pose)])

    @property
    def twist(self) -> Array:
        """True [v_A, w_A] now, body axes, shape (6,)."""
        return np.array([*flat(self.lists.of(self.block.state)[0].twist)])

    @property
    def rotor_speeds(self) -> Array:
        """True rotor speeds now, shape (n_r,) [rad/s]."""
        return np.array(self.lists.of(self.block.speeds))

    @property
    def estimate(self) -> Estimate:
        """What the law was told last."""
        told: Estimate = self.lists.of(self.block.estimate)[0]
        return told

    @property
    def saturated(self) -> bool:
        """Whether bounds kept the last command from being delivered."""
        return bool(self.lists.of(self.block.delivery)[0].saturated > 0.0)

    def run(self) -> Run:
        """The record so far."""
        self.lists.write_back()
        log = self.block.columns(self.ticks_flown)
        return finish(self.plan, log, self.outcome, self.reason, scene=self.block.plant.scene)


class EstimateStage:
    """The estimator as a stage: its kernel, or anybody's class with the face of an `Estimator`."""

    def __init__(self, estimator: Estimator, plan: FlightPlan) -> None:
        """Begin anew."""
        self._estimator, self._as_kernel = estimator, flies_as_kernel(type(estimator))
        self._measurement = Measurement(plan.nominal)
        self._begins = True

    def __call__(self, view: Any, k: int) -> None:
        """See `stages`."""
        estimator, readings = self._estimator, view.readings[0]
        begins, self._begins = k == 0 or self._begins, False
        if self._as_kernel:
            assert isinstance(estimator, KernelEstimator)
            view.estimate[0] = estimator.estimate(readings)
            return
        m = self._measurement
        if begins:
            estimator.reset(readings)
        estimator.update(readings, m)
        pose = record(Pose, m.q[:7])
        velocity = rotate_spatial(rotation_matrix(pose.attitude), record(Spatial, m.v[:6]))
        view.estimate[0] = Estimate(pose, velocity)
