"""Kernels that draw the weather and the true vehicle of a seed into rows, as `forecast` does.

They are stages of a program whose periods are lanes: stage(view, lane) draws what the seed of that
lane has in store. Being scalar code, they may branch on what they draw.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.dynamics.spatial import Spatial, axpy_spatial, multiply_spatial
from fullam.numbers.kernel import Number, absolute, kernel
from fullam.numbers.random_streams import draw_normals, next_normal, next_uniform, stream
from fullam.numbers.records import one
from fullam.numbers.vectors import ZERO, Vector, scale
from fullam.simulation.true_vehicle import write_vehicle
from fullam.simulation.weather import STREAMS

NOISE, GUSTS, INERTIAL, PARAMETERS = range(len(STREAMS))
"""Numbers of the streams."""


class Source(NamedTuple):
    """What is drawn from: a `Seed` for each lane, and the layers of the ziggurat."""

    seeds: Any
    layers: Any


class InertialNoise(NamedTuple):
    """Noise of the gyroscope [rad/s] and of the accelerometer [m/s^2] in a control period."""

    gyroscope: Vector
    accelerometer: Vector


class GustEntry(NamedTuple):
    """That a control period holds a gust, and for which share; see `weather.GustTable`."""

    period: Number
    gust: Number
    share: Number


class NoiseView(NamedTuple):
    """Source, standard deviations (a `Spatial`) and bound, room for the draws; and the noise."""

    source: Source
    sigma: Any
    bound: Any
    draws: Any
    outside: Any
    noise: Any


class GustView(NamedTuple):
    """Source, standard deviations, `GustEntry` rows, room for the draws; and the gusts."""

    source: Source
    sigma: Any
    entries: Any
    draws: Any
    gust: Any


class InertialView(NamedTuple):
    """Source, standard deviations of both sensors, room for the draws; and the noise."""

    source: Source
    sigma: Any
    draws: Any
    inertial: Any


class VehicleView(NamedTuple):
    """Source, `Nominal`, share of each factor, room for factors; links and rotors."""

    source: Source
    nominal: Any
    shares: Any
    factors: Any
    links: Any
    rotors: Any


@kernel
def six(draws, i):
    """Entry i of six numbers each."""
    j = 6 * i
    return Spatial(
        (draws[j], draws[j + 1], draws[j + 2]), (draws[j + 3], draws[j + 4], draws[j + 5])
    )


@kernel
def draw_noise(view, lane):
    """Draw the noise of the pose; what is beyond the bound is drawn again, in its order."""
    draws, outside, bound, count = view.draws, view.outside, view.bound[0], 0
    state = draw_normals(stream(view.source.seeds[lane], NOISE), view.source.layers, draws)
    for i in range(len(draws)):
        if absolute(draws[i]) > bound:
            outside[count] = float(i)
            count += 1
    while count > 0:
        remaining = 0
        for j in range(count):
            i = int(outside[j])
            state, x = next_normal(state, view.source.layers)
            draws[i] = x
            if absolute(x) > bound:
                outside[remaining] = float(i)
                remaining += 1
        count = remaining
    noise, sigma = one(view.noise, lane), view.sigma[0]
    for k in range(len(noise)):
        noise[k] = multiply_spatial(sigma, six(draws, k))


@kernel
def draw_gusts(view, lane):
    """Draw the gusts, and write the periods that hold some."""
    draws, gust, sigma = view.draws, one(view.gust, lane), view.sigma[0]
    draw_normals(stream(view.source.seeds[lane], GUSTS), view.source.layers, draws)
    for i in range(len(view.entries)):
        gust[int(view.entries[i].period)] = Spatial(ZERO, ZERO)
    for i in range(len(view.entries)):
        entry = view.entries[i]
        k, wrench = int(entry.period), multiply_spatial(sigma, six(draws, int(entry.gust)))
        gust[k] = axpy_spatial(entry.share, wrench, gust[k])


@kernel
def draw_inertial(view, lane):
    """Draw the noise of the inertial sensors, all of the gyroscope's first."""
    draws, inertial, sigma = view.draws, one(view.inertial, lane), view.sigma
    draw_normals(stream(view.source.seeds[lane], INERTIAL), view.source.layers, draws)
    count = len(inertial)
    for k in range(count):
        i, j = 3 * k, 3 * (count + k)
        inertial[k] = InertialNoise(
            scale(sigma[0], (draws[i], draws[i + 1], draws[i + 2])),
            scale(sigma[1], (draws[j], draws[j + 1], draws[j + 2])),
        )


@kernel
def draw_vehicle(view, lane):
    """Draw the factors, and write the rows of the true vehicle."""
    state = stream(view.source.seeds[lane], PARAMETERS)
    factors = view.factors
    for i in range(len(view.shares)):
        state, u = next_uniform(state)
        factors[i] = 1.0 + view.shares[i] * (-1.0 + 2.0 * u)
    write_vehicle(view.nominal, factors, one(view.links, lane), one(view.rotors, lane))
