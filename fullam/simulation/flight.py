"""One flight, flown: the loop of sensors, controller, allocation and plant.

What can be known before take-off stands in the tables of the `FlightPlan`, so the loop reads as one
sentence.
"""

from __future__ import annotations

import functools
import platform
from collections.abc import Callable, Iterator
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import fullam.version
from fullam.control.allocation import Allocator
from fullam.control.controller import Controller, Measurement, ReferencePoint, controller_class
from fullam.control.estimator import Inertial, Readings
from fullam.control.signals import Estimate
from fullam.control.tick import ControlTick
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial, rotate_spatial, rotate_spatial_back
from fullam.numbers.records import Rows, flat, record
from fullam.numbers.vectors import ZERO
from fullam.simulation.anticipation import advance, thrust_attitude
from fullam.simulation.flight_plan import (
    DIVERGENCE_PERIOD,
    FlightPlan,
    divergence,
    hover_speeds,
    make_estimator,
)
from fullam.simulation.plant import Plant
from fullam.simulation.run import COLUMNS, FORMAT, Run, allocate_columns
from fullam.simulation.sensors import keep_pose, sense_inertial, sense_pose

Array = NDArray[np.float64]


class Flight:
    """The reference engine: flies a plan tick by tick, in Python.

    Iterate over `ticks()`; after each tick the row of that tick is in the log and the plant stands
    at the next one. A viewer may stop at any tick; `run()` gives the record so far.

    Attributes:
        plan: What is flown.
        plant: The true vehicle.
        controller: The law.
        allocator: Wrench to squared speeds.
        tick: Both at work.
        outcome: "flying", "completed" or "diverged".
        reason: Why it diverged.
        ticks_flown: Rows of the log that are written.
        thrust_attitude: Gives the R_WA that turns commands to {A}, for studies of what a wrong
            one costs; None is the estimate's.
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
        self.tick = ControlTick(self.controller, self.allocator)
        self.estimator = make_estimator(simulation, plan.weather, nominal.gravity)
        self._log = allocate_columns(plan.t.size, nominal.n_arm, nominal.rotors.count)
        self._rows = _gather(self._log, PER_TICK)
        self.measurement = Measurement(nominal)
        self.measurement.q[:7] = plan.scenario.initial_pose
        self.measurement.q[7:] = plan.arm.theta[0]
        self.plant = Plant(
            plan.true,
            plan.arm,
            plan.scenario.initial_pose,
            hover_speeds(plan, self.allocator),
            simulation.plant_period,
            simulation.integrator,
        )
        self.sensors = _Sensors(plan, self.estimator.needs_inertial)
        self._look_every = max(1, round(DIVERGENCE_PERIOD / simulation.control_period))
        self._near = _Near(plan, self._look_every)
        self.thrust_attitude: Callable[[], Array] | None = None
        self.outcome, self.reason = "flying", ""
        self.ticks_flown = 0

    def ticks(self) -> Iterator[int]:
        """Fly; yields the number of each tick once its row is written and its period flown."""
        plan, plant, tick, m = self.plan, self.plant, self.tick, self.measurement
        sensors, estimator, controller = self.sensors, self.estimator, self.controller
        anticipation = plan.anticipation
        ahead = [] if anticipation is None else anticipation.rows.to_list()
        reference, arm, substeps = plan.reference, plan.arm, plan.simulation.substeps
        arm_rows = 2 * substeps  # of the arm's table in a control period
        gusts = plan.forecast.disturbance
        gusting: list[bool] = np.any(gusts != 0.0, axis=1).tolist()
        point = ReferencePoint()
        last, look_every = plan.t.size - 1, self._look_every
        poses, rows = self._log["pose"], self._rows
        residuals, saturated = self._log["residual"], self._log["saturated"]
        pose, told_pose, arm_angles = plant.q[:7], m.q[:7], m.q[7:]
        velocity, told_velocity, arm_rates = plant.v[:6], m.v[:6], m.v[6:]
        for k, t in enumerate(plan.t.tolist()):
            poses[k] = pose
            if k % look_every == 0 and self._has_diverged(k):
                return
            readings = sensors.read(k, plant)
            row = arm_rows * k
            arm_angles[:], arm_rates[:] = arm.theta[row], arm.dtheta[row]
            m.arm_acceleration = arm.ddtheta[row]
            point.pose, point.velocity = reference.pose[k], reference.velocity[k]
            point.acceleration = reference.acceleration[k]
            if k == 0:
                estimator.reset(readings)
                estimator.update(readings, m)
                controller.reset(m, point)
            else:
                estimator.update(readings, m)

            R_thrust = None if self.thrust_attitude is None else self.thrust_attitude()
            if anticipation is not None and anticipation.moves:
                now = advance(_estimate_of(m), ahead[k])
                R = rotation_matrix(now.pose.attitude)
                m.q[:7] = [*flat(now.pose)]
                m.v[:6] = [*flat(rotate_spatial_back(R, now.velocity))]
                R_thrust = np.reshape(rotation_matrix(thrust_attitude(now, ahead[k])), (3, 3))
            speeds = tick.speeds(t, m, point, R_thrust)
            if tick.saturated:
                residuals[k], saturated[k] = tick.residual, True

            told = (velocity, told_pose, told_velocity, controller.u_pid, controller.u_dc)
            np.concatenate((*told, tick.command, speeds, plant.speeds), out=rows[k])
            self.ticks_flown = k + 1
            if k < last:
                plant.advance(speeds, gusts[k] if gusting[k] else None, substeps)
            yield k
        self.outcome = "completed"

    def _has_diverged(self, k: int) -> bool:
        if self._near.surely(k, self._log["pose"][k]):
            return False
        reason = divergence(self.plan, k, self._log["pose"][k])
        if reason is not None:
            self.outcome, self.reason = "diverged", reason
        return reason is not None

    def run(self) -> Run:
        """The record so far; columns that follow from others are computed here, at once."""
        return finish(self.plan, self._log, self.ticks_flown, self.outcome, self.reason)


PER_TICK = (
    "velocity",
    "measured_pose",
    "measured_velocity",
    "u_pid",
    "u_dc",
    "command",
    "rotor_commands",
    "rotor_speeds",
)
"""Columns of the log that every tick writes at once, in this order."""


def _gather(log: dict[str, Array], names: tuple[str, ...]) -> Array:
    """Make columns of a log views of one table, side by side, which is returned.

    One row is then written by one call: eight assignments cost three times as much.
    """
    widths = [log[name].shape[1] for name in names]
    table = np.zeros((len(log[names[0]]), sum(widths)))
    for name, start, width in zip(names, np.cumsum([0, *widths]), widths, strict=False):
        log[name] = table[:, start : start + width]
    return table


class _Sensors:
    """The sensors' kernels, read from the plant once a control period."""

    def __init__(self, plan: FlightPlan, inertial: bool) -> None:
        settings, draw = plan.simulation, plan.forecast
        self._every, self._gravity = settings.pose_every, plan.nominal.gravity
        self._ring: list[Any] = [None] * (settings.delay_periods + 1)
        self._noise = Rows(Spatial, draw.pose_noise).to_list()
        self._inertial_noise: list[Inertial] = []
        if inertial:
            noise = np.hstack([draw.gyroscope_noise, draw.accelerometer_noise])
            self._inertial_noise = Rows(Inertial, noise).to_list()
        self._pose: Any = None

    def read(self, k: int, plant: Plant) -> Readings:
        pose, v = record(Pose, plant.q[:7]), record(Spatial, plant.v[:6])
        keep_pose(self._ring, pose, k)
        self._pose = sense_pose(self._ring, self._noise[k], self._pose, self._every, k)
        felt = Inertial(ZERO, ZERO)
        if self._inertial_noise:
            a = record(Spatial, plant.acceleration)
            felt = sense_inertial(pose.attitude, v, a, self._gravity, self._inertial_noise[k])
        return Readings(self._pose, v, *felt)


