"""A flight that can be touched while it flies, and flown again bit for bit.

It is `Flight` with four things in the hand's reach: the target, the arm, a wrench on the platform,
and who flies. All that a hand does is an `Intervention`, kept in the record's script; a moment that
has been flown can be gone back to, and flown on from in another way.
"""

from __future__ import annotations

import bisect
import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.control.signals import Ahead, Target
from fullam.control.trim import Trim
from fullam.dynamics.spatial import Spatial, add_spatial
from fullam.exceptions import InvalidInput
from fullam.numbers.blas import one_blas_thread
from fullam.numbers.records import Rows, flat, record
from fullam.simulation.flight import Flight
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.hands.crew import Aboard, CrewChange
from fullam.simulation.hands.force import NOTHING, Holds, felt, still_pushing
from fullam.simulation.hands.interventions import Intervention, intervention
from fullam.simulation.hands.servos import MovingArm, MovingCenters
from fullam.simulation.hands.snapshots import Saved, can_be_saved, saved_fields, saved_rows
from fullam.simulation.hands.state import Hands, Now
from fullam.simulation.hands.touch import Touch
from fullam.simulation.record.finish import finish, trim_data
from fullam.simulation.record.run import Run

Array = NDArray[np.float64]

REMEMBER_EVERY = 1.0
"""Time between the moments that are remembered to go back to [s]."""


class Row:
    """Rows that a function gives, one by one."""

    def __init__(self, row: Callable[[int], Any]) -> None:
        """Bind the function."""
        self._row = row

    def __getitem__(self, k: int) -> Any:
        """Row k."""
        return self._row(k)


class Moment(NamedTuple):
    """What it takes to go back to the start of a control period."""

    period: int
    hands: Hands
    aboard: Aboard
    stages: dict[str, Any]
    parts: list[Saved]


