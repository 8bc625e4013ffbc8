"""The last link meets the world: contact and payload, whoever flies."""

import numpy as np
import pinocchio as pin
import pytest

import fullam
from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.recursion import Link, shift_inertia
from fullam.dynamics.so3 import rotation_matrix
from fullam.exceptions import ScenarioError
from fullam.model.chain import LinkChain
from fullam.model.loading import load_vehicle
from fullam.numbers.records import Rows, record
from fullam.numbers.vectors import IDENTITY, ZERO
from fullam.simulation import touching
from fullam.simulation.fused import fly as fly_fused
from fullam.simulation.many import fly_many
from fullam.simulation.payload import Payload, joined
from fullam.simulation.servo_motion import Contact, servo_stage
from fullam.simulation.simulate import fly_by_python, prepare
from fullam.simulation.touching import Box, Plane, Sphere, Surface, Tool, World, tool_contact

VEHICLE = load_vehicle("fullam")

SOFT = Surface(3e4, 0.5, 0.4, 1e-3)
UP = (0.0, 0.0, 1.0)


def tool_of(vehicle, radius=0.01):
    """The vehicle's tool, in the axes of the last link's row."""
    chain = LinkChain.from_vehicle(vehicle)
    assert chain.tool_link == chain.n
    return Tool(tuple((LinkRows.of(chain).frames[-1].T @ chain.tool_P).tolist()), radius)


def world(tool, planes=(), spheres=(), boxes=()):
    kinds = ((Tool, [tool]), (Plane, planes), (Sphere, spheres), (Box, boxes))
    return World(*(Rows.of(k, list(r)) if r else Rows.empty(k, 0) for k, r in kinds))


def lists(view):
    return World(*(rows.to_list() for rows in view))


def turned_box(half, center=ZERO):
    R = rotation_matrix((0.1, -0.3, 0.2, np.sqrt(1.0 - 0.14)))
    return Box(center, R, half, SOFT)


def test_a_box_is_as_deep_as_its_nearest_point_says():
    """Against a search of the surface for the nearest point."""
    box, rng = turned_box((0.1, 0.2, 0.3), (0.3, 0.1, 2.0)), np.random.default_rng(3)
    R, half = np.reshape(box.rotation, (3, 3)), np.array(box.half)
    for local in rng.uniform(-0.5, 0.5, (200, 3)):
        p = np.array(box.center) + R @ local
        depth, normal = touching.box_depth(box, tuple(p.tolist()), 0.02)
        inside = (np.abs(local) < half).all()
        if inside:
            expected = 0.02 + (half - np.abs(local)).min()
        else:
            expected = 0.02 - np.linalg.norm(local - np.clip(local, -half, half))
        assert depth == pytest.approx(expected, abs=1e-12)
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        # A step along the normal takes as much of the depth.
        further = tuple((p + 1e-6 * np.array(normal)).tolist())
        taken = depth - touching.box_depth(box, further, 0.02)[0]
        assert taken == pytest.approx(1e-6, rel=1e-4)


def test_contact_pushes_out_pulls_at_nothing_and_rubs():
    force = touching.contact_force(SOFT, 1e-3, UP, (0.0, 0.0, 0.0))
    assert force == pytest.approx((0.0, 0.0, 3e4 * 1e-3**1.5))
    assert touching.contact_force(SOFT, -1e-3, UP, (1.0, 0.0, -1.0)) == (0.0, 0.0, 0.0)
    fleeing = touching.contact_force(SOFT, 1e-3, UP, (0.0, 0.0, 5.0))
    assert fleeing == (0.0, 0.0, 0.0)
    hit = touching.contact_force(SOFT, 1e-3, UP, (0.0, 0.0, -1.0))
    assert hit[2] == pytest.approx(1.5 * force[2])
    rubbed = touching.contact_force(SOFT, 1e-3, UP, (0.1, 0.0, 0.0))
    assert rubbed[0] == pytest.approx(-0.4 * force[2], rel=1e-4)
    centre = touching.sphere_depth(Sphere(ZERO, 0.1, SOFT), (0.0, 0.0, 0.0), 0.01)
    assert np.isfinite([centre[0], *centre[1]]).all()


BODIES = {
    "plane": {"planes": [Plane((0.0, 0.0, 1.2), UP, SOFT)]},
    "sphere": {"spheres": [Sphere((0.2, 0.2, 0.2), 1.1, SOFT)]},
    "box": {"boxes": [turned_box((1.0, 1.0, 0.5), (0.2, 0.2, 0.7))]},
}


