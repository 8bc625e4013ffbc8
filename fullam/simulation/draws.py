"""The weather and the true vehicles of many seeds, drawn in bulk into rows for the flight.

A seed gives what `forecast` and `perturb` give, bit for bit. Machine code draws it, without the
interpreter's lock, where kernels can be compiled and its numbers are those of this numpy; elsewhere
`forecast` itself does. Whatever a weather leaves certain is written once and never touched again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.recursion import Link
from fullam.dynamics.spatial import Spatial
from fullam.exceptions import ScenarioError
from fullam.model.perturbation import draw_factors, factor_shares
from fullam.model.vehicle import Vehicle
from fullam.numbers.machine_code import available
from fullam.numbers.program import Program, Stage, program
from fullam.numbers.random_streams import Seed, seed_words, ziggurat
from fullam.numbers.records import Rows
from fullam.simulation.drawn_weather import (
    Gaps,
    GapView,
    GustEntry,
    GustView,
    InertialNoise,
    InertialView,
    NoiseView,
    OffsetView,
    OutlierView,
    Source,
    VehicleView,
    draw_gaps,
    draw_gusts,
    draw_inertial,
    draw_noise,
    draw_offsets,
    draw_outliers,
    draw_vehicle,
)
from fullam.simulation.sensor_errors import gap_counts
from fullam.simulation.true_vehicle import Nominal, RotorRow, nominal_rows, write_vehicle
from fullam.simulation.weather import PAPER, GustTable, Weather, control_period, forecast

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
        missing: Numbers, 1 for each control period that no pose arrives in, else 0; a single 0 in
            a weather without gaps.
        inertial: `InertialNoise` rows, a control period each; None if they are not asked for.
        gains: `InertialNoise`, one row: what gyroscope and accelerometer make of 1.
        links: `Link` rows of the true vehicle.
        rotors: `RotorRow` rows of it.
    """

    def __init__(self, draws: Draws, lanes: int, inertial: bool, compiled: bool | None) -> None:
        """Lay out the rows; see `Draws.rows`."""
        self._draws, count = draws, draws.t.size
        self._nominal = Nominal(*(rows.to_list() for rows in draws.nominal))
        self.noise = Rows.empty(Spatial, count, lanes=lanes)
        self.gust = Rows.empty(Spatial, count, lanes=lanes)
        gaps = count if draws.weather.sensors.have_gaps else 1
        self.missing = Rows.empty(float, gaps, lanes=lanes)
        self.inertial = Rows.empty(InertialNoise, count, lanes=lanes) if inertial else None
        self.gains = Rows.empty(InertialNoise, 1, lanes=lanes)
        self.gains.array[:] = 1.0
        self.links = Rows.empty(Link, len(draws.nominal.links.array), lanes=lanes)
        self.rotors = Rows.empty(RotorRow, len(draws.nominal.rotors.array), lanes=lanes)
        self._seeds = Rows.empty(Seed, max(lanes, 1))
        self._put_vehicle(np.ones_like(draws.shares), *range(len(self._seeds.array)))
        self._program: Program | None = None
        layers = ziggurat()
        stages = list(self._stages(Source(self._seeds, layers)))
        self._is_certain = not stages
        if stages and layers is not None and compiled is not False and agrees_with_numpy(lanes):
            self._program = program(stages, True)

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
        if self._is_certain or not seeds:
            return
        words = [seed_words(int(seed)) for seed in seeds]
        if self._program is None or None in words:
            for lane, seed in enumerate(seeds):
                self._fill_by_forecast(int(seed), lane)
        else:
            self._seeds.array[: len(words)] = words
            self._program.run(0, len(words))

    def put(self, vehicle: Vehicle) -> None:
        """Write a vehicle of one's own, of the nominal one's joints and rotors, for all lanes."""
        own = nominal_rows(vehicle, float(self._draws.nominal.period.array[0, 0]))
        links, rotors = own.links.array, [None] * len(own.rotors.array)
        exact = np.ones(self._draws.shares.size + 1).tolist()
        write_vehicle(
            Nominal(*(rows.to_list() for rows in own)), exact, [None] * len(links), rotors
        )
        for lane in range(len(self._seeds.array)):
            _put(self.links, links, lane)
            _put(self.rotors, Rows.of(RotorRow, rotors).array, lane)

    def _stages(self, source: Source) -> Iterator[Stage]:
        """What draws; nothing for what is certain."""
        weather, gusts, shares = self._draws.weather, self._draws.gusts, self._draws.shares
        room = Rows.empty(float, 6 * max(self._draws.t.size + 1, gusts.gusts))
        if weather.noise_scale.any() or weather.sensors.have_outliers:
            yield _noise_stage(source, weather, room, self.noise)
        yield from self._lost_pose_stages(source, room)
        if weather.gust_scale.any() and gusts.period.size:
            entries = np.stack([gusts.period, gusts.gust, gusts.share], axis=1)
            drawn = _first(room, 6 * gusts.gusts)
            yield Stage(
                draw_gusts,
                GustView(
                    source,
                    Rows(Spatial, weather.gust_scale[None]),
                    Rows(GustEntry, entries),
                    drawn,
                    self.gust,
                ),
            )
        yield from self._inertial_stages(source, room)
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

    def _lost_pose_stages(self, source: Source, room: Rows) -> Iterator[Stage]:
        """What makes poses outliers, and what takes some away."""
        errors, t = self._draws.weather.sensors, self._draws.t
        if errors.have_outliers:
            kind = Rows(float, [[errors.outlier_share], *errors.outlier[:, None]])
            drawn = _first(room, 6 + t.size)
            yield Stage(draw_outliers, OutlierView(source, kind, drawn, self.noise))
        if errors.have_gaps:
            period = control_period(t, self._draws.weather)
            spare = errors.gap_interval - errors.gap_duration
            counts = gap_counts(errors, t.size, period)
            gaps = Rows(Gaps, [[*counts, errors.gap_interval, spare, period]])
            yield Stage(draw_gaps, GapView(source, gaps, self.missing))

    def _inertial_stages(self, source: Source, room: Rows) -> Iterator[Stage]:
        """What is read off the inertial sensors beside the truth."""
        weather, t = self._draws.weather, self._draws.t
        period = control_period(t, weather)
        scales, errors = weather.inertial_scale(period), weather.sensors
        if self.inertial is None or not (any(scales) or errors.are_biased):
            return
        drawn, sigma = _first(room, 6 * t.size), Rows(float, np.array([scales]).T)
        yield Stage(draw_inertial, InertialView(source, sigma, drawn, self.inertial))
        if errors.are_biased:
            bounds = Rows(float, errors.bounds[:, None])
            steps = Rows(float, (errors.drift * np.sqrt(period))[:, None])
            drawing = source, bounds, steps, Rows.empty(float, 12), drawn
            yield Stage(draw_offsets, OffsetView(*drawing, self.gains, self.inertial))

    def _fill_by_forecast(self, seed: int, lane: int) -> None:
        """The same draws by `forecast` and `draw_factors`."""
        draws = self._draws
        draw = forecast(draws.weather, seed, draws.t)
        _put(self.noise, draw.pose_noise, lane)
        _put(self.gust, draw.disturbance, lane)
        if self.inertial is not None:
            _put(self.inertial, draw.inertial_noise, lane)
            _put(self.gains, draw.gains[None], lane)
        if draws.weather.sensors.have_gaps:
            _put(self.missing, draw.missing[:, None], lane)
        self._put_vehicle(draw_factors(draws.shares, draw.parameters), lane)

    def _put_vehicle(self, factors: Array, *lanes: int) -> None:
        """Write the rows of the vehicle with these factors."""
        nominal = self._nominal
        links, rotors = [None] * len(nominal.links), [None] * len(nominal.rotors)
        write_vehicle(nominal, [*factors.tolist(), 1.0], links, rotors)
        for lane in lanes:
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


def _noise_stage(source: Source, weather: Weather, room: Rows, noise: Rows) -> Stage:
    count = 6 * len(noise.array)
    view = NoiseView(
        source,
        Rows(Spatial, weather.noise_scale[None]),
        Rows(float, [[weather.noise_bound]]),
        _first(room, count),
        Rows.empty(float, count),
        noise,
    )
    return Stage(draw_noise, view)


@cache
def agrees_with_numpy(lanes: int = 0) -> bool:
    """Whether machine code can be had, and draws the normal numbers that this numpy draws.

    numpy may change its algorithms from one version to the next; then it has to draw itself.
    """
    layers = ziggurat() if available() else None
    if layers is None:
        return False
    seed, t = 2**70 + 1, np.arange(1000.0)
    source = Source(Rows.of(Seed, [seed_words(seed)]), layers)
    noise, room = Rows.empty(Spatial, t.size, lanes=lanes), Rows.empty(float, 6 * t.size)
    program([_noise_stage(source, PAPER, room, noise)], True).run(0, 1)
    drawn = noise.array[..., 0] if lanes else noise.array
    return np.array_equal(drawn, forecast(PAPER, seed, t).pose_noise)
