"""What is timed: flights of a plan, and states along flights, so that nothing timed is frozen."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from fullam.analysis.judge import Figures
from fullam.analysis.judged import judge_of
from fullam.control.allocation import Allocator
from fullam.control.controller import Measurement, ReferencePoint
from fullam.control.controllers import make_controller
from fullam.control.tick import ControlTick
from fullam.dynamics.so3 import rotation_matrix
from fullam.model.loading import load_vehicle
from fullam.model.vehicle import Vehicle
from fullam.model.wrench_axes import controllable_axes
from fullam.simulation import fused
from fullam.simulation.block import Block, Keep
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.fused import Fused
from fullam.simulation.many import LANES
from fullam.simulation.motions.arm_motion import SineRate
from fullam.simulation.motions.references import Circle, Step, Waypoints
from fullam.simulation.scenarios.interaction import AHEAD_DEG, HOME, YAW_DEG
from fullam.simulation.scenarios.scenario import AXES, Scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.simulate import prepare
from fullam.simulation.tables import Tables
from fullam.simulation.weather import CALM, PAPER, Weather
from fullam.simulation.world.surfaces import Plane

VEHICLES = ("fullam", "hextilt")
"""Eight rotors and four joints; six rotors and five joints."""

WEATHERS = {
    "fullam": PAPER,
    "hextilt": replace(PAPER, force_disturbance=2.0, moment_disturbance=0.1),
}
"""Noise, gusts and parameter errors that each vehicle can bear."""

KILOHERTZ = SimulationSettings(control_period=0.001, plant_period=0.001, delay=0.002)
"""Control and plant at 1 kHz, with a late pose."""

BANK = 100
"""Ticks of a bank: few enough to stay in the caches, as the one live measurement of a loop does."""

LAPS = 4
"""How often a burst goes through a bank."""

SETTLED = 1000
"""Ticks that a bank leaves out: the start of its flight."""

STRETCH_EVERY = 235
"""Ticks from stretch to stretch of the demanding bank, whose reference jumps every 250."""


def plan(
    vehicle: Vehicle | str = "fullam",
    steps: int = 1000,
    law: str = "dc-pid",
    estimator: str = "first-order",
    weather: Weather | None = None,
    integrator: str = "midpoint",
    hover: bool = False,
    plant: str = "prescribed",
) -> FlightPlan:
    """Once round a level circle of 1 m in 8 s while the arm's last joint but one swings.

    A vehicle whose rotors cannot do that hovers in height and attitude; so do all with `hover`.

    Args:
        vehicle: The vehicle, or its name.
        steps: Control periods, of 1 ms, as the plant's steps.
        law: Name of the law.
        estimator: Name of the estimator.
        weather: The paper's if None, as far as the vehicle can bear it.
        integrator: Name of the plant's integrator.
        hover: Hover on the spot.
        plant: Name of the plant.
    """
    if isinstance(vehicle, str):
        vehicle = load_vehicle(vehicle)
    mask = controllable_axes(vehicle.rotors)
    start = (1.0, 0.0, 2.0)
    joint = max(1, vehicle.n_arm - 1)
    swing = {"arm_motion": SineRate(joint=joint, rate=0.5, frequency=1.0)}
    scenario = Scenario(
        name=f"benchmark of {vehicle.name}",
        initial_position=start,
        reference=Step(start) if hover or not all(mask) else Circle((0.0, 0.0, 2.0), 1.0, 8.0),
        duration=0.001 * (steps - 1),
        axes=tuple(axis for axis, good in zip(AXES, mask, strict=True) if good),
        weather=weather or WEATHERS.get(vehicle.name, PAPER),
        **(swing if vehicle.n_arm else {}),
    )
    simulation = replace(KILOHERTZ, estimator=estimator, integrator=integrator, plant=plant)
    return prepare(scenario, law, vehicle=vehicle, simulation=simulation)


def pushing(steps: int, world: bool, plant: str) -> FlightPlan:
    """The hybrid law at a soft wall, 5 mm inside which the tool stands at the start.

    Args:
        steps: Control periods, of 1 ms, as the plant's steps.
        world: Whether the wall is there.
        plant: Which physics flies.
    """
    wall = Plane((0.595, 0.0, 0.0), (-1.0, 0.0, 0.0), stiffness=1e4, dissipation=5.0)
    scenario = Scenario(
        name="benchmark at a wall",
        initial_position=HOME,
        initial_euler_deg=YAW_DEG,
        initial_arm_deg=AHEAD_DEG,
        reference=Step(HOME, YAW_DEG),
        duration=0.001 * (steps - 1),
        weather=CALM,
        world=(wall,) if world else (),
    )
    settings = {"engage_at": 0.002, "tare": 0.001}
    simulation = replace(KILOHERTZ, estimator="kalman", plant=plant)
    return prepare(scenario, "hybrid-force", settings=settings, simulation=simulation)


class Fleet:
    """Blocks of a plan, one a thread, whose weather and true vehicles are drawn beforehand.

    Attributes:
        steps: Control periods that one `fly` flies, over all flights.
        blocks: What each thread flies.
    """

    def __init__(
        self, flown: FlightPlan, lanes: int = LANES, threads: int = 1, keep: Keep = "record"
    ) -> None:
        """Compile, and draw; lanes=0 flies one flight at a time, as scalars."""
        tables, width = Tables(flown), max(lanes, 1)
        self._fused = [Fused(tables, lanes, keep) for _ in range(threads)]
        self.blocks = [fused.block for fused in self._fused]
        for i, block in enumerate(self.blocks):
            block.draw(range(i * width, (i + 1) * width))
        self.steps = threads * width * tables.periods
        self._pool = ThreadPoolExecutor(threads)
        self.fly()  # starts the threads
        for block in self.blocks:
            outcomes = {block.ending(lane)[1] for lane in range(width)}
            if outcomes != {"completed"}:
                raise AssertionError(f"the flights of {flown.controller} ended {outcomes}")

    def fly(self) -> None:
        """Fly all blocks once, side by side."""
        if len(self._fused) == 1:
            self._fused[0].fly()
        else:
            list(self._pool.map(Fused.fly, self._fused))

    @property
    def saturated(self) -> float:
        """Share of the recorded control periods whose wrench was out of reach."""
        return float(np.mean([block.entries["saturated"].mean() for block in self.blocks]))


def judging(flown: FlightPlan, block: Block) -> Callable[[], Figures]:
    """A function that judges what a block has flown, as a campaign does."""
    of_track, flights = judge_of(flown).over(block.track), range(block.lanes)

    def figures() -> Figures:
        rows, outcomes = zip(*(block.ending(lane) for lane in flights), strict=True)
        return of_track.figures(rows, [outcome == "diverged" for outcome in outcomes])

    return figures


@dataclass(frozen=True, eq=False)
class Bank:
    """Measurements and references of successive ticks of a flight."""

    vehicle: Vehicle
    axes: tuple[bool, ...]
    measurements: list[Measurement]
    references: list[ReferencePoint]

    @property
    def pairs(self) -> list[tuple[Measurement, ReferencePoint]]:
        """What the law is told, tick by tick."""
        return list(zip(self.measurements, self.references, strict=True))

    @property
    def calls(self) -> int:
        """Ticks of a burst."""
        return LAPS * len(self.measurements)

    def allocator(self, method: str = "ladder") -> Allocator:
        """A fresh allocator."""
        return Allocator(self.vehicle.rotors, axes=self.axes, method=method)

    def tick(self, law: str = "dc-pid", compiled: bool = True) -> ControlTick:
        """A law at 1 kHz with its allocator, before its first tick."""
        controller = make_controller(law, self.vehicle, 0.001, self.axes)
        return ControlTick(controller, self.allocator(), compiled)

    def replay(self, tick: ControlTick) -> Callable[[], None]:
        """A function that flies the bank through a tick, LAPS times."""
        pairs = self.pairs * LAPS

        def work() -> None:
            speeds = tick.speeds
            for m, point in pairs:
                speeds(0.0, m, point)

        return work


def record(vehicle: Vehicle | str, hover: bool = False) -> Bank:
    """A bank from a calm flight around the circle, or hovering at a point."""
    return bank_of(plan(vehicle, SETTLED + BANK, weather=CALM, hover=hover), (SETTLED,), BANK)


def record_demanding(vehicle: str) -> Bank:
    """A bank from a flight in noise and gusts whose reference jumps four times a second.

    The jumps are metres and tens of degrees and are not blended, so most of its wrenches are out of
    reach. Ten stretches of ten ticks, at different times after ten jumps: within a stretch the
    active set changes as it does in flight, from stretch to stretch altogether.
    """
    starts = tuple(range(SETTLED, SETTLED + 10 * STRETCH_EVERY, STRETCH_EVERY))
    flown = plan(vehicle, starts[-1] + BANK)
    rng, center = np.random.default_rng(0), np.array([0.0, 0.0, 10.0])
    times = tuple(np.arange(0.0, flown.scenario.duration, 0.25).tolist())
    jumps = Waypoints(
        times,
        tuple((rng.uniform(-3.0, 3.0, 3) + center).tolist() for _ in times),
        tuple(rng.uniform(-60.0, 60.0, 3).tolist() for _ in times),
    )
    scenario = replace(flown.scenario, initial_position=tuple(center), reference=jumps)
    unblended = {"max_acceleration": None, "max_angular_acceleration": None}
    wide = replace(KILOHERTZ, max_position_error=50.0, max_attitude_error_deg=179.9)
    jumping = prepare(scenario, vehicle=flown.nominal, shaping=unblended, simulation=wide)
    return bank_of(jumping, starts, BANK // len(starts))


def bank_of(flown: FlightPlan, starts: tuple[int, ...], length: int) -> Bank:
    """Fly a plan and keep what the law is told in stretches of its ticks."""
    run, measurements, references = fused.fly(flown), [], []
    for k in itertools.chain.from_iterable(range(start, start + length) for start in starts):
        m, point, row = Measurement(flown.nominal), ReferencePoint(), flown.arm_row(k)
        pose, arm = run.measured_pose[k], flown.arm
        R = np.reshape(rotation_matrix(pose[3:].tolist()), (3, 3))
        m.q[:7], m.q[7:] = pose, arm.theta[row]
        m.v[:6] = (run.measured_velocity[k].reshape(2, 3) @ R).ravel()
        m.v[6:], m.arm_acceleration[:] = arm.dtheta[row], arm.ddtheta[row]
        point.pose, point.velocity = flown.reference.pose[k], flown.reference.velocity[k]
        point.acceleration = flown.reference.acceleration[k]
        measurements.append(m)
        references.append(point)
    return Bank(flown.nominal, flown.scenario.axes_mask, measurements, references)
