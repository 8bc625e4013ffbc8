"""What is said before take-off, against what the atlas says of the same attitude."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.foresight import reach_warning
from fullam.model.loading import load_vehicle
from fullam.simulation.motions.arm_motion import SineRate
from fullam.simulation.motions.references import Step
from fullam.simulation.scenarios.scenario import Scenario, load_scenario, scenario_names


@pytest.mark.parametrize("name", scenario_names())
def test_the_papers_scenarios_are_within_reach(name: str) -> None:
    scenario = load_scenario(name)
    assert reach_warning(scenario, load_vehicle(scenario.vehicle)) is None


def test_too_much_tilt_is_told_with_the_arm_pose_and_by_how_much() -> None:
    vehicle = load_vehicle("fullam")
    scenario = Scenario(
        "steep",
        reference=Step((0.0, 0.0, 1.0), (0.0, 40.0, 0.0), at=1.0),
        initial_arm_deg=(-90.0, 0.0, -45.0, 0.0),
        arm_motion=SineRate(joint=3, rate=0.5, frequency=1.0),
        duration=3.0,
    )
    found = reach_warning(scenario, vehicle)
    assert found is not None
    assert np.rad2deg(found.tilt) == pytest.approx(40.0)
    held = float(Envelope.of(vehicle, found.arm).rose([found.azimuth])[0])
    assert found.held == pytest.approx(held, abs=1e-12)
    assert found.short == pytest.approx(np.deg2rad(40.0) - held)
    assert found.t >= 1.0
    text = str(found)
    assert "40.0 deg is asked for" in text
    assert f"{np.rad2deg(found.short):.1f} deg short" in text
    assert "arm at (-90 deg" in text


def test_a_vehicle_that_cannot_hover_is_told() -> None:
    vehicle = load_vehicle("fullam")
    rotors = replace(vehicle.rotors, max_speeds=0.5 * vehicle.rotors.max_speeds)
    found = reach_warning(load_scenario("task-1"), replace(vehicle, rotors=rotors))
    assert found is not None
    assert found.held is None
    assert "cannot hover level" in str(found)


def test_a_tilt_that_nobody_controls_is_not_asked_for() -> None:
    scenario = replace(
        load_scenario("quadrotor-arm"), reference=Step((0.0, 0.0, 1.0), (30.0, 0.0, 0.0))
    )
    assert reach_warning(scenario, load_vehicle("quadrotor_arm")) is None
