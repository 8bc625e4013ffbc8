"""A third witness: MuJoCo reads the same URDF and shares no code with the other two.

What its model has beside ours, and what is done about it:
- it welds the root link to the world: a free joint is added through its spec API;
- it would add mass for shapes and balance inertias: both are switched off, meshes are stripped;
- it reads `<dynamics damping friction>` (hextilt: 0.1 each) as torques at the joints. Joints move
  as prescribed here, so they change what the servo must give and not the platform's motion or the
  wrench through joint 1; a test shows the difference to be exactly the damping torque;
- armature (rotor inertia of a gearbox) is zero in these URDFs, and would also stay inside the
  joint;
- it has joint limits and contacts: constraints are switched off, since prescribed joints need none;
- its free joint has linear velocity in world axes and angular velocity in body axes;
- it integrates with its own Runge-Kutta on quaternions: the two trajectories differ by their
  discretisation, of fourth order in the step, which the last tests measure.
"""

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pytest
from scipy.optimize import nnls

from fullam.analysis.random_states import CATEGORIES, random_states
from fullam.dynamics.integrators import half_steps, integrator
from fullam.dynamics.multibody import Multibody, rotation_of, world_acceleration
from fullam.dynamics.spatial import Pose, Spatial
from fullam.numbers.records import flat, record
from fullam.numbers.vectors import ZERO

COUNT = 40

AGREEMENT = 1e-11
"""Relative. MuJoCo computes in doubles about the vehicle's centre of mass, up to 17 m from the
world's origin: rounding of 1e-15 there, times mass over the smallest inertia, about 1e3."""

DURATION = 5.0
STEPS = (1000, 2000)
"""Steps over the flight: 5 ms and 2.5 ms."""

ORDER_4 = 11.0
"""By how much halving the step must shrink the difference: 16, less the next order's share."""

TRAJECTORY = 1e-5
"""Difference in pose and velocity after 5 s in steps of 5 ms [m, m/s, rad, rad/s]: h^4 times
derivatives of (3 rad/s)^5 over five seconds gives 6e-10 * 250 * 5 = 8e-7; room of a decade."""


class MuJoCo:
    """The vehicle in MuJoCo, with joints that move as prescribed."""

    def __init__(self, vehicle):
        robot = ET.fromstring(vehicle.urdf)
        for link in robot.findall("link"):
            for tag in ("visual", "collision"):
                for element in link.findall(tag):
                    link.remove(element)
        options = ET.SubElement(robot, "mujoco")
        ET.SubElement(
            options,
            "compiler",
            fusestatic="false",
            inertiafromgeom="false",
            balanceinertia="false",
        )
        spec = mujoco.MjSpec.from_string(ET.tostring(robot, encoding="unicode"))
        spec.body(vehicle.platform).add_freejoint()
        spec.option.gravity = vehicle.model.gravity.linear
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.first_link = self.model.joint(vehicle.arm_joints[0]).bodyid[0]
        self._M = np.empty((self.model.nv, self.model.nv))

    def place(self, q, v):
        """Take over Pinocchio's coordinates."""
        self.data.qpos[:] = np.concatenate([q[:3], q[6:7], q[3:6], q[7:]])
        self.data.qvel[:] = np.concatenate([rotation_of(q) @ v[:3], v[3:]])

    def coordinates(self):
        """Configuration and velocity in Pinocchio's convention."""
        x = self.data.qpos
        q = np.concatenate([x[:3], x[4:7], x[3:4], x[7:]])
        return q, np.concatenate([rotation_of(q).T @ self.data.qvel[:3], self.data.qvel[3:]])

    def base_acceleration(self, wrench_A, ddtheta):
        """Free-joint acceleration from MuJoCo's mass matrix and bias at the present state."""
        mujoco.mj_fullM(self.model, self.data, self._M)
        R = self.data.xmat[1].reshape(3, 3)
        force = np.concatenate([R @ wrench_A[:3], wrench_A[3:]])
        right = force - self.data.qfrc_bias[:6] - self._M[:6, 6:] @ ddtheta
        return np.linalg.solve(self._M[:6, :6], right)

    def joint_one_wrench(self, qacc):
        """Wrench of the platform on link 1, world axes, at the origin of {M_1}."""
        self.data.qacc[:] = qacc
        mujoco.mj_rnePostConstraint(self.model, self.data)
        body = self.first_link
        moment, force = np.split(self.data.cfrc_int[body], 2)
        com = self.data.subtree_com[self.model.body_rootid[body]]
        return force, moment + np.cross(com - self.data.xpos[body], force)