def _estimate_of(m: Measurement) -> Estimate:
    pose, v = record(Pose, m.q[:7]), record(Spatial, m.v[:6])
    return Estimate(pose, rotate_spatial(rotation_matrix(pose.attitude), v))


class _Near:
    """A quick look at the bounds of sense, which sends all doubtful cases to `divergence`."""

    MARGIN = 0.99
    """Share of a bound within which a pose is surely near."""

    def __init__(self, plan: FlightPlan, every: int) -> None:
        settings, mask = plan.simulation, plan.scenario.axes_mask
        self._every = every
        self._targets: list[list[float]] = plan.reference.pose[::every].tolist()
        self._mask = tuple(float(a) for a in mask[:3])
        self._square = (self.MARGIN * settings.max_position_error) ** 2
        half_angle = np.radians(min(180.0, self.MARGIN * settings.max_attitude_error_deg)) / 2.0
        self._cosine = float(np.cos(half_angle))

    def surely(self, k: int, pose: Array) -> bool:
        """Whether the pose, shape (7,), is well within the bounds around row k (NaN is not)."""
        x, y, z, a, b, c, d = pose.tolist()
        X, Y, Z, A, B, C, D = self._targets[k // self._every]
        u, v, w = self._mask
        near = u * (x - X) ** 2 + v * (y - Y) ** 2 + w * (z - Z) ** 2 < self._square
        return near and abs(a * A + b * B + c * C + d * D) > self._cosine


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
        log: The columns of `LOGGED`, velocities in body axes.
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
        turn = plan.anticipation.rows["turn"][:rows].copy()
        R_thrust = R_told @ Rotation.from_rotvec(turn).as_matrix()
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
        "versions": _versions(engine),
    }
    return Run({name: out[name] for name in COLUMNS}, metadata)


DECISIVE = ("pin", "numpy", "scipy", "proxsuite")
"""The packages that decide a flight's last bits."""

DECISIVE_FOR = {"compiled": ("numba", "llvmlite")}
"""Those that do so under one engine only, by its name."""


@functools.cache
def _versions(engine: str) -> dict[str, str]:
    """What flew: versions of this package, Python and all that decides the last bits."""
    return {
        "fullam": fullam.version.__version__,
        "python": platform.python_version(),
        **{name: version(name) for name in (*DECISIVE, *DECISIVE_FOR.get(engine, ()))},
    }


def _turn(R: Array, wrenches: Array) -> Array:
    """Turn both halves of 6-vectors, shape (N, 6), by rotations, shape (N, 3, 3)."""
    halves = wrenches.reshape(-1, 2, 3)
    return np.einsum("nij,nkj->nki", R, halves).reshape(-1, 6)
