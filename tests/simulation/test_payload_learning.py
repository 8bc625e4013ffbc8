"""Loads that nobody told of, learned in flight."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fullam.control.law_stage import LawStage
from fullam.exceptions import ScenarioError, UnknownName
from fullam.simulation.block import Block
from fullam.simulation.fused import Fused
from fullam.simulation.hands.interactive import InteractiveFlight
from fullam.simulation.many import fly_many
from fullam.simulation.motions.arm_motion import SineRate
from fullam.simulation.motions.references import Step
from fullam.simulation.payloads.payload import Payload
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.simulate import prepare, simulate
from fullam.simulation.tables import Tables
from fullam.simulation.weather import CALM, PAPER

PICK = Scenario(
    "pick",
    Step((0.0, 0.0, 1.0)),
    initial_position=(0.0, 0.0, 1.0),
    initial_arm_deg=(-90.0, 0.0, -45.0, 0.0),
    duration=5.0,
    weather=CALM,
    payloads=(Payload(0.2, 1.0, 4.0),),
)
BRIEF = replace(PICK, duration=2.2, payloads=(Payload(0.2, 0.4, 1.8),))
"""Long enough for all that happens to a load."""

LEARNED = {"plant": "servo", "plant_settings": {"payload": "learned"}}
UNKNOWN = {"plant": "servo", "plant_settings": {"payload": "unknown"}}


@cache
def flown(scenario=PICK, learned=True, law="dc-pid-plus"):
    return simulate(scenario, law, driver="fused", simulation=LEARNED if learned else UNKNOWN)


def dip(run, begin):
    """Farthest from the target within a second from then on [m]."""
    rows = (run.t >= begin) & (run.t < begin + 1.0)
    return np.linalg.norm(run.pose[rows, :3] - [0.0, 0.0, 1.0], axis=1).max()


@pytest.mark.parametrize(
    ("law", "settings"),
    [
        ("dc-pid-plus", {}),
        ("dc-pid-plus", {"compensation": "previous_wrench"}),
        ("dc-pid", {}),
        ("dc-pid", {"compensation": "previous_wrench"}),
    ],
)
def test_both_drivers_learn_alike(law, settings):
    fast, slow = (
        simulate(BRIEF, law, driver=driver, settings=settings, simulation=LEARNED)
        for driver in ("fused", "python")
    )
    for name in ("pose", "arm_goal", "rotor_commands"):
        found, expected = getattr(slow, name), getattr(fast, name)
        # As the flights of the contract: rounding, fed back.
        atol = 1e-9 * max(1.0, np.abs(expected).max())
        np.testing.assert_allclose(found, expected, atol=atol, err_msg=name)


def test_a_law_that_python_forgets_to_relieve_flies_elsewhere(monkeypatch):
    fast = simulate(BRIEF, "dc-pid-plus", driver="fused", simulation=LEARNED)
    monkeypatch.setattr(LawStage, "relieve", lambda self, view, k: None)
    forgotten = simulate(BRIEF, "dc-pid-plus", driver="python", simulation=LEARNED)
    assert np.abs(forgotten.pose - fast.pose).max() > 1e-3  # millions of times the tolerance above


def test_lanes_learn_as_one_flight_does():
    plan = prepare(replace(BRIEF, weather=PAPER), "dc-pid-plus", simulation=LEARNED)
    for seed, run in enumerate(fly_many(plan, range(3))):
        alone = simulate(
            plan.scenario, "dc-pid-plus", driver="fused", seed=seed, simulation=LEARNED
        )
        np.testing.assert_array_equal(run.pose, alone.pose)


def test_a_block_that_flies_again_knows_nothing_any_more():
    plan = prepare(BRIEF, "dc-pid-plus", simulation=LEARNED)
    fused, poses = Fused(Tables(plan)), []
    for _ in range(2):
        fused.block.load(plan)
        fused.fly()
        poses.append(fused.block.columns(len(plan.t))["pose"])
    np.testing.assert_array_equal(*poses)


def test_mujoco_learns_too():
    pytest.importorskip("mujoco")
    chosen = {"plant": "mujoco", "plant_settings": {"payload": "learned"}}
    other = simulate(BRIEF, "dc-pid-plus", simulation=chosen)
    ours = simulate(BRIEF, "dc-pid-plus", driver="fused", simulation=LEARNED)
    # The plants' own difference: 0.2 um in 2 s. Where nothing is learned it is 3 mm away.
    np.testing.assert_allclose(other.pose[:, :3], ours.pose[:, :3], atol=1e-5)


def test_nothing_is_learned_unless_it_is_asked_for():
    for choices in ({}, {"simulation": UNKNOWN}):
        plan = prepare(PICK, "dc-pid-plus", **choices)
        assert not {"expect", "lift", "learn", "relieve"} & set(Block(Tables(plan)).stages())
    empty = prepare(replace(PICK, payloads=()), "dc-pid-plus", simulation=LEARNED)
    assert "learn" not in Block(Tables(empty)).stages()


@pytest.mark.parametrize(("law", "dropped"), [("dc-pid-plus", 4.0), ("dc-pid", 8.0)])
def test_a_drop_costs_little_once_the_load_is_learned(law, dropped):
    long = replace(PICK, duration=dropped + 1.0, payloads=(Payload(0.2, 1.0, dropped),))
    learned, unknown = flown(long, law=law), flown(long, learned=False, law=law)
    before = learned.t < 1.5  # nobody can know earlier what hangs there
    np.testing.assert_array_equal(learned.pose[before], unknown.pose[before])
    # dc-PID+ 0.9 mm of 4.4; dc-PID, whose integrator takes seconds to carry the load, 5 of 69 mm.
    assert dip(learned, dropped) < 0.25 * dip(unknown, dropped)


def test_the_command_follows_the_load_and_jumps_nowhere_else():
    learned, unknown = flown(), flown(learned=False)
    steps = np.abs(np.diff(learned.command[:, :3], axis=0)).max(axis=1)
    carried = (learned.t[1:] > 1.5) & (learned.t[1:] < 3.99)
    weight = 9.81 * 0.2
    assert steps[carried].max() < 0.15 * weight  # the arm comes up in whole steps of its servos
    at = int(np.argmin(np.abs(learned.t - 4.0)))
    change = learned.command[at, 2] - learned.command[at - 1, 2]
    assert change == pytest.approx(-weight, rel=0.1)
    assert abs(unknown.command[at, 2] - unknown.command[at - 1, 2]) < 0.25 * weight


def test_the_arm_comes_up_again():
    # Joints against where they are without a load: 2.0 deg off with it, 0.04 once it is learned;
    # a step of the servo is 0.29.
    off = [
        np.degrees(np.abs(run.arm[(run.t > 3.0) & (run.t < 4.0)] - run.arm[90]).max())
        for run in (flown(learned=False), flown())
    ]
    assert off[0] > 1.5 and off[1] < 0.3


def learners(scenario, seeds, until):
    """The block at a time, flown in lanes [s]."""
    plan = prepare(scenario, "dc-pid-plus", simulation=LEARNED)
    fused = Fused(Tables(plan), lanes=8)
    fused.block.draw(seeds)
    fused.block.begin()
    fused._whole.run(0, round(until / plan.simulation.control_period))
    return fused.block.plant.carried.learner


def test_mass_and_its_deviation_are_right_in_the_paper_s_weather():
    learner = learners(replace(PICK, weather=PAPER), range(8), 3.9)
    mass, variance = learner.state.array[0, 0], learner.covariance.array[0, 0, 0]
    error = mass - 0.2
    assert np.abs(error).max() < 0.02  # 6 g RMS of 64 seeds, 17 g at worst
    assert np.mean(error**2 / variance) < 3.0  # of rotor factors it knows nothing
    assert 0.001 < np.sqrt(variance).max() < 0.02


def test_it_is_frozen_while_the_arm_swings():
    swing = replace(PICK, arm_motion=SineRate(2, 0.9, 6.0))
    learner = learners(swing, range(8), 3.9)
    assert (learner.memory["told"] == 0.0).all()
    np.testing.assert_array_equal(flown(swing).pose, flown(swing, learned=False).pose)


def test_one_after_the_other_and_a_known_one_beside():
    two = replace(
        PICK,
        payloads=(
            Payload(0.2, 1.0, 2.4),
            Payload(0.1, 3.0, 4.6),
            Payload(0.05, 0.0, 10.0, known=True),
        ),
    )
    for until, mass in ((2.3, 0.2), (4.5, 0.1)):
        found = learners(two, range(8), until).state.array[0, 0]
        np.testing.assert_allclose(found, mass, atol=0.005)  # calm: 2 g, as it settles


def test_going_back_is_learned_anew():
    flight = InteractiveFlight(prepare(BRIEF, "dc-pid-plus", simulation=LEARNED))
    while flight.step():
        pass
    there = flight.record.pose
    flight.rewind(1.5)
    while flight.step():
        pass
    np.testing.assert_array_equal(flight.record.pose, there)
    for law in ("dc-pid", "backstepping"):
        flight.rewind(1.0)
        flight.do("controller", {"name": law})
        while flight.step():
            pass
        assert len(flight.record) == len(there)


@pytest.mark.parametrize("law", ["pid", "backstepping", "computed-wrench"])
def test_a_law_that_cannot_be_relieved_is_helped_all_the_same(law):
    long = replace(PICK, duration=9.0, payloads=(Payload(0.2, 1.0, 8.0),))
    learned, unknown = flown(long, law=law), flown(long, learned=False, law=law)
    assert dip(learned, 8.0) < 0.5 * dip(unknown, 8.0)


def test_two_at_a_time_and_other_words_are_refused():
    both = replace(PICK, payloads=(Payload(0.2, 1.0, 4.0), Payload(0.1, 2.0, 3.0)))
    with pytest.raises(ScenarioError, match="hangs together"):
        prepare(both, "dc-pid-plus", simulation=LEARNED)
    prepare(both, "dc-pid-plus", simulation=UNKNOWN)
    with pytest.raises(UnknownName, match="learned"):
        prepare(PICK, simulation={"plant": "servo", "plant_settings": {"payload": "learnt"}})
