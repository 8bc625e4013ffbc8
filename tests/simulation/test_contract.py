"""Whatever is registered flies under both drivers, and machine code gives the bits of Python.

Every law, estimator, integrator, vehicle and plant meets every other one at least once. A flight is
flown by the kernels in plain Python, by scalar machine code and in lanes: the same bits; and by the
Python driver, where Pinocchio is the dynamics and the law's model: the same to rounding.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, fields, replace
from functools import cache

import numpy as np
import pytest

import fullam
from fullam.control.controllers import controller_names
from fullam.control.estimators import estimator_names
from fullam.dynamics.integrators import INTEGRATORS
from fullam.model.loading import load_vehicle, vehicle_names
from fullam.model.vehicle import Vehicle
from fullam.model.wrench_axes import controllable_axes
from fullam.numbers.program import program
from fullam.simulation.arm_motion import HoldArm, SineRate
from fullam.simulation.block import Block
from fullam.simulation.fused import Fused, run_of
from fullam.simulation.many import fly_many
from fullam.simulation.plant_settings import IN_KERNELS
from fullam.simulation.plants import PLANTS
from fullam.simulation.scenario import AXES
from fullam.simulation.simulate import fly_by_python, prepare
from fullam.simulation.tables import Tables

PERIODS, MANY_PERIODS = 100, 1000
"""Control periods of each flight, and of those that are flown long."""

LONG = 6
"""Every so manieth case is flown long."""

ROUNDING = 1e-9
"""Relative to a column's largest entry (at least 1): rounding of other sums of the same dynamics,
fed back through the loop; saturated flights have a null space of 1e-8 in the allocation."""

SEEDS = range(3, 11)


def without_arm():
    """The default platform with its arm held: one body."""
    vehicle = load_vehicle("fullam")
    definition = {k: v for k, v in vehicle.definition.items() if k not in ("arm", "design")}
    held = dict.fromkeys(vehicle.arm_joints, 0.2)
    return Vehicle.from_definition(definition | {"name": "no arm", "held": held}, vehicle.urdf)


def sliding():
    """The default vehicle with a second joint that slides."""
    vehicle = load_vehicle("fullam")
    start = vehicle.urdf.index('<joint name="joint_2"')
    end = vehicle.urdf.index("</joint>", start)
    joint = vehicle.urdf[start:end].replace('type="revolute"', 'type="prismatic"')
    urdf = vehicle.urdf[:start] + joint + vehicle.urdf[end:]
    return Vehicle.from_definition(vehicle.definition | {"name": "sliding"}, urdf)


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
    "sliding": sliding,
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


def fly_interpreted(plan):
    """The fused driver's kernels, called by plain Python."""
    block = Block(Tables(plan))
    block.load(plan)
    block.begin()
    stages, last = block.stages(), block.tables.periods - 1
    program(list(stages.values()), compiled=False).run(0, last)
    del stages["move"]
    program(list(stages.values()), compiled=False).run(last, last + 1)
    return run_of(block, plan)


def fly_scalar(plan, seeds):
    fused = Fused(Tables(plan))
    for seed in seeds:
        own = plan.with_seed(seed)
        fused.block.load(own)
        fused.fly()
        yield run_of(fused.block, own)


def assert_same_bits(a, b):
    assert a.columns.keys() == b.columns.keys()
    for name in a.columns:
        np.testing.assert_array_equal(a.columns[name], b.columns[name], err_msg=name)
    assert a.metadata == b.metadata


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
