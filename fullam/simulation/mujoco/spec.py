"""The true vehicle and its world as a MuJoCo model, made by its spec API.

The vehicle is read from the same URDF, without meshes, limits and friction of joints; its platform
gets a free joint, and the bodies that move get the mass properties of the true vehicle's (links
behind fixed joints are merged in them, as Pinocchio does). Then

- a rotor is a motor on a site, z along its axis, that gives force k_f and drag d k_tau along z for
  a squared speed as its control;
- a servo (`model.servos`) is an actuator k (goal - q) within +-stall, damping d and armature of its
  joint; a stop is an actuator -stop (q - limit) that acts one way;
- what touches is a small ball at the tool, massless, or the shapes of the scene's body "tool".

Around it stands a scene in MJCF, or nothing. It keeps its own options, but for step, integrator,
gravity (the vehicle's), friction cone (elliptic) and, beside a scenario's surfaces, `impratio`; air
of a density drags at the vehicle, too. Keyframes are not read: what moves begins as it is drawn.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.exceptions import MissingDependency, ScenarioError, VehicleError
from fullam.model.rotors import Rotors
from fullam.model.servos import Servos
from fullam.model.vehicle import Vehicle
from fullam.simulation.world.world_file import WorldFile

if TYPE_CHECKING:
    import mujoco

Array = NDArray[np.float64]

PREFIX = "fullam/"
"""Before every name of the vehicle's, so that a scene may have any names."""

TOOL = "tool"
"""The body of a scene whose shapes are mounted on the tool."""

COMPILER = {"fusestatic": "false", "inertiafromgeom": "false", "balanceinertia": "false"}

UNLIMITED = 1e12
"""A stop may push this much [N m or N]."""


def load_mujoco() -> Any:
    """The package.

    Raises:
        MissingDependency: It is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        raise MissingDependency("plant 'mujoco'", "mujoco", "contact") from error
    return mujoco


@contextmanager
def quiet() -> Iterator[None]:
    """Have MuJoCo keep warnings to itself, which it else writes into a file where one stands.

    They are of numbers that are not finite, and a flight that has some ends as diverged.
    """
    mujoco = load_mujoco()
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def vehicle_spec(vehicle: Vehicle, servos: Servos | None) -> mujoco.MjSpec:
    """A vehicle that flies freely.

    Args:
        vehicle: The true vehicle.
        servos: What moves its joints; None leaves them free.

    Raises:
        MissingDependency: MuJoCo is not installed.
    """
    mujoco = load_mujoco()
    spec = mujoco.MjSpec.from_string(plain_urdf(vehicle.urdf))
    platform = spec.body(vehicle.platform)
    platform.add_freejoint(name="free")
    for body, inertia in zip(moving_bodies(spec, vehicle), vehicle.model.inertias[1:], strict=True):
        set_inertia(body, inertia)
    add_rotors(spec, platform, vehicle.rotors)
    for i, name in enumerate(vehicle.arm_joints):
        joint = spec.joint(name)
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
        if servos is not None:
            joint.armature = servos.armature[i]
            joint.damping = np.append(servos.damping[i], np.zeros(np.size(joint.damping) - 1))
            add_servo(spec, name, servos, i)
    return spec


def plain_urdf(text: str) -> str:
    """A URDF for MuJoCo: its tree and its joints' axes alone."""
    robot = ET.fromstring(text)
    for link in robot.findall("link"):
        for element in list(link):
            link.remove(element)
    for joint in robot.findall("joint"):
        for tag in ("dynamics", "limit", "mimic", "safety_controller", "calibration"):
            for element in joint.findall(tag):
                joint.remove(element)
        if joint.get("type") == "revolute":
            joint.set("type", "continuous")  # which asks for no limits
    for tag in ("mujoco", "gazebo", "transmission", "material"):
        for element in robot.findall(tag):
            robot.remove(element)
    ET.SubElement(ET.SubElement(robot, "mujoco"), "compiler", COMPILER)
    return ET.tostring(robot, encoding="unicode")


