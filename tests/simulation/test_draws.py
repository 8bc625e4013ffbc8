"""Draws in bulk: the weather and the vehicle of a seed, bit for bit, however they are drawn."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fullam.dynamics.link_rows import LinkRows
from fullam.exceptions import ScenarioError
from fullam.model.chain import LinkChain
from fullam.model.loading import load_vehicle
from fullam.model.perturbation import PARAMETERS, Uncertainty, perturb
from fullam.model.vehicle import Vehicle
from fullam.numbers.machine_code import available
from fullam.numbers.records import Rows
from fullam.simulation import draws as bulk
from fullam.simulation.draws import Draws
from fullam.simulation.sensor_errors import MPU6050, SensorErrors
from fullam.simulation.weather import CALM, PAPER, RECORDED, SOLD, forecast

T = np.arange(300) * 0.01
PLANT_PERIOD = 0.002
SEEDS = [7, 0, 2**40, 3, 2**100 + 1, 4, 5, 6]
ALL = Uncertainty(0.2, PARAMETERS)

WEATHERS = {
    "recorded": RECORDED,
    "paper": PAPER,
    "all uncertain": replace(PAPER, uncertainty=ALL),
    "tight bound": replace(PAPER, noise_bound=0.2),
    "only attitude": replace(PAPER, position_noise=0.0),
    "gusts that overlap": replace(PAPER, gust_interval=0.015, gust_duration=0.013),
    "long gusts": replace(PAPER, gust_interval=0.5, gust_duration=0.5, moment_disturbance=0.0),
    "only uncertain": replace(CALM, uncertainty=ALL),
    "calm": CALM,
    "sold": replace(SOLD, sensors=replace(MPU6050, gap_interval=0.7, outlier_share=0.1)),
    "only sensors": replace(CALM, sensors=replace(MPU6050, gap_interval=0.5)),
    "only bias": replace(CALM, sensors=SensorErrors(gyroscope_bias_deg=(1.0, 2.0, 3.0))),
}

BODY = """
  <link name="{0}"><inertial><origin xyz="0.01 0.02 -0.03"/><mass value="{1}"/>
    <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="0.002" iyz="0.003"/>
  </inertial></link>
"""
JOINT = """
  <joint name="slide" type="prismatic"><parent link="base"/><child link="arm"/>
    <origin xyz="0.1 0 0" rpy="0.1 0.2 0.3"/><axis xyz="0.48 0.6 0.64"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
