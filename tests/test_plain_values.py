"""Settings of any dataclass are saved and read back; what cannot be saved is refused in time."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fullam
from fullam.checks import Checker
from fullam.control.controllers import CONTROLLERS, make_settings, plain_settings
from fullam.control.estimator import Estimator
from fullam.control.estimators import ESTIMATORS
from fullam.exceptions import FullamError, SettingsError
from fullam.plain_values import from_plain, to_plain

CHECK = Checker("own", SettingsError)


@dataclass(frozen=True)
class Filter:
    cutoff: float = 18.0
    taps: tuple[float, ...] = (1.0, 2.0)


@dataclass(frozen=True, eq=False)
class Own:
    """One field of each kind."""

    gain: float = 2.0
    rounds: int = 3
    name: str = "spring"
    on: bool = True
    bound: float | None = None
    gains: tuple[float, ...] = (1.0, 0.1)
    matrix: np.ndarray = field(default_factory=lambda: np.diag([1.0, 2.0]))
    counts: np.ndarray = field(default_factory=lambda: np.array([1, 2]))
    filter: Filter = Filter()
    more: dict[str, Any] = field(default_factory=dict)
    nothing: Any = None


CHANGES = {
    "gain": np.float64(0.1),
    "rounds": np.int64(4),
    "on": False,
    "bound": 0.5,
    "gains": [3.0, 0.3],
    "matrix": [[0.1, 0.0], [0.0, 0.2]],
    "filter": {"cutoff": 9.0},
    "more": {"a": [1, {"b": None}]},
}


def test_a_dataclass_goes_to_json_and_back():
    made = from_plain(Own, CHANGES, CHECK)
    assert made.gains == (3.0, 0.3)
    np.testing.assert_array_equal(made.matrix, np.diag([0.1, 0.2]))
    assert made.counts.dtype == np.array([1, 2]).dtype
    assert made.filter == Filter(cutoff=9.0)
    plain = to_plain(made, CHECK)
    assert plain["matrix"] == ((0.1, 0.0), (0.0, 0.2))
    assert plain["filter"] == {"cutoff": 9.0, "taps": (1.0, 2.0)}
    assert [type(plain[name]) for name in ("gain", "rounds", "on")] == [float, int, bool]
    assert to_plain(from_plain(Own, plain, CHECK), CHECK) == plain


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"gian": 1.0}, "own: gian: is no setting of it; it has gain, rounds"),
        ({"gain": "high"}, "own: gain: is 'high'; give a number, as 2.0"),
        ({"gain": True}, "own: gain: is True; give a number"),
        ({"on": 1}, "own: on: is 1; give true or false"),
        ({"matrix": ["a"]}, r"own: matrix: is \['a'\]; give numbers, as in"),
        ({"filter": {"cut": 1.0}}, "own: filter: cut: is no setting of it; it has cutoff, taps"),
    ],
)
def test_what_does_not_fit_is_refused_with_its_field(changes, says):
    with pytest.raises(SettingsError, match=says):
        from_plain(Own, changes, CHECK)


@pytest.mark.parametrize(
    ("value", "where"),
    [
        (Path("x"), "nothing: is PosixPath"),
        (print, "nothing: is <built-in function print>, a builtin"),
        ((1.0, {2}), r"nothing\[1\]: is \{2\}, a set"),
        ({"a": object}, r"nothing\.a: is <class 'object'>"),
        (1j, "nothing: is 1j, a complex"),
        (np.array([object()]), "nothing: is array"),
    ],
)
def test_what_cannot_be_saved_is_refused_with_its_field(value, where):
    with pytest.raises(SettingsError, match=rf"own: {where}.*cannot be saved; give numbers"):
        to_plain(Own(nothing=value), CHECK)


def test_settings_need_defaults():
    @dataclass
    class Bare:
        gain: float

    with pytest.raises(SettingsError, match=r"own: gain: has no default; write `gain: \.\.\. ="):
        from_plain(Bare, {}, CHECK)
    with pytest.raises(SettingsError, match="Settings: is <class 'dict'>; give a dataclass"):
        from_plain(dict, {}, CHECK)


class OwnLaw(fullam.Controller):
    """Somebody's law, which must not be asked for anything before its settings are looked at."""

    Settings = Own

    def reset(self, measurement, reference):
        self.weight = np.r_[0, 0, self.vehicle.mass * self.vehicle.gravity, 0, 0, 0]

    def wrench(self, t, measurement, reference):
        assert isinstance(self.settings.matrix, np.ndarray)
        return self.weight * self.settings.gain


class OwnFilter(Estimator):
    Settings = Filter

    def reset(self, readings):
        pass

    def update(self, readings, measurement):
        assert isinstance(self.settings.taps, tuple)
        measurement.q[:7] = np.concatenate(readings.pose)


@pytest.fixture
def own(monkeypatch):
    for registry, name, cls in (
        (CONTROLLERS, "own-law", OwnLaw),
        (ESTIMATORS, "own-filter", OwnFilter),
    ):
        monkeypatch.setattr(cls, "name", name, raising=False)
        monkeypatch.setitem(registry, name, cls)


HOP = fullam.Scenario("hop", duration=0.1)


def test_a_flight_with_settings_of_ones_own_is_saved_and_flies_again(own, tmp_path):
    run = fullam.simulate(
        HOP,
        "own-law",
        settings=Own(gain=1.01, matrix=np.array([[0.1]])),
        simulation={
            "estimator": "own-filter",
            "estimator_settings": {"taps": np.array([0.5, 0.25])},
        },
    )
    assert run.settings["matrix"] == [[0.1]]
    loaded = fullam.Run.load(run.save(tmp_path / "run.npz"))
    again = fullam.refly(loaded)
    np.testing.assert_array_equal(again.pose, run.pose)
    assert again.metadata == run.metadata


def test_what_cannot_be_saved_is_refused_before_take_off(own, monkeypatch):
    monkeypatch.setattr(OwnLaw, "__init__", None)  # it is not even made
    with pytest.raises(SettingsError, match=r"'own-law': nothing: is <built-in.*give numbers"):
        fullam.prepare(HOP, "own-law", settings=Own(nothing=print))
    with pytest.raises(FullamError, match=r"simulation settings: taps: is <built-in"):
        fullam.SimulationSettings(estimator="own-filter", estimator_settings={"taps": print})


def test_settings_of_every_law_go_to_json_and_back():
    for name in fullam.controller_names():
        settings = make_settings(name)
        assert make_settings(name, plain_settings(name, settings)) == settings
