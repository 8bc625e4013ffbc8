"""The same kernels traced by CasADi: exact derivatives, and C."""

import numpy as np
import pytest

from fullam.control.controllers import make_controller
from fullam.control.signals import Estimate, Target
from fullam.dynamics.recursion import (
    Chain,
    Joint,
    JointMotion,
    base_acceleration,
    gravity_in,
    place_joints,
)
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Spatial
from fullam.model.loading import load_vehicle
from fullam.numbers.records import flat, reader, record, size

casadi = pytest.importorskip("casadi", reason="derivatives need CasADi")

ROUNDING = 1e-12
"""Relative to the largest entry: CasADi's sine and its order of sums are its own."""

STEP, TRUNCATION = 1e-5, 1e-7
"""Of central differences, and what they are worth relative to the largest entry: the third
derivative times STEP^2, and rounding 1e-16 over STEP times numbers of up to 1e3."""


def symbols(kind):
    """A record of symbols, and the vector of them."""
    vector = casadi.SX.sym("x", size(kind))
    return reader(kind)(casadi.vertsplit(vector)), vector


def traced(answer, *vectors):
    return casadi.Function("traced", [*vectors], [casadi.vertcat(*flat(answer))])


def differences(function, x):
    """Central differences, column by column."""
    steps = STEP * np.eye(len(x))
    return np.stack([(function(x + h) - function(x - h)) / (2.0 * STEP) for h in steps], axis=1)


def close(found, expected, tolerance):
    expected = np.asarray(expected)
    scale = tolerance * np.abs(expected).max()
    np.testing.assert_allclose(np.asarray(found).reshape(expected.shape), expected, 0, scale)


@pytest.fixture(scope="module")
def law():
    return make_controller("dc-pid", load_vehicle("fullam"), wrench_bounds=(90.0,) * 6)


@pytest.fixture
def chain(law, rng):
    """The nominal chain with its arm in motion, Joint by Joint."""
    joints = [Joint(*joint) for joint in moving(law, rng)]
    return Chain(law.links, joints)


def moving(law, rng):
    joints = [None] * (len(law.links) - 1)
    motions = [JointMotion(*rng.normal(size=3).tolist()) for _ in joints]
    place_joints(law.links, motions, joints)
    return joints


def test_the_platforms_acceleration_and_its_derivative(chain, rng):
    """By attitude, angular velocity and wrench."""

    def acceleration(attitude, w, wrench):
        R = rotation_matrix(attitude)
        return base_acceleration(chain, w, gravity_in(R, 9.81), wrench)

    def numbers(x):
        parts = tuple(x[:4]), tuple(x[4:7]), record(Spatial, x[7:])
        return np.array([*flat(acceleration(*parts))])

    x = rng.normal(size=13)
    x[:4] /= np.linalg.norm(x[:4])
    vector = casadi.SX.sym("x", 13)
    parts = casadi.vertsplit(vector)
    answer = acceleration(tuple(parts[:4]), tuple(parts[4:7]), reader(Spatial)(parts[7:]))
    function = traced(answer, vector)
    close(function(x), numbers(x), ROUNDING)
    jacobian = casadi.Function("j", [vector], [casadi.jacobian(function(vector), vector)])
    close(jacobian(x), differences(numbers, x), TRUNCATION)


def test_a_law_and_its_derivative(law, chain, rng):
    """dc-PID's wrench by the estimate: what a controller that looks ahead wants to know."""
    kernels, numbers = law.kernels, law.numbers()
    target = record(Target, np.concatenate([[0.2, 0.1, 0.3, 0.0, 0.0, 0.0, 1.0], np.zeros(12)]))
    estimate, vector = symbols(Estimate)
    memory = kernels.start(numbers, chain, estimate)

    def command(estimate):
        return kernels.command(numbers, chain, estimate, target, memory)[0].wrench

    function = traced(command(estimate), vector)

    def plain(x):
        return np.array([*flat(command(record(Estimate, x)))])

    x = 0.1 * rng.normal(size=size(Estimate))
    x[3:7] = rng.normal(size=4) + np.array([0.0, 0.0, 0.0, 5.0])
    x[3:7] /= np.linalg.norm(x[3:7])
    assert np.abs(plain(x)).max() < 89.0, "within its bounds, where the law is smooth"
    close(function(x), plain(x), ROUNDING)
    jacobian = casadi.Function("j", [vector], [casadi.jacobian(function(vector), vector)])
    close(jacobian(x), differences(plain, x), TRUNCATION)


def test_a_law_beyond_its_bounds_takes_the_other_side_of_the_select(law, chain):
    kernels, numbers = law.kernels, law.numbers()
    target = record(Target, np.concatenate([[50.0, 0, 0, 0, 0, 0, 1], np.zeros(12)]))
    estimate, vector = symbols(Estimate)
    memory = kernels.start(numbers, chain, estimate)
    answer = kernels.command(numbers, chain, estimate, target, memory)[0].wrench
    x = np.concatenate([[0, 0, 0, 0, 0, 0, 1], np.zeros(6)])
    assert float(traced(answer, vector)(x)[0]) == 90.0


def test_c_of_a_law(law, chain, tmp_path):
    """A function of plain C, no library beside libm."""
    kernels, numbers = law.kernels, law.numbers()
    target, target_vector = symbols(Target)
    estimate, estimate_vector = symbols(Estimate)
    memory = kernels.start(numbers, chain, estimate)
    answer = kernels.command(numbers, chain, estimate, target, memory)[0].wrench
    code = casadi.CodeGenerator("law")
    code.add(traced(answer, estimate_vector, target_vector))
    code.generate(f"{tmp_path}/")
    text = (tmp_path / "law.c").read_text()
    assert "int traced(" in text
    included = {line for line in text.splitlines() if line.startswith("#include")}
    assert included == {"#include <math.h>"}
