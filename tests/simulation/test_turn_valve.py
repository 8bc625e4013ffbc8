"""A valve in MuJoCo is turned by its pin."""

from dataclasses import replace

import numpy as np
import pytest

from fullam.simulation.hands.interactive import InteractiveFlight
from fullam.simulation.scenarios import turn_valve
from fullam.simulation.scenarios.scenario import Scenario, load_scenario
from fullam.simulation.scenarios.turn_valve import FRICTION, HINGE, PLAY, RADIUS, hoop_angle
from fullam.simulation.simulate import prepare, simulate
from fullam.simulation.weather import CALM, PAPER

VALVE = load_scenario("turn-valve")


def flown(law, weather, until):
    """The run, and the wheel's angle up to a time."""
    run = simulate(replace(VALVE, weather=weather), law)
    return run, run.moved("valve")[: round(100.0 * until) + 1]


@pytest.fixture(scope="module")
def calm():
    return flown("dc-pid-plus", CALM, 13.5)


def test_the_record_has_the_angle_that_mujoco_has():
    """While the wheel begins to turn, read from the engine between periods."""
    flight = InteractiveFlight(prepare(replace(VALVE, weather=CALM), "dc-pid-plus"))
    flight.advance(6.0)
    for _ in range(5):
        flight.advance(0.1)
        angle = flight.flight.block.plant.engine.data.joint("valve").qpos[0]
        assert flight.step() and flight.record.moved("valve")[-1] == angle
    assert angle > 0.01


def test_the_wheel_is_turned_by_more_than_a_right_angle(calm):
    run, wheel = calm
    assert run.well and run.simulation.plant == "mujoco"
    assert np.abs(wheel[:400]).max() < 1e-3, "it stands until the hoop moves it"
    assert np.degrees(wheel[-1]) > 95.0


def test_where_the_hoop_is_tells_the_wheels_angle(calm):
    run, wheel = calm
    behind = hoop_angle(run)[800 : len(wheel)] - wheel[800:]
    # The stiff contact gives way by some um, and the hoop leans by the servos' sag.
    most = np.arcsin(PLAY / RADIUS)
    assert (behind > 0.5 * most).all() and (behind < most + np.radians(0.5)).all()


def test_what_the_tool_feels_is_the_hinges_resistance(calm):
    """The moment of the pin's force about the hinge, over 3 s about the fastest moment."""
    run, wheel = calm
    angle = run.moved("valve")
    y, z = -RADIUS * np.sin(angle), RADIUS * np.cos(angle)
    fy, fz = -run.contact_force[:, 1], -run.contact_force[:, 2]
    moment = (y * fz - z * fy)[700:1000].mean()
    rate = (wheel[1000] - wheel[700]) / 3.0
    # Friction on the pin has its radius for a lever, 0.2 * 5 mm / 120 mm: 1 %; inertia 0.2 %.
    assert moment == pytest.approx(FRICTION + 0.02 * rate, rel=0.03)


def test_in_gusts_the_pin_is_taken_and_the_wheel_pushed():
    run, wheel = flown("hybrid-force", PAPER, 8.5)
    assert run.well and np.degrees(wheel[-1]) > 45.0
    # Gusts shake the push; over 5.5 s and two seeds its mean was 2.99 N and 3.04 N.
    assert -run.contact_force[600:850, 0].mean() == pytest.approx(3.0, rel=0.1)


def test_the_tool_is_led_from_the_pin_about_the_hinge():
    t = np.linspace(0.0, VALVE.duration, 500)
    away = VALVE.tool.offsets(t)
    from_hinge = np.linalg.norm(away[:, 1:] + [0.0, RADIUS], axis=1)
    # Of a spline through knots 0.125 s apart.
    np.testing.assert_allclose(from_hinge, RADIUS, atol=1e-6)
    assert away[-1] == pytest.approx(
        [
            turn_valve.REACH,
            -RADIUS * np.sin(turn_valve.TURN),
            RADIUS * np.cos(turn_valve.TURN) - RADIUS,
        ],
        abs=1e-9,
    )
    assert HINGE[2] + RADIUS == pytest.approx(0.94), "the tool's height at the start"


def test_it_survives_a_file():
    assert Scenario.from_dict(VALVE.to_dict()) == VALVE
