"""The flights of a campaign that were lost or that swing, flown again to say why."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fullam.analysis.diagnosis import Finding, diagnose
from fullam.analysis.judged import FLIGHT_ENDED, LOST, driver_of
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.simulate import simulate
from fullam.simulation.weather import Weather

if TYPE_CHECKING:
    from fullam.analysis.campaign_table import CampaignTable

MOST = 5
"""So many are flown again: the first ones of a table tell as much as all of them."""

OSCILLATING = ("oscillating",)
"""Outcome of a flight that came to its end swinging; see `fullam.simulation.oscillation`."""


@dataclass(frozen=True)
class LostFlight:
    """A flight that was not well.

    Attributes:
        scenario: Its name.
        contender: Label of who flew.
        seed: Seed of the weather.
        reason: How it ended, or swings.
        findings: What was in its way.
    """

    scenario: str
    contender: str
    seed: int
    reason: str
    findings: tuple[Finding, ...]


def lost_flights(
    table: CampaignTable, most: int = MOST, outcomes: Sequence[str] = LOST
) -> tuple[int, list[LostFlight]]:
    """How many flights of a campaign were lost, and the first of them explained.

    Args:
        table: Its rows, which know the conditions.
        most: Flights to fly again.
        outcomes: Which flights are meant; `OSCILLATING` asks for those that swing.
    """
    lost = list(_lost(table, outcomes))
    return len(lost), [_explained(table, *row) for row in itertools.islice(lost, most)]


def _lost(table: CampaignTable, outcomes: Sequence[str]) -> Iterator[tuple[str, str, int, str]]:
    """Scenario, contender, seed, reason."""
    columns = [table.column(name) for name in ("scenario", "contender", "seed", "reason")]
    for row, outcome in zip(zip(*columns, strict=True), table.column("outcome"), strict=True):
        if outcome in outcomes:
            scenario, contender, seed, reason = row
            yield str(scenario), str(contender), int(seed), str(reason)


def _explained(
    table: CampaignTable, scenario: str, contender: str, seed: int, reason: str
) -> LostFlight:
    """The flight, flown again under the table's own conditions."""
    conditions = table.identity
    flown = next(s for s in conditions["scenarios"] if s["name"] == scenario)
    who = next(c for c in conditions["contenders"] if c["label"] == contender)
    simulation = SimulationSettings.from_dict(dict(conditions["simulation"]))
    given = dict(conditions["simulation"])
    if who["estimator"] not in (None, simulation.estimator):
        given |= {"estimator": who["estimator"], "estimator_settings": {}}
    weather = conditions["weather"] and Weather.from_dict(conditions["weather"])
    asked = Scenario.from_dict(flown)
    plants = [str(given.get("plant")), asked.plant]
    try:
        run = simulate(
            asked,
            who["controller"],
            settings=who["settings"],
            simulation=given,
            weather=weather,
            seed=seed,
            driver=driver_of(who["controller"], given["estimator"], plants=plants),
            throw=False,
        )
    except FLIGHT_ENDED:
        return LostFlight(scenario, contender, seed, reason, ())
    return LostFlight(scenario, contender, seed, reason, tuple(diagnose(run)))
