"""Plans of flights in the hand: of a scenario, or of free flight without one."""

from __future__ import annotations

from dataclasses import replace
from typing import Unpack

from fullam.model.loading import load_vehicle
from fullam.model.vehicle import Vehicle
from fullam.model.wrench_axes import controllable_axes
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.motions.references import Step
from fullam.simulation.scenarios.scenario import AXES, Scenario, load_scenario, scenario_names
from fullam.simulation.simulate import Choices, prepare
from fullam.simulation.weather import CALM

HEIGHT = 1.5
"""Where a free flight begins [m]."""

LONGEST_FREE = 300.0
"""Length of a free flight by default [s]: its tables are laid out before take-off."""


def free_flight(vehicle: Vehicle, duration: float = LONGEST_FREE) -> Scenario:
    """Hover until told otherwise, in calm air, on the axes that the rotors can control."""
    place, mask = (0.0, 0.0, HEIGHT), controllable_axes(vehicle.rotors)
    return Scenario(
        name="free flight",
        description="Hover until told otherwise",
        vehicle=vehicle.name,
        initial_position=place,
        reference=Step(place),
        duration=duration,
        axes=tuple(name for name, can in zip(AXES, mask, strict=True) if can),
        weather=CALM,
    )


def plan_of(
    subject: Vehicle | Scenario | str,
    controller: str | None = None,
    duration: float | None = None,
    **choices: Unpack[Choices],
) -> FlightPlan:
    """The plan of a scenario, or of a vehicle's free flight.

    Args:
        subject: A vehicle, its name or path, for a free flight; or a scenario or its name.
        controller: Name of a registered controller; by default the scenario's, in free flight
            dc-PID.
        duration: When it ends at the latest [s]; `LONGEST_FREE` by default in free flight.
        **choices: As in `simulate`.

    Raises:
        FullamError: As `simulate`.
    """
    if isinstance(subject, str) and subject in scenario_names():
        subject = load_scenario(subject)
    if isinstance(subject, Scenario):
        if duration is not None:
            subject = replace(subject, duration=duration)
        return prepare(subject, controller, **choices)
    vehicle = subject if isinstance(subject, Vehicle) else load_vehicle(subject)
    scenario = free_flight(vehicle, LONGEST_FREE if duration is None else duration)
    choices.setdefault("vehicle", vehicle)
    return prepare(scenario, controller, **choices)
