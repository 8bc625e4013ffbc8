"""Campaigns: many flights over seeds, on one process or many, that lose nothing when stopped.

Every contender meets the same weather under the same seed. A flight that diverges or swings, or
whose allocation finds no answer, is a row. The result is the same file whatever flew it.
"""

from __future__ import annotations

import functools
import itertools
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from fullam.analysis import provenance
from fullam.analysis.campaign_store import open_store
from fullam.analysis.campaign_table import FORMAT, CampaignTable, Cells, Key
from fullam.analysis.cluster import Scheduler, checked_jobs, open_workers
from fullam.analysis.contender import Contender
from fullam.analysis.judged import FASTEST, driver_of, fly_judged
from fullam.analysis.provenance import cached_vehicle
from fullam.checks import Checker, shown
from fullam.control.controllers import controller_class, recommended_estimator, register
from fullam.control.estimators import estimator_class, register_estimator
from fullam.exceptions import CampaignError, FullamWarning
from fullam.model.vehicle import Vehicle
from fullam.numbers.blas import one_blas_thread
from fullam.numbers.kernel import KERNELS, kernel
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.progress import Progress
from fullam.simulation.scenarios.scenario import Scenario, load_scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.simulate import prepare
from fullam.simulation.weather import Weather
from fullam.simulation.weather import weather as named_weather

SLICE = 0.25
"""After this long a worker hands over what it has flown [s]: a kill costs no more than that."""

BATCH = {"python": 8, "fused": 64}
"""Flights in a task: about a second of work against 3 ms of scheduling and 10 ms of preparation."""

TRACE_PERIOD = 0.04
"""Time between kept samples of a motion [s]; the motion itself is below 5 Hz."""


