"""Hands on a flight: what they do is felt, recorded, and flies again bit for bit."""

import numpy as np
import pinocchio as pin
import pytest

import fullam
from fullam.control.controllers import CONTROLLERS
from fullam.exceptions import FullamError, InvalidInput, RunFileError
from fullam.simulation.hands.force import MOST_FORCE, STIFFNESS
from fullam.simulation.hands.interactive import InteractiveFlight
from fullam.simulation.record.refly import hand_forces
from fullam.simulation.simulate import prepare, simulate


def task(duration=1.0):
    data = fullam.load_scenario("task-2").to_dict() | {"duration": duration}
    return fullam.Scenario.from_dict(data)


def assert_same(a, b):
    assert len(a) == len(b)
    for name, column in a.columns.items():
        np.testing.assert_array_equal(column, b.columns[name], err_msg=name)
    assert {**a.metadata, "versions": None} == {**b.metadata, "versions": None}


def touched(flight):
    """All that a hand can do, one after the other."""
    flight.advance(0.2)
    flight.target = [9.3, 9.0, 9.2]
    flight.advance(0.1)
    flight.push([3.0, 0.0, 0.0], at="tool", duration=0.15)
    flight.push([0.0, 0.0, -2.0], moment=[0.0, 0.1, 0.0], at="platform", duration=0.05)
    flight.advance(0.2)
    flight.pull([9.6, 9.2, 8.8])
    flight.move_arm([-60.0, 10.0, -45.0, 10.0])
    flight.advance(0.1)
    flight.release()
    flight.switch("pid", estimator="kalman")
    flight.advance(0.1)
    flight.switch("dc-pid-plus", weather="calm")
    flight.advance(0.05)
    flight.fail_rotor(2)
    flight.advance(0.05)
    flight.fail_rotor(5, known=True)
    flight.advance(0.1)
    flight.repair_rotor(2)
    flight.aim(euler_deg=(10.0, 0.0, 0.0))
    return flight


@pytest.fixture(scope="module")
def flown():
    flight = touched(fullam.fly(task(3.0), seed=3))
    flight.advance(0.3)
    return flight


def test_untouched_it_is_the_flight_of_simulate():
    run = InteractiveFlight(prepare(task(0.5), seed=4)).run()
    assert run.script is None
    assert_same(run, simulate(task(0.5), seed=4))


def test_a_touched_record_flies_again_bit_for_bit_also_from_its_file(flown, tmp_path):
    run = flown.record
    assert run.outcome == "completed" and run.t[-1] == pytest.approx(1.19)
    assert run.saturated.any(), "the memory of the active set has to be restored, too"
    kinds = [done["kind"] for done in run.script["interventions"]]
    assert set(kinds) == {
        *("target", "push", "pull", "release", "arm", "controller", "estimator", "weather"),
        "rotor",
    }
    assert_same(run, fullam.refly(run))
    assert_same(run, fullam.refly(fullam.Run.load(run.save(tmp_path / "touched.npz"))))


def test_going_back_and_flying_on_otherwise_is_flying_that_script():
    flight = touched(fullam.fly(task(3.0), seed=3))
    flight.advance(0.7)  # beyond a second, so that a remembered moment lies within
    for back in (1.35, 0.55, 0.0):
        flight.rewind(back)
        assert flight.time == pytest.approx(back)
        flight.push([0.0, 2.0, 0.0], duration=0.1)
        flight.advance(0.15)
        run = flight.record
        assert all(done["period"] <= round(back / 0.01) for done in run.script["interventions"])
        assert_same(run, fullam.refly(run))


def test_laws_of_ones_own_go_back_to_the_start(monkeypatch):
    class Own(fullam.make_controller("pid", fullam.load_vehicle("fullam")).__class__):
        name = "own-of-this-test"

        def wrench(self, t, measurement, reference):
            return super().wrench(t, measurement, reference)

    monkeypatch.setitem(CONTROLLERS, Own.name, Own)
    flight = fullam.fly(task(3.0), "own-of-this-test", seed=2)
    flight.advance(1.2)
    flight.rewind(0.9)
    flight.switch("dc-pid")
    flight.advance(0.1)
    flight.switch("own-of-this-test")
    flight.advance(0.1)
    assert_same(flight.record, fullam.refly(flight.record))


