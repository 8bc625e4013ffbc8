"""One flight, flown: the loop of sensors, controller, allocation and plant.

What can be known before take-off stands in the tables of the `FlightPlan`, so the loop reads as one
sentence.
"""

from __future__ import annotations

import platform
from collections.abc import Iterator
from importlib.metadata import version

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import fullam.version
from fullam.control.allocation import Allocator
from fullam.control.controller import Controller, Measurement, ReferencePoint, controller_class
from fullam.dynamics.pose_space import AttitudeView
from fullam.simulation.flight_plan import (
    DIVERGENCE_PERIOD,
    FlightPlan,
    divergence,
    hover_speeds,
    make_estimator,
)
from fullam.simulation.plant import Plant
from fullam.simulation.run import FORMAT, Run, allocate_columns
from fullam.simulation.sensors import Sensors

Array = NDArray[np.float64]


class Flight:
    """The reference engine: flies a plan tick by tick, in Python.

    Iterate over `ticks()`; after each tick the row of that tick is in the log and the plant stands
    at the next one. A viewer may stop at any tick; `run()` gives the record so far.

    Attributes:
        plan: What is flown.
        plant: The true vehicle.
        controller: The law.
        allocator: Wrench to rotor speeds.
        outcome: "flying", "completed" or "diverged".
        reason: Why it diverged.
        ticks_flown: Rows of the log that are written.
    """

    def __init__(self, plan: FlightPlan) -> None:
        """Place the vehicle at the scenario's start, at rest, its rotors at hover speed."""
        self.plan = plan
        nominal, simulation = plan.nominal, plan.simulation
        axes = plan.scenario.axes_mask
        self.allocator = Allocator(nominal.rotors, axes=np.array(axes), vehicle_name=nominal.name)
        self.controller: Controller = controller_class(plan.controller)(
            nominal, plan.settings, simulation.control_period, axes
        )
        self.estimator = make_estimator(simulation, plan.weather, nominal.gravity)
        self._log = allocate_columns(plan.t.size, nominal.n_arm, nominal.rotors.count)
        self.measurement = Measurement(nominal)
        self.measurement.q[:7] = plan.scenario.initial_pose
        self.measurement.q[7:] = plan.arm.theta[0]
        self._attitude = AttitudeView()
        self._data = nominal.create_data()
        self._at_origin = nominal.neutral()
        self.plant = Plant(
            plan.true,
            plan.arm,
            plan.scenario.initial_pose,
            hover_speeds(plan, self.allocator),
            simulation.plant_period,
            simulation.integrator,
        )
        self.sensors = Sensors(simulation, plan.forecast, plan.nominal.gravity, self._log["pose"])
        self.outcome, self.reason = "flying", ""
        self.ticks_flown = 0

    def ticks(self) -> Iterator[int]:
        """Fly; yields the number of each tick once its row is written and its period flown."""
        plan, plant, log, m = self.plan, self.plant, self._log, self.measurement
        sensors, estimator, controller = self.sensors, self.estimator, self.controller
        allocator, attitude = self.allocator, self._attitude
        anticipation = plan.anticipation
        inertial = estimator.needs_inertial
        reference, arm, substeps = plan.reference, plan.arm, plan.simulation.substeps
        poses, velocities, accelerations = (
            reference.pose,
            reference.velocity,
            reference.acceleration,
        )
        max_speeds = plan.nominal.rotors.max_speeds
        normalized_coupling = plan.nominal.rotors.normalized_coupling
        gusts = plan.forecast.disturbance
        gusting: list[bool] = np.any(gusts != 0.0, axis=1).tolist()
        point = ReferencePoint()
        wrench_A = np.empty(6)
        last = plan.t.size - 1
        look_every = max(1, round(DIVERGENCE_PERIOD / plan.simulation.control_period))
        for k, t in enumerate(plan.t.tolist()):
            log["pose"][k] = plant.q[:7]
            log["velocity"][k] = plant.v[:6]
            log["rotor_speeds"][k] = plant.speeds
            if k % look_every == 0 and self._has_diverged(k):
                return
            readings = sensors.read(k, plant)
            if inertial:
                sensors.read_inertial(k, plant)
            row = plan.arm_row(k)
            m.q[7:], m.v[6:] = arm.theta[row], arm.dtheta[row]
            m.arm_acceleration = arm.ddtheta[row]
            point.pose, point.velocity = poses[k], velocities[k]
            point.acceleration = accelerations[k]
            if k == 0:
                estimator.reset(readings)
                estimator.update(readings, m)
                controller.reset(m, point)
            else:
                estimator.update(readings, m)

            ahead = anticipation if anticipation is not None and anticipation.moving[k] else None
            if ahead is not None:
                ahead.advance(k, m)

            wrench_W = controller.wrench(t, m, point)
            R_WA = ahead.attitude_of_thrust(k, m) if ahead is not None else attitude.look(m.q[:7])
            np.dot(wrench_W.reshape(2, 3), R_WA, out=wrench_A.reshape(2, 3))
            u = allocator.allocate(wrench_A)
            if allocator.saturated:
                u = allocator.allocate_about(wrench_A, self._center_of_mass())
                achieved_A = normalized_coupling @ u
                controller.delivered((achieved_A.reshape(2, 3) @ R_WA.T).ravel())
                log["residual"][k] = achieved_A - wrench_A
                log["saturated"][k] = True
            speeds = max_speeds * np.sqrt(u)

            log["measured_pose"][k] = m.q[:7]
            log["measured_velocity"][k] = m.v[:6]
            log["u_pid"][k] = controller.u_pid
            log["u_dc"][k] = controller.u_dc
            log["command"][k] = wrench_W
            log["rotor_commands"][k] = speeds
            self.ticks_flown = k + 1
            if k < last:
                plant.advance(speeds, gusts[k] if gusting[k] else None, substeps)
            yield k
        self.outcome = "completed"

    def _center_of_mass(self) -> Array:
        """Centre of mass of the nominal vehicle in {A} for the arm as it is, shape (3,) [m]."""
        self._at_origin[7:] = self.measurement.q[7:]
        return pin.centerOfMass(self.plan.nominal.model, self._data, self._at_origin)

    def _has_diverged(self, k: int) -> bool:
        reason = divergence(self.plan, k, self._log["pose"][k])
        if reason is not None:
            self.outcome, self.reason = "diverged", reason
        return reason is not None

    def run(self) -> Run:
        """The record so far; columns that follow from others are computed here, at once."""
        return finish(self.plan, self._log, self.ticks_flown, self.outcome, self.reason)