@dataclass(frozen=True)
class Campaign:
    """What is flown: every contender in every scenario under every seed.

    Attributes:
        scenarios: Scenarios, or names or paths of them.
        contenders: Controllers, or names as in `Contender.parse`.
        seeds: Seeds of the weather.
        weather: A weather or its name; None takes each scenario's own.
        simulation: Rates, integrator, sensors.
        driver: Who flies; `FASTEST` takes, contender by contender, machine code where law and
            estimator are written as kernels, and Python elsewhere.
        traces: Keep each motion, every `TRACE_PERIOD`.
        vehicles: Vehicle of each name that a scenario has, as its files were when this was made.
        registered: Classes that fly here and are not fullam's own, by "controller NAME" or
            "estimator NAME".
        kernels: Kernels of those classes' modules: a worker that gets them by value has to be told
            that they are kernels.
        drivers: Driver that flies each contender, by its label.
    """

    scenarios: tuple[Scenario, ...]
    contenders: tuple[Contender, ...]
    seeds: tuple[int, ...]
    weather: Weather | None = None
    simulation: SimulationSettings = field(default_factory=SimulationSettings)
    driver: str = FASTEST
    traces: bool = False
    vehicles: dict[str, Vehicle] = field(init=False, repr=False, compare=False)
    registered: dict[str, type] = field(init=False, repr=False, compare=False)
    kernels: tuple[Callable[..., Any], ...] = field(init=False, repr=False, compare=False)
    drivers: dict[str, str] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Look names up and refuse what cannot be flown, before anything flies.

        Raises:
            FullamError: An unknown name, a scenario that does not fit its vehicle, ...

        Warns:
            FullamWarning: Settings from a file were tuned on other vehicles or with another
                estimator.
        """
        check = Checker("campaign", CampaignError)
        for what in ("scenarios", "contenders", "seeds"):
            given = getattr(self, what)
            if not (
                isinstance(given, list | tuple | range)
                or (isinstance(given, np.ndarray) and given.ndim)
            ):
                raise check.refuse(what, f"is {shown(given)}", "give a tuple of them")
        check.instance("simulation", self.simulation, SimulationSettings)
        check.text("driver", self.driver)
        check.flag("traces", self.traces)
        if self.weather is not None:
            check.instance("weather", self.weather, (str, Weather))
        scenarios = tuple(
            s if isinstance(s, Scenario) else load_scenario(s) for s in self.scenarios
        )
        contenders = tuple(
            c if isinstance(c, Contender) else Contender.parse(c) for c in self.contenders
        )
        seeds = tuple(check.whole("seed", seed) for seed in self.seeds)
        weather = named_weather(self.weather) if isinstance(self.weather, str) else self.weather
        for what, names in (
            ("scenarios", [s.name for s in scenarios]),
            ("contenders", [c.label for c in contenders]),
            ("seeds", list(seeds)),
        ):
            if not names or len(set(names)) < len(names):
                raise CampaignError(
                    "campaign", what, f"are {names}", "give at least one, each of them once"
                )
        # What a name stands for is fixed here, and travels to the workers: a file that is edited,
        # or is another one elsewhere, cannot mix two vehicles in one table.
        vehicles = {s.vehicle: cached_vehicle(s.vehicle) for s in scenarios}
        self._fix(scenarios=scenarios, contenders=contenders, seeds=seeds, weather=weather)
        self._fix(vehicles=vehicles, registered=self._registered())
        own = {cls.__module__ for cls in self.registered.values()}
        self._fix(kernels=tuple(k for k in KERNELS if k.__module__ in own))
        usual = self.simulation.estimator
        plants = [self.simulation.plant, *(s.plant for s in scenarios)]
        drivers = {
            c.label: driver_of(c.controller, c.estimator or usual, self.driver, plants)
            for c in contenders
        }
        self._fix(drivers=drivers)
        differences: dict[str, None] = {}
        for scenario, contender in itertools.product(scenarios, contenders):
            plan, file = self.plan(scenario, contender), contender.file
            if file is not None:
                found = file.differences(plan.nominal, plan.simulation.estimator)
                differences |= dict.fromkeys(found)
        # Workers and rows get a motion of one's own as the rows that every plan of it has.
        flown = tuple(self.plan(scenario, contenders[0]).scenario for scenario in scenarios)
        self._fix(scenarios=flown)
        for difference in differences:
            warnings.warn(difference, FullamWarning, stacklevel=3)

    def _fix(self, **values: Any) -> None:
        """Set fields while this is being made."""
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @functools.cached_property
    def _plans(self) -> dict[tuple[str, str], FlightPlan]:
        return {}

    def __getstate__(self) -> dict[str, Any]:
        """What travels to a worker: it prepares the plans of its own flights."""
        return {name: value for name, value in vars(self).items() if name != "_plans"}

    def plan(self, scenario: Scenario, contender: Contender) -> FlightPlan:
        """What a contender flies in a scenario, under any seed; prepared once."""
        key = (scenario.name, contender.label)
        if key not in self._plans:
            simulation = self.simulation
            if contender.estimator not in (None, simulation.estimator):
                # The campaign's settings are those of its own estimator.
                simulation = replace(
                    simulation, estimator=contender.estimator, estimator_settings={}
                )
            self._plans[key] = prepare(
                scenario,
                contender.controller,
                vehicle=self.vehicles[scenario.vehicle],
                weather=self.weather,
                settings=contender.settings,
                simulation=simulation,
            )
        return self._plans[key]

    def _registered(self) -> dict[str, type]:
        """Classes that would fly now and are not fullam's own."""
        found: dict[str, type] = {}
        for contender in self.contenders:
            estimator = contender.estimator or self.simulation.estimator
            estimator = estimator or recommended_estimator(contender.controller)
            found[f"controller {contender.controller}"] = controller_class(contender.controller)
            found[f"estimator {estimator}"] = estimator_class(estimator)
        return {name: cls for name, cls in found.items() if not provenance.is_ours(cls)}

    def conditions(self) -> dict[str, Any]:
        """Digests and versions of what flies, as this process has it; JSON values."""
        return {
            "vehicles": {n: provenance.vehicle_digest(v) for n, v in self.vehicles.items()},
            "registered": {n: provenance.class_digest(c) for n, c in self._registered().items()},
            "versions": provenance.versions(),
            "code": provenance.code_digest(),
        }

    def register_here(self) -> None:
        """Make a user's own classes known to a worker that was sent this."""
        for name, cls in self.registered.items():
            kind, _, called = name.partition(" ")
            (register if kind == "controller" else register_estimator)(called)(cls)
        for function in self.kernels:
            if function not in KERNELS:
                kernel(function)

    @property
    def keys(self) -> list[Key]:
        """(scenario, contender, seed) of every row, in canonical order."""
        return [
            (s.name, c.label, seed)
            for s in self.scenarios
            for c in self.contenders
            for seed in self.seeds
        ]

    def identity(self) -> dict[str, Any]:
        """The conditions of a row, as JSON values; seeds are not among them."""
        return {
            "format": FORMAT,
            "scenarios": [s.to_dict() for s in self.scenarios],
            "contenders": [
                {
                    "label": c.label,
                    "controller": c.controller,
                    "settings": c.settings,
                    "estimator": c.estimator,
                }
                for c in self.contenders
            ],
            "weather": None if self.weather is None else self.weather.to_dict(),
            "simulation": self.simulation.to_dict(),
            "drivers": self.drivers,
            "traces": TRACE_PERIOD if self.traces else None,
        } | self.conditions()

    def fly(self, keys: list[Key], threads: int = 1) -> Iterator[Cells]:
        """Fly some cells, a few at a time; neighbours of one plan share it.

        Args:
            keys: The cells.
            threads: Threads of the fused driver.
        """
        period = self.simulation.control_period
        trace_every = max(1, round(TRACE_PERIOD / period)) if self.traces else 0
        for (name, label), group in itertools.groupby(keys, key=lambda key: key[:2]):
            scenario = next(s for s in self.scenarios if s.name == name)
            contender = next(c for c in self.contenders if c.label == label)
            plan, seeds = self.plan(scenario, contender), [seed for _, _, seed in group]
            estimator = str(plan.simulation.estimator)  # by its name, in a plan
            for flights in fly_judged(
                plan, seeds, self.drivers[label], threads=threads, trace_every=trace_every
            ):
                yield Cells(name, label, contender.controller, estimator, flights)