class InteractiveFlight(Touch):
    """A plan flown by Python, period by period, under somebody's hands.

    Attributes:
        plan: What is flown.
        flight: Who flies it.
        script: All interventions, in order; those that are still to come in a flight flown again.
        felt: Wrench of the hands in the last period, and the pull alone.
        lock: Held while it flies or is touched: several threads may do so.
    """

    def __init__(self, plan: FlightPlan, script: Iterable[Intervention] = ()) -> None:
        """Stand at the start.

        Args:
            plan: What is flown.
            script: What is going to be done to it.
        """
        self.plan, self.script = plan, list(script)
        self.lock = threading.RLock()
        self.flight = flight = Flight(plan)
        tables, s = flight.block.tables, plan.simulation
        look = flight.lists.of
        self._targets, self._ahead = look(tables.targets), look(tables.ahead)
        half_step, per_period = 0.5 * s.plant_period, 2 * s.substeps
        self._arm = MovingArm(look(tables.motions), tables.arm_stride, per_period, half_step)
        self._no_lead = record(Ahead, np.zeros(15))
        self._holds, self.felt = Holds(plan.nominal), NOTHING
        self._change = CrewChange(flight, plan)
        self.hands = Hands()
        rows = len(plan.t)
        self._asked = np.zeros((rows, 7))
        self._leads = np.zeros((rows, 15))
        self._loads = np.zeros((rows, 6))
        self._joints = np.zeros((2, rows, plan.nominal.n_arm))
        self._moments: list[Moment] = []
        self._bind(MovingCenters(look(tables.links), self._arm))

    def _bind(self, centers: MovingCenters) -> None:
        """Have the stages read what hands change."""
        stages, rows = self.flight.stages, [2.0 * self.plan.simulation.substeps]
        targets, ahead, loads = Row(self._target), Row(self._lead), Row(self._load)
        shown: dict[str, dict[str, Any]] = {
            "watch": {"targets": targets},
            "govern": {"targets": targets},
            "foresee": {"ahead": ahead},
            "allocate": {"ahead": ahead},
            "move": {"gusts": loads},
        }
        steered = self.flight.block.plant.steered_by(self._arm, centers, rows)
        for name, changes in (*shown.items(), *steered.items()):
            if name in stages:
                stage, view = stages[name]
                stages[name] = stage, view._replace(**changes)
        stage, view = stages["move"]
        stages["move"] = self._change.moving(stage), view

    # What the stages read in period k.

    def _target(self, k: int) -> Target:
        held: Target = self.hands.target or self._targets[k]
        return held

    def _lead(self, k: int) -> Ahead:
        """Nobody knows ahead where a hand will move the target."""
        known: Ahead = self._ahead[k] if self.hands.target is None else self._no_lead
        return known

    def _load(self, k: int) -> Spatial:
        return record(Spatial, self._loads[k])

    # Flying.

    @property
    def period(self) -> int:
        """The control period that is flown next."""
        return self.flight.ticks_flown

    @property
    def time(self) -> float:
        """Where the vehicle stands in time [s]."""
        return float(self.plan.t[min(self.period, len(self.plan.t) - 1)])

    @property
    def outcome(self) -> str:
        """One of "flying", "completed" and "diverged"."""
        return self.flight.outcome

    @property
    def pose(self) -> Array:
        """True pose now, [p, quaternion xyzw], shape (7,)."""
        return self.flight.pose

    @property
    def arm(self) -> Array:
        """Positions, rates and accelerations of the joints now, shape (3, n)."""
        return np.array(self._true_arm(min(self.period, len(self.plan.t) - 1))).reshape(-1, 3).T

    def _true_arm(self, k: int) -> Any:
        """The joints' motion in period k, which is now: what is commanded, or what servos made."""
        true = self.flight.block.plant.arm
        return self._arm[self._arm_row(k)] if true is None else self.flight.lists.of(true)

    @property
    def tool(self) -> Array:
        """Where the tool is, shape (3,) [m]."""
        return np.array(self._holds.place("tool", self.pose, self.arm[0]))

    @property
    def contact(self) -> Array:
        """Force of the world on the tool in the last period, world axes, shape (3,) [N]."""
        touches = self.flight.block.plant.touches
        if touches is None or self.period == 0:
            return np.zeros(3)
        return np.array(self.flight.lists.of(touches)[self.period - 1])

    @property
    def scene(self) -> Array | None:
        """Coordinates of the scene's joints in the last period; None if there are none yet."""
        moved = self.flight.block.plant.moved
        if moved is None or self.period == 0:
            return None
        return np.array(self.flight.lists.of(moved)[self.period - 1])

    @property
    def trim(self) -> Trim | None:
        """How it hovers without the rotors that are known to have failed; None if none is."""
        return self._change.aboard.trim

    def step(self) -> bool:
        """Fly the next control period; False if the flight is over."""
        with self.lock:
            return self._step()

    def _step(self) -> bool:
        k = self.period
        if self.outcome != "flying" or k >= len(self.plan.t):
            return self.flight.step()
        if not self._moments or k >= self._moments[-1].period + self._stride:
            self._remember(k)
        while self.hands.done < len(self.script) and self.script[self.hands.done].period <= k:
            self.hands = self.hands.after(self.script[self.hands.done], self._now(k))
            self._arm.state = self.hands.arm
        self._change.begin(k, self.hands.crew)
        self._write(k)
        if not self.flight.step():
            return False
        simulation, joints = self.plan.simulation, self.plan.nominal.joints
        self.hands = self.hands.next_period(joints, simulation.control_period)
        self._arm.state = self.hands.arm
        return True

    def _now(self, k: int) -> Now:
        plan = self.plan
        motions = self._arm[self._arm_row(k)]
        step = plan.simulation.control_period
        return Now(k, self._target(k), motions, plan.nominal.joints, step)

    def _write(self, k: int) -> None:
        """What hands make of the row of a period."""
        plan, hands = self.plan, self.hands
        self.hands = hands = replace(hands, force=still_pushing(hands.force, k))
        for i, motion in enumerate(self._true_arm(k)):
            self._joints[0, k, i], self._joints[1, k, i] = motion.position, motion.rate
        self.felt = felt(hands.force, self._holds, self.flight.pose, self._joints[0, k])
        gust = self._change.aboard.draw.gust[k]
        total = gust if self.felt is NOTHING else add_spatial(gust, self.felt.wrench)
        self._loads[k] = flat(total)
        self._leads[k] = flat(self._lead(k))
        self._asked[k] = plan.asked.pose[k] if hands.goal is None else flat(hands.goal)

    def _arm_row(self, k: int) -> int:
        return 2 * self.plan.simulation.substeps * k

    @one_blas_thread()
    def advance(self, seconds: float) -> None:
        """Fly on for a time [s], or to the end."""
        until = self.period + round(seconds / self.plan.simulation.control_period)
        while self.period < until and self.step():
            pass

    @one_blas_thread()
    def run(self) -> Run:
        """Fly on to the end, and give the record."""
        while self.step():
            pass
        return self.record

    @property
    def record(self) -> Run:
        """The record so far, as that of a flight that was meant to end here.

        Raises:
            InvalidInput: Less than two control periods have been flown.
        """
        with self.lock:
            return self._record()

    def _record(self) -> Run:
        flight, plan, rows = self.flight, self.plan, self.flight.ticks_flown
        outcome = "completed" if self.outcome == "flying" else self.outcome
        horizon = plan.scenario.duration
        script = [done.to_dict() for done in self.script if done.period < rows]
        metadata: dict[str, Any] = trim_data(self.trim)
        if script or (rows < len(plan.t) and outcome == "completed"):
            metadata["script"] = {"horizon": horizon, "interventions": script}
        if rows < len(plan.t) and outcome == "completed":
            if rows < 2:
                raise InvalidInput("flight", "record", "has no rows yet", "fly on: `advance(1.0)`")
            plan = replace(plan, scenario=replace(plan.scenario, duration=float(plan.t[rows - 1])))
        if plan.anticipation is not None:
            rows_flown = Rows(Ahead, self._leads.copy())
            plan = replace(plan, anticipation=replace(plan.anticipation, rows=rows_flown))
        flight.lists.write_back()
        touched = {
            "reference_pose": self._asked,
            "arm": self._joints[0],
            "arm_rate": self._joints[1],
            "disturbance": self._loads,
            "metadata": metadata,
        }
        log = flight.block.columns(rows)
        scene = flight.block.plant.scene
        return finish(plan, log, outcome, flight.reason, touched=touched, scene=scene)

    def row(self, k: int) -> dict[str, Array]:
        """What was recorded in a period: the columns of `stages.Entry`, and those hands change."""
        with self.lock:
            self.flight.lists.write_back()
            log = self.flight.block.columns(k + 1, copy=False)
            row = {name: np.array(c[k]) for name, c in log.items()}
        row |= {"arm": self._joints[0, k].copy(), "arm_rate": self._joints[1, k].copy()}
        return row | {"reference_pose": self._asked[k].copy(), "disturbance": self.load(k)}

    def load(self, k: int) -> Array:
        """Gust and hands on the platform in a period that was flown, world axes, shape (6,)."""
        return np.array(self._loads[k])

    # Going back.

    @property
    def _stride(self) -> int:
        if not can_be_saved(self.flight.controller, self.flight.estimator):
            return len(self.plan.t)
        return max(1, round(REMEMBER_EVERY / self.plan.simulation.control_period))

    def _remember(self, k: int) -> None:
        parts = [saved_rows(view) for view in self._change.remembered()]
        parts += [saved_fields(part) for part in (self.flight.controller, self.flight.estimator)]
        stages = dict(self.flight.stages)
        self._moments.append(Moment(k, self.hands, self._change.aboard, stages, parts))

    def rewind(self, time: float) -> None:
        """Go back to a moment that was flown; what was done from it on is forgotten.

        Raises:
            InvalidInput: The flight has not been there.
        """
        period = round(time / self.plan.simulation.control_period)
        if not 0 <= period <= self.period:
            remedy = f"give 0 to {self.time:g} s"
            raise InvalidInput("flight", "time", f"is {time!r} s", remedy)
        with self.lock:
            self._rewind(period)

    def _rewind(self, period: int) -> None:
        self.script = [done for done in self.script if done.period < period]
        if not self._moments:
            return
        at = bisect.bisect_right([moment.period for moment in self._moments], period) - 1
        moment = self._moments[at]
        del self._moments[at + 1 :]
        self.flight.stages.update(moment.stages)
        self._change.restore(moment.aboard)
        for part in moment.parts:
            part.restore()
        self.hands, self._arm.state = moment.hands, moment.hands.arm
        flight = self.flight
        flight.ticks_flown, flight.outcome, flight.reason = moment.period, "flying", ""
        while self.period < period and self.step():
            pass

    # What hands do.

    def do(self, kind: str, values: Mapping[str, Any]) -> Intervention:
        """Do something before the next period is flown; see `interventions.KINDS`.

        Raises:
            InvalidInput: It cannot be done.
            UnknownName: No such controller, estimator or weather.
        """
        with self.lock:
            done = intervention(self.period, kind, values)
            self._change.check(done, self.hands.crew)
            self.script.append(done)
        return done
