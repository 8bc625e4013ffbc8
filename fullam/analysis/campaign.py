"""Campaigns: many flights over seeds, on one process or many, that lose nothing when stopped.

Every contender meets the same weather under the same seed. A flight that diverges, or whose
allocation finds no answer, is a row. The result is the same file whatever flew it.
"""

from __future__ import annotations

import functools
import importlib.util
import itertools
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fullam.analysis import provenance
from fullam.analysis.cluster import Scheduler, ThisProcess, open_workers
from fullam.analysis.contender import Contender
from fullam.analysis.metrics import measure
from fullam.analysis.provenance import cached_vehicle
from fullam.analysis.response import coordinates
from fullam.checks import Checker, shown
from fullam.control.controller import controller_class, register
from fullam.control.estimator import estimator_class, register_estimator
from fullam.exceptions import (
    AllocationFailed,
    CampaignError,
    NonFiniteWrench,
    SettingsError,
    UnknownName,
    VehicleError,
)
from fullam.model.vehicle import Vehicle
from fullam.simulation.progress import Progress
from fullam.simulation.scenario import Scenario, load_scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.simulate import ENGINES, fly_under_seeds, prepare
from fullam.simulation.weather import Weather
from fullam.simulation.weather import weather as named_weather

if TYPE_CHECKING:
    from fullam.analysis.campaign_store import CampaignTable, Key
    from fullam.simulation.flight_plan import FlightPlan
    from fullam.simulation.run import Run

SLICE = 0.25
"""After this long a worker hands over what it has flown [s]: a kill costs no more than that."""

BATCH = {"reference": 8, "compiled": 64}
"""Flights in a task: about a second of work against 3 ms of scheduling and 10 ms of preparation."""

TRACE_PERIOD = 0.04
"""Time between kept samples of a motion [s]; the motion itself is below 5 Hz."""

FASTEST = "fastest"
"""Stands for the fastest engine that covers a flight."""

FLIGHT_ENDED = (NonFiniteWrench, AllocationFailed, np.linalg.LinAlgError)
"""What ends a flight without divergence; all other errors are mistakes of whoever asked for it."""


@dataclass(frozen=True)
class Campaign:
    """What is flown: every contender in every scenario under every seed.

    Attributes:
        scenarios: Scenarios, or names or paths of them.
        contenders: Controllers, or names as in `Contender.parse`.
        seeds: Seeds of the weather.
        weather: A weather or its name; None takes each scenario's own.
        simulation: Rates, integrator, sensors.
        engine: Which engine flies; `FASTEST` takes, contender by contender, the compiled engine
            where that is installed and covers what is flown, and the reference engine elsewhere.
        traces: Keep each motion, every `TRACE_PERIOD`.
    """

    scenarios: tuple[Scenario, ...]
    contenders: tuple[Contender, ...]
    seeds: tuple[int, ...]
    weather: Weather | None = None
    simulation: SimulationSettings = field(default_factory=SimulationSettings)
    engine: str = "reference"
    traces: bool = False

    def __post_init__(self) -> None:
        """Look names up and refuse what cannot be flown, before anything flies.

        Raises:
            FullamError: An unknown name, a scenario that does not fit its vehicle, ...
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
        check.text("engine", self.engine)
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
        for name, value in (
            ("scenarios", scenarios),
            ("contenders", contenders),
            ("seeds", seeds),
            ("weather", weather),
        ):
            object.__setattr__(self, name, value)
        for what, names in (
            ("scenarios", [s.name for s in scenarios]),
            ("contenders", [c.label for c in contenders]),
            ("seeds", list(seeds)),
        ):
            if not names or len(set(names)) < len(names):
                raise CampaignError(
                    "campaign", what, f"are {names}", "give at least one, each of them once"
                )
        if self.engine not in (*ENGINES, FASTEST):
            raise UnknownName("engine", self.engine, (*ENGINES, FASTEST))
        # What a name stands for is fixed here, and travels to the workers: a file that is edited,
        # or is another one elsewhere, cannot mix two vehicles in one table.
        vehicles = {s.vehicle: cached_vehicle(s.vehicle) for s in scenarios}
        object.__setattr__(self, "_vehicles", vehicles)
        object.__setattr__(self, "_classes", self._registered())
        plans = {c.label: [self.plan(s, c) for s in scenarios] for c in contenders}
        engines = {
            label: self.engine if self.engine != FASTEST else fastest_engine(those)
            for label, those in plans.items()
        }
        object.__setattr__(self, "_engines", engines)

    @property
    def engines(self) -> dict[str, str]:
        """Engine that flies each contender, by its label."""
        engines: dict[str, str] = self._engines  # type: ignore[attr-defined]
        return engines

    def plan(self, scenario: Scenario, contender: Contender) -> FlightPlan:
        """What a contender flies in a scenario, under the first seed."""
        simulation = self.simulation
        if contender.estimator is not None:
            simulation = replace(simulation, estimator=contender.estimator)
        return prepare(
            scenario,
            contender.controller,
            vehicle=self._vehicles[scenario.vehicle],  # type: ignore[attr-defined]
            seed=self.seeds[0],
            weather=self.weather,
            settings=contender.settings,
            simulation=simulation,
        )

    def _registered(self) -> dict[str, type]:
        """Classes that fly here and are not fullam's own: "controller NAME" or "estimator NAME"."""
        found: dict[str, type] = {}
        for contender in self.contenders:
            estimator = contender.estimator or self.simulation.estimator
            found[f"controller {contender.controller}"] = controller_class(contender.controller)
            found[f"estimator {estimator}"] = estimator_class(estimator)
        return {name: cls for name, cls in found.items() if not provenance.is_ours(cls)}

    def conditions(self) -> dict[str, Any]:
        """Digests and versions of what flies, as this process has it; JSON values."""
        vehicles: dict[str, Vehicle] = self._vehicles  # type: ignore[attr-defined]
        return {
            "vehicles": {n: provenance.vehicle_digest(v) for n, v in vehicles.items()},
            "registered": {n: provenance.class_digest(c) for n, c in self._registered().items()},
            "versions": provenance.versions(),
            "code": provenance.code_digest(),
        }

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
        from fullam.analysis.campaign_store import FORMAT

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
            "engines": self.engines,
            "traces": TRACE_PERIOD if self.traces else None,
        } | self.conditions()

    def fly(self, keys: list[Key]) -> Iterator[dict[str, Any]]:
        """Fly some cells, one row after the other; neighbours of one plan share it.

        Raises:
            MissingDependency: The engine's package is not installed.
        """
        for (name, label), group in itertools.groupby(keys, key=lambda key: key[:2]):
            scenario = next(s for s in self.scenarios if s.name == name)
            contender = next(c for c in self.contenders if c.label == label)
            plan = self.plan(scenario, contender)
            fly = fly_under_seeds(plan, self.engines[label])
            for _, _, seed in group:
                row: dict[str, Any] = {
                    "scenario": name,
                    "contender": label,
                    "controller": contender.controller,
                    "estimator": plan.simulation.estimator,
                    "seed": seed,
                }
                yield row | self._figures(fly, seed, plan.nominal)

    def _figures(self, fly: Callable[[int], Run], seed: int, vehicle: Vehicle) -> dict[str, Any]:
        """What a flight gives to its row."""
        from fullam.analysis.campaign_store import flatten

        try:
            run = fly(seed)
        except FLIGHT_ENDED as error:
            return {"outcome": "failed", "reason": str(error)}
        row: dict[str, Any] = {
            "outcome": run.outcome,
            "reason": str(run.metadata.get("reason", "")),
        }
        if self.traces:
            stride = max(1, round(TRACE_PERIOD / self.simulation.control_period))
            row["trace"] = coordinates(run.pose)[::stride].ravel().astype(np.float32).tolist()
        return row | flatten(measure(run, vehicle))


