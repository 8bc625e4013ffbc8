"""MuJoCo as the physics of one flight: its model, its state, and steps in between.

Coordinates: MuJoCo's free joint has its quaternion as wxyz, its linear velocity in world axes and
its angular velocity in body axes, both at the origin of {A}. A gust's force is applied at that
origin (`qfrc_applied`), its moment to the body (`xfrc_applied`): both are world axes' and need not
be turned within a step. A rotor's squared speed is its mean over the step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.recursion import JointMotion, Link
from fullam.dynamics.so3 import rotation_matrix
from fullam.dynamics.spatial import Pose, Spatial
from fullam.model.physics import body_inertia
from fullam.model.servos import Servos
from fullam.model.vehicle import Vehicle
from fullam.numbers.vectors import rotate, rotate_back
from fullam.simulation.mujoco.contact import add_world, set_materials, tool_force
from fullam.simulation.mujoco.scene import scene_joints
from fullam.simulation.mujoco.spec import (
    PREFIX,
    compiled,
    load_mujoco,
    moving_bodies,
    quiet,
    scene_spec,
    set_inertia,
    vehicle_spec,
)
from fullam.simulation.plants.settings import MUJOCO_INTEGRATORS
from fullam.simulation.scenarios.scenario import Scenario

Array = NDArray[np.float64]


class Engine:
    """A vehicle in its world.

    Attributes:
        model: MuJoCo's.
        data: MuJoCo's.
        touches: Whether there is anything to touch.
        joints: The scene's joints, whose coordinates `scene` gives.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        servos: Servos | None,
        scenario: Scenario,
        integrator: str,
        period: float,
        radius: float = 0.002,
    ) -> None:
        """Build and compile.

        Args:
            vehicle: The true vehicle.
            servos: What moves its joints; None for nothing.
            scenario: What stands around it.
            integrator: One of `MUJOCO_INTEGRATORS`.
            period: Step [s].
            radius: Of the ball at the tool [m].

        Raises:
            MissingDependency: MuJoCo is not installed.
            ScenarioError: MuJoCo refuses the scene.
            VehicleError: It refuses the vehicle.
        """
        mujoco = load_mujoco()
        self._mujoco, self._vehicle, self._file = mujoco, vehicle, scenario.world_file
        spec = scene_spec(scenario.world_file)
        spec.attach(vehicle_spec(vehicle, servos), frame=spec.worldbody.add_frame(), prefix=PREFIX)
        option = spec.option
        option.timestep, option.gravity = period, vehicle.model.gravity.linear
        option.integrator = getattr(mujoco.mjtIntegrator, MUJOCO_INTEGRATORS[integrator])
        option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        # A flight that blows up shall be seen to, and not begin anew.
        option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self.touches = bool(scenario.world) or scenario.world_file is not None
        self._pairs = add_world(spec, vehicle, scenario, radius) if self.touches else []
        self._spec = spec
        self._carried: Link | None = None
        self._compile()

    def _compile(self) -> None:
        mujoco, vehicle = self._mujoco, self._vehicle
        model = compiled(self._spec, vehicle, self._file)
        set_materials(model, self._pairs)
        self.model, self.data = model, mujoco.MjData(model)
        free = model.joint(f"{PREFIX}free")
        joints = [model.joint(PREFIX + name) for name in vehicle.arm_joints]
        at, moves = int(free.qposadr[0]), int(free.dofadr[0])
        self._pose, self._twist = slice(at, at + 7), slice(moves, moves + 6)
        self._angles = np.array([int(j.qposadr[0]) for j in joints], dtype=int)
        self._rates = np.array([int(j.dofadr[0]) for j in joints], dtype=int)
        self._platform = model.body(PREFIX + vehicle.platform).id
        count = vehicle.rotors.count
        self._rotors = [model.actuator(f"{PREFIX}rotor {i}").id for i in range(count)]
        names = [f"{PREFIX}servo {name}" for name in vehicle.arm_joints]
        known = {model.actuator(i).name for i in range(model.nu)}
        self._servos = [model.actuator(name).id for name in names if name in known]
        self._kind = mujoco.mjtState.mjSTATE_INTEGRATION
        self.joints, self._scene = scene_joints(model)

    @property
    def size(self) -> int:
        """Numbers of a state."""
        return int(self._mujoco.mj_stateSize(self.model, self._kind))

    def carry(self, link: Link, frame: Array) -> None:
        """Give the last body the mass properties of a link; as `PinocchioJoints.carry`."""
        if link == self._carried:
            return
        self._carried = link
        inertia = np.zeros((3, 3))
        inertia[np.triu_indices(3)] = link.inertia
        inertia += np.triu(inertia, 1).T
        own = body_inertia(link.mass, frame @ np.array(link.com), frame @ inertia @ frame.T)
        set_inertia(moving_bodies(self._spec, self._vehicle, PREFIX)[-1], own)
        self._compile()

    # The state.

    def place(self, pose: Pose, twist: Spatial, arm: Sequence[JointMotion]) -> None:
        """Put the vehicle somewhere; the scene is left as it is."""
        qpos, qvel = self.data.qpos, self.data.qvel
        x, y, z, w = pose.attitude
        qpos[self._pose] = *pose.position, w, x, y, z
        linear = rotate(rotation_matrix(pose.attitude), twist.linear)
        qvel[self._twist] = *linear, *twist.angular
        self.place_arm(arm)

    def place_arm(self, arm: Sequence[JointMotion]) -> None:
        """Put the joints somewhere."""
        self.data.qpos[self._angles] = [motion.position for motion in arm]
        self.data.qvel[self._rates] = [motion.rate for motion in arm]

    def state(self) -> tuple[Pose, Spatial]:
        """Pose and twist (body axes) of the platform."""
        px, py, pz, w, x, y, z = self.data.qpos[self._pose].tolist()
        vx, vy, vz, *angular = self.data.qvel[self._twist].tolist()
        pose = Pose((px, py, pz), (x, y, z, w))
        back = rotate_back(rotation_matrix(pose.attitude), (vx, vy, vz))
        return pose, Spatial(back, tuple(angular))

    def arm(self) -> tuple[list[float], list[float]]:
        """Positions and rates of the joints."""
        return self.data.qpos[self._angles].tolist(), self.data.qvel[self._rates].tolist()

    def scene(self) -> tuple[float, ...]:
        """Coordinates of the scene's joints, as `scene_joints` has them in a record."""
        return tuple(self.data.qpos[self._scene].tolist())

    def remember(self) -> tuple[float, ...]:
        """All that the next step depends on, `size` numbers."""
        numbers = np.empty(self.size)
        self._mujoco.mj_getState(self.model, self.data, numbers, self._kind)
        return tuple(numbers.tolist())

    def recall(self, numbers: Sequence[float]) -> None:
        """Go where `remember` was called."""
        self._mujoco.mj_setState(self.model, self.data, np.array(numbers), self._kind)

    # Steps.

    def push(self, gust: Spatial) -> None:
        """Push the platform at its origin from now on, world axes."""
        first = self._twist.start
        self.data.qfrc_applied[first : first + 3] = gust.linear
        self.data.xfrc_applied[self._platform, 3:] = gust.angular

    def ask(self, goals: Sequence[float]) -> None:
        """Set the servos' goals."""
        self.data.ctrl[self._servos] = goals

    def spin(self, squares: Sequence[float]) -> None:
        """Set the rotors' squared speeds."""
        self.data.ctrl[self._rotors] = squares

    def step(self) -> None:
        """One step."""
        with quiet():
            self._mujoco.mj_step(self.model, self.data)

    def tool_force(self) -> Array:
        """Force of the world on the tool in the present state, world axes [N], shape (3,)."""
        with quiet():
            self._mujoco.mj_forward(self.model, self.data)
        return tool_force(self.model, self.data)

    def wrench(self, squares: Sequence[float], gust: Spatial) -> Array:
        """What rotors and gust push the free joint's coordinates with, shape (6,)."""
        R = self.data.xmat[self._platform].reshape(3, 3)
        thrust = self._vehicle.rotors.coupling_matrix @ np.array(squares)
        force = R @ thrust[:3] + gust.linear
        return np.concatenate([force, thrust[3:] + R.T @ np.array(gust.angular)])

    def drive(self, wrench: Array, accelerations: Sequence[float]) -> None:
        """Torques at the joints that give them accelerations; before a step is evaluated.

        Args:
            wrench: On the free joint's coordinates, as `wrench` gives it.
            accelerations: Of the joints.
        """
        model, data = self.model, self.data
        M, base = np.empty((model.nv, model.nv)), self._twist
        self._mujoco.mj_fullM(model, data, M)
        own = np.array(accelerations, dtype=float)
        coupled = M[base, self._rates] @ own
        a = np.linalg.solve(M[base, base], wrench - data.qfrc_bias[base] - coupled)
        torques = M[self._rates, base] @ a + M[np.ix_(self._rates, self._rates)] @ own
        data.qfrc_applied[self._rates] = torques + data.qfrc_bias[self._rates]


def mean_square(speed: float, command: float, half_decay: float) -> float:
    """Mean of the square of a rotor's speed over a step, exactly.

    Args:
        speed: At the start [rad/s].
        command: What it tends to.
        half_decay: exp(-h / lag) for half the step.
    """
    apart, decay = speed - command, half_decay * half_decay
    if decay <= 0.0:
        return command * command
    x = -math.log(decay)
    first, second = (1.0 - decay) / x, (1.0 - decay * decay) / (2.0 * x)
    return command * command + 2.0 * command * apart * first + apart * apart * second
