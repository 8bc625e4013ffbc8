"""Every law's kernels: the same bits in Python, scalar machine code and eight lanes.

And, to rounding, the numbers of the law that Python flies, whose model is Pinocchio.
"""

from typing import Any, NamedTuple

import numpy as np
import pytest

from fullam.control.controllers import controller_names, make_controller
from fullam.control.law import CommandView, InformView, KernelLaw, command_stage, inform_stage
from fullam.control.signals import Command, Delivery, Estimate, Target
from fullam.dynamics.recursion import Joint, JointMotion, place_joints
from fullam.model.loading import load_vehicle
from fullam.model.vehicle import Vehicle
from fullam.numbers.kernel import kernel
from fullam.numbers.program import Stage, program
from fullam.numbers.records import Rows, columns, flat, size

PERIODS, LANES, PERIOD = 200, 8, 0.01
PYTHON_LANES = (0, 3)
"""Lanes that Python flies too: a calm one and one far from its target."""

PREVIOUS = {"compensation": "previous_wrench"}
TOUCHING = {"engage_at": 0.5, "tare": 0.3, "release_at": 1.5}
CASES: list[tuple[str, dict[str, Any]]] = [
    *((name, {}) for name in controller_names()),
    ("dc-pid", PREVIOUS),
    ("hybrid-force", TOUCHING),
    ("admittance", {**PREVIOUS, **TOUCHING, "stiffness": 40.0}),
    ("dc-pid-plus", {**PREVIOUS, "wrench_bounds": (4.0, 4.0, 25.0, 0.5, 0.5, 0.5)}),
]

LINK = """<link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>
  <inertia ixx="{ixx}" ixy="0.001" ixz="0" iyy="0.02" iyz="-0.0005" izz="0.025"/>
  </inertial></link>"""
JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
  <origin xyz="0.02 -0.03 -0.08" rpy="0.3 -0.2 0.5"/><axis xyz="0.36 0.48 0.8"/>
  <limit effort="9" velocity="9" lower="-1" upper="1"/></joint>"""
DEFINITION = {
    "name": "slider",
    "urdf": "slider.urdf",
    "platform": "base",
    "tool": "base",
    "arm": [],
    "rotor_defaults": {"k_f": 1e-5, "k_tau": 1e-7, "max_speed": 1000.0, "lag": 0.02},
    "rotor": [
        {"name": "one", "position": [0.3, 0.0, 0.0], "axis": [0.0, 0.0, 1.0], "spin": 1},
        {"name": "two", "position": [0.0, 0.3, 0.0], "axis": [0.0, 0.6, 0.8], "spin": -1},
    ],
}


def little_vehicle(kinds):
    """A platform with its centre of mass off the origin, and joints of these kinds."""
    names = [f"joint_{i}" for i in range(len(kinds))]
    parts = [LINK.format(name="base", com="0.01 -0.02 0.03", mass=1.5, ixx=0.02)]
    for i, kind in enumerate(kinds):
        child = f"link_{i}"
        parts.append(LINK.format(name=child, com="0.03 0.01 -0.05", mass=0.3, ixx=0.015))
        parent = f"link_{i - 1}" if i else "base"
        parts.append(JOINT.format(name=names[i], kind=kind, parent=parent, child=child))
    urdf = f'<robot name="slider">{"".join(parts)}</robot>'
    return Vehicle.from_definition({**DEFINITION, "arm": names}, urdf)


@pytest.fixture(scope="module", params=["fullam", "no arm", "sliding"])
def vehicle(request):
    if request.param == "fullam":
        return load_vehicle("fullam")
    kinds = ["revolute", "prismatic", "revolute"] if request.param == "sliding" else []
    return little_vehicle(kinds)


class Told(NamedTuple):
    """What is told in each period, and what was commanded."""

    targets: Any
    estimates: Any
    deliveries: Any
    target: Any
    estimate: Any
    delivery: Any
    command: Any
    commands: Any


@kernel
def tell(view, k):
    """This period's target and estimate, and what will have become of its command."""
    view.target[0] = view.targets[k]
    view.estimate[0] = view.estimates[k]
    view.delivery[0] = view.deliveries[k]


@kernel
def note(view, k):
    """What was commanded."""
    view.commands[k] = view.command[0]


class Flight(NamedTuple):
    """Inputs of eight flights, and the arm's motion, which they share."""

    motions: list[list[JointMotion]]
    targets: Rows
    estimates: np.ndarray
    deliveries: np.ndarray


