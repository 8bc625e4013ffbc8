"""Flights with a failed rotor: saved where they were lost, and whole vehicles left alone."""

import json

import numpy as np
import pytest

import fullam
from fullam import cli
from fullam.dynamics import quaternions
from fullam.dynamics.rotations import quaternion_rotation
from fullam.simulation.hands.interactive import InteractiveFlight
from fullam.simulation.many import fly_many
from fullam.simulation.motions.references import ReferenceTable
from fullam.simulation.motions.shaping import SHAPED
from fullam.simulation.record.refly import refly
from fullam.simulation.trimmed import blended, trimmed

SEEDS = range(5)


def away(run):
    """Distance from the target's position, shape (N,) [m]."""
    return np.linalg.norm(run.pose[:, :3] - run.reference_pose[:, :3], axis=1)


@pytest.mark.parametrize("name", ["tilt-hover-1", "tilt-hover-3"])
@pytest.mark.parametrize("law", ["dc-pid", "dc-pid-plus"])
@pytest.mark.parametrize("rotor", [0, 3, 5])
def test_flights_that_were_lost_hold_their_position(name, law, rotor):
    """Each of these flights diverges without the governor, within six seconds."""
    lost = fullam.prepare(name, law, failed=[rotor], simulation={"governor": "off"})
    assert {run.outcome for run in fly_many(lost, SEEDS)} == {"diverged"}
    for run in fly_many(fullam.prepare(name, law, failed=[rotor]), SEEDS):
        assert run.outcome == "completed"
        assert away(run).max() < 1.0
        assert away(run)[-50:].max() < 0.1


def test_a_step_is_flown_without_a_rotor():
    for run in fly_many(fullam.prepare("position-1", "dc-pid-plus", failed=["rotor_3"]), SEEDS):
        assert run.outcome == "completed"
        assert away(run)[-50:].max() < 0.03
        tilt = np.degrees(np.arccos(quaternion_rotation(run.pose[-1, 3:])[2, 2]))
        assert tilt == pytest.approx(run.trim["tilt_deg"], abs=2.0)


def test_what_is_held_stands_in_the_record(tmp_path):
    run = fullam.simulate("position-1", failed=[2], driver="fused")
    assert run.trim["failed"] == ["rotor_3"]
    assert "the tilt asked for is given up" in run.trim["says"]
    again = fullam.Run.load(run.save(tmp_path / "r.npz"))
    assert again.trim == run.trim
    np.testing.assert_array_equal(refly(again).pose, run.pose)


def test_whole_vehicles_have_no_trim():
    plan = fullam.prepare("tilt-hover-3")
    assert plan.trim is None
    blend = plan.scenario.shaping.blend(plan.asked, plan.scenario.initial_pose)
    np.testing.assert_array_equal(blend.pose[-1], plan.asked.pose[-1])
    assert fullam.simulate("task-1", driver="fused").trim is None


def test_without_the_governor_nothing_is_trimmed():
    plan = fullam.prepare("tilt-hover-3", failed=[0], simulation={"governor": "off"})
    assert plan.trim is None


@pytest.mark.parametrize("rotor", [0, 2])
def test_a_rotor_that_dies_in_flight_and_is_known(rotor):
    """After 2 s of a tilted hover; without the governor it runs away (the next test)."""
    flight = InteractiveFlight(fullam.prepare("tilt-hover-3", "dc-pid-plus", seed=3))
    assert flight.trim is None
    flight.advance(2.0)
    flight.fail_rotor(rotor, known=True)
    run = flight.run()
    assert run.outcome == "completed"
    assert away(run).max() < 0.6
    assert away(run)[-50:].max() < 0.02
    assert run.given_up[-1] == 1.0
    assert flight.trim.failed == (f"rotor_{rotor + 1}",)
    assert run.trim["says"] == str(flight.trim)


def test_it_runs_away_without_the_governor():
    plan = fullam.prepare("tilt-hover-3", "dc-pid-plus", seed=3, simulation={"governor": "off"})
    flight = InteractiveFlight(plan)
    flight.advance(2.0)
    flight.fail_rotor(0, known=True)
    assert flight.run().outcome == "diverged"


def test_a_repaired_rotor_gives_the_tilt_back():
    flight = InteractiveFlight(fullam.prepare("tilt-hover-1", "dc-pid-plus", calm=True))
    flight.advance(1.0)
    flight.fail_rotor(0, known=True)
    flight.advance(1.5)
    flight.repair_rotor(0)
    run = flight.run()
    assert run.given_up.max() == 1.0
    assert run.given_up[-1] == 0.0
    assert flight.trim is None