def finish(
    plan: FlightPlan,
    log: dict[str, Array],
    rows: int,
    outcome: str,
    reason: str,
    engine: str = "reference",
) -> Run:
    """Turn a log whose velocities are in body axes into a run.

    Args:
        plan: What was flown.
        log: Columns, of which pose, velocity, measured_pose, measured_velocity (body axes), u_pid,
            u_dc, command, residual, saturated, rotor_commands and rotor_speeds are written.
        rows: How many rows are written.
        outcome: "completed", "diverged" or "flying".
        reason: Why it diverged.
        engine: Which engine flew it.
    """
    out = {name: column[:rows].copy() for name, column in log.items()}
    out["t"] = plan.t[:rows].copy()
    arm_rows = plan.arm_row(1) * np.arange(rows)
    out["arm"], out["arm_rate"] = plan.arm.theta[arm_rows], plan.arm.dtheta[arm_rows]
    out["reference_pose"] = plan.asked.pose[:rows].copy()
    out["disturbance"] = plan.forecast.disturbance[:rows].copy()
    R_true = Rotation.from_quat(out["pose"][:, 3:]).as_matrix()
    R_told = Rotation.from_quat(out["measured_pose"][:, 3:]).as_matrix()
    out["velocity"] = _turn(R_true, out["velocity"])
    out["measured_velocity"] = _turn(R_told, out["measured_velocity"])
    R_thrust = R_told
    if plan.anticipation is not None:
        R_thrust = R_told @ Rotation.from_rotvec(plan.anticipation.turn[:rows, 3:]).as_matrix()
    if not all(plan.scenario.axes_mask):
        # On axes that nobody controls the allocation falls short without being saturated.
        asked_A = _turn(R_thrust.transpose(0, 2, 1), out["command"])
        rotors_A = np.square(out["rotor_commands"]) @ plan.nominal.rotors.coupling_matrix.T
        out["residual"] = rotors_A - asked_A
    out["delivered"] = out["command"] + _turn(R_thrust, out["residual"])
    rotor_A = np.square(out["rotor_speeds"]) @ plan.true.rotors.coupling_matrix.T
    out["rotor_wrench"] = _turn(R_true, rotor_A)
    metadata = {
        "format": FORMAT,
        "scenario": plan.scenario.to_dict(),
        "vehicle": plan.nominal.to_data(),
        "controller": plan.controller,
        "settings": plan.settings.to_dict(),
        "simulation": plan.simulation.to_dict(),
        "weather": plan.weather.to_dict(),
        "seed": plan.seed,
        "outcome": outcome,
        "reason": reason,
        "engine": engine,
        "versions": {
            "fullam": fullam.version.__version__,
            "python": platform.python_version(),
            **{name: version(name) for name in ("pin", "numpy", "scipy", "proxsuite")},
        },
    }
    return Run(out, metadata)


def _turn(R: Array, wrenches: Array) -> Array:
    """Turn both halves of 6-vectors, shape (N, 6), by rotations, shape (N, 3, 3)."""
    halves = wrenches.reshape(-1, 2, 3)
    return np.einsum("nij,nkj->nki", R, halves).reshape(-1, 6)
