"""A block of flights that are flown together: the rows they write, and their stages.

One block belongs to one thread. It is made once and flies one set of seeds after the other, one
flight or as many as it has lanes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from fullam.control.allocation import allocation_memory
from fullam.control.delivery import AllocateView, allocate_command
from fullam.control.estimator import (
    EstimateView,
    Estimator,
    KernelEstimator,
    Readings,
    estimate_stage,
    flies_as_kernel,
)
from fullam.control.governor import GovernorMemory, GovernView, govern, hand_on
from fullam.control.law import (
    CommandView,
    InformView,
    KernelLaw,
    RelieveView,
    command_stage,
    inform_stage,
    kernel_law,
    not_fused,
    numbers_of,
    relieve_stage,
)
from fullam.control.signals import DIVERGED, FOREVER, Command, Delivery, Estimate, Status, Target
from fullam.dynamics.spatial import Pose, Spatial
from fullam.numbers.program import Stage
from fullam.numbers.records import Rows, columns, rows_of
from fullam.simulation.drawn_weather import InertialNoise
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.flown import Flown, TrackView, write_track
from fullam.simulation.plants.kind import Surroundings
from fullam.simulation.plants.named import make_plant
from fullam.simulation.plants.plant import State
from fullam.simulation.stages import (
    ORDER,
    Entry,
    ForeseeView,
    RecordView,
    RotorEntry,
    SenseView,
    WatchView,
    foresee,
    record_entry,
    sense,
    sense_all,
    watch,
)
from fullam.simulation.tables import Tables

Array = NDArray[np.float64]
Keep = Literal["record", "track"]


class Block:
    """Rows and stages of some flights of a plan.

    Attributes:
        tables: What the flights share.
        lanes: Flights at a time; 0 for one, as scalars.
        law: The law, for its kernels and numbers; or, if it is no `KernelLaw`, for Python to fly.
        estimator: The estimator, in the same way.
        state: The platform, one row of `plants.plant.State`.
        status: Whether it still flies, one row of `Status`.
        speeds: Rotor speeds, n_r rows.
        entries: The record, a row a control period, if it is kept.
        rotors: Its rotors' part, (periods, n_r).
        plant: What moves the vehicle, and tells of its arm.
        track: The track, a row a control period, if that is kept.
    """

    def __init__(self, tables: Tables, lanes: int = 0, keep: Keep = "record") -> None:
        """Make the rows.

        Args:
            tables: What the flights share.
            lanes: Flights at a time; 0 for one, as scalars.
            keep: What the flights write: the whole record, or the track that figures need.
        """
        self.tables, self.lanes, self.keep = tables, lanes, keep
        plan, periods = tables.plan, tables.periods
        n = plan.nominal.rotors.count
        self.law, self.estimator = tables.controller(), tables.estimator()
        self.allocator = tables.allocator
        self.state, self.status = self._empty(State, 1), self._empty(Status, 1)
        self.poses = self._empty(Pose, plan.simulation.delay_periods + 1)
        self.readings, self.estimate = self._empty(Readings, 1), self._empty(Estimate, 1)
        self.command, self.delivery = self._empty(Command, 1), self._empty(Delivery, 1)
        self.residual = self._empty(Spatial, 1)
        self.target, self.governor = self._empty(Target, 1), self._empty(GovernorMemory, 1)
        self.speeds = self._empty(float, n)
        self.drawn = tables.draws.rows(lanes, self.estimator.needs_inertial)
        self.problem, self.memory = self.allocator.problem(), allocation_memory(n, lanes)
        self.commands: Rows = self.memory.speeds
        kept = periods if keep == "record" else 0
        self.entries, self.rotors = self._empty(Entry, kept), self._empty(RotorEntry, kept, n)
        self.track = self._empty(Flown, periods - kept)
        self.plant = make_plant(
            Surroundings(
                tables,
                lanes,
                kept,
                self.state,
                self.estimate,
                self.target,
                self.command,
                self.delivery,
                self.drawn,
                self.speeds,
                self.commands,
            )
        )
        self.law_memory: Any = None
        self.estimator_memory: Any = None
        self._law_numbers = self._estimator_numbers = None
        if isinstance(self.law, KernelLaw):
            self.law_memory = self._empty(self.law.Memory, 1)
            self._law_numbers = numbers_of(self.law)
        if isinstance(self.estimator, KernelEstimator):
            self.estimator_memory = self.estimator.memory(lanes)
            self._estimator_numbers = numbers_of(self.estimator)

    def _empty(self, record: Any, *lengths: int) -> Rows:
        return Rows.empty(record, *lengths, lanes=self.lanes)

    # Before a flight.

    def begin(self) -> None:
        """Stand at the scenario's start, at rest, rotors at hover speed; nothing remembered."""
        self.state.array[:] = 0.0
        self.state.array[0, :7].T[:] = self.tables.initial_pose
        for rows in (self.status, self.governor, self.delivery):
            rows.array[:] = 0.0
        self.status["end"][:] = FOREVER
        for rows in rows_of(self.memory):
            rows.array[:] = 0.0
        for rows in (self.commands, self.speeds):
            rows.array[:, 0].T[:] = self.tables.hover
        self.plant.begin()

    def draw(self, seeds: Sequence[int]) -> None:
        """Draw the weather and the true vehicles of seeds, one a lane."""
        self.drawn.fill(seeds)

    def load(self, plan: FlightPlan) -> None:
        """Take the weather and the true vehicle of a plan; for one flight at a time."""
        self.draw([plan.seed])
        if plan.replaced is not None:
            self.drawn.put(plan.replaced)

    # What flies, stage by stage; see `fullam.simulation.stages`.

    def stages(self) -> dict[str, Stage]:
        """The stages of a control period as kernels, in order.

        Raises:
            SettingsError: Law or estimator are no kernels.
        """
        law, estimator = kernel_law(self.law), kernel_estimator(self.estimator)
        joints = self.plant.seen.joints
        estimate = Stage(estimate_stage(estimator.kernel), self.estimate_view())
        own = {
            "estimate": estimate,
            "command": Stage(command_stage(law.kernels), self.command_view(joints)),
            "inform": Stage(inform_stage(law.kernels), self.inform_view(joints)),
        }
        if self.learns and law.kernels.relieved is not None:
            own["relieve"] = Stage(relieve_stage(law.kernels), self.relieve_view())
        return in_order(self.common_stages() | own | self.plant.stages())

    def common_stages(self) -> dict[str, Stage]:
        """Those that neither law, estimator nor plant have a say in."""
        t = self.tables
        sensing = sense_all if self.estimator.needs_inertial else sense
        stages = {
            "watch": Stage(watch, WatchView(self.state, t.targets, t.bounds, self.status)),
            "sense": Stage(sensing, self.sense_view()),
            "govern": Stage(govern if t.is_governed else hand_on, self.govern_view()),
            "allocate": Stage(allocate_command, self.allocate_view()),
        }
        if t.plan.anticipation is not None:
            stages["foresee"] = Stage(foresee, ForeseeView(t.ahead, self.estimate))
        if self.keep == "record":
            stages["record"] = Stage(record_entry, self.record_view())
        else:
            stages["record"] = Stage(write_track, self.track_view())
        return stages

    def sense_view(self) -> SenseView:
        """What the sensors' stage is shown."""
        rates, drawn = self.tables.rates, self.drawn
        inertial = drawn.inertial or self._empty(InertialNoise, 0)
        errors = drawn.noise, drawn.missing, inertial, drawn.gains
        return SenseView(self.state, self.poses, *errors, rates, self.readings)

    def estimate_view(self) -> EstimateView:
        """What the estimator's stage is shown."""
        memory = self.estimator_memory
        return EstimateView(self._estimator_numbers, memory, self.readings, self.estimate)

    def govern_view(self) -> GovernView:
        """What the governor's stage is shown."""
        t = self.tables
        return GovernView(t.governor, t.targets, self.delivery, self.governor, self.target)

    def command_view(self, joints: Rows) -> CommandView:
        """What the law's first stage is shown; `joints` as the law wants to see them."""
        return CommandView(
            self._law_numbers,
            self.plant.seen.links,
            joints,
            self.plant.seen.rows,
            self.target,
            self.estimate,
            self.law_memory,
            self.command,
        )

    def allocate_view(self) -> AllocateView:
        """What the allocation's stage is shown."""
        t = self.tables
        return AllocateView(
            self.problem,
            self.memory,
            self.estimate,
            t.ahead,
            self.command,
            self.plant.seen.centers,
            self.plant.seen.rows,
            self.status,
            self.delivery,
            self.residual,
        )

    def inform_view(self, joints: Rows) -> InformView:
        """What the law's second stage is shown."""
        return InformView(
            self._law_numbers,
            self.plant.seen.links,
            joints,
            self.plant.seen.rows,
            self.estimate,
            self.law_memory,
            self.share,
        )

    @property
    def share(self) -> Rows:
        """What was delivered of the law's own command, one row of `Delivery`."""
        return self.delivery if self.plant.carried is None else self.plant.carried.share

    @property
    def learns(self) -> bool:
        """Whether what hangs at the tool is learned in flight."""
        return self.plant.carried is not None and self.plant.carried.learner is not None

    def relieve_view(self) -> RelieveView:
        """What the stage is shown that tells the law of what was learned."""
        seen, carried = self.plant.seen, self.plant.carried
        assert carried is not None and carried.learner is not None
        return RelieveView(
            self._law_numbers,
            seen.links,
            seen.joints,
            seen.rows,
            self.estimate,
            self.law_memory,
            carried.learner.weight,
        )

    def record_view(self) -> RecordView:
        """What the stage that writes the record is shown."""
        return RecordView(
            self.state,
            self.estimate,
            self.command,
            self.delivery,
            self.governor,
            self.residual,
            self.commands,
            self.drawn.rotors,
            self.speeds,
            self.entries,
            self.rotors,
        )

    def track_view(self) -> TrackView:
        """What the stage that writes the track is shown."""
        coefficients = self.tables.thrust_coefficients
        return TrackView(self.state, self.delivery, self.speeds, coefficients, self.track)

    # After a flight.

    def columns(self, rows: int, lane: int = 0, copy: bool = True) -> dict[str, Array]:
        """The first rows of a flight's record, column by column, as `finish` takes them.

        Args:
            rows: How many.
            lane: Which of the flights.
            copy: Whether to leave the block its rows, as one that flies again needs them.
        """
        sources = self.entries, self.rotors, self.drawn.gust
        parts = [s.array[:rows, ..., lane] if self.lanes else s.array[:rows] for s in sources]
        entries, rotors, gusts = (np.array(part) for part in parts) if copy else parts
        log = {name: entries[:, part] for name, part in columns(Entry).items()}
        log["saturated"] = log["saturated"][:, 0] > 0.0
        log["given_up"] = log["given_up"][:, 0]
        log |= {"rotor_commands": rotors[..., 0], "rotor_speeds": rotors[..., 1]}
        return log | {"disturbance": gusts} | self.plant.columns(rows, lane, copy)

    def ending(self, lane: int = 0) -> tuple[int, str]:
        """How many rows a flight has, and "completed", "diverged" or "not finite"."""
        status = self.status.array[0, :, lane] if self.lanes else self.status.array[0]
        end, cause = status.tolist()
        if end >= self.tables.periods:
            return self.tables.periods, "completed"
        return int(end), "diverged" if cause == DIVERGED else "not finite"

    def last_command(self, lane: int = 0) -> Array:
        """The wrench that the law asked for last, world axes, shape (6,)."""
        wrench = self.command["wrench"][0]
        return np.array(wrench[:, lane] if self.lanes else wrench)

    def pose(self, lane: int, row: int) -> Array:
        """The recorded pose of a row, shape (7,)."""
        pose = (self.entries if self.keep == "record" else self.track)["pose"][row]
        return np.array(pose[:, lane] if self.lanes else pose)


def in_order(stages: dict[str, Any]) -> dict[str, Any]:
    """Stages by name, in the order in which a control period calls them."""
    return {name: stages[name] for name in ORDER if name in stages}


def kernel_estimator(estimator: Estimator) -> KernelEstimator:
    """The estimator, if it is written as a kernel.

    Raises:
        SettingsError: It is a class of its own.
    """
    if isinstance(estimator, KernelEstimator) and flies_as_kernel(type(estimator)):
        return estimator
    raise not_fused("estimator", estimator.name, "KernelEstimator")
