"""Scenarios: the paper's numbers, own ones from files, and what is refused."""

import numpy as np
import pytest

import fullam
from fullam.exceptions import NotFullyActuated, ScenarioError, UnknownName
from fullam.simulation.motions.arm_motion import HoldArm, SineRate
from fullam.simulation.motions.shaping import Shaping
from fullam.simulation.scenarios.scenario import Scenario, load_scenario, scenario_names
from fullam.simulation.simulate import prepare
from fullam.simulation.weather import CALM

PAPER_SCENARIOS = [
    *(f"position-{i}" for i in range(1, 5)),
    *(f"tilt-hover-{i}" for i in range(1, 5)),
    "task-1",
    "task-2",
    "quadrotor-arm",
]


def test_the_papers_experiments_are_registered_with_its_numbers():
    assert set(PAPER_SCENARIOS) <= set(scenario_names())
    three = load_scenario("position-3")
    assert three.initial_euler_deg == (20.0, 10.0, -15.0)
    assert three.initial_arm_deg == (0.0, 0.0, -90.0, 0.0)
    assert three.reference.position == (10.0, 10.0, 10.0)
    assert load_scenario("tilt-hover-2").reference.euler_deg == (20.0, 20.0, 20.0)
    task = load_scenario("task-2")
    assert task.reference.position == (9.3, 9.3, 9.3)
    assert task.reference.euler_deg == (20.0, 20.0, 0.0)
    assert task.arm_motion == SineRate(joint=3, rate=0.5, frequency=1.0)
    assert load_scenario("task-1").initial_arm_deg == (-90.0, 0.0, -45.0, 0.0)


@pytest.mark.parametrize("name", PAPER_SCENARIOS)
def test_plain_data_and_back(name):
    scenario = load_scenario(name)
    assert Scenario.from_dict(scenario.to_dict()) == scenario


def test_a_scenario_of_ones_own_from_a_file(tmp_path):
    path = tmp_path / "hop.toml"
    path.write_text(
        """
        name = "hop"
        vehicle = "hextilt"
        initial_position = [0, 0, 2]
        duration = 2.0
        weather = "calm"
        reference = { kind = "step", position = [0, 0, 2.2] }
        arm_motion = { kind = "sine-rate", joint = 2, rate = 0.2 }

        [shaping]
        max_acceleration = 3.0
        max_angular_acceleration = inf
        """
    )
    scenario = load_scenario(path)
    assert scenario.shaping == Shaping(3.0, None, anticipate=True)
    assert scenario.weather == CALM
    assert scenario.vehicle == "hextilt"
    run = fullam.simulate(scenario)
    assert abs(run.pose[-1, 2] - 2.2) < 2e-3


def test_a_scenario_of_ones_own_in_three_lines():
    scenario = fullam.Scenario("hop", reference=fullam.Step((0.2, 0.0, 1.0)), duration=2.5)
    run = fullam.simulate(scenario, calm=True)
    assert abs(run.pose[-1, 0] - 0.2) < 2e-3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name = 'x'\nspeed = 3", r"x\.toml.*speed.*it has name"),
        ("reference = {kind='step', position=[0,0,1]}", r"x\.toml.*name.*missing"),
        ("name = 'x'\nduration = -1", r"x\.toml.*duration"),
        ("name = 'x'\nduration = 'long'", r"x\.toml.*duration: is 'long'"),
        ("name = 'x'\nweather = 5", r"x\.toml: weather.*is 5; give a table"),
        ("name = 'x'\nweather = 'storm'", r"x\.toml.*storm.*paper"),
        ("name = 'x'\nvehicle = 3", r"x\.toml.*vehicle"),
        ("name = 'x'\nreference = {kind='spline'}", r"x\.toml.*spline.*step"),
        ("name = 'x'\nweather = {uncertainty={share=2}}", r"x\.toml.*share"),
        ("name = 'x'\narm_motion = {kind='sine-rate', joint=2.0}", r"x\.toml.*joint"),
        ("name = 'x'\naxes = 3", r"x\.toml.*axes: is 3"),
        ("name = 'x'\nshaping = 3", r"x\.toml: shaping.*is 3; give a table"),
        ("name = 'x'\nshaping = {speed = 3}", r"x\.toml.*speed.*it has max_acceleration"),
        ("name = 'x'\nshaping = {max_acceleration = 0}", r"x\.toml.*max_acceleration: is 0"),
        ("name = 'x'\nshaping = {max_angular_acceleration = nan}", r"max_angular.*: is NaN"),
        ("name = 'x'\nshaping = {anticipate = 'no'}", r"anticipate.*true or false"),
        ("name = 'x'\nreference = {kind='step', position='up'}", r"x\.toml.*position: is 'up'"),
        ("name = 'x'\naxes = ['z', 'q']", r"x\.toml.*axes.*phi"),
        ("name = 'x'\nreference = {kind='step', position=[0, nan, 1]}", r"x\.toml.*position"),
        ("name = ", r"x\.toml.*TOML"),
        ("name = 'x'\narm_motion = {kind='sine-rate', joint=0}", r"x\.toml.*joint"),
    ],
)
def test_bad_files_name_file_and_field(tmp_path, text, message):
    path = tmp_path / "x.toml"
    path.write_text(text)
    with pytest.raises(ScenarioError, match=message):
        load_scenario(path)


