"""One tuning procedure for every controller: same training flights, same budget, same optimiser.

A comparison of controllers is worth what their tuning is worth. So each controller declares its
search space (`SEARCH_SPACES`), and all are tuned by CMA-ES (package `cma`) from their defaults, on
the same flights (`TRAINING`), whose seeds no evaluation uses, with the same number of candidates.

The cost of a flight, in which 1 is roughly "as bad as the sensor's noise":

    J = integral |p - p_d| dt / |step| / 1 s  +  the same of the attitude    (0 for what is held)
      + RMS position / 10 mm                  +  RMS attitude / 1 deg        (steady part)
      + largest excursion / 25 mm             +  largest excursion / 5 deg   (off the straight path)

and `LOST` for a flight that does not end. The cost of a candidate is the mean over the training
flights. Afterwards defaults and tuned settings fly `VALIDATION`, seeds that the optimiser did not
see either, and both costs are kept with the result: a gain that was only luck shows.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.analysis import provenance
from fullam.analysis.cluster import open_workers
from fullam.analysis.journal import open_journal
from fullam.analysis.judge import Figures
from fullam.analysis.judged import FASTEST, driver_of, fly_judged
from fullam.analysis.prices import Prices
from fullam.analysis.provenance import cached_vehicle
from fullam.analysis.tuned_gains import contender_name
from fullam.control.controllers import make_settings, recommended_estimator
from fullam.exceptions import MissingDependency, SettingsError, UnknownName
from fullam.files import atomic_path
from fullam.simulation.scenario import AXES, load_scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.simulate import prepare
from fullam.version import __version__

Array = NDArray[np.float64]

LOST = 50.0
"""Cost of a flight that diverges or fails; a bad one that ends has about 15."""

POPULATION = 10
"""Candidates a generation."""

FLIGHT_LENGTH = 6.0
"""Training flights are cut to this [s]: their second half is still steady."""

Set = tuple[tuple[str, int], ...]
_SCENARIOS = ("position-1", "position-3", "tilt-hover-2", "task-2")
TRAINING: Set = tuple((name, 1_000_000 + k) for name in _SCENARIOS for k in range(3))
"""(scenario, seed) of the flights that the optimiser sees."""

VALIDATION: Set = tuple((name, 2_000_000 + k) for name in _SCENARIOS for k in range(6))
"""(scenario, seed) of the flights that judge its result."""


@dataclass(frozen=True)
class Parameter:
    """One number that the optimiser may choose, on a logarithmic scale.

    Attributes:
        field: Field of the controller's settings.
        index: Which entry of the field.
        low: Smallest value.
        high: Largest value.
    """

    field: str
    index: int
    low: float
    high: float

    def decode(self, x: float) -> float:
        """Value of x in [0, 1], to four digits: what is written is what was flown."""
        return float(f"{self.low * (self.high / self.low) ** x:.4g}")

    def encode(self, value: float) -> float:
        """The inverse of `decode`, clipped to [0, 1]."""
        share = math.log(max(value, self.low) / self.low) / math.log(self.high / self.low)
        return min(share, 1.0)


_PID = (
    Parameter("position_gains", 0, 2.0, 80.0),
    Parameter("position_gains", 1, 0.01, 100.0),
    Parameter("position_gains", 2, 1.0, 20.0),
    Parameter("attitude_gains", 0, 5.0, 300.0),
    Parameter("attitude_gains", 1, 0.05, 500.0),
    Parameter("attitude_gains", 2, 2.0, 60.0),
)
SEARCH_SPACES: dict[str, tuple[Parameter, ...]] = {
    "pid": _PID,
    "dc-pid": _PID,
    "computed-wrench": _PID,
    "dc-pid-plus": (
        *(_PID[i] for i in (0, 2, 3, 5)),
        Parameter("observer_rates", 0, 0.5, 60.0),
        Parameter("observer_rates", 1, 0.5, 60.0),
    ),
    "backstepping": (
        Parameter("position_gains", 0, 0.5, 16.0),
        Parameter("position_gains", 1, 0.5, 16.0),
        Parameter("position_gains", 2, 0.005, 40.0),
        Parameter("attitude_gains", 0, 0.5, 40.0),
        Parameter("attitude_gains", 1, 1.0, 30.0),
        Parameter("attitude_gains", 2, 0.01, 100.0),
    ),
}
"""Per controller: what may be tuned, six numbers each; everything else keeps its default."""


@dataclass(frozen=True)
class Tuning:
    """What a tuning found.

    Attributes:
        controller: Name of the controller.
        estimator: The estimator that it was tuned with.
        settings: Fields that were tuned, with their values.
        cost: On `TRAINING`.
        default_cost: Of the defaults on `TRAINING`.
        evaluations: Candidates flown.
        budget: Candidates allowed.
        seed: Seed of the optimiser.
        driver: The driver that flew.
        validation: (defaults, tuned) on `VALIDATION`; None while the search goes on.
    """

    controller: str
    estimator: str
    settings: dict[str, Any]
    cost: float
    default_cost: float
    evaluations: int
    budget: int
    seed: int
    driver: str = "fused"
    validation: tuple[float, float] | None = None

    @property
    def name(self) -> str:
        """Name of its file and its argument of `fullam tune`."""
        return contender_name(self.controller, self.estimator)

    @property
    def command(self) -> str:
        """The command that finds it again."""
        driver = "" if self.driver == "fused" else f" --driver {self.driver}"
        return f"fullam tune {self.name} --budget {self.budget} --seed {self.seed}{driver}"

    def to_toml(self) -> str:
        """The result as a TOML document."""
        lines = [
            f'command = "{self.command}"',
            f'controller = "{self.controller}"',
            f'estimator = "{self.estimator}"',
            f'fullam = "{__version__}"',
            f"evaluations = {self.evaluations}",
            f"cost = {self.cost:.4f} # on the training flights; {self.default_cost:.4f} untuned",
        ]
        if self.validation is not None:
            default, tuned = self.validation
            lines.append(f"validation = {{ defaults = {default:.4f}, tuned = {tuned:.4f} }}")
        lines += ["", "[settings]"]
        lines += [f"{k} = {list(v)}" for k, v in self.settings.items()]
        return "\n".join(lines) + "\n"

    def save(self, path: str | Path) -> None:
        """Write the TOML document, atomically."""
        with atomic_path(path) as temporary:
            temporary.write_text(self.to_toml(), encoding="utf-8")


def flight_costs(figures: Figures) -> Array:
    """J of the module's text of each flight, shape (flights,)."""
    cost = (
        figures["rms_position_mm"] / 10.0
        + figures["rms_attitude_deg"]
        + figures["max_excursion_mm"] / 25.0
        + figures["max_excursion_deg"] / 5.0
    )
    for half, integral in ((AXES[:3], "integral_position"), (AXES[3:], "integral_attitude")):
        step = np.linalg.norm([figures[f"{axis}_step"] for axis in half], axis=0)
        cost += np.where(step > 0.0, figures[integral] / np.where(step > 0.0, step, 1.0), 0.0)
    ended = (figures["diverged"] == 0.0) & np.isfinite(cost)
    return np.where(ended, cost, LOST)