@pytest.fixture(scope="module")
def engine(vehicle):
    return MuJoCo(vehicle)


def test_masses_and_joints_are_those_of_the_vehicle(vehicle, engine):
    assert engine.model.body_mass.sum() == pytest.approx(vehicle.mass, rel=1e-12)
    names = [engine.model.joint(k).name for k in range(1, engine.model.njnt)]
    assert tuple(names) == vehicle.arm_joints
    assert not engine.model.dof_armature.any()


@pytest.mark.parametrize("category", ["ordinary", "fast", "singular", "stretched"])
def test_accelerations_and_joint_one_wrench_agree(vehicle, engine, category):
    rng = np.random.default_rng(CATEGORIES.index(category))
    states = random_states(vehicle.n_arm, category, COUNT, rng)
    witness = Multibody(vehicle)
    for q, v, ddtheta, wrench_A in zip(
        states.q, states.v, states.ddtheta, states.wrench_A, strict=True
    ):
        a_A = witness.base_acceleration(q, v, ddtheta, wrench_A)
        expected = world_acceleration(q, v, a_A)
        engine.place(q, v)
        mujoco.mj_forward(engine.model, engine.data)
        found = engine.base_acceleration(wrench_A, ddtheta)
        in_world = np.concatenate([found[:3], rotation_of(q) @ found[3:]])
        assert np.linalg.norm(in_world - expected) < AGREEMENT * np.linalg.norm(expected)
        f, tau = witness.joint_wrenches(q, v, np.concatenate([a_A, ddtheta]))
        force, moment = engine.joint_one_wrench(np.concatenate([found, ddtheta]))
        assert np.linalg.norm(force - f[0]) < AGREEMENT * np.linalg.norm(f[0])
        assert np.linalg.norm(moment - tau[0]) < AGREEMENT * np.linalg.norm(tau[0])


def test_damping_stays_inside_the_joints(vehicle, engine):
    """MuJoCo's inverse dynamics asks for damping * rate more at the joints, nothing more below."""
    witness = Multibody(vehicle)
    states = random_states(vehicle.n_arm, "ordinary", COUNT, np.random.default_rng(9))
    damping = engine.model.dof_damping[6:]
    for q, v, ddtheta, wrench_A in zip(
        states.q, states.v, states.ddtheta, states.wrench_A, strict=True
    ):
        a = np.concatenate([witness.base_acceleration(q, v, ddtheta, wrench_A), ddtheta])
        _, tau = witness.joint_wrenches(q, v, a)
        engine.place(q, v)
        mujoco.mj_forward(engine.model, engine.data)
        engine.data.qacc[:] = np.concatenate([engine.base_acceleration(wrench_A, ddtheta), ddtheta])
        mujoco.mj_inverse(engine.model, engine.data)
        R = rotation_of(q)
        base = np.concatenate([R.T @ engine.data.qfrc_inverse[:3], engine.data.qfrc_inverse[3:6]])
        np.testing.assert_allclose(base, wrench_A, atol=1e-10)
        axes = np.array([engine.data.xaxis[k] for k in range(1, engine.model.njnt)])
        torques = np.sum(axes * tau, axis=1) + damping * v[6:]
        np.testing.assert_allclose(engine.data.qfrc_inverse[6:], torques, atol=1e-10)


