"""Files of settings: read, refused with their name, and flown as what they were made for."""

from dataclasses import dataclass

import pytest

import fullam
from fullam.control.controller import Controller
from fullam.control.controllers import CONTROLLERS, make_settings
from fullam.exceptions import FullamWarning, SettingsError
from fullam.model.loading import load_vehicle

GAINS = "[settings]\nposition_gains = [20, 10, 6]\nrounds = 2\n"
OF_DC_PID = f'controller = "dc-pid"\nestimator = "kalman"\n{GAINS}'


@pytest.fixture
def write(tmp_path):
    def written(text):
        path = tmp_path / "gains.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return written


def test_a_file_is_a_mapping_that_flies(write):
    gains = fullam.load_settings(write(OF_DC_PID))
    assert dict(gains) == {"position_gains": [20, 10, 6], "rounds": 2}
    assert (gains.controller, gains.estimator, len(gains)) == ("dc-pid", "kalman", 2)
    plan = fullam.prepare("position-1", "dc-pid", settings=gains)
    expected = make_settings("dc-pid", {"position_gains": (20.0, 10.0, 6.0), "rounds": 2})
    assert plan.settings == expected
    assert plan.simulation.estimator == "kalman", "what it is made for, dc-pid's is first-order"
    run = fullam.simulate(
        fullam.Scenario("hop", duration=0.1), settings=gains, calm=True, driver="python"
    )
    assert run.metadata["settings"]["rounds"] == 2


def test_a_file_without_a_controller_is_anybodys(write):
    gains = fullam.load_settings(write("[settings]\nposition_gains = [20, 10, 6]\n"))
    for name in ("pid", "dc-pid"):
        plan = fullam.prepare("position-1", name, settings=gains)
        assert plan.settings.position_gains == (20.0, 10.0, 6.0)
        assert plan.simulation.estimator == "first-order"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('controller = "dc-pdi"\n[settings]\n', r"controller: 'dc-pdi' is not known.*dc-pid"),
        ("position_gains = [1, 2, 3]\n", r"position_gains: is no part of it; it has .*settings"),
        ('controller = "dc-pid"\n', r"\[settings\]: is missing"),
        ("settings = 3\n", "give a table"),
        (f"{OF_DC_PID}rond = 2\n", r"rond: is no setting of it; it has .*rounds"),
        (f"{OF_DC_PID}anti_windup = true\n", r"anti_windup: is True; give a number"),
        (f"{OF_DC_PID}attitude_gains = [1, 2]\n", r"attitude_gains: is \(1, 2\); give 3 numbers"),
        (f'{OF_DC_PID}attitude_gains = "high"\n', r"attitude_gains: is 'high'; give 3 numbers"),
        (f"{OF_DC_PID}attitude_gains = [1, 2, -1]\n", r"attitude_gains: is .*none < 0"),
        (f'{OF_DC_PID}compensation = "none"\n', "compensation: is 'none'; give one of"),
        (f"{OF_DC_PID}wrench_bounds = 'wide'\n", r"wrench_bounds: is of the wrong type"),
        (f"{OF_DC_PID}[tuning]\nvehicles = {{ fullam = 3 }}\n", "give a string"),
        (f"{OF_DC_PID}[", "correct the syntax"),
    ],
)
def test_what_does_not_fit_is_refused_with_the_files_name(write, text, words):
    with pytest.raises(SettingsError, match=rf"gains\.toml.*{words}"):
        fullam.load_settings(write(text))


def test_no_file_is_no_traceback(tmp_path):
    with pytest.raises(SettingsError, match="there is no such file"):
        fullam.load_settings(tmp_path / "none.toml")


def test_another_controllers_file_is_refused(write):
    gains = fullam.load_settings(write(OF_DC_PID))
    with pytest.raises(SettingsError, match="is 'dc-pid', and 'pid' is to fly"):
        fullam.simulate("position-1", "pid", settings=gains)


def test_a_flight_that_differs_from_the_tuning_is_warned_of(write):
    digest = load_vehicle("hextilt").digest()
    tuning = f'[tuning]\nvehicles = {{ hextilt = "{digest}" }}\n'
    gains = fullam.load_settings(write(OF_DC_PID + tuning))
    fullam.prepare("hextilt-step", settings=gains)  # warnings are errors here
    with pytest.warns(FullamWarning, match="tuned on 'hextilt', and 'fullam' flies"):
        fullam.prepare("position-1", settings=gains)
    with pytest.warns(FullamWarning, match="made for the estimator 'kalman', and 'first-order'"):
        fullam.prepare("hextilt-step", settings=gains, simulation={"estimator": "first-order"})
    edited = fullam.load_settings(write(OF_DC_PID + tuning.replace(digest, "0" * 16)))
    with pytest.warns(FullamWarning, match="'hextilt' is not what it was when"):
        fullam.prepare("hextilt-step", settings=edited)


@dataclass(frozen=True)
class PlainSettings:
    """As a user writes it: nothing is checked."""

    gain: float = 2.0
    lags: tuple[float, ...] = (0.1, 0.2)
    name: str = "plain"
    wide: bool = False
    bound: float | None = None


class Plain(Controller):
    name, Settings = "plain", PlainSettings


def test_settings_that_check_nothing_are_checked_by_their_defaults(write, monkeypatch):
    monkeypatch.setitem(CONTROLLERS, "plain", Plain)
    head = 'controller = "plain"\n[settings]\n'
    good = fullam.load_settings(write(f"{head}gain = 3\nlags = [1.0]\nbound = 4\n"))
    assert make_settings("plain", good) == PlainSettings(3.0, (1.0,), bound=4)
    for line, words in (
        ("gain = '3'", "give a number"),
        ("lags = [true]", "give numbers"),
        ("name = 3", "give a string"),
        ("wide = 1", "true or false"),
    ):
        with pytest.raises(SettingsError, match=words):
            fullam.load_settings(write(f"{head}{line}\n"))