"""
ROTOR = {
    "position": [0.3, 0.1, 0.02],
    "axis": [0.48, 0.6, 0.64],
    "spin": 1,
    "k_f": 1e-5,
    "k_tau": 1e-7,
    "max_speed": 900.0,
    "lag": 0.02,
}


@cache
def vehicle(name: str) -> Vehicle:
    """A registered vehicle, a platform without arm, or one with a slanted slide."""
    if name not in ("bare", "slanted"):
        return load_vehicle(name)
    bodies = BODY.format("base", 1.0)
    if name == "slanted":
        bodies += BODY.format("arm", 0.2) + JOINT
    definition = {
        "name": name,
        "platform": "base",
        "tool": "base" if name == "bare" else "arm",
        "arm": [] if name == "bare" else ["slide"],
        "rotor": [{"name": "one", **ROTOR}, {"name": "other", **ROTOR, "lag": 0.0}],
    }
    return Vehicle.from_definition(definition, f'<robot name="{name}">{bodies}</robot>')


VEHICLES = ["fullam", "hextilt", "borinot", "quadrotor_arm", "bare", "slanted"]


def lane_of(rows: Rows, lane: int) -> np.ndarray:
    return rows.array[..., lane] if rows.lanes else rows.array


def assert_weather(drawn, lane, weather, seed):
    """The rows of a lane are the forecast of that seed."""
    draw = forecast(weather, seed, T)
    np.testing.assert_array_equal(lane_of(drawn.noise, lane), draw.pose_noise)
    np.testing.assert_array_equal(lane_of(drawn.gust, lane), draw.disturbance)
    if drawn.inertial is not None:
        np.testing.assert_array_equal(lane_of(drawn.inertial, lane), draw.inertial_noise)
        np.testing.assert_array_equal(lane_of(drawn.gains, lane)[0], draw.gains)
    missing = lane_of(drawn.missing, lane)[:, 0]
    np.testing.assert_array_equal(np.resize(missing, T.size), draw.missing)


def assert_vehicle(drawn, lane, nominal, weather, seed):
    """The rows of a lane are those of the perturbed vehicle."""
    true = perturb(nominal, weather.uncertainty, forecast(weather, seed, T).parameters)
    links = LinkRows.of(LinkChain.from_vehicle(true)).rows.array
    # A frame that is turned about a slanted axis multiplies in another order.
    rounding = 4e-16 if nominal.name == "slanted" else 0.0
    np.testing.assert_allclose(
        lane_of(drawn.links, lane), links, rtol=rounding, atol=rounding * np.abs(links).max()
    )
    rotors = lane_of(drawn.rotors, lane)
    coupling = true.rotors.coupling_matrix.T
    # Sums of three products, in machine code without fused ones.
    np.testing.assert_allclose(
        rotors[:, :6], coupling, rtol=4e-16, atol=4e-16 * np.abs(coupling).max()
    )
    lags = np.maximum(true.rotors.lags, 1e-12)
    decays = np.exp(-np.outer([0.5, 1.0], PLANT_PERIOD / lags)).T
    np.testing.assert_allclose(rotors[:, 6:], decays, rtol=0.0, atol=4e-16)  # both are below 1


@pytest.mark.parametrize("lanes", [0, 8])
@pytest.mark.parametrize("weather", WEATHERS.values(), ids=WEATHERS)
def test_a_seed_has_the_weather_of_its_forecast(weather, lanes):
    drawn = Draws.of(vehicle("fullam"), weather, T, PLANT_PERIOD).rows(lanes, inertial=True)
    for start in range(0, len(SEEDS), max(lanes, 1)):
        seeds = SEEDS[start : start + max(lanes, 1)]
        drawn.fill(seeds)
        for lane, seed in enumerate(seeds):
            assert_weather(drawn, lane, weather, seed)


@pytest.mark.parametrize("lanes", [0, 8])
@pytest.mark.parametrize("name", VEHICLES)
def test_a_seed_has_the_vehicle_that_perturb_draws(name, lanes):
    for weather in (PAPER, WEATHERS["all uncertain"], CALM):
        drawn = Draws.of(vehicle(name), weather, T, PLANT_PERIOD).rows(lanes)
        seeds = SEEDS[-max(lanes, 1) :]
        drawn.fill(seeds)
        for lane, seed in enumerate(seeds):
            assert_vehicle(drawn, lane, vehicle(name), weather, seed)


@pytest.mark.parametrize("name", ["fullam", "bare", "slanted"])
@pytest.mark.parametrize("weather", WEATHERS.values(), ids=WEATHERS)
def test_numpy_draws_the_same_bits_as_machine_code(weather, name):
    draws = Draws.of(vehicle(name), weather, T, PLANT_PERIOD)
    for lanes in (0, 8):
        one, other = (draws.rows(lanes, True, compiled) for compiled in (True, False))
        for drawn in (one, other):
            drawn.fill(SEEDS[: max(lanes, 1)])
        for field in ("noise", "gust", "missing", "inertial", "gains", "links", "rotors"):
            np.testing.assert_array_equal(getattr(one, field).array, getattr(other, field).array)


@pytest.mark.parametrize("seed", [2**128 - 1, 2**128, 2**200 + 5])
def test_seeds_may_be_as_long_as_numpys(seed):
    drawn = Draws.of(vehicle("fullam"), PAPER, T, PLANT_PERIOD).rows()
    drawn.fill([seed])
    assert_weather(drawn, 0, PAPER, seed)
    assert_vehicle(drawn, 0, vehicle("fullam"), PAPER, seed)


def test_the_seed_before_leaves_no_trace():
    drawn = Draws.of(vehicle("fullam"), WEATHERS["gusts that overlap"], T, PLANT_PERIOD).rows(8)
    drawn.fill(SEEDS)
    drawn.fill(SEEDS[::-1])
    for lane, seed in enumerate(SEEDS[::-1]):
        assert_weather(drawn, lane, WEATHERS["gusts that overlap"], seed)
        assert_vehicle(drawn, lane, vehicle("fullam"), PAPER, seed)


def test_fewer_seeds_than_lanes_leave_the_others_calm_and_nominal():
    drawn = Draws.of(vehicle("fullam"), PAPER, T, PLANT_PERIOD).rows(8)
    drawn.fill(SEEDS[:3])
    for lane, seed in enumerate(SEEDS[:3]):
        assert_weather(drawn, lane, PAPER, seed)
    for lane in range(3, 8):
        assert_weather(drawn, lane, CALM, 0)
        assert_vehicle(drawn, lane, vehicle("fullam"), CALM, 0)


def test_what_is_certain_is_not_touched():
    """Rows are written where a seed decides, and nowhere else: here is a mark that stays."""
    drawn = Draws.of(vehicle("fullam"), CALM, T, PLANT_PERIOD).rows(8, inertial=True)
    fields = (drawn.noise, drawn.gust, drawn.inertial, drawn.links, drawn.rotors)
    for rows in fields:
        rows.array[:] = 42.0
    drawn.fill(SEEDS)
    assert all((rows.array == 42.0).all() for rows in fields)
    drawn = Draws.of(vehicle("fullam"), RECORDED, T, PLANT_PERIOD).rows(8)
    drawn.links.array[:] = drawn.gust.array[:] = 42.0
    drawn.fill(SEEDS)
    assert (drawn.links.array == 42.0).all()
    assert np.flatnonzero((drawn.gust.array != 42.0).any(axis=(1, 2))).tolist() == [100, 200]


def test_threads_draw_what_one_draws():
    draws = Draws.of(vehicle("fullam"), PAPER, T, PLANT_PERIOD)

    def draw(first: int) -> list[np.ndarray]:
        drawn = draws.rows(8)
        copies = []
        for start in range(first, first + 80, 8):
            drawn.fill(range(start, start + 8))
            copies += [drawn.noise.array.copy(), drawn.gust.array.copy()]
            copies += [drawn.links.array.copy(), drawn.rotors.array.copy()]
        return copies

    alone = [draw(first) for first in range(0, 640, 80)]
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(draw, range(0, 640, 80)))
    for one, other in zip(alone, together, strict=True):
        assert all(map(np.array_equal, one, other))


@pytest.mark.parametrize("seeds", [[-1], [0.5], ["1"], [1, 2]])
def test_bad_seeds_are_named(seeds):
    drawn = Draws.of(vehicle("fullam"), PAPER, T, PLANT_PERIOD).rows()
    with pytest.raises(ScenarioError, match="draws: seed"):
        drawn.fill(seeds)


def test_machine_code_draws_what_this_numpy_draws():
    """Else nothing breaks, but all draws are slow."""
    assert bulk.agrees_with_numpy(0) is available()


def test_another_ziggurat_would_be_noticed(monkeypatch):
    """One last bit of one layer of 256 is enough."""
    layers = bulk.ziggurat()
    changed = Rows(layers.record, layers.array.copy())
    changed.array[77, 0] = np.nextafter(changed.array[77, 0], 1.0)
    monkeypatch.setattr(bulk, "ziggurat", lambda: changed)
    assert bulk.agrees_with_numpy.__wrapped__(0) is False