class Program:
    """Rotor speeds and joint accelerations as fixed functions of time."""

    def __init__(self, vehicle, q):
        engine = Multibody(vehicle)
        still = np.zeros(vehicle.model.nv)
        self.rotors = vehicle.rotors
        hover, _ = nnls(vehicle.rotors.normalized_coupling, engine.root_wrench(q, still, still))
        self.hover = np.sqrt(hover) * vehicle.rotors.max_speeds
        self.phase = np.arange(vehicle.rotors.count)
        self.n = vehicle.n_arm

    def wrench(self, t):
        return self.rotors.wrench(self.hover * (1.0 + 0.01 * np.sin(3.0 * t + self.phase)))

    def ddtheta(self, t):
        return 0.3 * np.cos(2.0 * t + np.arange(self.n))

    def arm(self, t):
        """Angles from those at the start on, and rates: `ddtheta` integrated from rest."""
        start = np.arange(self.n)
        rate = 0.15 * (np.sin(2.0 * t + start) - np.sin(start))
        return 0.075 * (np.cos(start) - np.cos(2.0 * t + start)) - 0.15 * t * np.sin(start), rate


def fly_pinocchio(vehicle, program, q, steps):
    witness, dt = Multibody(vehicle), DURATION / steps
    now, then = q.copy(), np.zeros(vehicle.model.nv)

    def acceleration(start, stage, pose, twist):
        t = start + 0.5 * half_steps(stage) * dt
        turned, then[6:] = program.arm(t)
        now[:7], then[:6], now[7:] = [*flat(pose)], [*flat(twist)], q[7:] + turned
        a_A = witness.base_acceleration(now, then, program.ddtheta(t), program.wrench(t))
        return record(Spatial, a_A)

    pose, twist = record(Pose, q[:7]), Spatial(ZERO, ZERO)
    for k in range(steps):
        pose, twist, _ = integrator("rk4").step(acceleration, k * dt, pose, twist, dt)
    turned, rate = program.arm(DURATION)
    return np.array([*flat(pose), *(q[7:] + turned)]), np.array([*flat(twist), *rate])


def fly_mujoco(engine, program, q, steps):
    """MuJoCo's own integrator; a callback sets the servo torques that prescribe the joints."""
    model, data = engine.model, engine.data
    mujoco.mj_resetData(model, data)
    engine.place(q, np.zeros(model.nv))
    model.opt.timestep = DURATION / steps

    def control(model, data):
        wrench_A, ddtheta = program.wrench(data.time), program.ddtheta(data.time)
        base = engine.base_acceleration(wrench_A, ddtheta)
        torques = engine._M @ np.concatenate([base, ddtheta]) + data.qfrc_bias
        data.qfrc_applied[:] = torques - data.qfrc_passive

    mujoco.set_mjcb_control(control)
    try:
        mujoco.mj_step(model, data, steps)
    finally:
        mujoco.set_mjcb_control(None)
    return engine.coordinates()


def end_difference(vehicle, engine, steps):
    q = vehicle.neutral(np.linspace(-1.0, 0.5, vehicle.n_arm))
    q[:3] = [9.0, 9.0, 9.0]
    program = Program(vehicle, q)
    ours, theirs = (
        fly_pinocchio(vehicle, program, q, steps),
        fly_mujoco(engine, program, q, steps),
    )
    apart = np.linalg.norm(rotation_of(ours[0]).T @ rotation_of(theirs[0]) - np.eye(3))
    position = np.linalg.norm(np.delete(ours[0] - theirs[0], [3, 4, 5, 6]))
    travelled = np.linalg.norm(ours[0][:3] - q[:3])
    return max(apart, position, np.linalg.norm(ours[1] - theirs[1])), travelled


def test_an_open_loop_flight_of_five_seconds_agrees(vehicle, engine):
    coarse, _ = end_difference(vehicle, engine, STEPS[0])
    fine, travelled = end_difference(vehicle, engine, STEPS[1])
    assert travelled > 0.5, "the program must take the vehicle somewhere"
    assert fine < TRAJECTORY
    # What is left is the integrators' own error: it falls with the fourth power of the step.
    assert fine < coarse / ORDER_4
