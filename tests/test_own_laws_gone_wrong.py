"""Own laws, wrong in ways that a fuzzer found: refused in words, at the door or in flight."""

import re
import sys
from typing import NamedTuple

import numpy as np
import pytest

import fullam
from fullam import ownership
from fullam.cli import main
from fullam.control.controllers import CONTROLLERS, make_controller, register
from fullam.control.law import numbers_of
from fullam.control.settings_file import read_settings
from fullam.control.tunable import search_space
from fullam.exceptions import FullamError, PluginError, SettingsError
from fullam.numbers.records import layout
from fullam.ownership import LOADED

LAW = """import fullam

@fullam.register({name})
class Own(fullam.Controller):
    {more}

    def reset(self, measurement, reference):
        pass

    def wrench(self, t, measurement, reference):
        {first}
        return {wrench}
"""
PARTS = {"name": "'own'", "more": "pass", "first": "pass", "wrench": "[0, 0, 25, 0, 0, 0]"}
HOP = fullam.Scenario("hop", duration=0.05)


@pytest.fixture(autouse=True)
def nothing_stays():
    yield
    while LOADED:
        ownership.withdraw(LOADED.popitem()[1])
    CONTROLLERS.pop("own", None)
    sys.modules.pop("wrong_law", None)


@pytest.fixture
def law(tmp_path, monkeypatch):
    """Writes a law that is good but for what is said."""
    monkeypatch.chdir(tmp_path)

    def write(after="", **parts):
        path = tmp_path / "wrong_law.py"
        path.write_text(LAW.format(**PARTS | parts) + after, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        ({"name": "object()"}, r"line 3: .*name: is <object.*give a string; mend it there\."),
        ({"name": "''"}, r"line 3: .*name: is empty"),
        ({"name": "'a,b'"}, r"has a comma, an @ or blanks"),
        ({"name": "'a@kalman'"}, r"has a comma, an @ or blanks"),
        ({"name": "'x' * 5000"}, r"is too long"),
        ({"name": "'\\x1b[31m'"}, r"control characters"),
        ({"more": "estimator = None"}, r"estimator: is None; give a string"),
        ({"more": "def __init__(self): pass"}, r"__init__: cannot be called \(too many.*vehicle"),
        ({"after": "fullam.load_plugin(__file__)\n"}, r"plugin: loads itself; leave that out"),
    ],
)
def test_what_cannot_fly_is_refused_when_it_is_loaded(law, parts, says):
    path = law(**parts)
    with pytest.raises(PluginError, match=says):
        fullam.load_plugin(path)
    assert "own" not in CONTROLLERS


@pytest.mark.parametrize(
    "wrench", ["[1j] * 6", "list('abcdef')", "[None] * 6", "[10**400] * 6", "[[1, 2], [3]]", "{}"]
)
def test_a_wrench_of_no_numbers_is_told_so(law, wrench):
    fullam.load_plugin(law(wrench=wrench))
    with pytest.raises(SettingsError, match=r"controller 'own'.*wrench: is .*return or set six"):
        fullam.simulate(HOP, "own")


def test_an_own_init_has_to_call_its_bases(law):
    fullam.load_plugin(law(more="def __init__(self, *parts): pass"))
    with pytest.raises(SettingsError, match=r"class Own.*call super\(\).__init__ with all"):
        fullam.simulate(HOP, "own")


def test_what_a_law_does_to_its_measurement_is_undone(law):
    """A law that puts other arrays, or numbers, there is told the truth in the next period."""
    fullam.load_plugin(law(first="self.seen = measurement.q.copy(); measurement.q = None"))
    spoilt = fullam.simulate(HOP, "own", seed=3)
    del CONTROLLERS["own"]
    LOADED.clear()
    fullam.load_plugin(law())
    assert np.array_equal(spoilt.pose, fullam.simulate(HOP, "own", seed=3).pose)


def test_what_a_law_raises_in_flight_ends_the_command_in_a_line(law, capsys):
    law(first="raise ValueError('my own')")
    flags = ["--plugin", "wrong_law.py", "--controller", "own"]
    assert main(["run", "position-1", *flags]) == 2
    said = capsys.readouterr().err
    assert re.search(r"wrong_law\.py, line 11: ValueError: my own; mend it there\.", said), said
    assert "Traceback" not in said


class Unknown(NamedTuple):
    a: "Nowhere"  # noqa: F821 - which is what is tried


class Ragged(NamedTuple):
    a: float
    b: float

    def numbers(self):
        return Ragged([1.0, 2.0], 3.0)  # type: ignore[arg-type]


def test_records_of_no_numbers_are_named():
    with pytest.raises(SettingsError, match=r"record Unknown.*'Nowhere' is not defined"):
        layout(Unknown)
    with pytest.raises(SettingsError, match=r"class Ragged: numbers\(\): is no record"):
        numbers_of(Ragged(1.0, 2.0))


def test_settings_beyond_sense_or_nowhere(tmp_path):
    path = tmp_path / "gains.toml"
    path.write_text(f"controller = 'pid'\n[settings]\nanti_windup = 1{'0' * 400}\n", "utf-8")
    with pytest.raises(SettingsError, match=r"anti_windup: is an integer of about 401 digits"):
        fullam.load_settings(path)
    for wrong in (None, 3, [], "a\0b"):
        with pytest.raises(SettingsError, match="path"):
            read_settings(wrong)


@pytest.mark.parametrize(
    "call",
    [
        lambda: register(3)(int),
        lambda: search_space(3),
        lambda: make_controller("pid", None),
        lambda: make_controller("pid", fullam.load_vehicle("fullam"), period="x"),
        lambda: fullam.tunable(3.0, 1.0, 9.0, scale=np.zeros(2)),
        lambda: fullam.measure(None),
        lambda: fullam.refly(3),
        lambda: fullam.diagnose("x"),
        lambda: fullam.loop_margins(3),
        lambda: fullam.external_wrench([]),
        lambda: fullam.excitation_flight(None),
        lambda: fullam.excitation_flight(fullam.load_vehicle("fullam"), duration={}),
        lambda: list(fullam.fly_many(fullam.prepare(HOP), 3)),
        lambda: list(fullam.fly_many(3, [1])),
    ],
)
def test_what_is_no_such_thing_is_refused_at_the_door(call):
    with pytest.raises(FullamError, match=r"give|derive|choose"):
        call()
