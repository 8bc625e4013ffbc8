"""fullam: fully-actuated aerial manipulators on Pinocchio.

Load a vehicle, fly a scenario under a controller, and ask the record what happened:

    import fullam

    run = fullam.simulate("task-2", "dc-pid", seed=0)
    print(fullam.measure(run))
"""

# isort: off
import fullam.interrupt  # first of all, so that Ctrl-C during the other imports is one line

# isort: on
import fullam.control.backstepping
import fullam.control.computed_wrench
import fullam.control.dc_pid
import fullam.control.dc_pid_plus
import fullam.control.kalman
import fullam.control.pid
import fullam.simulation.catalogue  # noqa: F401 - registers the controllers and the scenarios
from fullam.analysis.metrics import Metrics, measure
from fullam.control.allocation import Allocation, Allocator
from fullam.control.controller import Controller, controller_names, make_controller, register
from fullam.control.estimator import estimator_names
from fullam.exceptions import FullamError
from fullam.model.design import VehicleDesign, design_vehicle
from fullam.model.loading import load_vehicle, vehicle_names
from fullam.model.rotors import Rotors
from fullam.model.vehicle import Vehicle
from fullam.simulation.arm_motion import HoldArm, SineRate
from fullam.simulation.references import Circle, Step, Waypoints
from fullam.simulation.run import Run
from fullam.simulation.scenario import (
    Scenario,
    load_scenario,
    register_scenario,
    scenario_names,
)
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.simulate import simulate
from fullam.simulation.weather import Weather, weather
from fullam.version import __version__
from fullam.viz.viewer import explore, view

# Vehicles and records know nothing of pictures: what one sees imports what is, not the reverse.
Run.view = Vehicle.view = view  # type: ignore[attr-defined]

__all__ = [
    "Allocation",
    "Allocator",
    "Circle",
    "Controller",
    "FullamError",
    "HoldArm",
    "Metrics",
    "Rotors",
    "Run",
    "Scenario",
    "SimulationSettings",
    "SineRate",
    "Step",
    "Vehicle",
    "VehicleDesign",
    "Waypoints",
    "Weather",
    "__version__",
    "controller_names",
    "design_vehicle",
    "estimator_names",
    "explore",
    "load_scenario",
    "load_vehicle",
    "make_controller",
    "measure",
    "register",
    "register_scenario",
    "scenario_names",
    "simulate",
    "vehicle_names",
    "view",
    "weather",
]
