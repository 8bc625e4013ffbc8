"""A `FlightPlan` as flat arrays, and what the compiled engine does not cover."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.control.allocation import Allocator
from fullam.control.backstepping import Backstepping
from fullam.control.controller import Controller, controller_class
from fullam.control.dc_pid import DcPid
from fullam.control.pid import Pid, PidBase
from fullam.exceptions import SettingsError
from fullam.model.chain import LinkChain
from fullam.model.vehicle import Vehicle
from fullam.simulation.compiled import law as laws
from fullam.simulation.compiled.allocation import Allotment
from fullam.simulation.compiled.box_qp import FORCE_ROWS, N_COUNTERS, PRIOR, SOLUTION
from fullam.simulation.compiled.dynamics import ARM_WIDTH, chain_rows
from fullam.simulation.compiled.entries import place
from fullam.simulation.compiled.integrate import ESTIMATE, POSE, READING, RULES, TOLD, Craft
from fullam.simulation.compiled.law import Law
from fullam.simulation.compiled.loop import ESTIMATORS, Draw, Job, Log, Tables
from fullam.simulation.flight_plan import DIVERGENCE_PERIOD, FlightPlan, hover_speeds
from fullam.simulation.weather import Forecast

Array = NDArray[np.float64]

WHERE = "engine 'compiled'"

MOST_ROTORS = 31
"""An active set is one 64-bit number, two bits a rotor."""

SLOTS = 16384
"""Size of the table of active-set maps, of which half are used: as many as the reference keeps. A
flight meets a few dozen; memory that is not touched costs nothing."""


def own(values: Any) -> Array:
    """A writable, contiguous copy: numba compiles anew for every other kind of array."""
    return np.array(values, dtype=np.float64, order="C")


def refuse(field: str, asked: str, covered: Any) -> SettingsError:
    """The error for what is not compiled."""
    return SettingsError(
        WHERE,
        field,
        f"'{asked}' is not compiled",
        f"compiled are {', '.join(covered)}; engine='reference' flies everything",
    )


def check(plan: FlightPlan) -> None:
    """Refuse what the compiled engine does not cover.

    Raises:
        SettingsError: The controller, the estimator, the integrator or the number of rotors is
            not covered; the message says which are.
        VehicleError: The arm is not one chain.
    """
    if controller_class(plan.controller) not in LAWS:
        raise refuse("controller", plan.controller, [c.name for c in LAWS])
    if plan.simulation.estimator not in ESTIMATORS:
        raise refuse("estimator", plan.simulation.estimator, ESTIMATORS)
    if plan.simulation.integrator not in RULES:
        raise refuse("integrator", plan.simulation.integrator, RULES)
    check_rotors(plan.nominal)
    if np.any(LinkChain.from_model(plan.nominal.model).prismatic):
        raise refuse("arm", "prismatic joints", ["arms of revolute joints"])


def check_rotors(vehicle: Vehicle) -> None:
    """Refuse more rotors than a word has bits for."""
    if vehicle.rotors.count > MOST_ROTORS:
        raise refuse(
            "rotors",
            f"{vehicle.name}: {vehicle.rotors.count}",
            [f"vehicles of up to {MOST_ROTORS} rotors"],
        )


def links_of(vehicle: Vehicle) -> Array:
    """The vehicle's chain as rows of `dynamics`."""
    return chain_rows(LinkChain.from_model(vehicle.model))


def craft_of(plan: FlightPlan, links: Array) -> Craft:
    """The vehicle that flies; `links` is its chain."""
    s, rotors = plan.simulation, plan.true.rotors
    spans = -s.plant_period / np.maximum(rotors.lags, 1e-12)
    decay = np.exp(np.array([[0.0], [0.5], [1.0]]) * spans)
    plant = np.array([RULES[s.integrator], s.plant_period, s.substeps, plan.true.gravity])
    return Craft(links, own(np.vstack([rotors.coupling_matrix, decay]).T), plant)


def _pid(controller: PidBase, numbers: Array, kind: int, rounds: int = 1) -> None:
    law, bounds, mass = controller.law, controller.settings.wrench_bounds, controller.vehicle.mass
    numbers[laws.OF_ERROR] = law.proportional_gain
    numbers[laws.OF_RATE] = law.derivative_gain
    numbers[laws.OF_INTEGRATION] = law.integral_gain * law.period
    numbers[laws.LIMIT] = law.integral_limit
    if bounds is not None:
        numbers[laws.UPPER] = bounds
        numbers[laws.LOWER] = -numbers[laws.UPPER]
        numbers[laws.LOWER, 2] = 0.0
    pairs = np.triu_indices(3)
    numbers[laws.INERTIA] = controller.rigid_inertia[pairs]
    numbers[laws.INVERSE] = np.linalg.inv(controller.rigid_inertia)[pairs]
    drain, gravity = law.anti_windup * law.period, controller.vehicle.gravity
    numbers[laws.MISC] = [kind, drain, rounds, mass, mass * gravity, gravity]


def _rigid_body(controller: Pid, numbers: Array) -> None:
    _pid(controller, numbers, laws.PID)


def _dc_pid(controller: DcPid, numbers: Array) -> None:
    previous = controller.settings.compensation == "previous_wrench"
    kind = laws.DC_PID_PREVIOUS if previous else laws.DC_PID
    _pid(controller, numbers, kind, controller.settings.rounds)


def _backstepping(controller: Backstepping, numbers: Array) -> None:
    numbers[laws.OF_ERROR] = controller._of_error
    numbers[laws.OF_SLOPE] = controller._of_derivative
    numbers[laws.OF_RATE] = controller._of_rate
    numbers[laws.OF_INTEGRATION] = controller._step
    numbers[laws.LIMIT] = controller._limit
    drain = controller.settings.anti_windup * controller.period
    gravity = controller.vehicle.gravity
    numbers[laws.MISC] = [laws.BACKSTEPPING, drain, 1, 1.0, 0.0, gravity]