def test_a_push_on_the_tool_is_a_wrench_on_the_platform():
    """Against generalised forces: the tool's Jacobian, transposed, in the platform's six rows."""
    flight = fullam.fly("fullam", seed=0)
    flight.move_arm([-90.0, 0.0, -45.0, 0.0])
    flight.advance(1.0)
    force = np.array([3.0, -1.0, 0.5])
    flight.push(force, at="tool", duration=0.02)
    flight.advance(0.05)
    run = flight.record
    blown = np.abs(run.disturbance).max(axis=1) > 0.0
    np.testing.assert_array_equal(np.flatnonzero(blown), [100, 101])
    vehicle, k = run.vehicle, 100
    q = np.concatenate([run.pose[k], run.arm[k]])
    data = vehicle.create_data()
    frame = vehicle.model.getFrameId(vehicle.tool)
    J = pin.computeFrameJacobian(vehicle.model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
    generalized = J[:3].T @ force
    R = pin.Quaternion(run.pose[k, 3:]).toRotationMatrix()
    wrench_A = np.concatenate([R.T @ run.disturbance[k, :3], R.T @ run.disturbance[k, 3:]])
    np.testing.assert_allclose(generalized[:6], wrench_A, atol=1e-12)
    # The vehicle gives way.
    assert run.velocity[102, 0] - run.velocity[100, 0] > 0.2 * 0.02 * force[0] / vehicle.mass


def test_a_pull_is_a_spring_between_hand_and_tool():
    flight = fullam.fly("fullam")
    flight.advance(0.1)
    hand = flight.tool + np.array([0.2, 0.0, 0.0])
    flight.pull(hand)
    flight.advance(0.3)
    far = flight.tool + np.array([0.0, 30.0, 0.0])
    flight.pull(far, at="platform")
    flight.advance(0.05)
    flight.release()
    flight.advance(0.05)
    run = flight.record
    foot, pull = np.hsplit(hand_forces(run), 2)
    weight = run.vehicle.mass * run.vehicle.gravity
    np.testing.assert_allclose(pull[10:40], STIFFNESS * weight * (hand - foot[10:40]), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(pull[40:45], axis=1), MOST_FORCE * weight)
    np.testing.assert_array_equal(foot[40:45], run.pose[40:45, :3])
    assert not pull[:10].any() and not pull[45:].any()
    np.testing.assert_array_equal(pull, run.disturbance[:, :3])


def test_the_target_is_reached_within_its_bounds():
    flight = fullam.fly("fullam")
    flight.aim([1.5, -0.5, 2.0], euler_deg=(15.0, 0.0, 60.0))
    assert flight.target[0] == 1.5
    seen = []
    for _ in range(500):
        flight.step()
        seen.append(flight.hands.target)
    speed = np.array([np.linalg.norm(row.velocity.linear) for row in seen])
    acceleration = np.array([np.linalg.norm(row.acceleration.linear) for row in seen])
    assert speed.max() <= 2.0 + 1e-9 and acceleration.max() <= 2.6 + 1e-9
    # Its velocity is that of its position; on the goal it snaps by less than 1e-7 m.
    positions = np.array([row.pose.position for row in seen])
    velocities = np.array([row.velocity.linear for row in seen])
    mean = 0.5 * (velocities[1:] + velocities[:-1])
    np.testing.assert_allclose(np.diff(positions, axis=0), 0.01 * mean, atol=2e-7)
    np.testing.assert_allclose(flight.pose[:3], [1.5, -0.5, 2.0], atol=2e-3)
    np.testing.assert_allclose(seen[-1].pose.attitude, flight.target[3:], atol=1e-6)


def test_servos_keep_limits_and_bring_the_arm_there():
    flight = fullam.fly("fullam")
    joints = flight.plan.nominal.joints
    flight.move_arm([-90.0, 400.0, 30.0, 0.0])
    flight.advance(3.0)
    run = flight.record
    assert run.arm[:, 1].max() <= joints.upper[1] + 1e-6
    assert np.abs(run.arm_rate).max() <= joints.max_rates[0] + 1e-9
    np.testing.assert_allclose(np.rad2deg(run.arm[-1, [0, 2, 3]]), [-90.0, 30.0, 0.0], atol=1e-3)
    steps = np.diff(run.arm, axis=0) - 0.005 * (run.arm_rate[1:] + run.arm_rate[:-1])
    np.testing.assert_allclose(steps, 0.0, atol=1e-12)  # constant acceleration in a period


def test_a_failed_rotor_runs_down_whatever_is_asked_of_it():
    flight = fullam.fly("fullam")
    flight.advance(0.2)
    flight.fail_rotor(4)
    flight.advance(0.3)
    flight.fail_rotor(4, known=True)
    flight.advance(5.0)
    run = flight.record
    assert run.rotor_speeds[19, 4] > 100.0
    assert run.rotor_speeds[-1, 4] < 1.0
    assert run.rotor_commands[45, 4] > 100.0, "nobody has told the allocation"
    np.testing.assert_array_equal(run.rotor_commands[51:, 4], 0.0)
    assert np.linalg.norm(run.pose[-1, :3] - [0.0, 0.0, 1.5]) < 0.1


def test_another_law_begins_afresh_and_another_weather_is_the_seeds():
    flight = fullam.fly(task(0.6), seed=5)
    flight.advance(0.3)
    flight.switch("pid", weather="calm")
    run = flight.run()
    assert np.ptp(run.u_dc[:30], axis=0).max() > 1e-3
    assert np.ptp(run.u_dc[30:], axis=0).max() == 0.0, "PID carries the weight, and no more"
    still = run.measured_pose[31:, :3] - run.pose[31:, :3]
    assert np.abs(np.diff(still, axis=0)).max() < 2e-3, "no noise any more"
    assert_same(run, fullam.refly(run))


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("dance", {}),
        (None, {}),
        ("target", {"position": [0.0, 0.0, float("nan")], "attitude": [0, 0, 0, 1]}),
        ("target", {"position": [0.0, 0.0, 1.0], "attitude": [0, 0, 0, 0]}),
        ("push", {"force": [1e9, 0.0, 0.0], "duration": 1.0}),
        ("push", {"force": [1.0, 0.0, 0.0]}),
        ("push", {"force": [1.0, 0.0, 0.0], "duration": 1.0, "at": "nowhere"}),
        ("pull", {"hand": "here"}),
        ("arm", {"positions": [0.0]}),
        ("controller", {"name": "nobody"}),
        ("controller", {"name": "pid", "settings": {"colour": 1}}),
        ("estimator", {"name": 7}),
        ("weather", {"weather": "foggy"}),
        ("rotor", {"index": 8}),
        ("rotor", {"index": True}),
    ],
)
def test_what_cannot_be_done_is_refused_and_not_recorded(kind, values):
    flight = fullam.fly("fullam", duration=1.0)
    with pytest.raises(FullamError):
        flight.do(kind, values)
    assert flight.script == []


