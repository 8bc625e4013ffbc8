"""The weather and the true vehicles of many seeds, drawn in bulk into rows for the flight.

A seed gives what `forecast` and `perturb` give, bit for bit. Machine code draws it, without the
interpreter's lock, where kernels can be compiled and its numbers are those of this numpy; elsewhere
`forecast` itself does. Whatever a weather leaves certain is written once and never touched again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.recursion import Link
from fullam.dynamics.spatial import Spatial
from fullam.exceptions import ScenarioError
from fullam.model.perturbation import draw_factors, factor_shares
from fullam.model.vehicle import Vehicle
from fullam.numbers.kernel import kernel
from fullam.numbers.machine_code import available
from fullam.numbers.program import Program, Stage, program
from fullam.numbers.random_streams import Seed, draw_normals, seed_words, stream, ziggurat
from fullam.numbers.records import Rows
from fullam.numbers.vectors import Vector
from fullam.simulation.drawn_weather import (
    GustEntry,
    GustView,
    InertialNoise,
    InertialView,
    NoiseView,
    Source,
    VehicleView,
    draw_gusts,
    draw_inertial,
    draw_noise,
    draw_vehicle,
)
from fullam.simulation.true_vehicle import Nominal, RotorRow, nominal_rows, write_vehicle
from fullam.simulation.weather import GustTable, Weather, forecast

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Draws:
    """All that does not depend on the seed. Threads may share it; each has rows of its own.

    Attributes:
        weather: What is drawn.
        t: Control grid [s], shape (N,), read-only.
        nominal: The nominal vehicle, and which factors are whose.
        shares: How far each factor may be from 1, in the order of the draws; read-only.
        gusts: Which gusts each control period holds.
    """

    weather: Weather
    t: Array
    nominal: Nominal
    shares: Array
    gusts: GustTable

    @classmethod
    def of(cls, vehicle: Vehicle, weather: Weather, t: Array, plant_period: float) -> Draws:
        """Prepare the draws of a plan.

        Args:
            vehicle: The nominal vehicle.
            weather: What spoils the flights, and how far the true vehicles are from it.
            t: Control grid [s], shape (N,).
            plant_period: Time step of the plant [s].
        """
        t, shares = np.array(t, dtype=float), factor_shares(vehicle, weather.uncertainty)
        t.setflags(write=False)
        shares.setflags(write=False)
        nominal = nominal_rows(vehicle, plant_period)
        return cls(weather, t, nominal, shares, GustTable.of(weather, t))

    def rows(self, lanes: int = 0, inertial: bool = False, compiled: bool | None = None) -> Drawn:
        """Rows for the draws of one seed (lanes=0) or of as many as there are lanes.

        Args:
            lanes: Lanes of the rows.
            inertial: Whether the inertial sensors are read.
            compiled: Whether machine code draws; None takes it where it can be had.
        """
        return Drawn(self, lanes, inertial, compiled)


class Drawn:
    """Rows that hold the draws of some seeds; one thread's own.

    Calm air and the nominal vehicle before the first seed.

    Attributes:
        noise: `Spatial` rows, a control period each: position (world) [m], attitude (tangent at
            {A}) [rad].
        gust: `Spatial` rows, a control period each: wrench on the platform at its origin, world
            axes, held over the period [N, N m].
        inertial: `InertialNoise` rows, a control period each; None if they are not asked for.
        links: `Link` rows of the true vehicle.
        rotors: `RotorRow` rows of it.
    """

    def __init__(self, draws: Draws, lanes: int, inertial: bool, compiled: bool | None) -> None:
        """Lay out the rows; see `Draws.rows`."""
        self._draws, count = draws, draws.t.size
        self.noise = Rows.empty(Spatial, count, lanes=lanes)
        self.gust = Rows.empty(Spatial, count, lanes=lanes)
        self.inertial = Rows.empty(InertialNoise, count, lanes=lanes) if inertial else None
        self.links = Rows.empty(Link, len(draws.nominal.links.array), lanes=lanes)
        self.rotors = Rows.empty(RotorRow, len(draws.nominal.rotors.array), lanes=lanes)
        for lane in range(max(lanes, 1)):
            self._put_vehicle(np.ones_like(draws.shares), lane)
        self._seeds = Rows.empty(Seed, max(lanes, 1))
        self._program: Program | None = None
        layers = ziggurat() if agrees_with_numpy() and compiled is not False else None
        if layers is not None:
            self._program = program(list(self._stages(Source(self._seeds, layers))), True)

    def fill(self, seeds: Sequence[int]) -> None:
        """Draw seeds, one a lane; lanes beyond them keep what they hold, which can be flown.

        Raises:
            ScenarioError: There are more seeds than lanes, or one is no whole number from 0 on.
        """
        if len(seeds) > len(self._seeds.array):
            raise ScenarioError(
                "draws", "seeds", f"are {len(seeds)}", f"give {len(self._seeds.array)} at most"
            )
        for seed in seeds:
            if not isinstance(seed, int | np.integer) or seed < 0:
                raise ScenarioError("draws", "seed", f"is {seed!r}", "give a whole number from 0")
        words = [seed_words(int(seed)) for seed in seeds]
        if self._program is None or None in words:
            for lane, seed in enumerate(seeds):
                self._fill_by_forecast(int(seed), lane)
        elif words:
            self._seeds.array[: len(words)] = words
            self._program.run(0, len(words))

    def _stages(self, source: Source) -> Iterator[Stage]:
        """What draws; nothing for what is certain."""
        weather, gusts, shares = self._draws.weather, self._draws.gusts, self._draws.shares
        sigma = weather.noise_scale, weather.gust_scale
        room = Rows.empty(float, 6 * max(self._draws.t.size, gusts.gusts))
        if sigma[0].any():
            view = NoiseView(
                source,
                Rows(Spatial, sigma[:1]),
                Rows(float, [[weather.noise_bound]]),
                _first(room, 6 * self._draws.t.size),
                Rows.empty(float, 6 * self._draws.t.size),
                self.noise,
            )
            yield Stage(draw_noise, view)
        if sigma[1].any() and gusts.period.size:
            entries = np.stack([gusts.period, gusts.gust, gusts.share], axis=1)
            drawn = _first(room, 6 * gusts.gusts)
            yield Stage(
                draw_gusts,
                GustView(
                    source, Rows(Spatial, sigma[1:]), Rows(GustEntry, entries), drawn, self.gust
                ),
            )
        inertial = [[weather.gyroscope_noise], [weather.accelerometer_noise]]
        if self.inertial is not None and np.any(inertial):
            drawn = _first(room, 6 * self._draws.t.size)
            view = InertialView(source, Rows(float, inertial), drawn, self.inertial)
            yield Stage(draw_inertial, view)
        if shares.any():
            factors = Rows(float, np.ones((shares.size + 1, 1)))
            yield Stage(
                draw_vehicle,
                VehicleView(
                    source,
                    self._draws.nominal,
                    Rows(float, shares[:, None]),
                    factors,
                    self.links,
                    self.rotors,
                ),
            )

    def _fill_by_forecast(self, seed: int, lane: int) -> None:
        """The same draws by `forecast` and `draw_factors`."""
        draws = self._draws
        draw = forecast(draws.weather, seed, draws.t)
        _put(self.noise, draw.pose_noise, lane)
        _put(self.gust, draw.disturbance, lane)
        if self.inertial is not None:
            sensors = [draw.gyroscope_noise, draw.accelerometer_noise]
            _put(self.inertial, np.concatenate(sensors, axis=1), lane)
        self._put_vehicle(draw_factors(draws.shares, draw.parameters), lane)

    def _put_vehicle(self, factors: Array, lane: int) -> None:
        """Write the rows of the vehicle with these factors."""
        nominal = Nominal(*(rows.to_list() for rows in self._draws.nominal))
        links, rotors = [None] * len(nominal.links), [None] * len(nominal.rotors)
        write_vehicle(nominal, [*factors.tolist(), 1.0], links, rotors)
        _put(self.links, Rows.of(Link, links).array, lane)
        _put(self.rotors, Rows.of(RotorRow, rotors).array, lane)


def _first(rows: Rows, count: int) -> Rows:
    """The first numbers of rows of numbers, in the same memory."""
    return Rows(float, rows.array[:count])


def _put(rows: Rows, values: Array, lane: int) -> None:
    """Write the numbers of one flight, shape (length, size), to its lane."""
    if rows.lanes:
        rows.array[..., lane] = values
    else:
        rows.array[:] = values


class _Sample(NamedTuple):
    """Source, and room for normal numbers."""

    source: Source
    numbers: Any


@kernel
def _sample(view, lane):
    draw_normals(stream(view.source.seeds[lane], 1), view.source.layers, view.numbers)


@cache
def agrees_with_numpy() -> bool:
    """Whether machine code can be had, and draws the normal numbers that this numpy draws.

    numpy may change its algorithms from one version to the next, and then flies as it draws.
    """
    layers = ziggurat() if available() else None
    if layers is None:
        return False
    seeds, numbers = Rows.of(Seed, [seed_words(2**70 + 1)]), Rows.empty(float, 4096)
    program([Stage(_sample, _Sample(Source(seeds, layers), numbers))], True).run(0, 1)
    rng = np.random.default_rng(np.random.SeedSequence(2**70 + 1).spawn(2)[1])
    return np.array_equal(numbers.array[:, 0], rng.standard_normal(4096))
