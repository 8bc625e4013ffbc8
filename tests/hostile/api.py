"""Calls of the Python API with one argument that does not belong there."""

from __future__ import annotations

import contextlib
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import api_flights
import numpy as np
from answers import PATIENCE, Hang, forget_plugins, patience

from fullam.analysis.agreement import agreement
from fullam.analysis.campaign import Campaign
from fullam.analysis.contender import Contender
from fullam.control.controllers import controller_names, make_settings
from fullam.control.estimators import make_estimator_settings
from fullam.control.governor import Governor
from fullam.exceptions import FullamError
from fullam.model import wrench_axes
from fullam.model.chain import LinkChain, release_joint, released_model
from fullam.model.design import VehicleDesign, design_vehicle
from fullam.model.loading import load_vehicle, vehicle_path
from fullam.model.perturbation import Uncertainty, perturb
from fullam.model.rotors import Rotors
from fullam.model.vehicle import Vehicle
from fullam.simulation.motions.arm_motion import HoldArm, JointTrajectory, SineRate
from fullam.simulation.motions.motion_rows import ReferenceRows
from fullam.simulation.motions.references import Circle, Step, Trajectory, Waypoints
from fullam.simulation.motions.shaping import Shaping
from fullam.simulation.record.run import Run
from fullam.simulation.scenarios.scenario import Scenario, load_scenario, register_scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.simulate import simulate
from fullam.simulation.tool.paths import CirclePath, LinePath, SquarePath
from fullam.simulation.tool.task import ToolTask
from fullam.simulation.tool.weights import ToolWeights
from fullam.simulation.weather import Weather, weather

WRONG: tuple[Any, ...] = (
    *(None, True, 3, -1, 10**400, 0.5, float("nan"), float("-inf"), 1j, "", "x", "a\0b", b"x"),
    *([], [None], ["x"], [1, 2], [[1, 2], [3]], (), {}, {"a": 1}, {1: 2}, set(), object(), print),
    *(
        object,
        np.zeros(0),
        np.zeros((2, 2)),
        np.array(["x"]),
        np.array([np.nan] * 3),
        np.float64(2),
    ),
    *(np.array(3), np.array([1j, 2, 3]), np.ma.masked, Path("x"), slice(3), Exception("x"), ...),
)
"""What a slip of the fingers, or a column of a data frame, may put there."""


def settings_of(law: str) -> Callable[..., Any]:
    """Makes the settings of a law, each given by name."""
    return lambda **changes: make_settings(law, changes)


def smooth_motions() -> list[tuple[Callable[..., Any], dict[str, Any]]]:
    """Smooth motions of platform and arm, whatever they are made from."""
    times, points, angles = (0.0, 1.0), ((0, 0, 1), (1, 0, 1)), ((0, 0, 0), (0, 0, 9))
    quaternions, velocities = ((0.0, 0.0, 0.0, 1.0),) * 2, ((1, 0, 0),) * 2
    choices = {"degree": 3, "ends": "free", "at": 0.5}
    through = {"waypoints": points, "times": times, "euler_deg": angles, "at": 0.5}
    joints = {"waypoints_deg": angles, "times": times, "joints": ("a", "b", "c"), "at": 0.5}
    rows = {"times": times, "positions": points, "quaternions": quaternions}
    arm = {"times": times, "positions_deg": points, "joints": ("a", "b", "c")}
    return [
        (Trajectory, {**rows, "velocities": velocities, **choices}),
        (Trajectory.from_arrays, {"t": times, "position": points, "euler_deg": angles, **choices}),
        (Trajectory.from_csv, {"path": Path(__file__).with_name("tour.csv"), **choices}),
        (Trajectory.minimum_snap, through),
        (Trajectory.b_spline, {**through, "degree": 5}),
        (JointTrajectory, {**arm, "units": ("deg", "m", "deg"), **choices}),
        (JointTrajectory.from_arrays, {"t": times, "positions_deg": points, **choices}),
        (JointTrajectory.minimum_snap, joints),
        (JointTrajectory.b_spline, {**joints, "degree": 5}),
        (ReferenceRows, {"period": 0.01, "packed": "abcd", "made_by": "x"}),
    ]


