"""What a law declares tunable: ranges beside the defaults, and the numbers a search makes of them.

The laws of the package are held to their ranges in tests/analysis/test_tuning.py.
"""

from dataclasses import dataclass

import pytest

import fullam
from fullam.control.tunable import Parameter, search_space
from fullam.exceptions import SettingsError


@dataclass(frozen=True)
class SpringSettings:
    stiffness: float = fullam.tunable(6.0, low=1, high=60)
    damping: tuple[float, float] = fullam.tunable((4, 2.0), low=(1.0, None), high=(20.0, None))
    offset: float = fullam.tunable(0.0, low=-1.0, high=1.0, scale="linear")
    rounds: int = fullam.tunable(3, low=1, high=9)
    model: str = "pinocchio"


def test_a_declaration_is_a_default_and_a_range():
    assert SpringSettings() == SpringSettings(6.0, (4, 2.0), 0.0, 3, "pinocchio")
    assert search_space(SpringSettings) == (
        Parameter("stiffness", None, 1.0, 60.0),
        Parameter("damping", 0, 1.0, 20.0),
        Parameter("offset", None, -1.0, 1.0, "linear"),
        Parameter("rounds", None, 1.0, 9.0, whole=True),
    )


def test_a_subclass_that_gives_another_default_declares_again():
    @dataclass(frozen=True)
    class Stiff(SpringSettings):
        stiffness: float = 60.0

    assert "stiffness" not in {p.field for p in search_space(Stiff)}
    assert len(search_space(Stiff)) == 3


@pytest.mark.parametrize(
    "parameter",
    [Parameter("gain", 0, 0.01, 30.0), Parameter("gain", None, -2.0, 7.0, "linear")],
    ids=lambda p: p.scale,
)
def test_decoding_inverts_encoding_at_the_written_precision(parameter):
    assert parameter.decode(0.0) == parameter.low
    assert parameter.decode(1.0) == parameter.high
    assert parameter.encode(100.0) == 1.0
    assert parameter.encode(-3.0) == 0.0  # a start beyond a range begins at its nearer end
    for x in (0.1, 0.5, 0.9):
        # Four digits are up to 5e-4 relative: over 8 e-folds 6.3e-5 of the interval, and of at most
        # 7 over a length of 9 less than 3.9e-4.
        tolerance = 6.3e-5 if parameter.scale == "log" else 3.9e-4
        assert parameter.encode(parameter.decode(x)) == pytest.approx(x, abs=tolerance)


def test_whole_numbers_stay_whole():
    rounds = search_space(SpringSettings)[-1]
    values = [rounds.decode(x) for x in (0.0, 0.3, 0.99, 1.0)]
    assert values == [1, 2, 9, 9]
    assert all(isinstance(value, int) for value in values)


@pytest.mark.parametrize(
    ("default", "low", "high", "scale", "words"),
    [
        (1.0, 2.0, 1.0, "log", "low < high"),
        (1.0, 0.0, 2.0, "log", "above 0"),
        (1.0, (0.5,), (2.0,), "log", "give them as 1.0 is"),
        ((1.0, 2.0), (0.5,), (2.0,), "log", "give them as"),
        ((1.0, 2.0), (0.5, None), (2.0, 3.0), "log", "lack one end"),
        (1.0, 0.5, float("inf"), "log", "inf"),
        ("high", "low", "higher", "log", "'high'"),
        (1.0, 0.5, 2.0, "square", "linear"),
    ],
)
def test_a_range_that_cannot_be_searched_is_refused(default, low, high, scale, words):
    with pytest.raises(SettingsError, match=words):
        fullam.tunable(default, low, high, scale=scale)


def test_a_class_that_declares_nothing_is_told_how():
    @dataclass(frozen=True)
    class Bare:
        gain: float = 1.0

    for cls in (Bare, dict):
        with pytest.raises(SettingsError, match=r"fullam\.tunable\(5\.0"):
            search_space(cls)