# The reference.


def turning_table(rng, rows=2001, dt=1e-3):
    """A reference that turns about all axes, and its rates by construction."""
    t = dt * np.arange(rows)
    a, b = rng.uniform(0.2, 0.5, size=(2, 3))
    angle = np.stack([a[i] * np.sin((1.0 + b[i]) * t + i) for i in range(3)], axis=1)
    attitude = quaternions.from_euler(angle)
    w = rates(attitude, dt)
    pose = np.hstack([np.zeros((rows, 3)), attitude])
    velocity = np.hstack([np.zeros((rows, 3)), w])
    acceleration = np.hstack([np.zeros((rows, 3)), np.gradient(w, dt, axis=0, edge_order=2)])
    return ReferenceTable(t, pose, velocity, acceleration)


def rates(attitude, dt):
    """Angular velocity in world axes by central differences, shape (N, 3) [rad/s]."""
    step = quaternions.product(attitude[2:], quaternions.inverse(attitude[:-2]))
    w = np.empty((len(attitude), 3))
    w[1:-1] = quaternions.to_rotation_vector(step) / (2.0 * dt)
    w[0], w[-1] = 2.0 * w[1] - w[2], 2.0 * w[-2] - w[-3]
    return w


def test_a_trimmed_reference_turns_about_the_vertical_with_its_own_rates(rng):
    table, up = turning_table(rng), np.array([0.2, -0.25, np.sqrt(1.0 - 0.1025)])
    found = trimmed(table, up)
    z = quaternion_rotation(found.pose[:, 3:]) @ up
    np.testing.assert_allclose(z, np.tile([0.0, 0.0, 1.0], (len(z), 1)), atol=1e-12)  # rounding
    inner = slice(5, -5)
    w, dt = rates(found.pose[:, 3:], 1e-3), 1e-3
    # Central differences of a curve whose third derivative is of the order 1: dt^2.
    np.testing.assert_allclose(found.velocity[inner, 3:], w[inner], atol=1e-5)
    dw = np.gradient(found.velocity[:, 3:], dt, axis=0, edge_order=2)
    np.testing.assert_allclose(found.acceleration[inner, 3:], dw[inner], atol=1e-5)


def test_a_trimmed_attitude_is_the_nearest_with_that_up_vector(rng):
    table, up = turning_table(rng, rows=50, dt=0.05), np.array([0.0, 0.3, np.sqrt(0.91)])
    found = trimmed(table, up).pose[:, 3:]
    turn = quaternions.product(found, quaternions.inverse(table.pose[:, 3:]))
    angles = np.linalg.norm(quaternions.to_rotation_vector(turn), axis=1)
    z = quaternion_rotation(table.pose[:, 3:]) @ up
    np.testing.assert_allclose(angles, np.arccos(z[:, 2]), atol=1e-7)  # an arc cosine near 1


def test_first_it_turns_then_it_moves():
    rows, dt = 600, 0.01
    pose = np.zeros((rows, 7))
    pose[:, :3], pose[:, 3:] = (1.0, 1.0, 1.0), quaternions.from_euler(np.array([0.3, 0.0, 0.0]))
    table = ReferenceTable(dt * np.arange(rows), pose, np.zeros((rows, 6)), np.zeros((rows, 6)))
    start = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    found = blended(table, start, SHAPED, 1.0)
    there = np.linalg.norm(found.pose - pose, axis=1)
    turned = np.linalg.norm(found.pose[:, 3:] - pose[:, 3:], axis=1)
    assert there[-1] < 1e-12
    assert dt * np.argmax(turned < 1e-9) < 0.5 < 3.0 < dt * np.argmax(there < 1e-9)
    assert np.linalg.norm(found.acceleration[:, :3], axis=1).max() == pytest.approx(1.0, rel=1e-3)
    np.testing.assert_allclose(found.pose[turned > 1e-9, :3], 0.0, atol=1e-12)  # rounding


def test_the_command_line_says_what_is_held(capsys):
    code = cli.main(["run", "tilt-hover-1", "--failed", "4", "--driver", "fused", "--json"])
    out, err = capsys.readouterr()
    trim = json.loads(out)["trim"]
    assert code == 0
    assert trim["failed"] == ["rotor_4"]
    assert f"fullam: {trim['says']}" in err
    assert "out of reach" not in err
