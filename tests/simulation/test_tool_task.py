"""Tool tasks: solved before take-off, within limits, flown everywhere, measured."""

from dataclasses import replace

import numpy as np
import pytest
from altered_vehicles import with_joint, without_arm

import fullam
from fullam.analysis.campaign import Campaign
from fullam.analysis.judged import fly_judged
from fullam.analysis.tool_error import AskedTool
from fullam.dynamics.pose_space import euler_from_pose, pose_from_euler
from fullam.exceptions import ScenarioError
from fullam.simulation.many import fly_many
from fullam.simulation.motions import arm_motion
from fullam.simulation.motions.arm_motion import SineRate
from fullam.simulation.motions.trajectory import Trajectory
from fullam.simulation.record.run import COLUMNS, Run
from fullam.simulation.scenarios.scenario import Scenario, load_scenario
from fullam.simulation.simulate import fly_by_python, prepare
from fullam.simulation.tool.kinematics import ToolKinematics
from fullam.simulation.tool.paths import CirclePath, LinePath, SquarePath
from fullam.simulation.tool.solution import solve_tool
from fullam.simulation.tool.task import ToolTask
from fullam.simulation.tool.weights import ToolWeights

ARM = (-90.0, 0.0, -45.0, 0.0)
CURVE = Trajectory.b_spline([[5, 5, 5], [5.1, 5, 5], [5.1, 5.2, 5.1], [5, 5, 5]], [0, 1, 2, 3])
PATHS = {
    "line": LinePath((0.2, -0.1, 0.1), 3.0),
    "circle": CirclePath(0.15, (1, 0, 0), 3.0),
    "leaning circle": CirclePath(0.1, (1, 1, 1), 3.0, rounds=-1.5),
    "square": SquarePath(0.15, (0, 1, 0), 4.0),
    "spline": CURVE,
}


@pytest.fixture(scope="module")
def vehicle():
    return fullam.load_vehicle("fullam")


def start(vehicle, euler_deg=(0.0, 0.0, 0.0)):
    pose = pose_from_euler(np.array([0.0, 0.0, 2.0]), np.radians(euler_deg))
    return pose, vehicle.joints.from_typed(ARM)


def flown(vehicle, task, solution, pose, arm, duration):
    """Errors of the tool on the 1 ms grid, and the tables of platform and arm."""
    t = np.arange(round(1e3 * duration) + 1) * 1e-3
    table = solution.reference.tabulate(t, pose)
    joints = arm_motion.tabulate(solution.arm, t, arm, vehicle.joints)
    kinematics = ToolKinematics(vehicle)
    begin = kinematics.place(np.concatenate([pose, arm]))
    away = kinematics.places(table.pose, joints.theta) - begin - task.offsets(t)
    return np.linalg.norm(away, axis=1), table, joints


@pytest.mark.parametrize("priority", ["weighted", "strict"])
@pytest.mark.parametrize("attitude", ["free", "preferred", "fixed"])
@pytest.mark.parametrize("name", PATHS)
def test_the_tool_follows_within_all_limits(vehicle, name, attitude, priority):
    task = ToolTask(PATHS[name], attitude=attitude, priority=priority)
    pose, arm = start(vehicle, (5.0, -5.0, 30.0))
    solution = solve_tool(task, vehicle, pose, arm, 4.0)
    error, table, joints = flown(vehicle, task, solution, pose, arm, 4.0)
    # Weighted, the tool gives way by the ratio of the weights: some um. Strict: the splines' error.
    assert error.max() < 2e-5 if priority == "weighted" else 2e-6
    assert solution.missed == pytest.approx(error.max(), abs=2e-6)
    assert vehicle.joints.position_problem(joints.theta) is None
    assert vehicle.joints.rate_problem(joints.dtheta) is None
    assert np.ptp(joints.theta, axis=0).max() > np.radians(1.0), "the arm takes part"
    assert np.abs(table.velocity[:, :3]).max() > 1e-3, "the platform takes part"
    turned = np.degrees(np.abs(euler_from_pose(table.pose) - np.radians([5.0, -5.0, 30.0])).max())
    # Of a spline through equal quaternions nothing is left but rounding, and their feedback.
    assert turned < 1e-4 if attitude == "fixed" else turned < 30.0
    if attitude == "free":
        assert turned > 0.5
    assert np.abs(table.acceleration).max() < 3.0, "smooth"


def test_paths_begin_and_end_where_they_should_and_at_rest():
    t = np.linspace(-1.0, 6.0, 7001)
    for name, path in PATHS.items():
        task = ToolTask(path, at=0.0)
        p = task.offsets(t)
        np.testing.assert_allclose(p[t <= 0.0], 0.0, atol=1e-14)
        closed = name not in ("line", "leaning circle")
        last = [0.2, -0.1, 0.1] if name == "line" else p[-1]
        np.testing.assert_allclose(p[-1], np.zeros(3) if closed else last, atol=1e-12)
        speed = np.linalg.norm(np.diff(p, axis=0), axis=1) / 1e-3
        assert speed[(t[:-1] < 0.01) | (t[:-1] > task.path.duration - 0.01)].max() < 2e-3
        assert speed.max() > 0.05


