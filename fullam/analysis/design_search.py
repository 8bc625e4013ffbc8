"""Design by optimisation: where to put the rotors and where to point them.

A layout is one row (azimuth, radius, height, cant, lean) a rotor. Rows repeat with a period
(2 is the alternating ring's), which makes the layout symmetric and the search small. CMA-ES
(package `cma`) starts from the best uniform ring, and a few times from random layouts; what breaks
a constraint pays for it, the more the farther.

The tilt jumps where the attitudes that can be held fall apart (54 deg to 9 deg within one degree of
cant), so ask for a reserve of thrust: a layout at the brink has none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.analysis.merit import OBJECTIVES, Judge, Merit
from fullam.exceptions import MissingDependency, SettingsError, UnknownName
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

COLUMNS = ("azimuths", "radii", "heights", "cants", "leans")
"""What can be set free, in the order of `VehicleDesign.rotor_rows`."""

RANGES = {
    "azimuths": (-0.8, 0.8),
    "radii": (0.7, 1.3),
    "heights": (-0.15, 0.15),
    "cants": (-80.0, 80.0),
    "leans": (-80.0, 80.0),
}
"""Bounds: azimuth about its place on the ring as a share of half the spacing; radius as a share of
the ring's; height [m]; cant and lean [deg]."""

SCAN = np.arange(0.0, 80.5, 0.5)
"""Cants of the uniform rings that a result is compared with [deg]."""

KEPT = 2e-3
"""A constraint broken by less is kept: its penalty is not infinitely steep."""

VIOLATION = 1e3
"""What a constraint broken by its own size costs, in units of the objective."""


@dataclass(frozen=True)
class DesignSearch:
    """A search, as data; calling it with a vehicle answers with changes for `design_vehicle`.

    Attributes:
        objective: One of `OBJECTIVES`.
        free: Which of `COLUMNS` may change.
        period: The rows repeat after so many rotors; 0 lets every rotor be different.
        reserve: Least thrust to weight.
        min_efficiency: Least weight over the least sum of thrusts that hold it.
        min_tilt: Least worst tilt [deg].
        arm_deg: Arm pose whose centre of mass counts [deg]; None puts it at the origin of {A}.
        evaluations: Layouts tried for each start.
        starts: The uniform ring, and starts - 1 random layouts.
        seed: Of the search.
    """

    objective: str = "worst-tilt"
    free: tuple[str, ...] = ("cants", "leans")
    period: int = 0
    reserve: float = 1.5
    min_efficiency: float = 0.0
    min_tilt: float = 0.0
    arm_deg: tuple[float, ...] | None = None
    evaluations: int = 6000
    starts: int = 3
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the names and numbers.

        Raises:
            UnknownName: No such objective, or nothing of that name to set free.
            SettingsError: A number out of range.
        """
        if self.objective not in OBJECTIVES:
            raise UnknownName("objective", self.objective, OBJECTIVES)
        for name in self.free:
            if name not in COLUMNS:
                raise UnknownName("free column", name, COLUMNS)
        for name, low in (("evaluations", 1), ("starts", 1), ("period", 0), ("reserve", 1.0)):
            if not getattr(self, name) >= low:
                raise SettingsError(
                    "design search", name, f"is {getattr(self, name)}", f"give {low} or more"
                )
        if not self.free:
            raise SettingsError("design search", "free", "is empty", f"give of {COLUMNS}")

    def __call__(self, vehicle: Vehicle) -> dict[str, Any]:
        """Changes that make the vehicle better, for `design_vehicle`."""
        return self.run(vehicle).changes

    def run(self, vehicle: Vehicle, progress: Callable[[int, int], None] | None = None) -> Found:
        """Search.

        Args:
            vehicle: A design on a ring; see `VehicleDesign`.
            progress: Told (layouts tried, layouts in all).

        Raises:
            MissingDependency: Package `cma` is not installed.
            SettingsError: The vehicle is not a design on a ring, or its rotors are no multiple of
                the period.
        """
        layouts = _Layouts.of(vehicle, self)
        ring = layouts.best_ring()
        best, tried = ring, len(SCAN)
        total = tried + self.starts * self.evaluations
        for start in range(self.starts):
            for point in _search(layouts, ring, start):
                tried += 1
                if layouts.cost(point.merit) < layouts.cost(best.merit):
                    best = point
                if progress is not None and tried % 50 == 0:
                    progress(min(tried, total), total)
        full = replace(layouts, asked=OBJECTIVES)
        return Found(self, full.judged(best.rows), full.judged(ring.rows), tried)


@dataclass(frozen=True, eq=False)
class Layout:
    """Rotor rows and what they are worth.

    Attributes:
        rows: Azimuth [deg], radius [m], height [m], cant [deg], lean [deg] of each rotor, (n, 5).
        merit: Their figures.
    """

    rows: Array
    merit: Merit


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found.

    Attributes:
        search: What was asked.
        best: The best layout.
        ring: The best uniform ring that keeps the same constraints, to compare with.
        evaluations: Layouts tried.
    """

    search: DesignSearch
    best: Layout
    ring: Layout
    evaluations: int

    @property
    def gain(self) -> float:
        """How much better than the ring, in the unit of the objective."""
        name = self.search.objective
        return self.best.merit.of(name) - self.ring.merit.of(name)

    @property
    def feasible(self) -> bool:
        """Whether the best layout keeps the constraints, to rounding."""
        search, merit = self.search, self.best.merit
        return (
            merit.reserve >= search.reserve - KEPT
            and merit.efficiency >= search.min_efficiency - KEPT
            and merit.worst_tilt >= search.min_tilt - KEPT
        )

    @property
    def changes(self) -> dict[str, Any]:
        """For `design_vehicle`."""
        return {"rotor_rows": tuple(tuple(float(x) for x in row) for row in self.best.rows)}