def fly_slice(campaign: Campaign, conditions: dict[str, Any], keys: list[Key]) -> list[Cells]:
    """Flights of the first cells, as many as fit into `SLICE`; this is what a worker is sent.

    Args:
        campaign: What is flown.
        conditions: `Campaign.conditions` of the process that wants the flights.
        keys: The cells; at least the first is flown.

    Raises:
        CampaignError: What would fly here is not what would fly there.
    """
    campaign.register_here()
    here = campaign.conditions()
    differing = sorted(k for k in conditions if conditions[k] != here[k])
    if differing:
        raise CampaignError(
            "worker",
            ", ".join(differing),
            f"differ from the campaign's ({_contrast(conditions, here, differing)})",
            "install one version of everything everywhere",
        )
    flown, end = [], time.monotonic() + SLICE
    for cells in campaign.fly(keys):
        flown.append(cells)
        if time.monotonic() >= end:
            break
    return flown


def _contrast(there: dict[str, Any], here: dict[str, Any], names: list[str]) -> str:
    """The differing entries, "pin 4.0.0 here, 4.1.0 there"."""
    texts = []
    for name in names:
        one, other = here[name], there[name]
        pairs = {name: (one, other)}
        if isinstance(one, dict) and isinstance(other, dict):
            pairs = {k: (one.get(k), other.get(k)) for k in sorted({*one, *other})}
        texts += [f"{k} {a} here, {b} there" for k, (a, b) in pairs.items() if a != b]
    return "; ".join(texts)


def sweep(
    campaign: Campaign,
    out: str | Path,
    *,
    jobs: int = 1,
    scheduler: Scheduler | str | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> CampaignTable:
    """Fly a campaign and write its rows to one Parquet file.

    Rows that `out`, or an attempt that was stopped, already holds are not flown again; so the same
    call continues after an interruption, and more seeds extend a finished file. A kill loses the
    flights in the air and those of the last half second. `out` is locked while this runs.

    Args:
        campaign: What is flown.
        out: The result; must end in .parquet.
        jobs: Threads of this process; for laws and estimators that are no kernels, processes.
        scheduler: A running dask scheduler, or its address, instead.
        overwrite: Forget what `out` holds instead of continuing it.
        progress: Told how many rows are kept.

    Returns:
        The rows asked for, in canonical order.

    Raises:
        CampaignError: `out` holds another campaign, or is being written by another process; jobs
            below 1; on a worker something else would fly; a worker keeps dying.
        MissingDependency: pyarrow, or what the workers need, is not installed.
    """
    identity, order = campaign.identity(), campaign.keys
    with open_store(out, identity, overwrite) as store:
        kept = store.keys
        pending = [key for key in order if key not in kept]
        done = len(order) - len(pending)
        if progress is not None:
            progress(done, len(order))
        for cells in _flown(campaign, pending, checked_jobs(jobs), scheduler):
            store.append(cells)
            done += len(cells)
            if progress is not None:
                progress(done, len(order))
        return store.finish(order)


def _flown(
    campaign: Campaign, pending: list[Key], jobs: int, scheduler: Scheduler | str | None
) -> Iterator[Cells]:
    """Flights, a few at a time, in the order in which they end."""
    here, there = pending, []
    if scheduler is not None:
        here, there = [], pending
    elif jobs > 1:
        here = [key for key in pending if campaign.drivers[key[1]] == "fused"]
        there = [key for key in pending if campaign.drivers[key[1]] != "fused"]
    if here:
        with one_blas_thread():
            yield from campaign.fly(here, jobs)
    if not there:
        return
    batches = []
    for (_, label), group in itertools.groupby(there, key=lambda key: key[:2]):
        cells, size = list(group), BATCH[campaign.drivers[label]]
        batches += [cells[i : i + size] for i in range(0, len(cells), size)]
    fly = functools.partial(fly_slice, campaign, campaign.conditions())
    with open_workers(jobs, scheduler) as workers:
        for _, flown in workers.map_unordered(fly, batches, _left):
            yield from flown


def _left(keys: list[Key], flown: list[Cells]) -> list[Key] | None:
    """Cells of a batch that were not flown in time."""
    return keys[sum(map(len, flown)) :] or None