def test_a_circle_is_round_and_across_its_normal():
    path = CirclePath(0.15, (1, 2, 3), 3.0)
    p = path.offsets(np.linspace(0, 3, 301))
    first = p[np.argmax(np.linalg.norm(p, axis=1))]
    np.testing.assert_allclose(np.linalg.norm(p - 0.5 * first, axis=1), 0.15, atol=1e-5)
    np.testing.assert_allclose(p @ [1, 2, 3], 0.0, atol=1e-15)
    turned = np.cross(p[60] - 0.5 * first, p[120] - 0.5 * first) @ [1, 2, 3]
    assert turned > 0.0


def test_an_attitude_that_is_preferred_is_blended_in(vehicle):
    pose, arm = start(vehicle)
    for mode, euler in (("fixed", 10.0), ("preferred", 10.0)):
        task = ToolTask(LinePath((0.1, 0, 0), 6.0), mode, (euler, 0.0, 0.0), at=0.5)
        solution = solve_tool(task, vehicle, pose, arm, 8.0)
        error, table, _ = flown(vehicle, task, solution, pose, arm, 8.0)
        assert error.max() < 2e-5
        phi = np.degrees(euler_from_pose(table.pose)[:, 0])
        assert phi[0] == 0.0
        assert phi[-1] == pytest.approx(euler, abs=1e-6 if mode == "fixed" else 1.0)
        assert np.abs(table.acceleration[:, 3:]).max() < 1.0


def test_weights_say_who_moves(vehicle):
    pose, arm = start(vehicle)
    ways = []
    for weights in (ToolWeights(joints=10.0), ToolWeights(platform=50.0)):
        task = ToolTask(CirclePath(0.1, (1, 0, 0), 4.0), "fixed", weights=weights)
        found = solve_tool(task, vehicle, pose, arm, 5.0)
        ways.append(
            (np.ptp(found.arm.positions_deg, axis=0).max(), np.ptp(found.reference.positions))
        )
    assert ways[0][0] < 0.2 * ways[1][0]


def test_a_path_that_is_too_fast_is_refused_with_its_time(vehicle):
    pose, arm = start(vehicle)
    task = ToolTask(LinePath((3.0, 0, 0), 2.0), max_speed=0.5)
    with pytest.raises(ScenarioError, match=r"path at t = 1\.\d* s: the tool stays up to .* mm"):
        solve_tool(task, vehicle, pose, arm, 3.0)


def test_joints_stay_within_their_limits_when_the_path_would_take_them_out(vehicle):
    """A platform that may hardly move, and a path to the end of the arm's reach."""
    pose, arm = start(vehicle)
    upper = vehicle.joints.upper
    near = np.where(np.arange(4) == 1, upper - 0.05, arm)
    weights = ToolWeights(platform=100.0, turn=100.0)
    for to in ((0.15, 0, 0), (-0.15, 0, 0), (0, 0.15, 0), (0, 0, 0.15), (0, 0, -0.15)):
        task = ToolTask(LinePath(to, 2.0), priority="strict", weights=weights)
        found = solve_tool(task, vehicle, pose, near, 3.0)
        error, _, joints = flown(vehicle, task, found, pose, near, 3.0)
        assert error.max() < 1e-4
        assert vehicle.joints.position_problem(joints.theta) is None
        assert vehicle.joints.rate_problem(joints.dtheta) is None


def made_of(name):
    """A vehicle: hextilt, or the default one with another kind of joint 4 or no arm."""
    if name in ("prismatic", "continuous"):
        return with_joint("joint_4", name)
    if name == "no arm":
        return without_arm()
    return fullam.load_vehicle(name)


@pytest.mark.parametrize("priority", ["weighted", "strict"])
@pytest.mark.parametrize("name", ["hextilt", "prismatic", "continuous", "no arm"])
def test_other_vehicles_follow_too(name, priority):
    vehicle = made_of(name)
    task = ToolTask(CirclePath(0.1, (1, 0, 0), 3.0), priority=priority)
    pose = pose_from_euler(np.array([0.0, 0.0, 2.0]), np.zeros(3))
    middle = np.where(np.isfinite(vehicle.joints.lower), 0.3 * vehicle.joints.upper, 7.0)
    solution = solve_tool(task, vehicle, pose, middle, 4.0)
    error, _, joints = flown(vehicle, task, solution, pose, middle, 4.0)
    assert error.max() < 2e-5
    assert vehicle.joints.position_problem(joints.theta) is None
    assert vehicle.n_arm == 0 or np.ptp(joints.theta, axis=0).max() > 0.01