def moving_bodies(spec: mujoco.MjSpec, vehicle: Vehicle, prefix: str = "") -> list[Any]:
    """The platform, and the links that the joints move, base to tip."""
    return [
        spec.body(prefix + vehicle.platform),
        *(spec.joint(prefix + name).parent for name in vehicle.arm_joints),
    ]


def set_inertia(body: Any, inertia: pin.Inertia) -> None:
    """Give a body mass properties, in its own frame."""
    J = inertia.inertia
    body.explicitinertial = True
    body.mass, body.ipos = inertia.mass, inertia.lever
    body.fullinertia = [J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]


def add_rotors(spec: mujoco.MjSpec, platform: Any, rotors: Rotors) -> None:
    """One site and one motor a rotor, whose control is its squared speed [(rad/s)^2]."""
    mujoco = load_mujoco()
    for i in range(rotors.count):
        z = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), rotors.axes[i])
        name = f"rotor {i}"
        quat = [z.w, z.x, z.y, z.z]
        platform.add_site(name=name, pos=rotors.positions[i], quat=quat)
        motor = spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_SITE, target=name)
        drag = rotors.spins[i] * rotors.k_tau[i]
        motor.gear = [0.0, 0.0, rotors.k_f[i], 0.0, 0.0, drag]
        motor.gainprm[0] = 1.0


def add_servo(spec: mujoco.MjSpec, joint: str, servos: Servos, i: int) -> None:
    """The actuator of a servo, whose control is its goal, and those of its stops."""
    k = servos.stiffness[i]
    _add_affine(spec, joint, f"servo {joint}", (k, 0.0, -k), (-servos.stall[i], servos.stall[i]))
    for limit, way in ((servos.lower[i], 1.0), (servos.upper[i], -1.0)):
        if np.isfinite(limit):
            stop = servos.stop[i]
            forces = (0.0, UNLIMITED) if way > 0.0 else (-UNLIMITED, 0.0)
            name = f"{'lower' if way > 0.0 else 'upper'} stop {joint}"
            _add_affine(spec, joint, name, (0.0, stop * limit, -stop), forces)


def _add_affine(
    spec: mujoco.MjSpec,
    joint: str,
    name: str,
    numbers: tuple[float, float, float],
    forces: tuple[float, float],
) -> None:
    """An actuator at a joint: gain * control + a + b q, within bounds."""
    mujoco = load_mujoco()
    actuator = spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint)
    actuator.gainprm[0] = numbers[0]
    actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    actuator.biasprm[0], actuator.biasprm[1] = numbers[1:]
    actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
    actuator.forcerange = list(forces)


def scene_spec(world_file: WorldFile | None) -> mujoco.MjSpec:
    """A scene, or an empty one.

    Raises:
        ScenarioError: MuJoCo does not read it; or its files are not what they were.
    """
    mujoco = load_mujoco()
    if world_file is None:
        return mujoco.MjSpec()
    world_file.check_files()
    try:
        if world_file.digest:
            return mujoco.MjSpec.from_file(world_file.path)
        return mujoco.MjSpec.from_string(world_file.text)
    except ValueError as error:
        raise refused(world_file, error) from error


def refused(world_file: WorldFile, error: Exception) -> ScenarioError:
    """MuJoCo's own words about a scene."""
    where = f"world_file '{world_file.path}'"
    words = " ".join(str(error).split())
    return ScenarioError(where, "MJCF", f"is refused by MuJoCo ({words})", "correct it")


def compiled(spec: mujoco.MjSpec, vehicle: Vehicle, world_file: WorldFile | None) -> Any:
    """The model of a spec, which weighs what it should.

    Raises:
        ScenarioError: MuJoCo refuses the scene.
        VehicleError: It refuses the vehicle.
    """
    try:
        return spec.compile()
    except ValueError as error:
        if world_file is not None:
            raise refused(world_file, error) from error
        words = " ".join(str(error).split())
        raise VehicleError(
            f"vehicle '{vehicle.name}'",
            "URDF",
            f"is refused by MuJoCo ({words})",
            "every body that moves needs a mass and an inertia; or choose plant 'servo'",
        ) from error
