"""Which flights tune a law: those that the search sees, and those that judge its result."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from fullam.analysis.campaign import Campaign
from fullam.analysis.contender import Contender
from fullam.analysis.judged import FASTEST
from fullam.analysis.margins import margin_warning
from fullam.analysis.tuning_cost import NO_MARGIN, flight_costs
from fullam.checks import Checker
from fullam.exceptions import SettingsError
from fullam.simulation.scenarios.scenario import Scenario, load_scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.weather import CALM, WEATHERS, Weather
from fullam.simulation.weather import weather as named_weather

Flight = tuple[str, int]
"""(scenario, seed)."""

PAPER_SCENARIOS = ("position-1", "position-3", "tilt-hover-2", "task-2")
PAPER_LENGTH = 6.0
"""What trains where nothing else is asked for, cut to this [s]: its second half is still steady."""

FIRST_SEED = 1_000_000
"""First seed of the flights that a search sees; no evaluation uses them."""

PAPER_SEEDS, SEEDS = 3, 8
"""How many: of each of the paper's four scenarios, and of others. Eight flights of one scenario fly
at a time, so that fewer are hardly faster."""

VALIDATION_SEEDS = tuple(range(2_000_000, 2_000_006))
"""Seeds of the flights that judge its result."""


@dataclass(frozen=True)
class TuningFlights:
    """What every candidate flies, and what its best one is judged by.

    Attributes:
        scenarios: Scenarios, or names or paths of them; the paper's `PAPER_SCENARIOS`, cut to
            `PAPER_LENGTH`, if there are none.
        vehicle: Name or path of another vehicle than the scenarios'.
        weather: A weather or its name; None takes each scenario's own.
        shaping: What differs from how the scenarios shape their references.
        simulation: Rates, sensors, estimator, governor: an instance, or a mapping of what differs
            from the defaults.
        seeds: Seeds that the search sees, by default `SEEDS` from `FIRST_SEED` on. In calm air they
            are all alike: the first one flies.
        validation_seeds: Other ones.
        driver: Who flies, one of `DRIVERS` or `FASTEST`.
    """

    scenarios: tuple[Scenario | str, ...] = ()
    vehicle: str | None = None
    weather: Weather | str | None = None
    shaping: Mapping[str, Any] = field(default_factory=dict, hash=False)
    simulation: SimulationSettings = field(default_factory=SimulationSettings)
    seeds: tuple[int, ...] = ()
    validation_seeds: tuple[int, ...] = VALIDATION_SEEDS
    driver: str = FASTEST

    def __post_init__(self) -> None:
        """Look the names up.

        Raises:
            FullamError: No such scenario, vehicle or weather; no seeds, or one for both purposes.
        """
        check = Checker("tuning", SettingsError)
        object.__setattr__(self, "scenarios", check.items("scenarios", self.scenarios))
        object.__setattr__(self, "shaping", check.table("shaping", self.shaping))
        for name in ("seeds", "validation_seeds"):
            given = check.items(name, getattr(self, name))
            if not given and name == "seeds":
                given = self._usual_seeds
            seeds = tuple(check.whole(name, seed) for seed in given)
            if not seeds or len(set(seeds)) < len(seeds):
                raise check.refuse(name, f"are {seeds}", "give at least one, each of them once")
            object.__setattr__(self, name, seeds)
        both = sorted(set(self.seeds) & set(self.validation_seeds))
        if both:
            problem = f"judge the result as well ({both[0]})"
            raise check.refuse("seeds", problem, "give others: the result would judge itself")
        if isinstance(self.weather, str):
            named_weather(self.weather)
        if not isinstance(self.simulation, SimulationSettings):
            object.__setattr__(self, "simulation", SimulationSettings.from_dict(self.simulation))
        flown = [s.name for s in self.flown]
        if len(set(flown)) < len(flown):
            raise check.refuse("scenarios", f"are {', '.join(flown)}", "give each of them once")

    @property
    def _usual_seeds(self) -> tuple[int, ...]:
        count = SEEDS if self.scenarios else PAPER_SEEDS
        return tuple(range(FIRST_SEED, FIRST_SEED + count))

    @cached_property
    def flown(self) -> tuple[Scenario, ...]:
        """The scenarios as they are flown."""
        names = self.scenarios or PAPER_SCENARIOS
        found = []
        for name in names:
            scenario = name if isinstance(name, Scenario) else load_scenario(name)
            if not self.scenarios:
                scenario = replace(scenario, duration=min(scenario.duration, PAPER_LENGTH))
            if self.vehicle is not None:
                scenario = replace(scenario, vehicle=self.vehicle)
            if self.shaping:
                scenario = replace(scenario, shaping=scenario.shaping.changed(self.shaping))
            found.append(scenario)
        return tuple(found)

    def _flights(self, seeds: tuple[int, ...]) -> tuple[Flight, ...]:
        chosen = named_weather(self.weather) if isinstance(self.weather, str) else self.weather
        return tuple(
            (scenario.name, seed)
            for scenario in self.flown
            for seed in (seeds[:1] if (chosen or scenario.weather) == CALM else seeds)
        )

    @property
    def training(self) -> tuple[Flight, ...]:
        """The flights that the search sees."""
        return self._flights(self.seeds)

    @property
    def validation(self) -> tuple[Flight, ...]:
        """The flights that judge its result."""
        return self._flights(self.validation_seeds)

    def campaign(self, contender: Contender) -> Campaign:
        """A contender on these flights; whatever cannot be flown is refused here.

        Raises:
            FullamError: As `Campaign`.
        """
        scenarios, seeds = self.flown, (*self.seeds, *self.validation_seeds)
        return Campaign(scenarios, (contender,), seeds, self.weather, self.simulation, self.driver)  # type: ignore[arg-type]

    def arguments(self) -> list[str]:
        """What says the same to `fullam tune`, as far as a command can."""
        names = [s.name if isinstance(s, Scenario) else s for s in self.scenarios]
        found = ["--scenario", ",".join(names)] if names else []
        if self.vehicle is not None:
            found += ["--vehicle", self.vehicle]
        if self.weather is not None:
            named = next((n for n, w in WEATHERS.items() if self.weather in (n, w)), None)
            found += ["--weather", named or "ANOTHER"]
        for key, value in self.shaping.items():
            found += ["--shape", f"{key}={json.dumps(value)}"]
        usual = SimulationSettings()
        for name, flag in (("control_period", "--control-rate"), ("plant_period", "--plant-rate")):
            if getattr(self.simulation, name) != getattr(usual, name):
                found += [flag, f"{1.0 / getattr(self.simulation, name):g}"]
        if self.simulation.governor is None:
            found += ["--governor", "off"]
        if self.seeds != self._usual_seeds:
            found += ["--seeds", ",".join(map(str, self.seeds))]
        return found if self.driver == FASTEST else [*found, "--driver", self.driver]


def candidate_cost(
    settings: Mapping[str, Any], campaign: Campaign, flights: Iterable[Flight]
) -> float:
    """Cost of settings over some flights, see `tuning_cost`; this is what a worker is sent.

    Args:
        settings: Those of the campaign's only contender that are tried.
        campaign: What is flown beside them.
        flights: The flights.
    """
    campaign.register_here()
    flown = trying(campaign, settings)
    keys = [(name, flown.contenders[0].label, seed) for name, seed in flights]
    costs = [flight_costs(cells.flights.figures) for cells in flown.fly(keys)]
    unsafe = NO_MARGIN if lacking_margin(flown) is not None else 0.0
    return float(np.mean(np.concatenate(costs))) + unsafe


def trying(campaign: Campaign, settings: Mapping[str, Any]) -> Campaign:
    """A campaign with other settings of its only contender."""
    (given,) = campaign.contenders
    tried = Contender(given.controller, {**given.complete, **settings}, given.estimator, "tried")
    return replace(campaign, contenders=(tried,))


def lacking_margin(campaign: Campaign) -> str | None:
    """Which loop of a campaign's only contender has no margin, in a line; None if all have one.

    Every vehicle is asked once, in hover with its arm as its first scenario has it.
    """
    first: dict[str, Scenario] = {}
    for scenario in campaign.scenarios:
        first.setdefault(scenario.vehicle, scenario)
    plans = (campaign.plan(scenario, campaign.contenders[0]) for scenario in first.values())
    return next((line for line in map(margin_warning, plans) if line is not None), None)