def test_a_platform_that_is_not_controlled_in_all_axes_is_refused(brief):
    with pytest.raises(ScenarioError, match=r"axes: are z, phi, psi, gamma; .* in all six"):
        prepare(replace(brief, vehicle="quadrotor_arm", axes=("z", "phi", "psi", "gamma")))


@pytest.fixture(scope="module")
def brief():
    task = ToolTask(CirclePath(0.1, (1, 0, 0), 1.5), at=0.2)
    return Scenario("brief", initial_arm_deg=ARM, tool=task, duration=1.8)


def test_it_flies_under_every_driver_and_again_from_its_record(brief, tmp_path):
    plan = prepare(brief, "dc-pid-plus", seed=2)
    run = fullam.simulate(brief, "dc-pid-plus", seed=2)
    machine = fullam.simulate(brief, "dc-pid-plus", seed=2, driver="fused")
    (lane,) = fly_many(plan, [2])
    for name in COLUMNS:
        np.testing.assert_array_equal(machine.columns[name], lane.columns[name])
    np.testing.assert_allclose(run.pose, machine.pose, rtol=0, atol=1e-9)
    run.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    assert again.scenario == plan.scenario
    assert again.scenario.tool == brief.tool
    np.testing.assert_array_equal(fullam.refly(again).pose, run.pose)
    assert fullam.measure(again) == fullam.measure(run)


def test_the_error_of_the_tool_is_measured(brief):
    """Against the same by Pinocchio, row by row; a campaign finds the same number."""
    run = fullam.simulate(brief, "dc-pid-plus", seed=2, driver="fused")
    vehicle = run.vehicle
    kinematics = ToolKinematics(vehicle)
    begin = kinematics.place(np.concatenate([brief.initial_pose, run.arm[0]]))
    away = kinematics.places(run.pose, run.arm) - begin - brief.tool.offsets(run.t)
    rows = (run.t >= 0.2) & (run.t <= 1.7)
    expected = 1e3 * np.sqrt(np.mean(np.sum(away[rows] ** 2, axis=1)))
    found = fullam.measure(run).tool_rms_mm
    assert found == pytest.approx(expected, rel=1e-9)
    assert 0.5 < found < 30.0
    judged = [
        j.figures["tool_rms_mm"] for j in fly_judged(prepare(brief, "dc-pid-plus"), [1, 2, 3])
    ]
    assert np.concatenate(judged)[1] == pytest.approx(found, rel=1e-9)
    # A platform that is 10 mm off has its tool 10 mm off.
    asked = AskedTool.of(run.scenario, vehicle, run.t, run.arm)
    exact = run.reference_pose + np.array([0.0, 0.006, 0.008, 0.0, 0.0, 0.0, 0.0])
    assert asked.rms_mm(asked.held_at(exact)[..., None]) == pytest.approx(10.0, abs=0.01)


def test_it_is_solved_to_the_same_bits_wherever_its_memory_lies(vehicle):
    pose, arm = start(vehicle)
    task, found, blocks = ToolTask(CURVE, priority="strict", at=0.1), set(), []
    for size in range(1, 6):
        blocks.append(np.zeros(37 * size))  # moves what is allocated next
        solution = solve_tool(task, vehicle, pose, arm, 1.0)
        found.add((solution.reference.positions, solution.arm.positions_deg))
    assert len(found) == 1


def test_without_a_task_there_is_no_such_figure():
    run = fullam.simulate(Scenario("hover", duration=0.1), calm=True)
    assert fullam.measure(run).tool_rms_mm is None


def test_a_campaign_flies_it(brief):
    campaign = Campaign((brief,), ("dc-pid", "dc-pid-plus"), (0, 1))
    assert isinstance(campaign.scenarios[0].reference, Trajectory)
    cells = list(campaign.fly(campaign.keys))
    assert all(np.isfinite(c.flights.figures["tool_rms_mm"]).all() for c in cells)


def test_a_reference_of_ones_own_leaves_the_task_to_be_measured(brief):
    still = replace(brief, reference=fullam.Step((0.0, 0.0, 1.0)), arm_motion=fullam.HoldArm())
    run = fullam.simulate(still, calm=True, driver="fused")
    offsets = np.linalg.norm(still.tool.offsets(run.t), axis=1)
    rows = (run.t >= 0.2) & (run.t <= 1.7)
    expected = 1e3 * np.sqrt(np.mean(offsets[rows] ** 2))
    assert fullam.measure(run).tool_rms_mm == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
def test_plain_data_and_back(path):
    task = ToolTask(
        path, "fixed", (1.0, 2.0, 3.0), "strict", ToolWeights(joints=2.0), 1.0, 2.0, 9.0
    )
    scenario = Scenario("x", tool=task)
    assert Scenario.from_dict(scenario.to_dict()) == scenario


