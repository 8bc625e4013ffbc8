"""A block of flights that are flown together: the rows they write, and their stages.

One block belongs to one thread. It is made once and flies one set of seeds after the other, one
flight or as many as it has lanes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.control.allocation import Allocator, allocation_memory
from fullam.control.estimator import EstimateView, KernelEstimator, estimate_stage
from fullam.control.law import (
    CommandView,
    InformView,
    KernelLaw,
    command_stage,
    inform_stage,
)
from fullam.control.signals import Command, Delivery, Estimate
from fullam.dynamics.recursion import Link
from fullam.dynamics.spatial import Pose, Spatial
from fullam.numbers.program import Stage
from fullam.numbers.records import Rows
from fullam.simulation.anticipation import ForeseeView, foresee
from fullam.simulation.draws import Draws, RotorRow, Weather
from fullam.simulation.flight_plan import hover_speeds
from fullam.simulation.plant import PlantView, State, plant_stage
from fullam.simulation.sensors import SenseView, sense_stage
from fullam.simulation.stages import (
    FOREVER,
    AllocateView,
    Entry,
    RecordView,
    RotorEntry,
    Status,
    WatchView,
    allocate_command,
    record_entry,
    watch,
)
from fullam.simulation.tables import Tables

Array = NDArray[np.float64]


class Block:
    """Rows and stages of some flights of a plan.

    Attributes:
        tables: What the flights share.
        lanes: Flights at a time; 0 for one, as scalars.
        law: The law, for its kernels and numbers; or, if it is no `KernelLaw`, for Python to fly.
        estimator: The estimator, in the same way.
        state: The platform, one row of `plant.State`.
        status: Whether it still flies, one row of `Status`.
        speeds: Rotor speeds, n_r rows.
        entries: The record, a row a control period; no rows if none is kept.
        rotors: Its rotors' part, (periods, n_r).
    """

    def __init__(self, tables: Tables, lanes: int = 0, record: bool = True) -> None:
        """Make the rows.

        Args:
            tables: What the flights share.
            lanes: Flights at a time; 0 for one, as scalars.
            record: Whether to keep a record.
        """
        self.tables, self.lanes = tables, lanes
        plan, periods = tables.plan, tables.periods
        n = plan.nominal.rotors.count
        self.law, self.estimator = tables.controller(), tables.estimator()
        self.allocator = tables.allocator()
        self.state, self.status = self._empty(State, 1), self._empty(Status, 1)
        self.poses = self._empty(Pose, plan.simulation.delay_periods + 1)
        self.readings, self.estimate = self._empty(Readings, 1), self._empty(Estimate, 1)
        self.command, self.delivery = self._empty(Command, 1), self._empty(Delivery, 1)
        self.residual = self._empty(Spatial, 1)
        self.commands, self.speeds = self._empty(float, n), self._empty(float, n)
        self.weather = self._empty(Weather, periods)
        self.inertial = self._empty(Inertial, periods if self.estimator.needs_inertial else 0)
        self.links = self._empty(Link, len(tables.links.array))
        self.rotor_rows = self._empty(Rotor, n)
        self.problem, self.memory = self.allocator.problem(), allocation_memory(n, lanes)
        kept = periods if record else 0
        self.entries, self.rotors = self._empty(Entry, kept), self._empty(RotorEntry, kept, n)
        self.law_memory: Any = None
        self.estimator_memory: Any = None
        if isinstance(self.law, KernelLaw):
            self.law_memory = self._empty(self.law.Memory, 1)
        if isinstance(self.estimator, KernelEstimator):
            self.estimator_memory = self.estimator.memory(lanes)

    def _empty(self, record: Any, *lengths: int) -> Rows:
        return Rows.empty(record, *lengths, lanes=self.lanes)

    # Before a flight.

    def begin(self) -> None:
        """Stand at the scenario's start, at rest, rotors at hover speed; nothing remembered."""
        self.state.array[:] = 0.0
        self.state.array[0, :7].T[:] = self.tables.plan.scenario.initial_pose
        self.status.array[:] = 0.0
        self.status["end"][:] = FOREVER
        for rows in (self.commands, self.speeds):
            rows.array[:, 0].T[:] = self.tables.hover
        for rows in rows_of(self.memory):
            rows.array[:] = 0.0

    def load(self, plan: FlightPlan) -> None:
        """Take the weather and the true vehicle of a plan; for one flight at a time."""
        draw, true = plan.forecast, plan.true
        self.weather.array[:] = np.hstack([draw.pose_noise, draw.disturbance])
        if len(self.inertial.array):
            noise = [draw.gyroscope_noise, draw.accelerometer_noise]
            self.inertial.array[:] = np.hstack(noise)
        self.links.array[:] = LinkRows.of(LinkChain.from_model(true.model)).rows.array
        self.rotor_rows.array[:] = rotor_rows(true.rotors, plan.simulation.plant_period)

    def draw(self, seeds: Sequence[int]) -> None:
        """Draw the weather and the true vehicles of as many seeds as there are lanes."""
        self.tables.draws.fill(seeds, self.weather, self.links, self.rotor_rows, self.inertial)

    # What flies, stage by stage.

    def stages(self) -> dict[str, Stage]:
        """The stages of a control period, in order; see `fullam.simulation.stages`.

        Raises:
            SettingsError: Law or estimator are no kernels.
        """
        t, plan = self.tables, self.tables.plan
        law, estimator = kernel_law(self.law), kernel_estimator(self.estimator)
        joints, centers = t.placed
        numbers = Rows.of(type(law.numbers()), [law.numbers()])
        estimator_numbers = Rows.of(type(estimator.numbers()), [estimator.numbers()])
        stages = {
            "watch": Stage(watch, WatchView(self.state, t.targets, t.bounds, self.status)),
            "sense": self.sense(),
            "estimate": Stage(
                estimate_stage(estimator.kernel),
                EstimateView(
                    estimator_numbers, self.estimator_memory, self.readings, self.estimate
                ),
            ),
            "foresee": Stage(foresee, ForeseeView(t.ahead, self.estimate)),
            "command": Stage(
                command_stage(law.kernels),
                CommandView(
                    numbers,
                    t.links,
                    joints,
                    t.joint_rows,
                    t.targets,
                    self.estimate,
                    self.law_memory,
                    self.command,
                ),
            ),
            "allocate": self.allocate(),
            "inform": Stage(
                inform_stage(law.kernels),
                InformView(
                    numbers,
                    t.links,
                    joints,
                    t.joint_rows,
                    self.estimate,
                    self.law_memory,
                    self.delivery,
                ),
            ),
            "record": self.record(),
            "move": Stage(plant_stage(plan.simulation.integrator), self.plant_view(joints)),
        }
        if plan.anticipation is None:
            del stages["foresee"]
        return stages

    def sense(self) -> Stage:
        """The sensors' stage."""
        raise NotImplementedError

    def allocate(self) -> Stage:
        """The allocation's stage."""
        t = self.tables
        view = AllocateView(
            self.problem,
            self.memory,
            self.estimate,
            t.ahead,
            self.command,
            t.placed[1],
            t.joint_rows,
            self.status,
            self.delivery,
            self.residual,
            self.commands,
        )
        return Stage(allocate_command, view)

    def record(self) -> Stage:
        """The stage that writes the record."""
        view = RecordView(
            self.state,
            self.estimate,
            self.command,
            self.delivery,
            self.residual,
            self.commands,
            self.speeds,
            self.entries,
            self.rotors,
        )
        return Stage(record_entry, view)

    def plant_view(self, arm: Rows) -> PlantView:
        """What the plant is shown; `arm` as its derivative wants to see it."""
        return PlantView(
            self.state,
            self.links,
            arm,
            self.rotor_rows,
            self.tables.stepping,
            self.weather,
            self.speeds,
            self.commands,
        )

    # After a flight.

    def columns(self, lane: int = 0) -> dict[str, Array]:
        """Columns of a flight's record, as `run.finish` takes them; views of the rows."""
        names = columns(Entry)
        entries = self.entries.array[..., lane] if self.lanes else self.entries.array
        rotors = self.rotors.array[..., lane] if self.lanes else self.rotors.array
        log = {name: entries[:, part] for name, part in names.items()}
        log["saturated"] = log["saturated"][:, 0] > 0.0
        return log | {"rotor_commands": rotors[..., 0], "rotor_speeds": rotors[..., 1]}

    def ending(self, lane: int = 0) -> tuple[int, str]:
        """How many rows a flight has, and "completed", "diverged" or "not finite"."""
        status = self.status.array[0, :, lane] if self.lanes else self.status.array[0]
        end, cause = status.tolist()
        if end >= self.tables.periods:
            return self.tables.periods, "completed"
        return int(end), "diverged" if cause == DIVERGED else "not finite"


def kernel_law(law: Controller) -> KernelLaw:
    """The law, if it is written as kernels.

    Raises:
        SettingsError: It is a class of its own.
    """
    if isinstance(law, KernelLaw):
        return law
    raise not_fused("controller", law.name, "KernelLaw")


def kernel_estimator(estimator: Estimator) -> KernelEstimator:
    """The estimator, if it is written as a kernel.

    Raises:
        SettingsError: It is a class of its own.
    """
    if isinstance(estimator, KernelEstimator):
        return estimator
    raise not_fused("estimator", estimator.name, "KernelEstimator")


def not_fused(field: str, name: str, base: str) -> SettingsError:
    """The error for a class that machine code cannot fly."""
    return SettingsError(
        "driver 'fused'",
        field,
        f"'{name}' is not written as kernels",
        f"fly it with driver='python', or derive it from {base}",
    )