def unit(x):
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def flight(vehicle):
    """Smooth targets, estimates about them, near for most lanes; one period in ten saturated."""
    rng = np.random.default_rng(7)
    t = PERIOD * np.arange(PERIODS)
    phase = rng.uniform(0.0, 6.0, vehicle.n_arm)
    swing = [
        0.4 * np.array([np.sin(3 * t + f), 3 * np.cos(3 * t + f), -9 * np.sin(3 * t + f)])
        for f in phase
    ]
    motions = [[JointMotion(*map(float, one[:, k])) for one in swing] for k in range(PERIODS)]

    targets = Rows.empty(Target, PERIODS)
    wave = np.sin(np.outer(t, rng.uniform(0.5, 2.0, 19)) + rng.uniform(0.0, 6.0, 19))
    targets.array[:] = 0.3 * wave
    pose = columns(Target)["pose"]
    targets.array[:, pose][:, 3:] = unit(0.3 * wave[:, 3:7] + [0.0, 0.0, 0.0, 1.0])

    far = np.where(np.arange(LANES) % 4 == 3, 1.0, 0.02)  # two lanes are far off
    near = rng.normal(size=(PERIODS, size(Estimate), LANES)) * far
    moving = np.concatenate([targets.array[:, pose], targets["velocity"]], axis=1)
    estimates = moving[:, :, None] + near
    estimates[:, 3:7] = unit(estimates[:, 3:7])
    weight = vehicle.mass * vehicle.gravity
    deliveries = rng.normal(size=(PERIODS, size(Delivery), LANES))
    deliveries[:, 2] += weight
    saturated = rng.uniform(size=(PERIODS, 1, LANES)) < 0.1
    deliveries[:, columns(Delivery)["saturated"]] = saturated
    return Flight(motions, targets, estimates, deliveries)


def fly(law, inputs, lanes=0, lane=0, compiled=True):
    """Commands of all periods and the memory left, (periods, 18, ...) and (memory, ...)."""
    pick = (lambda a: a) if lanes else (lambda a: a[..., lane])
    joints = [[None] * len(m) for m in inputs.motions]
    for motions, placed in zip(inputs.motions, joints, strict=True):
        place_joints(law.links, motions, placed)
    flown = (
        Rows.of(Joint, joints)
        if inputs.motions[0]
        else Rows.empty(Joint, PERIODS, 0)  # an arm of no joints
    )
    estimate, delivery, command, memory = (
        Rows.empty(kind, 1, lanes=lanes) for kind in (Estimate, Delivery, Command, law.Memory)
    )
    commands = Rows.empty(Command, PERIODS, lanes=lanes)
    numbers, each = Rows.of(type(law._numbers), [law._numbers]), Rows(float, [[1.0]])
    target = Rows.empty(Target, 1)
    told = Told(
        inputs.targets,
        Rows(Estimate, pick(inputs.estimates), lanes),
        Rows(Delivery, pick(inputs.deliveries), lanes),
        target,
        estimate,
        delivery,
        command,
        commands,
    )
    shown = numbers, law.link_rows, flown, each
    stages = [
        Stage(tell, told),
        Stage(
            command_stage(law.kernels),
            CommandView(*shown, target, estimate, memory, command),
        ),
        Stage(inform_stage(law.kernels), InformView(*shown, estimate, memory, delivery)),
        Stage(note, told),
    ]
    program(stages, compiled).run(0, PERIODS)
    return commands.array, memory.array[0]


@pytest.mark.parametrize(("name", "settings"), CASES)
def test_python_scalar_code_and_lanes_give_the_same_bits(vehicle, name, settings):
    """Equality, not closeness: the kernels have no arithmetic that could round otherwise."""
    law = make_controller(name, vehicle, PERIOD, **settings)
    assert isinstance(law, KernelLaw)
    inputs = flight(vehicle)
    commands, memory = fly(law, inputs, LANES)
    assert np.all(np.isfinite(commands))
    assert np.all(commands[:, :6].std(axis=0) > 1e-3)  # something is going on in every lane
    for lane in range(LANES):
        alone = fly(law, inputs, lane=lane)
        np.testing.assert_array_equal(commands[..., lane], alone[0])
        np.testing.assert_array_equal(memory[..., lane], alone[1])
    for lane in PYTHON_LANES:
        plain = fly(law, inputs, lane=lane, compiled=False)
        np.testing.assert_array_equal(commands[..., lane], plain[0])
        np.testing.assert_array_equal(memory[..., lane], plain[1])


@pytest.mark.parametrize(("name", "settings"), CASES)
def test_the_kernels_fly_what_python_flies(vehicle, name, settings):
    """The law on its own model, Pinocchio's for most, against its kernels on the recursion.

    Rounding of either grows over 200 periods by what integrators and observer remember: relative.
    """
    law = make_controller(name, vehicle, PERIOD, **settings)
    inputs = flight(vehicle)
    targets = inputs.targets.to_list()
    for lane in PYTHON_LANES:
        expected, _ = fly(law, inputs, lane=lane, compiled=False)
        estimates = Rows(Estimate, inputs.estimates[..., lane]).to_list()
        deliveries = Rows(Delivery, inputs.deliveries[..., lane]).to_list()
        law.forget()
        found = []
        for k in range(PERIODS):
            chain = law.chain(inputs.motions[k])
            found.append([*flat(law.command(chain, estimates[k], targets[k]))])
            if deliveries[k].saturated:
                law.inform(deliveries[k])
        scale = np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * scale)
