"""The scene of a MuJoCo model: its joints as a record has them, and the scene without a vehicle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.simulation.mujoco.contact import MOUNTED
from fullam.simulation.mujoco.spec import PREFIX, TOOL, refused, scene_spec
from fullam.simulation.world.scene_joints import SceneJoint, named
from fullam.simulation.world.world_file import WorldFile

HOLDER = f"{PREFIX}holder"
"""Name of the body that stands for the tool where there is no vehicle."""

KINDS = ("free", "ball", "slide", "hinge")
"""Kinds of joints, by MuJoCo's numbers."""

XYZW = np.array([1, 2, 3, 0])
"""Places of a quaternion's numbers in MuJoCo's order."""


def scene_joints(model: Any) -> tuple[tuple[SceneJoint, ...], NDArray[np.intp]]:
    """The joints of a model that are not the vehicle's, and where `qpos` has their coordinates."""
    found, places = [], []
    for i in range(model.njnt):
        joint = model.joint(i)
        mounted = joint.name.startswith(MOUNTED)
        if joint.name.startswith(PREFIX) and not mounted:
            continue
        kind = KINDS[int(model.jnt_type[i])]
        name = joint.name or model.body(int(model.jnt_bodyid[i])).name
        found.append((name.removeprefix(MOUNTED), kind))
        at = int(model.jnt_qposadr[i])
        if kind == "free":
            places += [*range(at, at + 3), *(at + 3 + XYZW)]
        else:
            places += [*(at + XYZW)] if kind == "ball" else [at]
    return named(found), np.array(places, dtype=np.intp)


def scene_model(world_file: WorldFile) -> Any:
    """A scene alone, as a compiled model; what is mounted on the tool hangs on a body `HOLDER`.

    Raises:
        MissingDependency: MuJoCo is not installed.
        ScenarioError: It refuses the scene, or files that the scene names are not what they were.
    """
    spec = scene_spec(world_file)
    try:
        if spec.body(TOOL) is not None:
            spec.delete(spec.body(TOOL))
            mounted = scene_spec(world_file).body(TOOL)
            mounted.pos, mounted.quat = np.zeros(3), [1.0, 0.0, 0.0, 0.0]
            holder = spec.worldbody.add_body(name=HOLDER, mocap=True)
            holder.add_frame().attach_body(mounted, MOUNTED, "")
        return spec.compile()
    except ValueError as error:
        raise refused(world_file, error) from error
