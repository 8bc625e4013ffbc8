"""Who flies, in which weather and on which rotors: what may be exchanged during a flight.

An exchanged part is a new stage of the flight with a fresh memory. The vehicle that flies stays
the one that took off, and so does its seed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from fullam.control.allocation import Allocator, allocation_memory
from fullam.control.box_qp import SMALL_STORE
from fullam.control.controller import Controller
from fullam.control.controllers import controller_class, make_settings
from fullam.control.estimator import Estimator
from fullam.control.law_stage import LawStage
from fullam.control.trim import Trim
from fullam.dynamics.spatial import Spatial
from fullam.exceptions import InvalidInput
from fullam.numbers.program import Long
from fullam.numbers.records import Rows
from fullam.registry import made
from fullam.simulation.drawn_weather import InertialNoise
from fullam.simulation.flight import EstimateStage, Flight
from fullam.simulation.flight_plan import FlightPlan, make_estimator
from fullam.simulation.hands.interventions import Intervention
from fullam.simulation.stages import sense, sense_all
from fullam.simulation.trimmed import trim_of
from fullam.simulation.weather import Weather, forecast


@dataclass(frozen=True)
class Crew:
    """What is wanted: the interventions that chose it, None for the plan's own.

    Attributes:
        controller: The law.
        estimator: The estimator.
        weather: The weather.
        failed: Rotors that stand still.
        known: Those of them that the allocation knows of.
    """

    controller: Intervention | None = None
    estimator: Intervention | None = None
    weather: Intervention | None = None
    failed: frozenset[int] = frozenset()
    known: frozenset[int] = frozenset()

    def after(self, done: Intervention) -> Crew:
        """The crew after an intervention."""
        if done.kind != "rotor":
            chosen: dict[str, Any] = {done.kind: done}
            return replace(self, **chosen)
        rotor, fails = {done.values["index"]}, done.values["fails"]
        failed = self.failed | rotor if fails else self.failed - rotor
        known = self.known | rotor if fails and done.values["known"] else self.known - rotor
        return replace(self, failed=failed, known=known)


class Draw(NamedTuple):
    """Rows of what the weather has in store, a row a control period."""

    noise: Any
    gust: Any
    missing: Any
    inertial: Any
    gains: Any


class Aboard(NamedTuple):
    """What flies at the moment: the crew as it was installed, its parts, and how it hovers.

    The last is None unless rotors are known to have failed.
    """

    crew: Crew
    law: Controller
    estimator: Estimator
    memory: Any
    draw: Draw
    trim: Trim | None


class CrewChange:
    """Exchanges parts of a flight between two control periods.

    Attributes:
        aboard: What flies.
    """

    def __init__(self, flight: Flight, plan: FlightPlan) -> None:
        """Begin with the plan's own parts."""
        self._flight, self._plan = flight, plan
        sensing, moving = flight.stages["sense"][1], flight.stages["move"][1]
        parts = sensing.missing, sensing.inertial, sensing.gains
        draw = Draw(sensing.noise, moving.gusts, *parts)
        memory = flight.stages["allocate"][1].memory
        self.aboard = Aboard(Crew(), flight.controller, flight.estimator, memory, draw, plan.trim)

    def begin(self, k: int, crew: Crew) -> None:
        """Have a crew fly from control period k on; an estimator begins at the next new pose."""
        now = self.aboard.crew
        if crew is now:
            return
        wanted = replace(crew, estimator=now.estimator)
        if crew.estimator is not now.estimator and k % self._plan.simulation.pose_every == 0:
            wanted = crew
        if wanted.weather is not now.weather:
            self._put(draw=self._drawn(wanted.weather))
        if wanted.estimator is not now.estimator:
            self._put(estimator=self._estimator(wanted))
            stage = EstimateStage(self.aboard.estimator, self._plan)
            self._flight.stages["estimate"] = stage, self._flight.stages["estimate"][1]
        if wanted.controller is not now.controller:
            self._put(law=self._law(wanted.controller))
            law, stages = LawStage(self.aboard.law), self._flight.stages
            stages["command"] = law.command, stages["command"][1]
            stages["inform"] = law.inform, stages["inform"][1]
            if "relieve" in stages:
                stages["relieve"] = law.relieve, stages["relieve"][1]
        if wanted.known != now.known:
            self._allocate_without(wanted.known)
            self._trim_without(wanted.known)
        self._put(crew=wanted)
        self._sense()

    def restore(self, aboard: Aboard) -> None:
        """Have again what flew at another moment, whose stages the flight has again."""
        self.aboard = aboard
        self._put()

    def _put(self, **parts: Any) -> None:
        self.aboard = self.aboard._replace(**parts)
        self._flight.controller, self._flight.estimator = self.aboard.law, self.aboard.estimator

    def _weather(self, chosen: Intervention | None) -> Weather:
        if chosen is None:
            return self._plan.weather
        return Weather.from_dict(chosen.values["weather"])

    def _drawn(self, chosen: Intervention | None) -> Draw:
        """The same seed's draws of a weather, from its first period on."""
        drawn = forecast(self._weather(chosen), self._plan.seed, self._plan.t)
        rows = (
            Rows(Spatial, drawn.pose_noise),
            Rows(Spatial, drawn.disturbance),
            Rows(float, drawn.missing[:, None]),
            Rows(InertialNoise, drawn.inertial_noise),
            Rows(InertialNoise, drawn.gains[None]),
        )
        return Draw(*map(Long, rows))

    def _sense(self) -> None:
        """Show the sensors the weather, and have read what the estimator needs."""
        draw, stages = self.aboard.draw, self._flight.stages
        inertial = self.aboard.estimator.needs_inertial
        if inertial and not len(draw.inertial):
            drawn = self._drawn(self.aboard.crew.weather)
            draw = draw._replace(inertial=drawn.inertial, gains=drawn.gains)
            self._put(draw=draw)
        errors = draw._asdict()
        del errors["gust"]
        view = stages["sense"][1]._replace(**errors)
        stages["sense"] = (sense_all if inertial else sense), view

    def _estimator(self, crew: Crew) -> Estimator:
        plan, chosen = self._plan, crew.estimator
        assert chosen is not None
        changes = {"estimator": chosen.values["name"]}
        simulation = replace(
            plan.simulation, **changes, estimator_settings=chosen.values["settings"]
        )
        return make_estimator(simulation, self._weather(crew.weather), plan.nominal.gravity)

    def _law(self, chosen: Intervention | None) -> Controller:
        plan = self._plan
        assert chosen is not None
        name = chosen.values["name"]
        settings = make_settings(name, chosen.values["settings"])
        step, axes = plan.simulation.control_period, plan.scenario.axes_mask
        anticipated = plan.anticipation is not None
        return made(controller_class(name), plan.nominal, settings, step, axes, anticipated)

    def _allocator(self, known: frozenset[int]) -> Allocator:
        nominal, axes = self._plan.nominal, np.array(self._plan.scenario.axes_mask)
        return Allocator(
            nominal.rotors.with_failed(*sorted(known)), axes=axes, vehicle_name=nominal.name
        )

    def _allocate_without(self, known: frozenset[int]) -> None:
        """A new allocation, which writes to the same speeds."""
        stage, view = self._flight.stages["allocate"]
        look = self._flight.lists.of
        memory = look(allocation_memory(self._plan.nominal.rotors.count))
        memory = memory._replace(speeds=view.memory.speeds)
        problem = look(self._allocator(known).problem(SMALL_STORE))
        self._flight.stages["allocate"] = stage, view._replace(problem=problem, memory=memory)
        self._put(memory=memory)

    def _trim_without(self, known: frozenset[int]) -> None:
        """Have the governor give the target's tilt up for that which the other rotors hold best.

        Once they all work again the tilt comes back, as after any shortage.
        """
        plan, view = self._plan, self._flight.stages["govern"][1]
        governor = plan.simulation.governor
        if governor is None or not all(plan.scenario.axes_mask):
            return
        nominal = plan.nominal.with_failed(*sorted(known))
        trim = trim_of(nominal, plan.arm.theta)
        now, weight = view.numbers[0], nominal.mass * nominal.gravity
        up, least = now.up, 0.0
        if trim is not None:
            up, least = tuple(trim.up), 1.0
        rows = governor.numbers(weight, plan.simulation.control_period, up, least)
        stage = self._flight.stages["govern"][0]
        self._flight.stages["govern"] = stage, view._replace(numbers=self._flight.lists.of(rows))
        self._put(trim=trim)

    def moving(self, stage: Callable[[Any, int], None]) -> Callable[[Any, int], None]:
        """The plant's stage, on the rotors that work: the others run down whatever is asked."""

        def move(view: Any, k: int) -> None:
            failed = self.aboard.crew.failed
            if failed:
                asked = [0.0 if i in failed else c for i, c in enumerate(view.commands)]
                view = view._replace(commands=asked)
            stage(view, k)

        return move

    def remembered(self) -> list[Any]:
        """The lists that hold what the stages remember from one period to the next."""
        b, look = self._flight.block, self._flight.lists.of
        rows = [b.state, b.status, b.poses, b.readings, b.estimate, b.command, b.delivery]
        rows += b.plant.remembered()
        return [*map(look, (*rows, b.residual, b.target, b.governor, b.speeds)), self.aboard.memory]

    def check(self, done: Intervention, crew: Crew) -> None:
        """Try what an intervention asks for, on the ground.

        Raises:
            FullamError: It cannot be had of this vehicle.
        """
        n, joints = self._plan.nominal.rotors.count, self._plan.nominal.n_arm
        if done.kind == "rotor" and done.values["index"] >= n:
            problem = f"is {done.values['index']}"
            raise InvalidInput("intervention 'rotor'", "index", problem, f"give 0 to {n - 1}")
        if done.kind == "arm" and len(done.values["positions"]) != joints:
            problem = f"are {len(done.values['positions'])}"
            raise InvalidInput("intervention 'arm'", "positions", problem, f"give {joints}")
        if done.kind == "controller":
            self._law(done)
        if done.kind == "rotor":
            self._allocator(crew.after(done).known)
