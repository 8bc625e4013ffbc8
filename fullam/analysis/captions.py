"""What was flown, in a few words, for tables and figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fullam.simulation.weather import WEATHERS

if TYPE_CHECKING:
    from fullam.simulation.record.run import Run


def weather_caption(run: Run) -> str:
    """The weather's name and the seed: "calm weather", "paper weather, seed 3"."""
    weather = run.weather
    name = next((name for name, known in WEATHERS.items() if known == weather), "own")
    return f"{name} weather" if name == "calm" else f"{name} weather, seed {run.seed}"


def caption(run: Run) -> str:
    """Scenario, controller, weather and seed in one line."""
    return f"{run.scenario.name}: {run.controller}, {weather_caption(run)}"
