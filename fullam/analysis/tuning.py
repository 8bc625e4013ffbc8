"""One tuning procedure for every controller: same flights, same budget, same optimiser.

A comparison of controllers is worth what their tuning is worth. So each law declares what may be
tuned of it (`fullam.control.tunable`), and all are tuned by CMA-ES (package `cma`), from their
defaults or from settings that are given, on the same flights (`TuningFlights`), whose seeds no
evaluation uses, with the same number of candidates, to one cost (`tuning_cost`). Afterwards start
and result fly seeds that the optimiser did not see either, and both costs are kept with the result:
a gain that was only luck shows.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.analysis import margins, provenance, pushed, tuning_cost, tuning_flights
from fullam.analysis.campaign import Campaign
from fullam.analysis.cluster import open_workers
from fullam.analysis.contender import Contender
from fullam.analysis.journal import open_journal
from fullam.analysis.prices import Prices
from fullam.analysis.provenance import cached_vehicle
from fullam.analysis.tuning_flights import TuningFlights, candidate_cost, lacking_margin, trying
from fullam.analysis.tuning_result import Costs, Tuning
from fullam.checks import Checker, shown
from fullam.control.controllers import controller_class, make_settings
from fullam.control.settings_file import SettingsFile
from fullam.control.tunable import Parameter, search_space
from fullam.exceptions import CampaignError, MissingDependency, SettingsError

Array = NDArray[np.float64]

_COST = [str(module.__file__) for module in (tuning_cost, tuning_flights, margins, pushed)]
"""Files that say what a candidate costs, beside those of `provenance.code_digest`."""

MOST = 10_000_000
"""More candidates than this are a typing error."""

POPULATION = 10
"""Candidates a generation."""


def tune(
    controller: str,
    flights: TuningFlights | None = None,
    *,
    settings: Mapping[str, Any] | None = None,
    budget: int = 200,
    seed: int = 0,
    jobs: int = 1,
    out: str | Path | None = None,
    progress: Callable[[Tuning], None] | None = None,
) -> Tuning:
    """Tune a controller; the procedure is the module's text.

    Args:
        controller: NAME of a registered controller that declares a search space, or
            NAME@ESTIMATOR.
        flights: What it is tuned on; the paper's scenarios if None.
        settings: Where the search starts, as in `simulate`: what differs from the defaults, or
            what `load_settings` read. Fields that are not tuned keep these values.
        budget: Candidates, each flown on all training flights; the start is the first.
        seed: Seed of the optimiser.
        jobs: Threads of this process; for laws and estimators that are no kernels, processes. The
            result does not depend on them.
        out: A TOML file that always holds the best so far, also when the search is interrupted.
            The cost of every candidate is kept beside it in `NAME.journal` until the end, so that
            the same call continues a search that was stopped.
        progress: Told the best so far after every generation.

    Raises:
        UnknownName: No such controller, estimator, scenario, weather or driver.
        SettingsError: A budget below one generation, a law that declares nothing to tune, settings
            that it does not take, flights that cannot tune, or arguments of another type.
        CampaignError: `out` is being written by another process, or what was kept beside it came
            under other conditions; or a vehicle was edited meanwhile.
        MissingDependency: The optimiser is not installed.
    """
    check = Checker("tuning", SettingsError)
    flights = TuningFlights() if flights is None else flights
    check.instance("flights", flights, TuningFlights)
    name, _, estimator = check.text("controller", controller).partition("@")
    space = search_space(controller_class(name).Settings)
    check.whole("budget", budget, POPULATION + 1, MOST)
    check.whole("seed", seed)
    out = None if out is None else check.path("out", out)
    if not (progress is None or callable(progress)):
        raise check.refuse("progress", f"is {shown(progress)}", "give a function, or None")
    origin = settings.path if isinstance(settings, SettingsFile) else None
    if out is not None and origin is not None and Path(out).resolve() == Path(origin).resolve():
        problem = "is where the search starts from"
        raise CampaignError(str(out), "file", problem, "write the result to another file")
    start_from = {} if settings is None else settings
    contender = Contender(name, start_from, estimator or flights.simulation.estimator, "start")
    campaign = flights.campaign(contender)
    start = make_settings(name, campaign.contenders[0].complete)
    tuned = {p.field: getattr(start, p.field) for p in space}
    with ExitStack() as stack:
        journal = None
        if out is not None:
            conditions = _conditions(campaign)
            journal = stack.enter_context(open_journal(f"{out}.journal", conditions))
        threads = campaign.drivers["start"] == "fused"
        workers = stack.enter_context(open_workers(jobs, threads=threads))
        vehicles = _vehicles(campaign)
        price = functools.partial(candidate_cost, campaign=campaign)
        prices = Prices(workers, price, journal, lambda: _vehicles(campaign) == vehicles)
        cost = prices.of([tuned], flights.training)[0]
        plans = [campaign.plan(s, campaign.contenders[0]) for s in campaign.scenarios]
        best = Tuning(
            name,
            str(plans[0].simulation.estimator),
            tuned,
            tuned,
            _kept(start, tuned),
            Costs(cost, cost),
            1,
            budget,
            seed,
            flights,
            {plan.nominal.name: plan.nominal.digest() for plan in plans},
            origin,
        )
        for found in _search(best, space, functools.partial(prices.of, flights=flights.training)):
            best = found
            if out is not None:
                best.save(out)
            if progress is not None:
                progress(best)
        validation = prices.of([tuned, best.settings], flights.validation)
        unsafe = lacking_margin(trying(campaign, best.settings))
        best = replace(best, validation=Costs(*validation), unsafe=unsafe)
        if out is not None:
            best.save(out)
            Path(f"{out}.journal").unlink()
    return best


def _conditions(campaign: Campaign) -> dict[str, Any]:
    """What the cost of a candidate depends on, as JSON values; seeds are part of its key."""
    identity = campaign.identity()
    (contender,) = identity.pop("contenders")
    return {
        "controller": contender["controller"],
        "start": contender["settings"],
        "estimator": contender["estimator"],
        "cost": provenance.short_digest(b"".join(Path(f).read_bytes() for f in _COST)),
        **identity,
    }


def _vehicles(campaign: Campaign) -> dict[str, str]:
    """Digests of the vehicles that the flights are of, as their files are now."""
    return {name: cached_vehicle(name).digest() for name in campaign.vehicles}


def _kept(start: Any, tuned: Mapping[str, Any]) -> dict[str, Any]:
    """The settings that are not tuned and differ from the defaults.

    Raises:
        SettingsError: One that no file can hold.
    """
    usual = type(start)()
    names = [f.name for f in fields(start) if f.name not in tuned]
    kept = {n: getattr(start, n) for n in names if getattr(start, n) != getattr(usual, n)}
    for name, value in kept.items():
        if value is None:
            raise SettingsError(
                "tuning", name, "is None, which no file can hold", "start from another value"
            )
    return kept


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
    start = [p.encode(p.of(best.start)) for p in space]
    if len(start) == 1:
        start = [*start, 0.5]  # the optimiser works in two dimensions at least
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
        candidates = [_settings(space, best.start, x) for x in points]
        costs = price(candidates)
        strategy.tell(points, costs)
        k = int(np.argmin(costs))
        best = replace(best, evaluations=best.evaluations + len(points))
        if costs[k] < best.cost.after:
            best = replace(best, settings=candidates[k], cost=Costs(best.cost.before, costs[k]))
        yield best


def _settings(
    space: tuple[Parameter, ...], base: Mapping[str, Any], point: Array
) -> dict[str, Any]:
    """Settings of a point of the unit cube; entries outside the search space stay."""
    values = dict(base)
    for parameter, x in zip(space, point, strict=False):
        value = parameter.decode(float(x))
        if parameter.index is not None:
            many = list(values[parameter.field])
            many[parameter.index] = value
            values[parameter.field] = tuple(many)
        else:
            values[parameter.field] = value
    return values