@dataclass(frozen=True, eq=False)
class _Layouts:
    """From points of the search to layouts and their costs."""

    search: DesignSearch
    judge: Judge
    ring: Array
    asked: tuple[str, ...] = field(default=OBJECTIVES)

    @classmethod
    def of(cls, vehicle: Vehicle, search: DesignSearch) -> _Layouts:
        design = vehicle.definition.get("design")
        if design is None:
            raise SettingsError(
                f"vehicle '{vehicle.name}'", "design", "is missing", "search among our own designs"
            )
        n = vehicle.rotors.count
        if n % (search.period or n):
            raise SettingsError(
                "design search", "period", f"is {search.period}", f"give a divisor of {n} rotors"
            )
        azimuths = (np.arange(n) + design["ring_phase"]) * 360.0 / n
        ring = np.zeros((n, 5))
        ring[:, 0], ring[:, 1], ring[:, 2] = azimuths, design["ring_radius"], design["rotor_height"]
        arm = None if search.arm_deg is None else np.deg2rad(search.arm_deg)
        asked = {search.objective}
        asked |= {"efficiency"} if search.min_efficiency > 0.0 else set()
        asked |= {"worst-tilt"} if search.min_tilt > 0.0 else set()
        return cls(search, Judge.of(vehicle, arm), ring, tuple(sorted(asked)))

    @property
    def repeats(self) -> int:
        """How often the free rows are repeated."""
        return len(self.ring) // (self.search.period or len(self.ring))

    @property
    def size(self) -> int:
        """Numbers that a point has."""
        return len(self.search.free) * (len(self.ring) // self.repeats)

    def rows(self, point: Array, base: Array) -> Array:
        """Rows of a point in [-1, 1]^size; what is not free stays as in `base`."""
        rows, n = base.copy(), len(self.ring)
        spread = np.tile(np.asarray(point).reshape(len(self.search.free), -1), self.repeats)
        for share, name in zip(spread, self.search.free, strict=True):
            low, high = RANGES[name]
            values = low + 0.5 * (share + 1.0) * (high - low)
            if name == "azimuths":
                values = self.ring[:, 0] + values * 180.0 / n
            elif name == "radii":
                values = self.ring[:, 1] * values
            rows[:, COLUMNS.index(name)] = values
        return rows

    def point(self, rows: Array) -> Array:
        """The inverse of `rows`, clipped to what can be reached."""
        n, found = len(rows), []
        for name in self.search.free:
            values, (low, high) = rows[:, COLUMNS.index(name)], RANGES[name]
            if name == "azimuths":
                values = (values - self.ring[:, 0]) * n / 180.0
            elif name == "radii":
                values = values / self.ring[:, 1]
            found.append((2.0 * (values - low) / (high - low) - 1.0)[: n // self.repeats])
        return np.clip(np.concatenate(found), -1.0, 1.0)

    def judged(self, rows: Array) -> Layout:
        """A layout with its merit."""
        azimuth, cant, lean = np.deg2rad(rows[:, [0, 3, 4]]).T
        c, s = np.cos(azimuth), np.sin(azimuth)
        positions = np.column_stack([rows[:, 1] * c, rows[:, 1] * s, rows[:, 2]])
        outward, tangent = np.sin(lean) * np.cos(cant), np.sin(cant)
        axes = np.column_stack(
            [c * outward - s * tangent, s * outward + c * tangent, np.cos(lean) * np.cos(cant)]
        )
        return Layout(rows, self.judge.merit(positions, axes, self.asked))

    def cost(self, merit: Merit) -> float:
        """The objective's opposite, and what broken constraints cost on top."""
        search = self.search
        broken = max(search.reserve - merit.reserve, 0.0) / search.reserve
        if search.min_efficiency > 0.0:
            broken += max(search.min_efficiency - merit.efficiency, 0.0) / search.min_efficiency
        if search.min_tilt > 0.0:
            broken += max(search.min_tilt - merit.worst_tilt, 0.0) / search.min_tilt
        unit = 1.0 if search.objective in ("worst-tilt", "failure-tilt") else 0.01
        return -merit.of(search.objective) / unit + VIOLATION * broken

    def best_ring(self) -> Layout:
        """The alternating ring whose one cant is the best."""
        candidates = []
        for cant in SCAN:
            rows = self.ring.copy()
            rows[:, 3] = cant * self.judge.spins
            candidates.append(self.judged(rows))
        return min(candidates, key=lambda layout: self.cost(layout.merit))


def _search(layouts: _Layouts, ring: Layout, start: int) -> Iterator[Layout]:
    """Layouts that CMA-ES tries; the first start is the ring, the others are random."""
    try:
        import cma
    except ImportError as error:
        raise MissingDependency("a design search", "cma", "campaign") from error
    search = layouts.search
    rng = np.random.default_rng([search.seed, start])
    first = layouts.point(ring.rows) if start == 0 else rng.uniform(-0.8, 0.8, layouts.size)
    options = {
        "bounds": [-1.0, 1.0],
        "verbose": -9,
        "maxfevals": search.evaluations,
        # The optimiser would seed numpy's global generator; it gets one of its own instead.
        "seed": np.nan,
        "randn": lambda *shape: rng.standard_normal(shape),
    }
    strategy = cma.CMAEvolutionStrategy(np.clip(first, -0.99, 0.99), 0.15, options)
    while not strategy.stop():
        points = strategy.ask()
        tried = [layouts.judged(layouts.rows(point, ring.rows)) for point in points]
        strategy.tell(points, [layouts.cost(layout.merit) for layout in tried])
        yield from tried


def pareto_front(
    vehicle: Vehicle,
    search: DesignSearch,
    efficiencies: ArrayLike,
    progress: Callable[[int, int], None] | None = None,
) -> list[Found]:
    """The best objective at each least hover efficiency: a front of two aims.

    A search that did worse than one under a stricter bound takes the latter's layout.

    Args:
        vehicle: As in `DesignSearch.run`.
        search: What to raise; its own least efficiency is replaced.
        efficiencies: Least efficiencies, shape (k,).
        progress: Told (searches done, searches in all).
    """
    levels = np.asarray(efficiencies, dtype=float)
    front: list[Found] = []
    for k, level in enumerate(levels):
        front.append(replace(search, min_efficiency=float(level)).run(vehicle))
        if progress is not None:
            progress(k + 1, len(levels))
    layouts = [found.best for found in front]
    return [replace(found, best=_best_of(vehicle, found, layouts)) for found in front]


def _best_of(vehicle: Vehicle, found: Found, layouts: list[Layout]) -> Layout:
    """The best under a search's constraints; what was found under stricter ones may be it."""
    judge = _Layouts.of(vehicle, found.search)
    return min(layouts, key=lambda layout: judge.cost(layout.merit))