def candidate_cost(
    settings: Mapping[str, Any], controller: str, estimator: str, driver: str, flights: Set
) -> float:
    """Mean cost of a controller's settings over some flights."""
    simulation = SimulationSettings(estimator=estimator)
    costs: list[Array] = []
    for name, group in itertools.groupby(flights, key=lambda flight: flight[0]):
        scenario = load_scenario(name)
        scenario = replace(scenario, duration=min(scenario.duration, FLIGHT_LENGTH))
        plan = prepare(
            scenario,
            controller,
            vehicle=cached_vehicle(scenario.vehicle),
            settings=dict(settings),
            simulation=simulation,
        )
        judged = fly_judged(plan, [seed for _, seed in group], driver)
        costs += [flight_costs(some.figures) for some in judged]
    return float(np.mean(np.concatenate(costs)))


def tune(
    controller: str,
    *,
    estimator: str | None = None,
    budget: int = 200,
    seed: int = 0,
    jobs: int = 1,
    driver: str = FASTEST,
    out: str | Path | None = None,
    progress: Callable[[Tuning], None] | None = None,
) -> Tuning:
    """Tune a controller; the procedure is the module's text.

    Args:
        controller: Name of a controller in `SEARCH_SPACES`.
        estimator: What it flies with; the one that it is made for if None.
        budget: Candidates, each flown on all of `TRAINING`; the defaults are the first.
        seed: Seed of the optimiser.
        jobs: Threads of this process; for laws and estimators that are no kernels, processes. The
            result does not depend on them.
        driver: Who flies, one of `DRIVERS` or `FASTEST`.
        out: A TOML file that always holds the best so far, also when the search is interrupted.
            The cost of every candidate is kept beside it in `NAME.journal` until the end, so that
            the same call continues a search that was stopped.
        progress: Told the best so far after every generation.

    Raises:
        UnknownName: No such controller, estimator or driver, or one without a search space.
        SettingsError: A budget below one generation.
        CampaignError: `out` is being written by another process, or what was kept beside it came
            under other conditions; or a vehicle was edited meanwhile.
        MissingDependency: The optimiser is not installed.
    """
    estimator = estimator or recommended_estimator(controller)
    driver = driver_of(controller, estimator, driver)
    if controller not in SEARCH_SPACES:
        raise UnknownName("tunable controller", controller, SEARCH_SPACES)
    if budget < POPULATION + 1:
        raise SettingsError("tuning", "budget", f"is {budget}", f"give {POPULATION + 1} or more")
    space = SEARCH_SPACES[controller]
    start = _chosen(space, make_settings(controller).to_dict())
    price = functools.partial(
        candidate_cost, controller=controller, estimator=estimator, driver=driver
    )
    with ExitStack() as stack:
        conditions = _conditions(controller, estimator, driver)
        journal = None
        if out is not None:
            journal = stack.enter_context(open_journal(f"{out}.journal", conditions))
        workers = stack.enter_context(open_workers(jobs, threads=driver == "fused"))
        prices = Prices(workers, price, journal, lambda: _vehicles() == conditions["vehicles"])
        default_cost = prices.of([start], TRAINING)[0]
        best = Tuning(
            controller, estimator, start, default_cost, default_cost, 1, budget, seed, driver
        )
        for found in _search(best, space, functools.partial(prices.of, flights=TRAINING)):
            best = found
            if out is not None:
                best.save(out)
            if progress is not None:
                progress(best)
        validation = prices.of([start, best.settings], VALIDATION)
        best = replace(best, validation=(validation[0], validation[1]))
        if out is not None:
            best.save(out)
            Path(f"{out}.journal").unlink()
    return best


