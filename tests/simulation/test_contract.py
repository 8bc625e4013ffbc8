"""Whatever is registered flies under both drivers, and machine code gives the bits of Python.

Every law, estimator, integrator, vehicle and plant meets every other one at least once. A flight is
flown by the kernels in plain Python, by scalar machine code and in lanes: the same bits; and by the
Python driver, where Pinocchio is the dynamics and the law's model: the same to rounding.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, fields, replace
from functools import cache, partial

import numpy as np
import pytest
from altered_vehicles import with_joint, without_arm
from same_flights import assert_same_bits, fly_interpreted, fly_scalar

import fullam
from fullam.control.controllers import controller_names
from fullam.control.estimators import estimator_names
from fullam.dynamics.integrators import INTEGRATORS
from fullam.model.loading import load_vehicle, vehicle_names
from fullam.model.wrench_axes import controllable_axes
from fullam.simulation.many import fly_many
from fullam.simulation.motions.arm_motion import HoldArm, SineRate
from fullam.simulation.plants.named import PLANTS
from fullam.simulation.plants.settings import IN_KERNELS
from fullam.simulation.scenarios.scenario import AXES
from fullam.simulation.simulate import fly_by_python, prepare

PERIODS, MANY_PERIODS = 100, 1000
"""Control periods of each flight, and of those that are flown long."""

LONG = 6
"""Every so manieth case is flown long."""

ROUNDING = 1e-9
"""Relative to a column's largest entry (at least 1): rounding of other sums of the same dynamics,
fed back through the loop; saturated flights have a null space of 1e-8 in the allocation."""

SEEDS = range(3, 11)


def rotors(number):
    def design():
        return fullam.design_vehicle("fullam", f"{number} rotors", rotor_count=number)

    return design


def one_rotor_more():
    """31 rotors, the most that a search of the active set takes: an uneven number."""
    vehicle = fullam.design_vehicle("fullam", "31 rotors", rotor_count=30)
    r = vehicle.rotors
    columns = {f.name: getattr(r, f.name) for f in fields(r)}
    columns = {name: c for name, c in columns.items() if isinstance(c, np.ndarray)}
    last = {name: np.append(column, column[:1], axis=0) for name, column in columns.items()}
    last["positions"][-1], last["axes"][-1] = (0.0, 0.0, 0.05), (0.0, 0.0, 1.0)
    return replace(vehicle, rotors=replace(r, names=(*r.names, "middle"), **last))


MADE = {
    "no arm": without_arm,
    "sliding": partial(with_joint, "joint_2", "prismatic", name="sliding"),
    "4 rotors": rotors(4),
    "31 rotors": one_rotor_more,
}

LAWS = (
    *controller_names(),
    *(f"{law}/previous_wrench" for law in ("dc-pid", "dc-pid-plus")),
)
"""Names, and what else changes the kernels that are flown."""

CHOICES = {
    "law": LAWS,
    "estimator": estimator_names(),
    "integrator": tuple(sorted(INTEGRATORS)),
    "vehicle": (*vehicle_names(), *MADE),
    "plant": tuple(name for name in PLANTS if name not in IN_KERNELS),
}


@cache
def vehicle_of(name):
    return MADE[name]() if name in MADE else load_vehicle(name)


@dataclass(frozen=True)
class Case:
    law: str
    estimator: str
    integrator: str
    vehicle: str
    plant: str
    number: int = 0

    def __str__(self):
        return "-".join((self.law, self.estimator, self.integrator, self.vehicle, self.plant))

    def plan(self):
        """A step with the arm in motion, all sensors late and noisy; every other time too far."""
        vehicle, far = vehicle_of(self.vehicle), self.number % 2 == 1
        axes = tuple(a for a, on in zip(AXES, controllable_axes(vehicle.rotors), strict=True) if on)
        tilt = (6.0, -4.0, 5.0) if len(axes) == 6 else (0.0, 0.0, 0.0)
        periods = MANY_PERIODS if self.number % LONG == 0 else PERIODS
        scenario = fullam.Scenario(
            "contract",
            initial_position=(0.0, 0.0, 2.0),
            reference=fullam.Step((0.3, -0.2, 2.4 if not far else 6.0), tilt, at=0.004),
            arm_motion=SineRate(joint=1, rate=0.3, frequency=9.0) if vehicle.n_arm else HoldArm(),
            duration=0.002 * (periods - 1),
            axes=axes,
        )
        law, _, compensation = self.law.partition("/")
        simulation = fullam.SimulationSettings(
            control_period=0.002,
            pose_period=0.004,
            delay=0.004,
            integrator=self.integrator,
            estimator=self.estimator,
            plant=self.plant,
            max_attitude_error_deg=179.0,
        )
        return prepare(
            scenario,
            law,
            vehicle=vehicle,
            seed=SEEDS[2],
            settings={"compensation": compensation} if compensation else {},
            shaping={"max_acceleration": None} if far else {},
            simulation=simulation,
        )


def pairs_of(choice):
    """Two choices each that meet in a case."""
    return {*itertools.combinations(zip(CHOICES, choice, strict=True), 2)}


def covering():
    """Cases in which each two choices meet; greedily, so it depends on nothing but the names."""
    every = list(itertools.product(*CHOICES.values()))
    wanted, cases = set().union(*map(pairs_of, every)), []
    while wanted:
        fresh = [len(wanted & pairs_of(choice)) for choice in every]
        best = every[fresh.index(max(fresh))]
        wanted -= pairs_of(best)
        cases.append(Case(*best, number=len(cases)))
    return cases


CASES = covering()


def assert_close(a, b):
    assert a.outcome == b.outcome
    assert a.columns.keys() == b.columns.keys()
    for name in a.columns:
        scale = max(1.0, np.abs(b.columns[name]).max(initial=0.0))
        np.testing.assert_allclose(
            1.0 * a.columns[name], 1.0 * b.columns[name], 0, ROUNDING * scale, err_msg=name
        )


def test_each_two_choices_meet():
    met = [pairs_of((c.law, c.estimator, c.integrator, c.vehicle, c.plant)) for c in CASES]
    sizes = [len(choices) for choices in CHOICES.values()]
    pairs = sum(a * b for a, b in itertools.combinations(sizes, 2))
    assert len(set().union(*met)) == pairs
    assert sum(case.number % LONG == 0 for case in CASES) >= 7


@pytest.mark.parametrize("case", CASES, ids=str)
def test_the_same_bits_whoever_flies_and_pinocchio_agrees(case):
    plan = case.plan()
    lanes = list(fly_many(plan, SEEDS, threads=1))
    scalar = list(fly_scalar(plan, SEEDS))
    for a, b in zip(lanes, scalar, strict=True):
        assert_same_bits(a, b)
    assert_same_bits(fly_interpreted(plan), scalar[SEEDS.index(plan.seed)])
    assert_close(fly_by_python(plan), scalar[SEEDS.index(plan.seed)])
    if case.number % 2:
        assert any(run.saturated.any() for run in scalar), "a case that is meant to saturate"