def tool_tasks() -> list[tuple[Callable[..., Any], dict[str, Any]]]:
    """What a tool may be told."""
    normal, weights = (1.0, 0.0, 0.0), ToolWeights().to_dict()
    task = {"attitude": "fixed", "euler_deg": (0, 0, 9), "priority": "strict", "at": 0.5}
    data = ToolTask(CirclePath(0.1)).to_dict()
    return [
        (LinePath, {"to": normal, "duration": 4.0}),
        (CirclePath, {"radius": 0.1, "normal": normal, "duration": 4.0, "rounds": 2.0}),
        (SquarePath, {"side": 0.1, "normal": normal, "duration": 4.0}),
        (ToolWeights, weights),
        (ToolTask, {"path": CirclePath(0.1), **task, "weights": ToolWeights()}),
        (ToolTask, {"path": CirclePath(0.1), "max_speed": 1.0, "max_turn_deg": 9.0}),
        (ToolTask.from_dict, {"data": data}),
    ]


def calls() -> list[tuple[Callable[..., Any], dict[str, Any]]]:
    """Functions and classes with arguments that are right."""
    vehicle, rng = load_vehicle("fullam"), np.random.default_rng(0)
    rotors = vehicle.rotors
    columns = {f: getattr(rotors, f) for f in ("names", "positions", "axes", "spins")}
    columns |= {f: getattr(rotors, f) for f in ("k_f", "k_tau", "max_speeds", "min_speeds")}
    columns |= {f: getattr(rotors, f) for f in ("lags", "where")}
    paper = weather("paper")
    scenario = load_scenario("task-2")
    design = {"rotor_count": 6, "cant_deg": 30.0, "platform_mass": 2.0, "k_f": 1e-5}
    return [
        (load_vehicle, {"name_or_path": "fullam"}),
        (vehicle_path, {"name_or_path": "fullam"}),
        (design_vehicle, {"base": "fullam", "name": "six", **design}),
        (Vehicle.from_definition, {"definition": vehicle.definition, "urdf_text": vehicle.urdf}),
        (Vehicle.from_data, {"data": vehicle.to_data()}),
        (vehicle.neutral, {"theta": [0.0] * 4}),
        (vehicle.actuation_rank, {"axes": (True,) * 6}),
        (vehicle.require_full_actuation, {"axes": [2, 3]}),
        (Rotors, columns),
        (rotors.wrench, {"speeds": np.zeros(rotors.count)}),
        (Uncertainty, {"share": 0.1, "parameters": ("k_f",)}),
        (Uncertainty.from_dict, {"data": paper.uncertainty.to_dict()}),
        (
            perturb,
            {"vehicle": vehicle, "uncertainty": Uncertainty(), "rng": rng},
        ),
        (LinkChain.from_model, {"model": vehicle.model, "tool": vehicle.tool}),
        (LinkChain.from_vehicle, {"vehicle": vehicle, "released": None}),
        (LinkChain.stack, {"chains": [LinkChain.from_vehicle(vehicle)] * 2}),
        (release_joint, {"urdf": vehicle.urdf, "joint": "tool_joint"}),
        (released_model, {"vehicle": vehicle, "joint": "tool_joint"}),
        (wrench_axes.rank_on, {"rotors": rotors, "axes": None}),
        (wrench_axes.controllable_axes, {"rotors": rotors}),
        (Step, {"position": (0, 0, 1), "euler_deg": (0, 0, 0), "at": 1.0}),
        (Waypoints, {"times": (0.0,), "positions": ((0, 0, 1),), "euler_deg": ((0, 0, 0),)}),
        (Circle, {"center": (0, 0, 1), "radius": 1.0, "period": 6.0, "euler_deg": (0, 0, 0)}),
        (SineRate, {"joint": 3, "rate": 0.5, "frequency": 1.0}),
        *smooth_motions(),
        (Scenario, {f: getattr(scenario, f) for f in Scenario.__dataclass_fields__}),
        (Scenario.from_dict, {"data": scenario.to_dict()}),
        (load_scenario, {"name_or_path": "task-1"}),
        (register_scenario, {"scenario": scenario}),
        *tool_tasks(),
        (Weather, {f: getattr(paper, f) for f in Weather.__dataclass_fields__}),
        (Weather.from_dict, {"data": paper.to_dict()}),
        (weather, {"name": "paper"}),
        (SimulationSettings, SimulationSettings().to_dict()),
        (Governor, vars(Governor())),
        (Shaping, Shaping().to_dict()),
        (Shaping.from_dict, {"data": {}}),
        (make_settings, {"name": "dc-pid", "changes": {"rounds": 2}}),
        (make_estimator_settings, {"name": "kalman", "changes": {"initial_speed": 0.1}}),
        *((settings_of(law), make_settings(law).to_dict()) for law in controller_names()),
        (VehicleDesign, VehicleDesign.from_table(vehicle.definition["design"]).to_table()),
        (VehicleDesign.from_table, {"table": vehicle.definition["design"]}),
        (
            simulate,
            {
                "scenario": replace(scenario, duration=0.02),
                "controller": "pid",
                "driver": "python",
                "vehicle": vehicle,
                "seed": 1,
                "weather": "calm",
                "calm": False,
                "settings": {},
                "simulation": {"governor": "off"},
                "shaping": {},
            },
        ),
        (SimulationSettings.from_dict, {"data": SimulationSettings().to_dict()}),
        (SimulationSettings().check_length, {"duration": 6.0}),
        (Run.load, {"path": "run.npz"}),
        (agreement, {"vehicle": vehicle, "samples": 6, "seed": 0}),
        (Contender, {"controller": "pid", "settings": {}, "estimator": "truth", "label": "x"}),
        (Contender.parse, {"text": "pid@truth"}),
        (
            Campaign,
            {
                "scenarios": (Scenario("brief", duration=0.1, arm_motion=HoldArm()),),
                "contenders": ("pid",),
                "seeds": (0,),
                "weather": None,
                "simulation": SimulationSettings(),
                "driver": "python",
                "traces": False,
            },
        ),
    ]


