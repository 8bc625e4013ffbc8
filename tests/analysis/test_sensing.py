"""An estimator that believes its sensors too much is named, and so is the one that does not."""

from dataclasses import replace

import pytest

import fullam
from fullam.analysis.diagnosis import diagnose
from fullam.analysis.margins import estimator_cost, loop_margins
from fullam.analysis.sensing import sensor_warning
from fullam.cli import main
from fullam.control.controllers import controller_names, recommended_estimator, suits
from fullam.exceptions import UnknownName
from fullam.simulation.sensor_errors import MPU6050, SensorErrors
from fullam.simulation.simulate import prepare
from fullam.simulation.weather import PAPER, SOLD, WEATHERS

BIASED = replace(PAPER, sensors=SensorErrors(gyroscope_bias_deg=(1.0, 2.0, 0.0)))
ONLY_GAPS = replace(PAPER, sensors=SensorErrors(gap_duration=0.5))


def test_what_each_estimator_believes():
    kalman = sensor_warning(SOLD, "kalman")
    assert "bias of inertial sensors (to 20 deg/s and 80 mg)" in kalman
    assert "outliers of the pose (2 %, 0.5 m and 20 deg off)" in kalman
    assert kalman.endswith("fly it with kalman-bias")
    first = sensor_warning(SOLD, "first-order")
    assert "bias" not in first.replace("kalman-bias", "")
    assert "a pose that has not come for 0.5 s" in first
    assert "to 2 deg/s and 0 mg" in sensor_warning(BIASED, "kalman")
    assert sensor_warning(BIASED, "first-order") is None
    assert sensor_warning(ONLY_GAPS, "kalman") is None
    with pytest.raises(UnknownName, match="kalman-bias"):
        sensor_warning(SOLD, "oracle")


@pytest.mark.parametrize("name", WEATHERS)
def test_the_one_that_is_recommended_bears_every_weather(name):
    weather = WEATHERS[name]
    assert sensor_warning(weather, "kalman-bias") is None
    if name != "sold":
        assert sensor_warning(weather, "kalman") is None
        assert sensor_warning(weather, "first-order") is None


def plan_of(weather="paper", estimator="kalman-bias", law="dc-pid-plus"):
    return prepare("task-1", law, weather=weather, simulation={"estimator": estimator})


def test_a_law_made_for_kalman_is_not_told_off_for_the_filter_with_bias():
    assert suits("dc-pid-plus", "kalman")
    assert suits("dc-pid-plus", "kalman-bias")
    assert not suits("dc-pid-plus", "first-order")
    assert not suits("dc-pid", "kalman-bias")
    assert all(suits(law, recommended_estimator(law)) for law in controller_names())
    assert estimator_cost(plan_of()) is None
    # dc-PID's own filter does not bear these sensors: no word about what leaving it costs.
    assert estimator_cost(plan_of("sold", law="dc-pid")) is None
    assert "dc-pid is made for" in estimator_cost(plan_of("paper", law="dc-pid"))


def test_margins_with_bias_states_are_those_without():
    """Of the loop with poses: to 2 deg, since biased sensors make the filter a little quicker."""
    plain = loop_margins(plan_of("paper", "kalman"))
    for weather in ("paper", "sold"):
        found = loop_margins(plan_of(weather))
        assert found.enough
        for axis, other in zip(found.axes, plain.axes, strict=True):
            assert abs(axis.phase - other.phase) < 2.0
            assert abs(axis.delay - other.delay) < 0.003


def test_the_record_of_a_flight_that_believed_tells():
    weather = replace(PAPER, sensors=MPU6050)
    choices = {"weather": weather, "seed": 2, "driver": "fused", "throw": False}
    run = fullam.simulate("task-1", "dc-pid-plus", **choices)
    found = {finding.kind: finding for finding in diagnose(run)}
    assert "bias of inertial sensors" in found["sensors"].what
    assert found["sensors"].remedy == "fly it with kalman-bias"
    run = fullam.simulate(
        "task-1", "dc-pid-plus", simulation={"estimator": "kalman-bias"}, **choices
    )
    kinds = {finding.kind for finding in diagnose(run)}
    assert not kinds & {"sensors", "estimator", "margin"}


def test_the_command_line_says_so_before_take_off(capsys):
    flight = ("run", "task-1", "--controller", "dc-pid-plus", "--weather", "sold", "--json")
    assert main([*flight, "--driver", "fused"]) in (0, 1)
    assert "the estimator kalman takes the bias" in capsys.readouterr().err
    assert main([*flight, "--driver", "fused", "--estimator", "kalman-bias"]) == 0
    assert "takes" not in capsys.readouterr().err
