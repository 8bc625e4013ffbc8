"""Kernels that draw the weather and the true vehicle of a seed into rows, as `forecast` does.

They are stages of a program whose periods are lanes: stage(view, lane) draws what the seed of that
lane has in store. Being scalar code, they may branch on what they draw.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.dynamics.spatial import Spatial, add_spatial, axpy_spatial, multiply_spatial
from fullam.numbers.kernel import Number, absolute, kernel, sqrt
from fullam.numbers.random_streams import draw_normals, next_normal, next_uniform, stream
from fullam.numbers.records import one
from fullam.numbers.vectors import ZERO, Vector, add, axpy, dot, scale
from fullam.simulation.true_vehicle import write_vehicle
from fullam.simulation.weather import STREAMS

NOISE, GUSTS, INERTIAL, PARAMETERS, BIASES, DRIFTS, GAPS, OUTLIERS = range(len(STREAMS))
"""Numbers of the streams."""


class Source(NamedTuple):
    """What is drawn from: a `Seed` for each lane, and the layers of the ziggurat."""

    seeds: Any
    layers: Any


class InertialNoise(NamedTuple):
    """What is added to gyroscope [rad/s] and accelerometer [m/s^2], or what they make of 1.

    Added in a control period are noise, bias and drift.
    """

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


class OffsetView(NamedTuple):
    """Source, bounds (12) and steps of the walks (2), room for drawn errors and for the draws.

    And what is written: gains (one row), and the noise that offsets are added to.
    """

    source: Source
    bounds: Any
    steps: Any
    errors: Any
    draws: Any
    gains: Any
    inertial: Any


class OutlierView(NamedTuple):
    """Source, probability, distance and angle (3), room for the draws; the noise of the poses."""

    source: Source
    kind: Any
    draws: Any
    noise: Any


class GapView(NamedTuple):
    """Source, `Gaps`, and what is written: 1 where no pose arrives."""

    source: Source
    gaps: Any
    missing: Any


class Gaps(NamedTuple):
    """How many are drawn, periods of each, interval, interval less duration, control period."""

    drawn: Number
    rows: Number
    interval: Number
    spare: Number
    period: Number


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
def draw_offsets(view, lane):
    """Draw biases, scale errors and drifts; add the offsets to the noise."""
    state, errors = stream(view.source.seeds[lane], BIASES), view.errors
    for i in range(len(errors)):
        state, u = next_uniform(state)
        errors[i] = view.bounds[i] * (-1.0 + 2.0 * u)
    one(view.gains, lane)[0] = InertialNoise(
        (1.0 + errors[6], 1.0 + errors[7], 1.0 + errors[8]),
        (1.0 + errors[9], 1.0 + errors[10], 1.0 + errors[11]),
    )
    draws, inertial, steps = view.draws, one(view.inertial, lane), view.steps
    draw_normals(stream(view.source.seeds[lane], DRIFTS), view.source.layers, draws)
    b_w, b_f = (errors[0], errors[1], errors[2]), (errors[3], errors[4], errors[5])
    w, f, count = ZERO, ZERO, len(inertial)
    for k in range(count):
        i, j = 3 * k, 3 * (count + k)
        w = axpy(steps[0], (draws[i], draws[i + 1], draws[i + 2]), w)
        f = axpy(steps[1], (draws[j], draws[j + 1], draws[j + 2]), f)
        noise = inertial[k]
        inertial[k] = InertialNoise(
            add(noise.gyroscope, add(b_w, w)), add(noise.accelerometer, add(b_f, f))
        )


@kernel
def draw_outliers(view, lane):
    """Draw which poses are outliers, and add to their noise what makes them so."""
    draws, kind, noise = view.draws, view.kind, one(view.noise, lane)
    state = stream(view.source.seeds[lane], OUTLIERS)
    for k in range(len(noise)):
        state, u = next_uniform(state)
        draws[6 + k] = u
    for k in range(len(noise)):
        if draws[6 + k] < kind[0]:
            for i in range(6):
                state, x = next_normal(state, view.source.layers)
                draws[i] = x
            if k > 0:
                way, turn = six(draws, 0)
                added = Spatial(lengthened(kind[1], way), lengthened(kind[2], turn))
                noise[k] = add_spatial(noise[k], added)


@kernel
def lengthened(size, a):
    """The vector of that length along a."""
    return scale(size / sqrt(dot(a, a)), a)


@kernel
def draw_gaps(view, lane):
    """Draw when poses are missing."""
    gaps, missing = view.gaps[0], one(view.missing, lane)
    state = stream(view.source.seeds[lane], GAPS)
    for k in range(len(missing)):
        missing[k] = 0.0
    for i in range(int(gaps.drawn)):
        state, u = next_uniform(state)
        first = int((i * gaps.interval + u * gaps.spare) / gaps.period) + 1
        for k in range(first, min(first + int(gaps.rows), len(missing))):
            missing[k] = 1.0


@kernel
def draw_vehicle(view, lane):
    """Draw the factors, and write the rows of the true vehicle."""
    state = stream(view.source.seeds[lane], PARAMETERS)
    factors = view.factors
    for i in range(len(view.shares)):
        state, u = next_uniform(state)
        factors[i] = 1.0 + view.shares[i] * (-1.0 + 2.0 * u)
    write_vehicle(view.nominal, factors, one(view.links, lane), one(view.rotors, lane))
