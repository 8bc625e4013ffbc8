"""Campaigns: many flights over seeds, on one process or many, that lose nothing when stopped.

Every contender meets the same weather under the same seed. A flight that diverges, or whose
allocation finds no answer, is a row. The result is the same file whatever flew it.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import itertools
import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import fullam
from fullam.analysis.cluster import open_workers
from fullam.analysis.metrics import measure
from fullam.analysis.response import coordinates
from fullam.control.controllers import make_settings
from fullam.control.estimators import estimator_class
from fullam.exceptions import (
    AllocationFailed,
    CampaignError,
    NonFiniteWrench,
    SettingsError,
    UnknownName,
    VehicleError,
)
from fullam.model.loading import load_vehicle
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

BATCH = {"reference": 8, "compiled": 64}
"""Flights in a task: about a second of work against 3 ms of scheduling and 10 ms of preparation."""

TRACE_PERIOD = 0.04
"""Time between kept samples of a motion [s]; the motion itself is below 5 Hz."""

FASTEST = "fastest"
"""Stands for the fastest engine that covers a flight."""

FLIGHT_ENDED = (NonFiniteWrench, AllocationFailed, np.linalg.LinAlgError)
"""What ends a flight without divergence; all other errors are mistakes of whoever asked for it."""


@dataclass(frozen=True)
class Contender:
    """A controller as it takes part: its settings, its estimator, the name of its rows.

    Attributes:
        controller: Name of a registered controller.
        settings: Settings that differ from its defaults, or "tuned" for the committed ones.
        estimator: Name of an estimator; None takes the campaign's.
        label: Name of its rows; made from the others if empty.
    """

    controller: str
    settings: dict[str, Any] | str = field(default_factory=dict)
    estimator: str | None = None
    label: str = ""

    def __post_init__(self) -> None:
        """Resolve the settings and check the names."""
        settings, suffix = self.settings, ""
        if settings == "tuned":
            from fullam.analysis.tuning import tuned_settings

            settings, suffix = tuned_settings(self.controller, self.estimator), ", tuned"
        if not isinstance(settings, dict):
            raise CampaignError(
                f"contender '{self.controller}'",
                "settings",
                f"is {settings!r}",
                "give 'tuned' or a mapping",
            )
        complete = make_settings(self.controller, settings).to_dict()
        object.__setattr__(self, "settings", complete)
        if self.estimator is not None:
            estimator_class(self.estimator)
        if not self.label:
            at = f"@{self.estimator}" if self.estimator else ""
            object.__setattr__(self, "label", f"{self.controller}{at}{suffix}")

    @classmethod
    def parse(cls, text: str, tuned: bool = False) -> Contender:
        """From "CONTROLLER" or "CONTROLLER@ESTIMATOR"."""
        controller, _, estimator = text.strip().partition("@")
        return cls(controller, "tuned" if tuned else {}, estimator or None)


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
        scenarios = tuple(
            s if isinstance(s, Scenario) else load_scenario(s) for s in self.scenarios
        )
        contenders = tuple(
            c if isinstance(c, Contender) else Contender.parse(c) for c in self.contenders
        )
        for seed in self.seeds:
            if not isinstance(seed, int | np.integer) or seed < 0:
                raise CampaignError(
                    "campaign", "seed", f"is {seed!r}", "give whole numbers, 0 or more"
                )
        seeds = tuple(int(s) for s in self.seeds)
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
            vehicle=cached_vehicle(scenario.vehicle),
            seed=self.seeds[0],
            weather=self.weather,
            settings=contender.settings,
            simulation=simulation,
        )

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
            "vehicles": {
                s.vehicle: _fingerprint(cached_vehicle(s.vehicle)) for s in self.scenarios
            },
            "weather": None if self.weather is None else self.weather.to_dict(),
            "simulation": self.simulation.to_dict(),
            "engines": self.engines,
            "traces": TRACE_PERIOD if self.traces else None,
            "version": fullam.__version__,
            "code": code_digest(),
        }

    def fly(self, keys: list[Key]) -> list[dict[str, Any]]:
        """Fly some cells and return their rows; neighbours that differ in seed alone share a plan.

        Raises:
            MissingDependency: The engine's package is not installed.
        """
        rows = []
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
                rows.append(row | self._figures(fly, seed, plan.nominal))
        return rows

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


def fly_batch(campaign: Campaign, keys: list[Key], code: str) -> list[dict[str, Any]]:
    """Fly some cells; this is what a worker is sent.

    Raises:
        CampaignError: The worker runs other code than the campaign was prepared with.
    """
    if code != code_digest():
        raise CampaignError(
            "worker", "code", "differs from the campaign's", "install one version everywhere"
        )
    return campaign.fly(keys)


def sweep(
    campaign: Campaign,
    out: str | Path,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> CampaignTable:
    """Fly a campaign and write its rows to one Parquet file.

    Rows that `out`, or an attempt that was stopped, already holds are not flown again; so the same
    call continues after an interruption, and more seeds extend a finished file.

    Args:
        campaign: What is flown.
        out: The result; must end in .parquet.
        jobs: Worker processes. 1 flies in this process and needs no cluster.
        scheduler: Address of a running dask scheduler, instead of a local cluster.
        overwrite: Forget what `out` holds instead of continuing it.
        progress: Told how many rows are kept.

    Returns:
        The rows asked for, in canonical order.

    Raises:
        CampaignError: `out` holds another campaign; jobs below 1; a worker runs other code, or
            keeps dying.
        MissingDependency: pyarrow, or for more than one job distributed, is not installed.
    """
    from fullam.analysis.campaign_store import CampaignStore

    store = CampaignStore(out, campaign.identity(), overwrite)
    order = campaign.keys
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
    campaign: Campaign, pending: list[Key], jobs: int, scheduler: str | None
) -> Iterator[list[dict[str, Any]]]:
    """Rows of finished batches, in the order in which they finish."""
    batches = []
    for (_, label), group in itertools.groupby(pending, key=lambda key: key[:2]):
        cells, size = list(group), BATCH[campaign.engines[label]]
        batches += [cells[i : i + size] for i in range(0, len(cells), size)]
    if not batches:
        return
    fly = functools.partial(fly_batch, campaign, code=code_digest())
    with open_workers(jobs, scheduler) as workers:
        for _, rows in workers.map_unordered(fly, batches):
            yield rows


@functools.lru_cache(maxsize=8)
def cached_vehicle(name: str) -> Vehicle:
    """The vehicle of that name, loaded once a process."""
    return load_vehicle(name)


def _fingerprint(vehicle: Vehicle) -> str:
    """Digest of a vehicle's data: the same name may be another vehicle tomorrow."""
    data = json.dumps(vehicle.to_data(), sort_keys=True, default=str)
    return hashlib.sha256(data.encode()).hexdigest()[:16]


def _sources() -> Iterable[Path]:
    root = Path(fullam.__file__).parent
    for room in ("model", "dynamics", "control", "simulation"):
        yield from sorted((root / room).rglob("*.py"))
    yield from (root / "analysis" / f"{name}.py" for name in ("metrics", "response"))


@functools.cache
def code_digest() -> str:
    """Digest of the sources that decide what a row says, so that stale rows are never reused."""
    digest = hashlib.sha256()
    for source in _sources():
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]