def failures() -> tuple[int, list[str]]:
    """Number of calls, and those that ended in an error that is none of ours, hung, or left files.

    Relative paths are those of an empty folder meanwhile.
    """
    with tempfile.TemporaryDirectory() as place, contextlib.chdir(place):
        count, found = _called()
        forget_plugins()
        # "x" is among the wrong values, and is a path where a path is wanted.
        left = {path.name for path in Path().iterdir()} - {"x"}
        found += [f"left behind: {name}" for name in sorted(left)]
    return count, found


def _called() -> tuple[int, list[str]]:
    count, found = 0, []
    for function, right in [*calls(), *api_flights.calls()]:
        outcome(function, right)  # compiles what it needs
        for name in right:
            for wrong in WRONG:
                count += 1
                text = outcome(function, right | {name: wrong}, PATIENCE)
                if text:
                    called = getattr(function, "func", function).__qualname__
                    found.append(f"{called}({name}={str(wrong)[:30]}): {text}")
    return count, found


def outcome(function: Callable[..., Any], arguments: dict[str, Any], seconds: int = 0) -> str:
    """What came of a call that should not have come."""
    try:
        with warnings.catch_warnings(), patience(seconds):
            warnings.simplefilter("ignore")
            function(**arguments)
    except FullamError as error:
        return "" if str(error).strip() else "no message"
    except (Exception, Hang) as error:  # noqa: BLE001 - which is what is looked for
        return f"{type(error).__name__}: {error}"[:90].replace("\n", " ")
    return ""


if __name__ == "__main__":
    calls_made, bad = failures()
    print("\n".join(bad))  # noqa: T201
    print(f"{calls_made} calls, {len(bad)} with an error of another's")  # noqa: T201