def fastest_engine(plans: Iterable[FlightPlan]) -> str:
    """The compiled engine if it is installed and covers all these flights, else the reference."""
    if importlib.util.find_spec("numba") is None:
        return "reference"
    from fullam.simulation.compiled.arrays import check

    try:
        for plan in plans:
            check(plan)
    except (SettingsError, VehicleError):
        return "reference"
    return "compiled"


def fly_slice(
    campaign: Campaign, conditions: dict[str, Any], keys: list[Key]
) -> list[dict[str, Any]]:
    """Rows of the first cells, as many as fit into `SLICE`; this is what a worker is sent.

    Args:
        campaign: What is flown.
        conditions: `Campaign.conditions` of the process that wants the rows.
        keys: The cells; at least the first is flown.

    Raises:
        CampaignError: What would fly here is not what would fly there.
    """
    for name, cls in campaign._classes.items():  # type: ignore[attr-defined]
        kind, _, called = name.partition(" ")
        (register if kind == "controller" else register_estimator)(called)(cls)
    here = campaign.conditions()
    differing = sorted(k for k in conditions if conditions[k] != here[k])
    if differing:
        raise CampaignError(
            "worker",
            ", ".join(differing),
            f"differ from the campaign's ({_contrast(conditions, here, differing)})",
            "install one version of everything everywhere",
        )
    rows, end = [], time.monotonic() + SLICE
    for row in campaign.fly(keys):
        rows.append(row)
        if time.monotonic() >= end:
            break
    return rows


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
        jobs: Worker processes. 1 flies in this process.
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
    from fullam.analysis.campaign_store import open_store

    identity, order = campaign.identity(), campaign.keys
    with open_store(out, identity, overwrite) as store:
        kept = store.keys
        pending = [key for key in order if key not in kept]
        done = len(order) - len(pending)
        if progress is not None:
            progress(done, len(order))
        for rows in _flown(campaign, pending, jobs, scheduler):
            store.append(rows)
            done += len(rows)
            if progress is not None:
                progress(done, len(order))
        return store.finish(order)


def _flown(
    campaign: Campaign, pending: list[Key], jobs: int, scheduler: Scheduler | str | None
) -> Iterator[list[dict[str, Any]]]:
    """Rows, a few at a time, in the order in which their flights end."""
    batches = []
    for (_, label), group in itertools.groupby(pending, key=lambda key: key[:2]):
        cells, size = list(group), BATCH[campaign.engines[label]]
        batches += [cells[i : i + size] for i in range(0, len(cells), size)]
    if not batches:
        return
    with open_workers(jobs, scheduler) as workers:
        if isinstance(workers, ThisProcess):  # nothing travels, so every row comes by itself
            yield from ([row] for cells in batches for row in campaign.fly(cells))
            return
        fly = functools.partial(fly_slice, campaign, campaign.conditions())
        for _, rows in workers.map_unordered(
            fly, batches, lambda cells, flown: cells[len(flown) :] or None
        ):
            yield rows
