"""From what a flight has written to its record: columns that follow from others, and metadata."""

from __future__ import annotations

import functools
import platform
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.control.controllers import plain_settings
from fullam.control.trim import Trim
from fullam.dynamics.quaternions import from_rotation_vector
from fullam.dynamics.rotations import quaternion_rotation
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.oscillation import flight_swing
from fullam.simulation.record.flown_plugins import plugins_of
from fullam.simulation.record.run import FORMAT, Run, columns_of
from fullam.simulation.world.scene_joints import COLUMN, SceneJoint
from fullam.version import __version__, version_of

Array = NDArray[np.float64]


def finish(
    plan: FlightPlan,
    log: dict[str, Array],
    outcome: str,
    reason: str,
    driver: str = "python",
    touched: Mapping[str, Any] | None = None,
    scene: Sequence[SceneJoint] = (),
) -> Run:
    """Turn what the stages wrote into a run.

    Args:
        plan: What was flown.
        log: The columns that the stages wrote, which the run will own; see `Block.columns`.
        outcome: "completed", "diverged" or "flying"; what completed may turn out "oscillating".
        reason: Why it diverged.
        driver: Which driver flew it.
        touched: Columns that are not the plan's because a hand changed them, and more metadata
            under "metadata".
        scene: Joints of the scene around it, whose coordinates the log has.
    """
    changed = dict(touched or {})
    more = changed.pop("metadata", {})
    rows = len(log["pose"])
    arm_rows = plan.arm_row(1) * np.arange(rows)
    out = {
        "t": plan.t[:rows].copy(),
        "arm": plan.arm.theta[arm_rows],
        "arm_rate": plan.arm.dtheta[arm_rows],
        "reference_pose": plan.asked.pose[:rows].copy(),
    }
    out |= log  # a plant whose joints are free wrote what they did
    out |= {name: column[:rows].copy() for name, column in changed.items()}
    if not all(plan.scenario.axes_mask):
        out |= _of_masked_axes(plan, out)
    if outcome == "completed" and not touched:  # who was pulled about may swing
        swings = flight_swing(plan, out["pose"])
        outcome, reason = ("oscillating", str(swings)) if swings else (outcome, reason)
    plugins = plugins_of(plan.controller, plan.simulation.estimator, more.get("script"))
    metadata = {
        "format": FORMAT,
        "scenario": plan.scenario.to_dict(),
        "vehicle": plan.nominal.to_data(),
        "controller": plan.controller,
        "settings": plain_settings(plan.controller, plan.settings),
        "simulation": plan.simulation.to_dict(),
        "weather": plan.weather.to_dict(),
        "seed": plan.seed,
        "outcome": outcome,
        "reason": reason,
        "driver": driver,
        "versions": _versions(driver, plan.simulation.plant),
        **({"plugins": plugins} if plugins else {}),
        **trim_data(plan.trim),
        **more,
    }
    names = [*columns_of(plan.simulation.plant)]
    if scene:
        metadata[COLUMN] = [joint.to_dict() for joint in scene]
        names.append(COLUMN)
    return Run({name: out[name] for name in names}, metadata)


def trim_data(trim: Trim | None) -> dict[str, Any]:
    """What metadata say of a vehicle with failed rotors: "trim", see `Trim`; nothing of others."""
    return {} if trim is None else {"trim": trim.to_dict()}


DECISIVE = ("pin", "numpy", "scipy", "proxsuite")
"""The packages that decide a flight's last bits."""

DECISIVE_FOR = {
    "fused": ("numba", "llvmlite"),
    "mujoco": ("mujoco",),
    "mujoco-prescribed": ("mujoco",),
}
"""Those that do so under one driver or plant only, by its name."""


@functools.cache
def _versions(driver: str, plant: str) -> dict[str, str]:
    """What flew: versions of this package, Python and all that decides the last bits."""
    more = (*DECISIVE_FOR.get(driver, ()), *DECISIVE_FOR.get(plant, ()))
    return {
        "fullam": __version__,
        "python": platform.python_version(),
        **{name: version_of(name) for name in (*DECISIVE, *more)},
    }


def _of_masked_axes(plan: FlightPlan, log: dict[str, Array]) -> dict[str, Array]:
    """What was delivered where some axes are nobody's, on which it falls short unsaturated."""
    rows, R = len(log["pose"]), quaternion_rotation(log["measured_pose"][:, 3:])
    if plan.anticipation is not None:
        turn = from_rotation_vector(plan.anticipation.rows["turn"][:rows])
        R = R @ quaternion_rotation(turn)
    coupling = plan.nominal.rotors.coupling_matrix
    achieved_A = np.square(log["rotor_commands"]) @ coupling.T
    residual = achieved_A - _turn(R.transpose(0, 2, 1), log["command"])
    return {"residual": residual, "delivered": log["command"] + _turn(R, residual)}


def _turn(R: Array, wrenches: Array) -> Array:
    """Turn both halves of 6-vectors, shape (N, 6), by rotations, shape (N, 3, 3)."""
    halves = wrenches.reshape(-1, 2, 3)
    return np.einsum("nij,nkj->nki", R, halves).reshape(-1, 6)
