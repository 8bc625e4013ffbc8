"""The external wrench from what the vehicle knows: its size, its place, and when it begins."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from fullam.analysis.external_wrench import (
    METHODS,
    WrenchSettings,
    external_wrench,
    followed,
    kalman_gains,
    unexplained,
)
from fullam.analysis.measured_motion import MeasuredMotion
from fullam.exceptions import SettingsError, UnknownName
from fullam.simulation.fused import Fused, run_of
from fullam.simulation.many import fly_many
from fullam.simulation.motions.arm_motion import SineRate
from fullam.simulation.motions.joint_trajectory import JointTrajectory
from fullam.simulation.motions.references import Step
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.simulate import prepare, simulate
from fullam.simulation.tables import Tables
from fullam.simulation.weather import CALM, PAPER

QUIET = replace(PAPER, force_disturbance=0.0, moment_disturbance=0.0)
HOVER = Scenario(
    "hover", Step((0.0, 0.0, 1.0)), duration=12.0, initial_arm_deg=(-90.0, 0.0, -45.0, 0.0),
    weather=QUIET,
)  # fmt: skip


HALVES = slice(3), slice(3, 6)
"""Force and moment."""


def pushed(plan, push, seeds=range(8)):
    """Flights whose platform is pushed, world axes, a row a control period."""
    fused = Fused(Tables(plan), len(seeds))
    fused.block.draw(seeds)
    fused.block.drawn.gust.array[:] += push[:, :, None]
    fused.fly()
    return [run_of(fused.block, plan.with_seed(s), lane) for lane, s in enumerate(seeds)]


def push_between(t, begin, end, wrench):
    return np.where(((t >= begin) & (t < end))[:, None], wrench, 0.0)


@pytest.fixture(scope="module")
def three_newtons():
    plan = prepare(replace(HOVER, arm_motion=SineRate(3, 0.3, 0.5)), "dc-pid-plus")
    push = push_between(plan.t, 8.0, 11.0, np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    return plan, push, pushed(plan, push)


@pytest.mark.parametrize("method", METHODS)
def test_three_newtons_are_seen(three_newtons, method):
    _, push, runs = three_newtons
    errors = []
    for run in runs:
        found = external_wrench(run, WrenchSettings(method, rate=10.0, agility=0.3))
        settled = (found.t > 8.5) & (found.t < 11.0)
        gap = (found.wrench - push[1:])[settled, :3]
        errors.append(np.sqrt(np.mean(np.sum(gap**2, axis=1))))
    # 0.15 N in the mean of the seeds 0..15, of which 0.12 are the rotors' +-10 %.
    assert np.mean(errors) < 0.25


def test_while_the_arm_swings_fast_on_servos_their_twin_tells_three_times_as_well():
    t = np.arange(0.0, 8.01, 0.05)
    s = np.clip((t - 5.0) / 0.45, 0.0, 1.0)
    swing = np.tile([-90.0, 0.0, -45.0, 0.0], (t.size, 1))
    swing[:, 0] += 50.0 * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    motion = JointTrajectory.from_arrays(tuple(t), swing)
    exact = replace(QUIET, uncertainty=CALM.uncertainty)
    scenario = replace(HOVER, duration=8.0, arm_motion=motion, weather=exact)
    off = {}
    for feedback in ("truth", "twin", "encoder"):
        servo = {"plant": "servo", "plant_settings": {"feedback": feedback}}
        run = simulate(scenario, "dc-pid-plus", driver="fused", simulation=servo)
        found = external_wrench(run, WrenchSettings("momentum", tare=(1.0, 4.5)))
        fast = (found.t > 5.0) & (found.t < 5.8)
        off[feedback] = np.sqrt(np.mean(found.wrench[fast] ** 2, axis=0))
    force, moment = ({k: np.linalg.norm(v[p]) for k, v in off.items()} for p in HALVES)
    # 0.10, 0.15, 0.45 N and 0.01, 0.06, 0.21 N m.
    assert force["truth"] < force["twin"] < 0.25 and force["encoder"] > 2.0 * force["twin"]
    assert moment["truth"] < moment["twin"] < 0.1 and moment["encoder"] > 2.0 * moment["twin"]


def test_in_calm_air_it_is_exact():
    plan = prepare(replace(HOVER, weather=CALM, duration=6.0), "dc-pid-plus")
    wrench = np.array([1.0, -2.0, 0.5, 0.05, -0.1, 0.2])
    push = push_between(plan.t, 4.0, 6.1, wrench)
    (run,) = pushed(plan, push, range(1))
    found = external_wrench(run, WrenchSettings("momentum", tare=(1.0, 3.0)))
    assert "at the platform" in str(found) and len(str(found)) < 120  # a line, not its rows
    # What is left: the platform is still turning a little after a second, the filter lags.
    np.testing.assert_allclose(found.wrench[-1], wrench, atol=0.01)


def test_a_wrench_at_the_tool_has_no_moment_there():
    hold = replace(HOVER, weather=CALM, duration=6.0)
    plan = prepare(hold, "dc-pid-plus")
    vehicle, force = plan.nominal, np.array([0.0, 2.0, 0.0])
    data = vehicle.create_data()
    q = vehicle.neutral(plan.arm.theta[0])
    pin.framesForwardKinematics(vehicle.model, data, q)
    lever = data.oMf[vehicle.model.getFrameId(vehicle.tool)].translation
    wrench = np.concatenate([force, np.cross(lever, force)])
    (run,) = pushed(plan, push_between(plan.t, 4.0, 6.1, wrench), range(1))
    found = external_wrench(run, WrenchSettings("momentum", "tool", tare=(1.0, 3.0)))
    np.testing.assert_allclose(found.wrench[-1], [*force, 0.0, 0.0, 0.0], atol=0.01)


@pytest.mark.parametrize(
    ("weather", "settings", "persistence", "latest"),
    [
        # Of 48 pushes in the seeds 0..7: 30 ms in the median, 50 ms in 95 %.
        (QUIET, WrenchSettings("momentum"), 0.0, 0.06),
        # A gust of 10 ms echoes for some 0.1 s: 110 ms, and 230 ms in 95 %.
        (PAPER, WrenchSettings("momentum", rate=60.0), 0.1, 0.3),
    ],
)
def test_a_newton_is_detected_in_time_and_nothing_else_is(weather, settings, persistence, latest):
    plan = prepare(replace(HOVER, weather=weather, duration=60.0), "dc-pid-plus")
    rng, push, begins = np.random.default_rng(3), np.zeros((len(plan.t), 6)), range(10, 60, 10)
    for begin in begins:
        way = rng.normal(size=3)
        force = np.concatenate([way / np.linalg.norm(way), np.zeros(3)])
        push += push_between(plan.t, begin, begin + 3.0, force)
    late, alarms = [], 0
    settings = replace(settings, tare=(1.0, 9.0))
    for run in pushed(plan, push):
        found = external_wrench(run, settings).detect(1.0, persistence)
        for begin in begins:
            heard = found[(found >= begin) & (found < begin + 3.0)]
            late.append(heard[0] - begin if heard.size else np.inf)
        alarms += sum(not any(b <= time < b + 3.7 for b in begins) for time in found)
    assert np.median(late) <= latest and np.mean(np.array(late) <= 2 * latest) > 0.9
    assert alarms <= 1  # in eight minutes, of which half are pushed


def test_a_quiet_hover_gives_no_alarm():
    plan = prepare(replace(HOVER, duration=60.0), "dc-pid-plus")
    settings = WrenchSettings("momentum", tare=(1.0, 9.0))
    alarms = [external_wrench(run, settings).detect(1.0) for run in fly_many(plan, range(16))]
    assert sum(map(len, alarms)) <= 1  # in 14 minutes; none in the hour of the seeds 0..31


def test_without_a_tare_the_nominal_vehicle_is_wrong_and_the_true_one_right(three_newtons):
    plan, _, runs = three_newtons
    gaps = {}
    for name in ("nominal", "true"):
        rows = []
        for run in runs:
            vehicle = plan.nominal if name == "nominal" else plan.with_seed(run.seed).true
            x = unexplained(MeasuredMotion.of(run, vehicle.rotors), vehicle)[200:700, :3]
            rows.append(np.linalg.norm(x.mean(axis=0)))
        gaps[name] = np.mean(rows)
    assert gaps["nominal"] > 0.4 and gaps["true"] < 0.02


def test_the_kalman_filter_is_its_recursion():
    rng = np.random.default_rng(0)
    x, (l_1, l_2) = rng.normal(size=50), kalman_gains(2.0, 0.5, 0.1)
    d = g = 0.0
    expected = []
    for value in x:
        i = value - d - g
        g, d = (l_1 - 1.0) * i, d + l_2 * i
        expected.append(d)
    np.testing.assert_allclose(followed(x, l_1, l_2), expected, rtol=1e-12)


def test_its_gains_leave_the_least_variance():
    """Against perturbed gains, on long noise of the model: h measured, driven, d a random walk."""
    rng, n, (white, driven, walk) = np.random.default_rng(1), 200_000, (1.0, 0.3, 0.01)
    d = np.cumsum(np.sqrt(walk) * rng.normal(size=n))
    e = np.sqrt(white) * rng.normal(size=n + 1)
    x = d + np.diff(e) + np.sqrt(driven) * rng.normal(size=n)
    best = kalman_gains(white, driven, walk)

    def variance(l_1, l_2):
        # d is known at the end of the period over which x is the mean.
        return np.var(followed(x, l_1, l_2) - d)

    least = variance(*best)
    for change in (0.7, 1.4):
        assert variance(best[0], best[1] * change) > least


def test_nonsense_is_refused(three_newtons):
    _, _, runs = three_newtons
    with pytest.raises(UnknownName, match="method"):
        WrenchSettings("magic")
    with pytest.raises(UnknownName, match="place"):
        WrenchSettings(at="elbow")
    with pytest.raises(SettingsError, match="tare"):
        WrenchSettings(tare=(4.0, 1.0))
    with pytest.raises(SettingsError, match="name a stretch"):
        external_wrench(runs[0], WrenchSettings(tare=(100.0, 110.0)))
