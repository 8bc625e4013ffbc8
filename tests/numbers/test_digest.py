"""The key of machine code changes with all that goes into it, and with nothing else."""

import math
import subprocess
import sys
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest

from fullam.numbers.digest import describe, digest
from fullam.numbers.records import Rows
from fullam.numbers.vectors import Vector

BASE = """
LIMIT = 1.0
TABLE = (1.0, 2.0)

def inner(x):
    return 2.0 * x

def callee(x, more=3.0):
    return inner(x) + LIMIT + more

def make(gain):
    def stage(view, k):
        def local(x):
            return x + 1.0
        return callee(local(gain)) + TABLE[0] + Pair(1.0, 2.0).a
    return stage

stage = make(4.0)
"""

RECORDS = """
from typing import NamedTuple

class Pair(NamedTuple):
    a: float
    b: float
"""


def key(source, records=RECORDS, name="stage"):
    names = {"__name__": "made"}
    exec(compile(records + source, "<kernels>", "exec"), names)
    return digest(names[name])


@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        ("2.0 * x", "2.5 * x"),  # a constant in what a callee calls
        ("2.0 * x", "2.0 + x"),
        ("LIMIT = 1.0", "LIMIT = 1.5"),  # a global of a callee
        ("LIMIT = 1.0", "LIMIT = 1"),
        ("(1.0, 2.0)", "(1.0, 2.5)"),
        ("make(4.0)", "make(4.5)"),  # a closure's cell
        ("more=3.0", "more=3.5"),  # a default
        ("x + 1.0", "x + 1.5"),  # a function inside
        ("inner(x) +", "callee(x) +"),
    ],
)
def test_a_change_anywhere_gives_another_key(was, becomes):
    assert was in BASE
    assert key(BASE.replace(was, becomes)) != key(BASE)


def test_a_record_of_other_fields_gives_another_key():
    assert key(BASE, RECORDS.replace("    b: float", "    c: float")) != key(BASE)


def test_what_changes_nothing_gives_the_same_key():
    assert key(BASE) == key(BASE)
    assert key("\n\n# Elsewhere in the file.\n" + BASE) == key(BASE)
    assert key(BASE.replace("def inner", "UNUSED = 3.0\n\ndef inner")) == key(BASE)


def test_constants_of_a_module_that_is_named_count_too():
    source = "def stage(view, k):\n    return constants.GRAVITY * constants.helper(k)\n"

    def helper(k):
        return k + 1

    def other(k):
        return k + 2

    def of(gravity, function):
        constants = ModuleType("constants")
        constants.GRAVITY, constants.helper = gravity, function
        names = {"constants": constants}
        exec(source, names)
        return digest(names["stage"])

    assert of(9.81, helper) == of(9.81, helper)
    assert len({of(9.81, helper), of(9.80, helper), of(9.81, other)}) == 3


def test_arrays_count_with_all_their_numbers():
    """Their text leaves most of them out."""
    source = "def stage(view, k):\n    return TABLE[k]\n"

    def of(table):
        names = {"TABLE": table}
        exec(source, names)
        return digest(names["stage"])

    long = np.zeros(5000)
    other = long.copy()
    other[2500] = 1e-12
    assert of(long) == of(long.copy())
    assert of(long) != of(other)


def test_recursion_and_library_functions_are_no_trouble():
    source = (
        "import math\ndef stage(view, k):\n    return stage(view, k) + math.sqrt(k) + len(view)"
    )
    assert key(source) == key(source)
    assert key(source) != key(source.replace("sqrt", "cos"))
    assert math.sqrt(4.0) == 2.0


class Pair(NamedTuple):
    a: float
    b: float


class Inner(NamedTuple):
    pairs: Any


class View(NamedTuple):
    inner: Any
    vectors: Any


def test_a_view_is_described_by_names_records_lanes_and_depths():
    def words(pairs, vectors):
        return describe(View(Inner(pairs), vectors))

    pairs, vectors = Rows.empty(Pair, 3), Rows.empty(Vector, 3)
    assert words(pairs, vectors) == words(Rows.empty(Pair, 7), vectors), "lengths are looked up"
    others = [
        (Rows.empty(Pair, 3, lanes=8), vectors),
        (Rows.empty(Pair, 3, 2), vectors),
        (Rows.empty(Vector, 3), vectors),
        (pairs, Rows.empty(float, 3)),
    ]
    assert len({words(pairs, vectors), *(words(*other) for other in others)}) == 5


def test_keys_are_the_same_in_every_process():
    """Else nothing would ever be found on disk: of a whole flight, law and all."""
    code = (
        "from fullam.numbers.digest import describe, digest\n"
        "from fullam.simulation.block import Block\n"
        "from fullam.simulation.simulate import prepare\n"
        "from fullam.simulation.tables import Tables\n"
        "import fullam\n"
        "settings = fullam.SimulationSettings(estimator='kalman', integrator='rk4')\n"
        "plan = prepare('task-2', 'dc-pid-plus', simulation=settings)\n"
        "for stage in Block(Tables(plan), 8).stages().values():\n"
        "    print(digest(stage.kernel, describe(stage.view)))\n"
    )
    command = [sys.executable, "-c", code]
    runs = [subprocess.run(command, capture_output=True, text=True, check=True) for _ in range(2)]
    assert runs[0].stdout == runs[1].stdout
    keys = runs[0].stdout.split()
    assert len(set(keys)) == len(keys) > 8
