"""Errors say what they were given, also after a trip to another process."""

import copy
import importlib
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import fullam
from fullam import exceptions
from fullam.exceptions import FullamError, InvalidInput
from fullam.viz.viewer.browser import BrowserError

INPUT = ("arm.toml", "mass", "is -1", "give kilograms, above 0")
EXAMPLES = {
    FullamError: ("something impossible",),
    exceptions.UnknownName: ("scenario", "tusk-1", ("task-1", "task-2")),
    exceptions.InvalidInput: INPUT,
    exceptions.VehicleError: INPUT,
    exceptions.ScenarioError: INPUT,
    exceptions.SettingsError: INPUT,
    exceptions.RunFileError: INPUT,
    exceptions.CampaignError: INPUT,
    exceptions.KernelError: INPUT,
    exceptions.PluginError: INPUT,
    exceptions.NotFullyActuated: ("quadrotor", 4, 6, "tilt the rotors"),
    exceptions.NonFiniteWrench: (np.array([np.nan, 0.0, 0.0, 0.0, 0.0, 0.0]),),
    exceptions.NonFiniteCenter: (np.ones(6), np.array([np.nan, 0.0, 0.0])),
    exceptions.AllocationFailed: (np.ones(6), "MAX_ITER", {"H": np.eye(2), "g": np.zeros(2)}),
    exceptions.Diverged: ({"t": np.arange(3.0)}, "at t = 1 s the platform is 9 m away"),
    BrowserError: ("the browser said nothing",),
    exceptions.MissingDependency: ("the fast engine", "numba", "fast"),
}
"""Arguments to make one error of every class."""


def classes(base=FullamError):
    """The base and all that derive from it, each once."""
    return {base}.union(*(classes(sub) for sub in base.__subclasses__()))


def defining_modules():
    """Names of the modules in which a class derives from a known error.

    The rest of the package need not be imported, which would ask for every optional dependency.
    """
    root = Path(fullam.__file__).parent
    bases = "|".join(sorted(cls.__name__ for cls in classes()))
    pattern = re.compile(rf"^class \w+\((?:.*[ .])?(?:{bases})\b.*\):", re.MULTILINE)
    for path in sorted(root.rglob("*.py")):
        if pattern.search(path.read_text(encoding="utf-8")):
            yield ".".join(path.relative_to(root.parent).with_suffix("").parts)


def test_every_error_has_an_example():
    for module in defining_modules():
        importlib.import_module(module)
    ours = {cls for cls in classes() if cls.__module__.startswith("fullam")}
    assert ours == set(EXAMPLES), "give the new error an example above"


def same(a, b):
    """Equality of evidence: arrays, and what holds them, by value."""
    return pickle.dumps(a) == pickle.dumps(b)


@pytest.mark.parametrize("cls", EXAMPLES, ids=lambda cls: cls.__name__)
@pytest.mark.parametrize("trip", [lambda e: pickle.loads(pickle.dumps(e)), copy.copy])
def test_an_error_survives_the_trip(cls, trip):
    error = cls(*EXAMPLES[cls])
    error.add_note("seed 7")
    back = trip(error)
    assert type(back) is cls
    assert str(back) == str(error)
    assert back.args == error.args
    assert vars(back).keys() == vars(error).keys()
    assert all(same(value, vars(back)[name]) for name, value in vars(error).items())
    assert back.__notes__ == ["seed 7"]


def test_an_input_error_has_its_parts_in_the_message():
    assert str(InvalidInput(*INPUT)) == "arm.toml: mass: is -1; give kilograms, above 0."
