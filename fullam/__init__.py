"""fullam: fully-actuated aerial manipulators on Pinocchio.

Load a vehicle, fly a scenario under a controller, and ask the record what happened:

    import fullam

    run = fullam.simulate("task-2", "dc-pid", seed=0)
    print(fullam.measure(run))
"""

# isort: off
import fullam.interrupt  # noqa: F401 - first of all: Ctrl-C during the others is one line

# isort: on
from importlib import import_module
from typing import TYPE_CHECKING, Any

from fullam.exceptions import FullamError
from fullam.version import __version__

if TYPE_CHECKING:
    from fullam.analysis.calibration import calibrate
    from fullam.analysis.calibration_flight import excitation_flight
    from fullam.analysis.campaign_table import read_campaign
    from fullam.analysis.diagnosis import diagnose
    from fullam.analysis.external_wrench import WrenchSettings, external_wrench
    from fullam.analysis.margins import loop_margins
    from fullam.analysis.metrics import Metrics, measure
    from fullam.analysis.payload_estimate import PayloadSettings, estimate_payload
    from fullam.control.allocation import Allocation, Allocator
    from fullam.control.controller import Controller
    from fullam.control.controllers import (
        controller_names,
        load_settings,
        make_controller,
        register,
    )
    from fullam.control.estimator import Estimator
    from fullam.control.estimators import estimator_names, register_estimator
    from fullam.control.tunable import tunable
    from fullam.model.design import VehicleDesign, design_vehicle
    from fullam.model.loading import load_vehicle, vehicle_names
    from fullam.model.rotors import Rotors
    from fullam.model.vehicle import Vehicle
    from fullam.plugins import load_plugin
    from fullam.simulation.many import fly_many
    from fullam.simulation.motions.arm_motion import HoldArm, JointTrajectory, SineRate
    from fullam.simulation.motions.arm_table import ArmTable
    from fullam.simulation.motions.reference_table import ReferenceTable
    from fullam.simulation.motions.references import Circle, Step, Trajectory, Waypoints
    from fullam.simulation.motions.shaping import Shaping
    from fullam.simulation.record.refly import refly
    from fullam.simulation.record.run import Run
    from fullam.simulation.scenarios.scenario import (
        Scenario,
        load_scenario,
        register_scenario,
        scenario_names,
    )
    from fullam.simulation.settings import SimulationSettings
    from fullam.simulation.simulate import prepare, simulate
    from fullam.simulation.tool.paths import CirclePath, LinePath, SquarePath
    from fullam.simulation.tool.task import ToolTask
    from fullam.simulation.tool.weights import ToolWeights
    from fullam.simulation.weather import Weather, weather
    from fullam.viz.viewer.studio import fly
    from fullam.viz.viewer.view import view
    from fullam.viz.viewer.widgets import explore

LATER = {
    "fullam.analysis.calibration": ("calibrate",),
    "fullam.analysis.calibration_flight": ("excitation_flight",),
    "fullam.analysis.campaign_table": ("read_campaign",),
    "fullam.analysis.external_wrench": ("WrenchSettings", "external_wrench"),
    "fullam.analysis.diagnosis": ("diagnose",),
    "fullam.analysis.margins": ("loop_margins",),
    "fullam.analysis.metrics": ("Metrics", "measure"),
    "fullam.analysis.payload_estimate": ("PayloadSettings", "estimate_payload"),
    "fullam.control.allocation": ("Allocation", "Allocator"),
    "fullam.control.controller": ("Controller",),
    "fullam.control.controllers": (
        *("controller_names", "load_settings", "make_controller", "register"),
    ),
    "fullam.control.estimator": ("Estimator",),
    "fullam.control.estimators": ("estimator_names", "register_estimator"),
    "fullam.control.tunable": ("tunable",),
    "fullam.model.design": ("VehicleDesign", "design_vehicle"),
    "fullam.model.loading": ("load_vehicle", "vehicle_names"),
    "fullam.model.rotors": ("Rotors",),
    "fullam.model.vehicle": ("Vehicle",),
    "fullam.plugins": ("load_plugin",),
    "fullam.simulation.motions.arm_motion": ("HoldArm", "JointTrajectory", "SineRate"),
    "fullam.simulation.motions.arm_table": ("ArmTable",),
    "fullam.simulation.many": ("fly_many",),
    "fullam.simulation.motions.reference_table": ("ReferenceTable",),
    "fullam.simulation.motions.references": ("Circle", "Step", "Trajectory", "Waypoints"),
    "fullam.simulation.record.refly": ("refly",),
    "fullam.simulation.record.run": ("Run",),
    "fullam.simulation.scenarios.scenario": (
        *("Scenario", "load_scenario", "register_scenario", "scenario_names"),
    ),
    "fullam.simulation.settings": ("SimulationSettings",),
    "fullam.simulation.motions.shaping": ("Shaping",),
    "fullam.simulation.simulate": ("prepare", "simulate"),
    "fullam.simulation.tool.paths": ("CirclePath", "LinePath", "SquarePath"),
    "fullam.simulation.tool.task": ("ToolTask",),
    "fullam.simulation.tool.weights": ("ToolWeights",),
    "fullam.simulation.weather": ("Weather", "weather"),
    "fullam.viz.viewer.studio": ("fly",),
    "fullam.viz.viewer.view": ("view",),
    "fullam.viz.viewer.widgets": ("explore",),
}
"""Modules that are imported when a name of theirs is asked for: a help text flies nothing."""

HOMES = {name: module for module, names in LATER.items() for name in names}


def __getattr__(name: str) -> Any:
    """A name of `LATER`, imported at its first use."""
    if name not in HOMES:
        raise AttributeError(f"module 'fullam' has no attribute '{name}'")
    globals()[name] = getattr(import_module(HOMES[name]), name)
    return globals()[name]


def __dir__() -> list[str]:
    """All names, for completion."""
    return sorted({*globals(), *__all__})


__all__ = [
    "Allocation",
    "Allocator",
    "ArmTable",
    "Circle",
    "CirclePath",
    "Controller",
    "Estimator",
    "FullamError",
    "HoldArm",
    "JointTrajectory",
    "LinePath",
    "Metrics",
    "PayloadSettings",
    "ReferenceTable",
    "Rotors",
    "Run",
    "Scenario",
    "Shaping",
    "SimulationSettings",
    "SineRate",
    "SquarePath",
    "Step",
    "ToolTask",
    "ToolWeights",
    "Trajectory",
    "Vehicle",
    "VehicleDesign",
    "Waypoints",
    "Weather",
    "WrenchSettings",
    "__version__",
    "calibrate",
    "controller_names",
    "design_vehicle",
    "diagnose",
    "estimate_payload",
    "estimator_names",
    "excitation_flight",
    "explore",
    "external_wrench",
    "fly",
    "fly_many",
    "load_plugin",
    "load_scenario",
    "load_settings",
    "load_vehicle",
    "loop_margins",
    "make_controller",
    "measure",
    "prepare",
    "read_campaign",
    "refly",
    "register",
    "register_estimator",
    "register_scenario",
    "scenario_names",
    "simulate",
    "tunable",
    "vehicle_names",
    "view",
    "weather",
]