@pytest.mark.parametrize("name", BODIES)
def test_energy_never_grows_in_a_bounce(free_of, free_joint, name):
    move = servo_stage("midpoint", contact=tool_contact)
    free = free_of(VEHICLE, "midpoint", 2.5e-4, free_joint, move=move)
    free.view = free.view._replace(world=lists(world(tool_of(VEHICLE), **BODIES[name])))
    energies, touched = [free.energy], 0
    for k in range(2400):
        before = free.momentum[2]
        free.move(free.view, k)
        energies.append(free.energy)
        weight = pin.computeTotalMass(free.model) * 9.81
        touched += free.momentum[2] - before > -0.5 * weight * free.step
    assert touched > 20, "it must have touched something"
    # The elastic energy of the contact comes back, so count what is there between touches.
    assert energies[-1] < energies[0] - 1e-3
    assert max(energies) < energies[0] + 1e-6 * abs(energies[0])


def scenario():
    return fullam.Scenario(
        "touch",
        initial_position=(0.0, 0.0, 2.0),
        initial_arm_deg=(-90.0, 0.0, 0.0, 0.0),
        reference=fullam.Step((0.0, 0.0, 2.0)),
        duration=0.6,
    )


def reaching():
    """A hover whose hanging tool begins 2 mm deep in a floor, and which picks up a brick."""
    flown, vehicle = scenario(), VEHICLE
    data = vehicle.model.createData()
    q = vehicle.neutral(np.radians((-90.0, 0.0, 0.0, 0.0)))
    q[2] = 2.0
    pin.framesForwardKinematics(vehicle.model, data, q)
    height = data.oMf[vehicle.model.getFrameId(vehicle.tool)].translation[2]
    floor = Plane((0.0, 0.0, height - 0.008), UP, SOFT)
    plan = prepare(flown, "dc-pid-plus", plant="servo", calm=True, vehicle=vehicle)
    plan = plan.with_contact(Contact(tool_contact, world(tool_of(vehicle), [floor])))
    brick = Payload(20.0, 50.0, 0.1, (0.0, 0.0, 0.03), (1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4))
    return plan.with_payloads(brick)


def test_contact_and_payload_fly_the_same_under_all_drivers():
    plan = reaching()
    fused, python = fly_fused(plan), fly_by_python(plan)
    for name, column in fused.columns.items():
        # Rounding of Pinocchio's sums, through the loop and a stiff contact.
        np.testing.assert_allclose(1.0 * python.columns[name], 1.0 * column, 0, 1e-8, err_msg=name)
    for run in fly_many(plan, range(8), threads=1):
        for name, column in fused.columns.items():
            np.testing.assert_array_equal(run.columns[name], column, err_msg=name)
    assert fused.pose[15, 2] > 2.0001, "the floor pushes the tool up"
    # 2 mm deep at first, by the tool's radius less the gap.
    assert fused.contact_wrench[0, 2] == pytest.approx(3e4 * 0.002**1.5, rel=1e-6)
    empty = fly_fused(plan.with_payloads())
    np.testing.assert_array_equal(empty.pose[:21], fused.pose[:21])
    assert fused.pose[30, 2] < empty.pose[30, 2] - 3e-4, "the brick weighs"


def test_a_payload_is_a_rigid_body_fixed_to_the_link():
    link = Link(0.05, (0.01, 0.0, 0.02), (1e-4, 1e-5, 0.0, 2e-4, 0.0, 1e-4), IDENTITY, ZERO, 0.0)
    brick = Payload(0.0, 1.0, 0.2, (0.0, 0.03, 0.05), (3e-4, 0.0, 0.0, 2e-4, 0.0, 1e-4))
    both = joined(link, brick)
    first = 0.05 * np.array(link.com) + 0.2 * np.array(brick.com)
    np.testing.assert_allclose(both.com, first / 0.25)
    about = [shift_inertia(b.inertia, b.mass, b.com) for b in (link, brick, both)]
    np.testing.assert_allclose(np.add(about[0], about[1]), about[2], atol=1e-12)
    assert record(Link, [0.0] * 23).mass == 0.0


def test_joints_on_rails_touch_nothing():
    plan = prepare(scenario(), calm=True)
    brick = Payload(0.0, 9.0, 0.1, ZERO, (1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4))
    touched = plan.with_contact(Contact(tool_contact, world(tool_of(VEHICLE))))
    for other, word in ((plan.with_payloads(brick), "payloads"), (touched, "contact")):
        with pytest.raises(ScenarioError, match=word):
            fly_by_python(other)
