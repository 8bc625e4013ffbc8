"""The atlas on one core: facets, tilts of many arm poses, and the ways that it replaces."""

from __future__ import annotations

import statistics
import time

import numpy as np
import pytest
from meter import Row
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from fullam.analysis.atlas import batches
from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.atlas.loads import centers_of, load_of
from fullam.model.attainable import faces, facets
from fullam.model.attainable.machine import available, machine_code
from fullam.model.loading import load_vehicle

pytestmark = pytest.mark.benchmark(timer=time.process_time)

GROUP = "The atlas: facets of a rotor set, and hover tilts read off them"
POSES, AZIMUTHS = 10_000, 72


def timed(benchmark, meter, work, row, calls=1, rounds=5):
    """Complete a row with the median time of a call [us]."""
    benchmark.pedantic(work, rounds=rounds, warmup_rounds=1)
    if benchmark.enabled:
        row.us = row.value = statistics.median(benchmark.stats.stats.data) / calls * 1e6
        meter.add(benchmark, row)


def generators(n):
    """Random full-scale generators, shape (n, 6): no five of them are dependent."""
    return np.random.default_rng(n).normal(size=(n, 6))


@pytest.mark.parametrize(("rotors", "must"), [(8, 10.0), (12, None), (16, 5000.0)])
def test_facets(benchmark, meter, rotors, must):
    if not available():
        pytest.skip("numba is not installed")
    vectors = generators(rotors)
    most = len(facets._fives(rotors, 0))
    rows, halves, masks = np.empty((most, 6)), np.empty(most), np.empty(most, dtype=np.int64)
    code, calls = machine_code(faces.list_faces), 2000 if rotors == 8 else 20

    def work():
        for _ in range(calls):
            code(vectors, 0, rows, halves, masks)

    row = Row(GROUP, f"facets, {rotors} rotors, machine code", 0.0, must=must, unit="us")
    timed(benchmark, meter, work, row, calls)


@pytest.mark.parametrize("rotors", [8, 16])
def test_facets_without_numba(benchmark, meter, rotors):
    vectors = generators(rotors)
    row = Row(GROUP, f"facets, {rotors} rotors, numpy", 0.0, unit="us")
    timed(benchmark, meter, lambda: facets._list_faces_by_numpy(vectors, 0), row)


def test_facets_by_qhull(benchmark, meter):
    """What one does otherwise: the hull of all 2^8 corners."""
    corners = (np.arange(256)[:, None] >> np.arange(8)) & 1
    points = corners @ generators(8)
    row = Row(GROUP, "facets, 8 rotors, Qhull of the corners", 0.0, unit="us")
    timed(benchmark, meter, lambda: ConvexHull(points), row, rounds=3)


@pytest.mark.parametrize("vehicle", ["fullam", "hextilt"])
def test_roses_of_many_poses(benchmark, meter, vehicle):
    described = load_vehicle(vehicle)
    envelope = Envelope.of(described)
    thetas = np.random.default_rng(0).uniform(-2.0, 2.0, (POSES, described.n_arm))
    azimuths = np.arange(AZIMUTHS) * 2.0 * np.pi / AZIMUTHS

    def work():
        centers = centers_of(described, thetas)
        batches.tilt_roses(envelope.facets, envelope.load, centers, azimuths)

    name = f"{POSES} poses x {AZIMUTHS} azimuths, {vehicle}"
    timed(benchmark, meter, work, Row(GROUP, name, 0.0, must=1e6, unit="us"))


def generic(n):
    """Envelope of n rotors without symmetry, which can hover."""
    vehicle = load_vehicle("fullam")
    rng, angle = np.random.default_rng(n), np.arange(n) * 2.0 * np.pi / n
    spins = np.where(np.arange(n) % 2 == 0, 1.0, -1.0)
    radial = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    tangent = np.column_stack([-np.sin(angle), np.cos(angle), 0.0 * angle])
    axes = [0.0, 0.0, 1.0] + 0.6 * spins[:, None] * tangent + rng.normal(0.0, 0.05, (n, 3))
    rotors = vehicle.rotors
    return Envelope.from_rotors(
        type(rotors)(
            names=tuple(str(k) for k in range(n)),
            positions=0.35 * radial,
            axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
            spins=spins,
            k_f=np.full(n, rotors.k_f[0]),
            k_tau=np.full(n, rotors.k_tau[0]),
            max_speeds=np.full(n, rotors.max_speeds[0]),
            lags=np.full(n, 0.03),
        ),
        load_of(vehicle),
    )


def test_worst_tilts_of_twelve_rotors(benchmark, meter):
    envelope = generic(12)
    centers = np.random.default_rng(1).normal(0.0, 0.01, (POSES, 3))
    tilts = batches.worst_tilts(envelope.facets, envelope.load, centers)
    assert np.isfinite(tilts).mean() > 0.9
    name = f"{POSES} worst tilts, 12 rotors, no symmetry"
    row = Row(GROUP, name, 0.0, must=5e6, unit="us")

    def work():
        batches.worst_tilts(envelope.facets, envelope.load, centers)

    timed(benchmark, meter, work, row)


def test_roses_of_eight_rotors_without_symmetry(benchmark, meter):
    envelope = generic(8)
    centers = np.random.default_rng(1).normal(0.0, 0.01, (POSES, 3))
    azimuths = np.arange(AZIMUTHS) * 2.0 * np.pi / AZIMUTHS
    name = f"{POSES} poses x {AZIMUTHS}, 8 rotors, no symmetry"

    def work():
        batches.tilt_roses(envelope.facets, envelope.load, centers, azimuths)

    timed(benchmark, meter, work, Row(GROUP, name, 0.0, must=1e6, unit="us"))


def test_one_envelope(benchmark, meter):
    """From a vehicle to its worst tilt, the facets included, by the public way."""
    vehicle = load_vehicle("hextilt")
    row = Row(GROUP, "from a vehicle to its worst tilt, hextilt", 0.0, unit="us")
    timed(benchmark, meter, lambda: [Envelope.of(vehicle).worst_tilt for _ in range(20)], row, 20)


def test_one_azimuth_by_bisection_of_linear_programs(benchmark, meter):
    """What one does otherwise: HiGHS at every tilt tried, to 0.01 deg."""
    envelope = Envelope.of(load_vehicle("hextilt"))
    found, load = envelope.facets, envelope.load
    system = found.matrix / found.scale[:, None]
    cost, bounds = np.zeros(len(found.least)), [(0.0, 1.0)] * len(found.least)

    def work():
        low, high = 0.0, np.pi
        while high - low > np.deg2rad(0.01):
            tilt = 0.5 * (low + high)
            wrench = load.wrench((np.sin(tilt), 0.0, np.cos(tilt))) / found.scale
            held = linprog(cost, A_eq=system, b_eq=wrench, bounds=bounds).status == 0
            low, high = (tilt, high) if held else (low, tilt)
        return low

    assert work() == pytest.approx(envelope.rose([0.0])[0], abs=np.deg2rad(0.02))
    row = Row(GROUP, "one azimuth, bisected by HiGHS, hextilt", 0.0, unit="us")
    timed(benchmark, meter, work, row)


def test_one_azimuth_by_the_atlas(benchmark, meter):
    envelope = Envelope.of(load_vehicle("hextilt"))
    row = Row(GROUP, "one azimuth, facets known, hextilt", 0.0, unit="us")
    assert envelope.can_hover

    def work():
        for _ in range(100):
            envelope.rose([0.0])

    timed(benchmark, meter, work, row, 100)