def test_unknown_names_list_the_known():
    with pytest.raises(UnknownName, match=r"Did you mean 'task-2'"):
        load_scenario("task2")
    with pytest.raises(UnknownName, match="task-1"):
        load_scenario("nowhere.toml")


def test_an_arm_of_another_size_is_refused():
    with pytest.raises(ScenarioError, match=r"initial_arm_deg.*'hextilt' has 5 joints"):
        fullam.simulate("task-1", vehicle="hextilt", calm=True)
    with pytest.raises(ScenarioError, match=r"joint.*give 1 to 2"):
        SineRate(joint=3).tabulate(np.zeros(1), np.zeros(2))


def test_six_axes_of_a_conventional_platform_are_refused():
    with pytest.raises(NotFullyActuated, match=r"quadrotor_arm.*rank 4.*6 axes"):
        fullam.simulate("tilt-hover-1", vehicle="quadrotor_arm")


def test_a_held_arm_is_still():
    table = HoldArm().tabulate(np.zeros(4), np.array([0.1, 0.2]))
    np.testing.assert_array_equal(table.theta, np.tile([0.1, 0.2], (4, 1)))
    assert not table.dtheta.any()
    assert not table.ddtheta.any()


def test_a_sine_rate_integrates_to_its_angle():
    """Central differences at 1e-3 s: 1e-6."""
    t = np.arange(3001) * 1e-3
    table = SineRate(joint=1, rate=0.5, frequency=2.0).tabulate(t, np.zeros(1))
    np.testing.assert_allclose(
        np.gradient(table.theta[:, 0], t)[1:-1], table.dtheta[1:-1, 0], atol=1e-6
    )
    np.testing.assert_allclose(
        np.gradient(table.dtheta[:, 0], t)[1:-1], table.ddtheta[1:-1, 0], atol=1e-6
    )


UNBLENDED = {"max_acceleration": None, "max_angular_acceleration": None}


def test_a_reference_that_starts_beyond_the_bound_of_divergence_is_refused():
    scenario = fullam.Scenario("far", reference=fullam.Step((9.0, 0.0, 1.0)))
    with pytest.raises(ScenarioError, match=r"is 9 m and 0 deg.*max_position_error.*max_accel"):
        prepare(scenario, shaping=UNBLENDED)
    assert prepare(scenario).reference.pose[0, 0] == 0.0


def test_a_reference_that_starts_turned_beyond_the_bound_is_refused():
    scenario = fullam.Scenario("turned", reference=fullam.Step((0, 0, 1), (150, 0, 0)))
    with pytest.raises(ScenarioError, match=r"150 deg.*max_attitude_error_deg.*max_angular"):
        prepare(scenario, shaping=UNBLENDED)
    wide = fullam.SimulationSettings(max_attitude_error_deg=179.0)
    assert prepare(scenario, shaping=UNBLENDED, simulation=wide).t.size > 1


def test_where_an_axis_is_not_controlled_the_reference_may_be_anywhere():
    """As in flight, where an axis that nobody controls is not looked at either."""
    scenario = fullam.Scenario(
        "sideways",
        vehicle="quadrotor_arm",
        reference=fullam.Step((9.0, 0.0, 1.0)),
        axes=("z", "phi", "psi", "gamma"),
        duration=0.1,
    )
    assert not fullam.simulate(scenario, shaping=UNBLENDED, calm=True).diverged
