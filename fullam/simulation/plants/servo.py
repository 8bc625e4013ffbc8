"""The plant whose joints are free, and moved by position servos; see `servo_motion`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.control.arm_feedback import (
    DIFFERENCE_LAG,
    FEEDBACK,
    LONGEST_STEP,
    EncodeView,
    FeedbackNumbers,
)
from fullam.control.arm_goals import FEED_FORWARD, GoalNumbers, GoalView, steer
from fullam.dynamics.articulated import ArmRows
from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.placing import PlaceView
from fullam.dynamics.recursion import Joint, JointMotion, Link
from fullam.dynamics.servo import ServoNumbers
from fullam.model.chain import LinkChain
from fullam.numbers.program import Stage
from fullam.numbers.records import Rows
from fullam.numbers.vectors import Vector
from fullam.simulation.payloads.carrying import Carried
from fullam.simulation.payloads.payload import LoadView, load, load_rows
from fullam.simulation.plants.kind import Plant, PythonStage, SeenArm, Surroundings
from fullam.simulation.plants.servo_motion import (
    ArmEntry,
    ArmRecordView,
    NoWorld,
    PinocchioJoints,
    ServoView,
    Slope,
    no_contact,
    record_arm,
    servo_stage,
)
from fullam.simulation.plants.settings import ServoSettings, plant_settings
from fullam.simulation.tool.track import ToolView, tool_point, write_tool
from fullam.simulation.world.contact import TouchView, record_touch, touch, world_rows

Array = NDArray[np.float64]


class ServoPlant(Plant):
    """Free joints: goals go to their servos, and encoders tell of them.

    Attributes:
        servos: `ServoNumbers` of the joints, which all flights share.
        goals: The servos' goals.
        entries: The joints' part of the record, (periods, n), if it is kept.
        world: What the tool may touch, `contact.World`; None if there is nothing.
        loads: What the tool carries and when, `Load` rows; None if it never carries anything.
        links: The true links, with what is carried.
        touches: See `Plant`; kept with the record.
    """

    name = "servo"

    def __init__(self, around: Surroundings) -> None:
        """Make the rows."""
        super().__init__(around)
        plan, n = around.tables.plan, around.tables.plan.nominal.n_arm
        settings = plant_settings(self.name, plan.simulation.plant_settings)
        assert isinstance(settings, ServoSettings)
        self.settings = settings
        self.servos = Rows(ServoNumbers, plan.nominal.servos.rows)
        # For each lane, as the true ones are: what is placed on them has lanes from the first on.
        own, links = self._empty(Link, n + 1), around.tables.links.array
        own.array[:] = links[..., None] if around.lanes else links
        self.arm: Rows = self._empty(JointMotion, n)
        self.goals = self._empty(float, n)
        self._slopes, self._sums = self._empty(Slope, n), self._empty(Slope, n)
        self._rates = self._empty(float, n)
        self._memory = self._empty(JointMotion, n)
        self._room = ArmRows.empty(n, around.lanes)
        self._twin_room = ArmRows.empty(n, around.lanes)
        self.entries = self._empty(ArmEntry, around.kept, n)
        surfaces = plan.scenario.world
        self.world = world_rows(plan.nominal, surfaces) if surfaces else None
        self._contact = no_contact if self.world is None else touch
        self.touches: Rows = self._empty(Vector, around.kept)
        if plan.scenario.tool is not None and not around.kept:
            self.tool = self._empty(Vector, around.tables.periods)
        payloads, period = plan.scenario.payloads, plan.simulation.control_period
        self.loads = load_rows(plan.nominal, payloads, period) if payloads else None
        known = [body for body in payloads if body.known]
        learned = [body for body in payloads if not body.known and settings.payload == "learned"]
        if known or learned:
            self.carried = Carried(plan.nominal, period, own, known, learned)
        self.links = around.drawn.links if self.loads is None else self._empty(Link, n + 1)
        self.seen = SeenArm(
            own,
            self._empty(JointMotion, 1, n),
            self._empty(Joint, 1, n),
            self._empty(Vector, 1),
            Rows(float, [[0.0]]),
        )

    def _empty(self, record: Any, *lengths: int) -> Rows:
        return Rows.empty(record, *lengths, lanes=self.around.lanes)

    def begin(self) -> None:
        """Stand where the arm's motion begins, encoders and twin as well."""
        start = self.around.tables.motions.array[0]
        for rows in (self.arm, self._memory):
            rows.array[:] = start[..., None] if self.around.lanes else start
        self._memory.array[:, 1:] = 0.0
        for rows in (self._slopes, self._sums, self.goals, self.seen.motions):
            rows.array[:] = 0.0
        if self.carried is not None:
            self.carried.begin()

    def stages(self) -> dict[str, Stage]:
        """See `Plant`."""
        name = self.around.tables.plan.simulation.integrator
        return self._own_stages() | {
            "move": Stage(servo_stage(name, contact=self._contact), self._view())
        }

    def python_stages(self, look: Callable[[Any], Any]) -> dict[str, PythonStage]:
        """See `Plant`; by Pinocchio."""
        plan = self.around.tables.plan
        solve = PinocchioJoints(plan.true, plan.nominal.servos)
        move = servo_stage(plan.simulation.integrator, solve, self._contact)
        own = {name: (s.kernel, look(s.view)) for name, s in self._own_stages().items()}
        if self.loads is not None:
            frame = LinkRows.of(LinkChain.from_model(plan.nominal.model)).frames[-1]
            own["load"] = (carrying(solve, frame), own["load"][1])
        return own | {"move": (move, look(self._view()))}

    def _own_stages(self) -> dict[str, Stage]:
        stages = {
            "steer": Stage(steer, self._goal_view()),
            "encode": Stage(FEEDBACK[self.settings.feedback], self._encode_view()),
        }
        if self.loads is not None:
            carried = LoadView(self.links, self.around.drawn.links, self.loads)
            stages["load"] = Stage(load, carried)
        if self.carried is not None:
            stages |= self._carrying(self.carried)
        if self.tool is not None:
            point = tool_point(self.around.tables.plan.nominal)
            room = self._room.joints
            held = ToolView(self.around.state, self.seen.links, self.arm, room, point, self.tool)
            stages["record tool"] = Stage(write_tool, held)
        if self.around.kept:
            view = ArmRecordView(self.arm, self.servos, self.goals, self.seen.motions, self.entries)
            stages["record arm"] = Stage(record_arm, view)
            if self.world is not None:
                touched = TouchView(
                    self.around.state,
                    self.links,
                    self.arm,
                    self._room,
                    self.world,
                    self.touches,
                )
                stages["record touch"] = Stage(record_touch, touched)
        return stages

    @property
    def _arm_links(self) -> Rows:
        """The links as the servos' goals and the twin know them."""
        return self.seen.links if self.carried is None else self.carried.links

    def _carrying(self, carried: Carried) -> dict[str, Stage]:
        a, seen = self.around, self.seen
        placed = seen.joints, seen.rows, a.estimate
        stages = carried.stages(*placed, a.target, a.command, a.delivery)
        if carried.learner is not None:
            stages["learn"] = carried.learner.stage(
                links=seen.links,
                joints=seen.joints,
                motions=seen.motions,
                joint_rows=seen.rows,
                estimate=a.estimate,
                ahead=a.tables.ahead,
                delivery=a.delivery,
            )
        return stages

    def _goal_view(self) -> GoalView:
        t = self.around.tables
        shares = FEED_FORWARD[self.settings.feed_forward]
        return GoalView(
            Rows.of(GoalNumbers, [GoalNumbers(*shares, t.plan.nominal.gravity)]),
            self._arm_links,
            self.servos,
            t.motions,
            t.joint_rows,
            self.around.estimate,
            self._twin_room,
            self.goals,
        )

    def _encode_view(self) -> EncodeView:
        t, seen = self.around.tables, self.seen
        period = t.plan.simulation.control_period
        numbers = FeedbackNumbers(
            period,
            self._twin_steps(period),
            t.plan.nominal.gravity,
            1.0 - math.exp(-period / DIFFERENCE_LAG),
        )
        return EncodeView(
            Rows.of(FeedbackNumbers, [numbers]),
            self.servos,
            self.goals,
            self.arm,
            t.motions,
            t.joint_rows,
            self.around.estimate,
            self._memory,
            self._twin_room,
            PlaceView(self._arm_links, seen.motions, seen.joints, seen.centers),
        )

    def _twin_steps(self, period: float) -> float:
        """Time steps of the twin in a control period."""
        servos = self.around.tables.plan.nominal.servos
        fastest = float(np.max(servos.damping / servos.armature, initial=0.0))
        return float(max(1, math.ceil(period * fastest / LONGEST_STEP - 0.05)))

    def _view(self) -> ServoView:
        a = self.around
        return ServoView(
            a.state,
            self.links,
            a.drawn.rotors,
            a.tables.stepping,
            a.drawn.gust,
            a.speeds,
            a.commands,
            self.servos,
            self.goals,
            self.arm,
            self._slopes,
            self._sums,
            self._rates,
            self._room,
            NoWorld() if self.world is None else self.world,
        )

    def columns(self, rows: int, lane: int, copy: bool) -> dict[str, Array]:
        """See `Plant`: the true arm, the servos' goals and torques, what the law was told."""
        entries = self.entries.array[:rows]
        entries = entries[..., lane] if self.around.lanes else entries
        names = "arm", "arm_rate", "arm_goal", "arm_torque", "measured_arm", "measured_arm_rate"
        found = {name: np.array(entries[..., i]) for i, name in enumerate(names)}
        touches = self.touches.array[:rows]
        return found | {
            "contact_force": np.array(touches[..., lane] if self.around.lanes else touches)
        }

    def remembered(self) -> Sequence[Rows]:
        """See `Plant`."""
        carried = () if self.carried is None else self.carried.remembered()
        return self.arm, self._memory, self.goals, *carried

    def steered_by(self, arm: Any, centers: Any, rows: Any) -> dict[str, dict[str, Any]]:
        """See `Plant`: the hand moves what the servos are asked."""
        wanted = {"motions": arm, "joint_rows": rows}
        return {"steer": wanted, "encode": wanted}


def carrying(solve: Any, frame: Array) -> Callable[[Any, int], None]:
    """The stage `load` that tells `solve` as well; `frame` turns the last row's axes to its."""

    def load_both(view: LoadView, k: int) -> None:
        load(view, k)
        solve.carry(view.links[-1], frame)

    return load_both