def test_too_many_known_failures_are_refused():
    flight = fullam.fly("fullam", duration=1.0)
    for rotor in range(8):
        try:
            flight.fail_rotor(rotor, known=True)
        except FullamError:
            assert rotor >= 2
            break
        flight.step()
    else:
        pytest.fail("a vehicle without rotors was allocated")


def test_there_is_no_record_of_nothing_and_no_way_ahead():
    flight = fullam.fly("fullam", duration=1.0)
    with pytest.raises(InvalidInput, match="advance"):
        _ = flight.record
    with pytest.raises(InvalidInput, match="0 to 0 s"):
        flight.rewind(0.5)


@pytest.mark.parametrize(
    "script",
    [
        3,
        {"horizon": 0.1, "interventions": []},
        {"horizon": 3.0, "interventions": [{"period": 1, "kind": "dance"}]},
        {"horizon": 3.0, "interventions": [{"period": 5, "kind": "release"},
                                           {"period": 4, "kind": "release"}]},
        {"horizon": 3.0, "interventions": [], "more": 1},
    ],
)  # fmt: skip
def test_a_bad_script_in_a_file_is_refused(flown, tmp_path, script):
    run = flown.record
    run.metadata["script"] = script
    with pytest.raises(RunFileError, match=r"script|horizon|more"):
        fullam.Run.load(run.save(tmp_path / "bad.npz"))