def _conditions(controller: str, estimator: str, driver: str) -> dict[str, Any]:
    """What the cost of a candidate depends on, as JSON values."""
    return {
        "controller": make_settings(controller).to_dict() | {"": controller},
        "estimator": estimator,
        "driver": driver,
        "scenarios": [load_scenario(name).to_dict() for name in _SCENARIOS],
        "vehicles": _vehicles(),
        "cost": provenance.short_digest(Path(__file__).read_bytes()),
        "versions": provenance.versions(),
        "code": provenance.code_digest(),
    }


def _vehicles() -> dict[str, str]:
    """Digests of the vehicles that the flights are of, as their files are now."""
    names = {load_scenario(name).vehicle for name in _SCENARIOS}
    return {name: provenance.vehicle_digest(cached_vehicle(name)) for name in sorted(names)}


def _search(
    best: Tuning,
    space: tuple[Parameter, ...],
    price: Callable[[list[dict[str, Any]]], list[float]],
) -> Iterable[Tuning]:
    """The best so far, after every generation."""
    try:
        import cma
    except ImportError as error:
        raise MissingDependency("tuning", "cma", "campaign") from error
    rng = np.random.default_rng(best.seed)
    start = [p.encode(best.settings[p.field][p.index]) for p in space]
    options = {
        "bounds": [0.0, 1.0],
        "popsize": POPULATION,
        "verbose": -9,
        # The optimiser would seed numpy's global generator; it gets one of its own instead.
        "seed": np.nan,
        "randn": lambda *shape: rng.standard_normal(shape),
    }
    strategy = cma.CMAEvolutionStrategy(start, 0.2, options)
    while best.evaluations + POPULATION <= best.budget and not strategy.stop():
        points = strategy.ask()
        candidates = [_settings(space, best.settings, x) for x in points]
        costs = price(candidates)
        strategy.tell(points, costs)
        k = int(np.argmin(costs))
        best = replace(best, evaluations=best.evaluations + len(points))
        if costs[k] < best.cost:
            best = replace(best, settings=candidates[k], cost=costs[k])
        yield best


def _chosen(space: tuple[Parameter, ...], settings: Mapping[str, Any]) -> dict[str, Any]:
    """The fields that the search may change."""
    return {p.field: tuple(settings[p.field]) for p in space}


def _settings(
    space: tuple[Parameter, ...], base: Mapping[str, Any], point: Array
) -> dict[str, Any]:
    """Settings of a point of the unit cube; entries outside the search space stay."""
    values = {name: list(value) for name, value in base.items()}
    for parameter, x in zip(space, point, strict=True):
        values[parameter.field][parameter.index] = parameter.decode(float(x))
    return {name: tuple(value) for name, value in values.items()}
