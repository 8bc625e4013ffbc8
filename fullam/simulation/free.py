"""Free flight: a vehicle in the hand, without a scenario."""

from __future__ import annotations

from dataclasses import replace
from typing import Unpack

from fullam.model.loading import load_vehicle
from fullam.model.vehicle import Vehicle
from fullam.model.wrench_axes import controllable_axes
from fullam.simulation.interactive import InteractiveFlight
from fullam.simulation.references import Step
from fullam.simulation.scenario import AXES, Scenario, load_scenario, scenario_names
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


def fly(
    subject: Vehicle | Scenario | str = "fullam",
    controller: str = "dc-pid",
    *,
    duration: float | None = None,
    **choices: Unpack[Choices],
) -> InteractiveFlight:
    """A flight in the hand, standing at its start: fly it on, touch it, go back, fly on otherwise.

        flight = fullam.fly("fullam")
        flight.target = [0.5, 0.0, 1.5]
        flight.advance(2.0)
        flight.push([3.0, 0.0, 0.0], at="tool", duration=1.0)
        flight.advance(3.0)
        run = flight.record            # `fullam.refly(run)` gives it again, bit for bit

    Args:
        subject: A vehicle, its name or path, for a free flight; or a scenario or its name.
        controller: Name of a registered controller.
        duration: When it ends at the latest [s]; 300 by default in free flight. `run()` flies on
            till then.
        **choices: As in `simulate`; free flight is in calm air unless `weather` says otherwise.

    Raises:
        FullamError: As `simulate`.
    """
    if isinstance(subject, str) and subject in scenario_names():
        subject = load_scenario(subject)
    if isinstance(subject, Scenario):
        if duration is not None:
            subject = replace(subject, duration=duration)
        return InteractiveFlight(prepare(subject, controller, **choices))
    vehicle = subject if isinstance(subject, Vehicle) else load_vehicle(subject)
    scenario = free_flight(vehicle, LONGEST_FREE if duration is None else duration)
    choices.setdefault("vehicle", vehicle)
    return InteractiveFlight(prepare(scenario, controller, **choices))