LAWS: dict[type[Controller], Any] = {
    Pid: _rigid_body,
    DcPid: _dc_pid,
    Backstepping: _backstepping,
}
"""The controllers that are compiled, and how each becomes numbers. A class derived from one of
them is another law and not covered."""


def law_of(controller: Controller, links: Array) -> Law:
    """A controller as numbers; `links` is the chain of its vehicle."""
    numbers = np.zeros((10, 6))
    numbers[laws.LOWER], numbers[laws.UPPER] = -np.inf, np.inf
    LAWS[type(controller)](controller, numbers)
    return Law(numbers, links)


def law_memory() -> Array:
    """The memory of a law before its first tick."""
    return np.zeros((7, 6))


def allotment_of(allocator: Allocator) -> Allotment:
    """The allocation problem of an allocator, before its first wrench."""
    box, rotors = allocator._box, allocator.rotors
    columns = [
        box.gain.T,
        box.offset,
        rotors.normalized_coupling,
        box.A,
        box.prior,
        box.upper,
        np.einsum("ij,ij->j", box.A, box.A) + box.eps,
        rotors.max_speeds,
    ]
    scales = np.array([*box.weights, box.eps, allocator._tolerance_squared])
    return fresh_allotment(own(np.vstack(columns).T), scales)


def fresh_allotment(box: Array, scales: Array) -> Allotment:
    """A problem with a memory of its own."""
    n = len(box)
    allotment = Allotment(
        box,
        scales,
        np.append(np.full(SLOTS, -1, dtype=np.int64), 0),
        np.zeros((SLOTS * (n + FORCE_ROWS), 7)),
        np.zeros((4, n)),
        np.zeros((2, 6)),
        np.zeros((2, n), dtype=np.int64),
        np.zeros(100 + 20 * n, dtype=np.int64),
        np.zeros(N_COUNTERS, dtype=np.int64),
    )
    start_afresh(allotment)
    return allotment


def start_afresh(allotment: Allotment) -> None:
    """Forget where the last search ended, but not the maps, which depend on the problem alone."""
    allotment.unknowns[:] = 0.0
    allotment.unknowns[SOLUTION] = allotment.box[:, PRIOR]
    allotment.sets[:] = 0


def arm_of(links: Array, theta: Array, dtheta: Array, ddtheta: Array) -> Array:
    """The arm's motion, shape (rows, n, ARM_WIDTH), from angles and rates of shape (rows, n).

    `links` is the chain of any vehicle whose links are as long; see `dynamics.place_arm`.
    """
    arm = np.zeros((*theta.shape, ARM_WIDTH))
    place(links, own(theta), own(dtheta), own(ddtheta), arm)
    return arm


def tables_of(plan: FlightPlan, links: Array) -> Tables:
    """The tables of a plan; `links` is the nominal chain."""
    N, reference, ahead = plan.t.size, plan.reference, plan.anticipation
    if ahead is None:
        rows, moving = np.zeros((N, 18)), np.zeros(N, dtype=np.bool_)
    else:
        parts = [ahead.rows["pose"], ahead.rows["velocity"], np.zeros((N, 3)), ahead.rows["turn"]]
        rows = np.hstack(parts)
        moving = np.array(rows.any(axis=1), dtype=np.bool_)
    return Tables(
        own(reference.pose),
        own(reference.velocity),
        own(reference.acceleration),
        arm_of(links, plan.arm.theta, plan.arm.dtheta, plan.arm.ddtheta),
        own(rows),
        moving,
    )


def draw_of(forecast: Forecast) -> Draw:
    """The weather as arrays."""
    return Draw(own(forecast.pose_noise), own(forecast.disturbance))


def rules_of(plan: FlightPlan) -> Array:
    """Rates and bounds."""
    s = plan.simulation
    pose_period = s.pose_period or s.control_period
    gain = min(1.0, s.filter_cutoff * pose_period)
    return np.array(
        [
            ESTIMATORS[s.estimator],
            s.pose_every,
            s.delay_periods,
            gain,
            gain / pose_period,
            plan.forecast.pose_noise.any(),
            max(1, round(DIVERGENCE_PERIOD / s.control_period)),
            s.max_position_error,
            np.radians(s.max_attitude_error_deg),
            *plan.scenario.axes_mask[:3],
        ],
        dtype=np.float64,
    )


def state_at(pose: Array) -> Array:
    """At rest at a pose."""
    state = np.zeros((8, 7))
    state[[POSE, READING, ESTIMATE, TOLD]] = pose
    return state


def job_of(plan: FlightPlan) -> Job:
    """Everything about a flight as arrays; raises as `check`."""
    check(plan)
    s, nominal = plan.simulation, plan.nominal
    axes, links = plan.scenario.axes_mask, links_of(nominal)
    controller = controller_class(plan.controller)(nominal, plan.settings, s.control_period, axes)
    allocator = Allocator(nominal.rotors, axes=np.array(axes), vehicle_name=nominal.name)
    return Job(
        craft_of(plan, links_of(plan.true)),
        law_of(controller, links),
        law_memory(),
        allotment_of(allocator),
        tables_of(plan, links),
        draw_of(plan.forecast),
        rules_of(plan),
        state_at(plan.scenario.initial_pose),
        np.tile(hover_speeds(plan, allocator), (2, 1)),
    )


def log_of(columns: dict[str, Array]) -> Log:
    """The columns that the loop writes."""
    return Log(**{name: columns[name] for name in Log._fields})