TOML = """
name = "draw"
weather = "calm"
duration = 2.0
initial_arm_deg = [-90, 0, -45, 0]
[tool]
attitude = "fixed"
at = 0.2
path = {path}
weights = {{ joints = 0.1 }}
"""


@pytest.mark.parametrize(
    "path",
    [
        "{ kind = 'circle', radius = 0.1, normal = [1, 0, 0], duration = 1.5 }",
        "{ kind = 'square', side = 0.1, duration = 1.6 }",
        "{ kind = 'minimum-snap', waypoints = [[0, 0, 0], [0.1, 0, 0.1]], speed = 0.2 }",
        "{ kind = 'csv', path = 'tool.csv' }",
    ],
)
def test_a_task_in_a_file(tmp_path, path):
    (tmp_path / "tool.csv").write_text(
        "t,x,y,z\n0,0,0,0\n0.5,0.02,0,0\n1,0.04,0.02,0\n1.5,0.04,0.02,0"
    )
    (tmp_path / "draw.toml").write_text(TOML.format(path=path))
    run = fullam.simulate(load_scenario(tmp_path / "draw.toml"), driver="fused")
    # The plain law in calm air, on paths of up to 0.8 m/s.
    assert fullam.measure(run).tool_rms_mm < 8.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"attitude": "level"}, "attitude: is 'level'; choose from free, preferred, fixed"),
        ({"priority": "high"}, "priority: is 'high'; choose from weighted, strict"),
        ({"path": 3}, "path: is 3; give a LinePath"),
        ({"weights": {}}, "weights: is {}; give a ToolWeights"),
        ({"at": -1.0}, "at: is -1.0"),
        ({"max_speed": 0.0}, "max_speed: is 0.0"),
    ],
)
def test_bad_values_name_the_field(change, words):
    with pytest.raises(ScenarioError, match=words):
        ToolTask(**({"path": CirclePath()} | change))


def test_what_does_not_go_together_is_refused(brief):
    with pytest.raises(ScenarioError, match="arm_motion: is given, and follows"):
        Scenario("x", tool=brief.tool, arm_motion=SineRate())
    with pytest.raises(ScenarioError, match="follows a tool that has no task"):
        replace(brief, tool=None)
    with pytest.raises(ScenarioError, match=r"is not solved yet.*prepare\(\.\.\.\)\.scenario"):
        brief.reference.tabulate(np.zeros(1), brief.initial_pose)
    with pytest.raises(ScenarioError, match=r"weights: colour: is no field|colour: is no field"):
        ToolTask.from_dict({"path": {"kind": "circle"}, "weights": {"colour": 1.0}})


def test_the_circle_that_is_registered_is_drawn():
    """Calm: 0.5 and 0.2 mm were measured (0.43 and 0.18)."""
    for law, most in (("dc-pid", 0.5), ("dc-pid-plus", 0.2)):
        run = fullam.simulate("draw-circle", law, calm=True, driver="fused")
        assert fullam.measure(run).tool_rms_mm < most


YIELDING = {
    "tool at the tip": lambda: fullam.load_vehicle("fullam"),
    "tool on a link before": lambda: with_joint("joint_2", "revolute", tool="link_3"),
    "sliding": lambda: with_joint("joint_4", "prismatic"),
    "hextilt": lambda: fullam.load_vehicle("hextilt"),
    "no arm": without_arm,
}


@pytest.mark.parametrize("name", YIELDING)
def test_a_campaign_knows_where_the_tool_of_an_arm_that_yields_was(brief, name):
    """The track's kernel against Pinocchio on the record: rounding."""
    vehicle, found = YIELDING[name](), []
    scenario = replace(brief, initial_arm_deg=())
    for plant in ("prescribed", "servo"):
        plan = prepare(scenario, "dc-pid-plus", plant=plant, vehicle=vehicle)
        judged = [j.figures["tool_rms_mm"] for j in fly_judged(plan, range(3), threads=1)]
        measured = [fullam.measure(run).tool_rms_mm for run in fly_many(plan, range(3), threads=1)]
        np.testing.assert_allclose(np.concatenate(judged), measured, rtol=1e-9)
        found.append(measured)
    if vehicle.n_arm:
        assert np.abs(np.subtract(*found)).max() > 0.01  # [mm]: it does yield


@pytest.mark.parametrize("plant", ["servo", "mujoco"])
def test_a_campaign_flown_by_python_measures_the_tool_too(brief, plant):
    plan = prepare(replace(brief, duration=0.5), "dc-pid", plant=plant)
    judged = next(iter(fly_judged(plan, [3], "python"))).figures["tool_rms_mm"]
    assert judged.tolist() == [fullam.measure(fly_by_python(plan.with_seed(3))).tool_rms_mm]
