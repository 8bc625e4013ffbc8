"""Newton-Euler recursion, matrix system and Pinocchio on 10 000 random states.

Pinocchio shares no code with the other two (the last test here holds the imports to that), and gets
there by another way: spatial algebra in body frames, mass matrix and RNEA.
"""

import ast
import itertools
from pathlib import Path

import numpy as np
import pytest

import fullam.dynamics.multibody
from fullam.analysis.agreement import (
    pinocchio_answers,
    recursion_and_matrix,
    relative_difference,
)
from fullam.analysis.random_states import CATEGORIES, random_states, randomized_inertias
from fullam.dynamics import kinematics
from fullam.dynamics.multibody import Multibody
from fullam.model.chain import LinkChain
from fullam.model.loading import load_vehicle

AGREEMENT = 1e-10
"""Relative to the vector compared. Rounding, 1e-16, times a condition number of up to 1e4 leaves
1e-12; the rest is room for vectors that are small differences of large terms."""

VEHICLES = ("fullam", "hextilt", "borinot")
CHAINS = (1, 2, 3, 4, 5, 6, 7, "P", "RPR", "PRPPR")
"""Numbers of revolute joints, or the kind of each joint."""
STATES_EACH = 129
"""Times six categories and thirteen systems: 10 062 states."""


def model_and_tool(system, rng, make_chain):
    if system not in VEHICLES:
        return make_chain(system, rng), "tool"
    vehicle = load_vehicle(system)
    return vehicle.model, vehicle.tool


def test_there_are_ten_thousand_states():
    assert STATES_EACH * len(CATEGORIES) * (len(VEHICLES) + len(CHAINS)) >= 10_000


@pytest.mark.parametrize("category", CATEGORIES)
@pytest.mark.parametrize("system", [*VEHICLES, *CHAINS])
def test_all_witnesses_agree(system, category, make_chain):
    rng = np.random.default_rng([CATEGORIES.index(category), (*VEHICLES, *CHAINS).index(system)])
    model, tool = model_and_tool(system, rng, make_chain)
    sizes = [STATES_EACH]
    if category == "inertias":
        sizes = [13] * 9 + [12]
    for size in sizes:
        if category == "inertias":
            model = randomized_inertias(model, rng)
        states = random_states(model.nv - 6, category, size, rng)
        assert_agreement(model, tool, states)


def assert_agreement(model, tool, states):
    recursion, matrix = recursion_and_matrix(LinkChain.from_model(model, tool), states)
    witness = pinocchio_answers(Multibody(model, tool), states)
    for a, b in itertools.combinations((recursion, matrix, witness), 2):
        for quantity in ("acceleration", "f", "tau", "u_dc"):
            difference = relative_difference(getattr(a, quantity), getattr(b, quantity))
            assert difference.max() < AGREEMENT, quantity


@pytest.mark.parametrize("tool_link", [0, 1, 2])
@pytest.mark.parametrize("joints", ["RRR", "RPR"])
def test_all_witnesses_agree_on_a_tool_before_the_last_link(joints, tool_link, make_chain):
    rng = np.random.default_rng([tool_link, len(joints)])
    model = make_chain(joints, rng, tool_link)
    assert_agreement(model, "tool", random_states(3, "external", 100, rng))


def test_a_dropped_coriolis_term_is_seen(make_chain, monkeypatch):
    rng = np.random.default_rng(0)
    model = make_chain("RPR", rng)
    right = kinematics.joint_linear_terms

    def single(chain, R, w, dtheta, ddtheta):
        return 0.5 * (right(chain, R, w, dtheta, ddtheta) + right(chain, R, 0 * w, dtheta, ddtheta))

    monkeypatch.setattr(kinematics, "joint_linear_terms", single)
    with pytest.raises(AssertionError, match="acceleration"):
        assert_agreement(model, "tool", random_states(3, "fast", 20, rng))


def test_the_witness_imports_nothing_of_the_paper_side():
    folder = Path(fullam.dynamics.multibody.__file__).parent
    paper = {"kinematics", "newton_euler", "matrix_system", "rotations", "paper_model"}
    for name in ("multibody", *sorted(paper)):
        imported = {
            part
            for node in ast.walk(ast.parse((folder / f"{name}.py").read_text(encoding="utf-8")))
            if isinstance(node, ast.ImportFrom)
            for part in [*(node.module or "").split("."), *(alias.name for alias in node.names)]
        }
        assert not imported & (paper if name == "multibody" else {"multibody"})
