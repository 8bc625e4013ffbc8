"""A scene in MJCF as shapes: those that stand, and those of bodies that move, with their places.

MuJoCo compiles the scene, without the vehicle, and says where its bodies are; what is mounted on
the tool is placed by it. Drawn are planes, boxes, balls, cylinders, capsules, ellipsoids, meshes
and height fields, in their own colours or the mean of their texture; not so the groups 3 to 5,
which MuJoCo's own viewer leaves out as well, and flexible bodies.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.exceptions import FullamWarning, MissingDependency, ScenarioError
from fullam.simulation.mujoco.scene import HOLDER, XYZW, scene_joints, scene_model
from fullam.simulation.mujoco.spec import load_mujoco
from fullam.simulation.world.scene_joints import SceneJoint
from fullam.simulation.world.world_file import WorldFile
from fullam.viz.viewer import shapes
from fullam.viz.viewer.shapes import Shape

Array = NDArray[np.float64]

MOST_GROUP = 2
"""The last group of geoms that is drawn."""

TILE = 0.004
"""Thickness of a plane's tile [m]."""

UNCOLOURED = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)
"""Colour of a geom that has none of its own: its material's counts."""


class DrawnScene:
    """What is drawn of a scene.

    Attributes:
        bodies: Names of the tracks of bodies that move, below a vehicle's path.
        middle: Of what stands around, planes left out, shape (3,) [m]; None where nothing does.
    """

    def __init__(self, world_file: WorldFile, joints: Sequence[SceneJoint] = ()) -> None:
        """Compile.

        Args:
            world_file: The scene.
            joints: Whose coordinates `places` will be told; other ones than the scene's, or
                none, leave it as it is drawn.

        Raises:
            MissingDependency: MuJoCo is not installed.
            ScenarioError: It refuses the scene, or the scene's files are not what they were.
        """
        mujoco = load_mujoco()
        self._model = model = scene_model(world_file)
        self._data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, self._data)
        own, self._at = scene_joints(model)
        self._moves = bool(joints) and tuple(joints) == own
        groups = model.geom_group
        most = MOST_GROUP if (groups <= MOST_GROUP).any() else groups.max(initial=0)
        geoms = [i for i in range(model.ngeom) if groups[i] <= most and _colour(model, i)[3] > 0.0]
        held, moving = _moving(model)
        self._still = [i for i in geoms if model.geom_bodyid[i] not in moving]
        with_geoms = sorted({int(model.geom_bodyid[i]) for i in geoms} & moving)
        self._carried = {b: [i for i in geoms if model.geom_bodyid[i] == b] for b in with_geoms}
        self.bodies = [f"{'mounted' if b in held else 'world'}/body_{b}" for b in with_geoms]
        plane = load_mujoco().mjtGeom.mjGEOM_PLANE
        solid = [i for i in geoms if model.geom_type[i] != plane]
        solid = [i for i in solid if model.geom_bodyid[i] not in held]
        self._solids = self._data.geom_xpos[solid].copy()
        self.middle = self._solids.mean(axis=0) if solid else None
        holder = next((b for b in moving if model.body(b).name == HOLDER), None)
        self._holder = None if holder is None else int(model.body_mocapid[holder])

    def places(self, coordinates: Array | None, tool: pin.SE3) -> Array:
        """Where the bodies are that move, [p, quaternion xyzw] each, shape (n, 7).

        Args:
            coordinates: Of the scene's joints, as a record has them; None for how it is drawn.
            tool: The vehicle's tool.
        """
        data, model = self._data, self._model
        data.qpos[:] = model.qpos0
        if self._moves and coordinates is not None:
            data.qpos[self._at] = coordinates
        if self._holder is not None:
            x, y, z, w = pin.Quaternion(tool.rotation).coeffs()
            data.mocap_pos[self._holder] = tool.translation
            data.mocap_quat[self._holder] = w, x, y, z
        load_mujoco().mj_kinematics(model, data)
        bodies = [*self._carried]
        return np.hstack([data.xpos[bodies], data.xquat[bodies][:, XYZW]])

    def shapes(self, prefix: str, offset: Array, places: Array, margin: float) -> list[Shape]:
        """All of it as shapes, those of moving bodies in these bodies' axes.

        Args:
            prefix: Scene path of the vehicle.
            offset: Where it is drawn, away from where it is [m].
            places: Where it all happens, shape (n, 3) [m].
            margin: How far beyond those, and the scene, a plane without an end is drawn [m].
        """
        model, data, found = self._model, self._data, []
        places = np.vstack([places, self._solids])
        for i in self._still:
            place = pin.SE3(data.geom_xmat[i].reshape(3, 3), data.geom_xpos[i])
            shape = _geometry(model, i)
            if shape["type"] == "plane":
                shape, place = _tile(shape, place, places, margin)
            place.translation = place.translation + offset
            path = f"{prefix}/world/scene/{i}"
            found.append({"path": path, "pose": shapes.pose_of(place), **shape})
        for name, geoms in zip(self.bodies, self._carried.values(), strict=True):
            for i in geoms:
                pose = [*model.geom_pos[i].tolist(), *model.geom_quat[i][XYZW].tolist()]
                found.append({"path": f"{prefix}/{name}/{i}", "pose": pose, **_geometry(model, i)})
        return found


def drawn_scene(
    world_file: WorldFile, joints: Sequence[SceneJoint]
) -> tuple[DrawnScene | None, str]:
    """The scene, or None and why it is not drawn, of which somebody is warned."""
    try:
        return DrawnScene(world_file, joints), ""
    except MissingDependency:
        missing = MissingDependency("drawing it", "mujoco", "contact")
        remark = f"the scene '{world_file.path}' is not drawn: {missing}"
    except ScenarioError as error:
        remark = f"the scene is not drawn: {error}"
    warnings.warn(remark, FullamWarning, stacklevel=2)
    return None, remark


def _moving(model: Any) -> tuple[set[int], set[int]]:
    """Bodies that hang on the tool, and all that do not stand still."""
    held: set[int] = set()
    moving: set[int] = set()
    for body in range(1, model.nbody):
        parent = int(model.body_parentid[body])
        if model.body(body).name == HOLDER or parent in held:
            held.add(body)
        if body in held or parent in moving or model.body_dofnum[body] > 0:
            moving.add(body)
    return held, moving


def _colour(model: Any, geom: int) -> Array:
    """Red, green, blue, alpha: the geom's own, or its material's with the mean of its texture."""
    own, material = model.geom_rgba[geom], int(model.geom_matid[geom])
    if material < 0 or not np.array_equal(own, UNCOLOURED):
        return np.array(own, dtype=float)
    colour = np.array(model.mat_rgba[material], dtype=float)
    role = int(load_mujoco().mjtTextureRole.mjTEXROLE_RGB)
    texture = int(model.mat_texid[material, role])
    if texture >= 0 and model.tex_nchannel[texture] >= 3:
        at, channels = int(model.tex_adr[texture]), int(model.tex_nchannel[texture])
        size = int(model.tex_height[texture]) * int(model.tex_width[texture]) * channels
        pixels = model.tex_data[at : at + size].reshape(-1, channels)
        colour[:3] *= pixels[:, :3].mean(axis=0) / 255.0
    return colour


def _geometry(model: Any, geom: int) -> Shape:
    """A geom in its own axes; a plane as `_tile` takes it."""
    red, green, blue = (round(255.0 * float(x)) for x in np.clip(_colour(model, geom)[:3], 0, 1))
    look = {"colour": f"#{red:02x}{green:02x}{blue:02x}", "opacity": float(_colour(model, geom)[3])}
    kinds, kind = load_mujoco().mjtGeom, int(model.geom_type[geom])
    a, b, c = model.geom_size[geom].tolist()
    if kind == kinds.mjGEOM_PLANE:
        return {"type": "plane", "size": [a, b], **look}
    if kind == kinds.mjGEOM_SPHERE:
        return {"type": "sphere", "radius": a, **look}
    if kind in (kinds.mjGEOM_CYLINDER, kinds.mjGEOM_CAPSULE):
        name = "cylinder" if kind == kinds.mjGEOM_CYLINDER else "capsule"
        return {"type": name, "radius": a, "length": 2.0 * b, **look}
    if kind == kinds.mjGEOM_ELLIPSOID:
        return {"type": "ellipsoid", "size": [a, b, c], **look}
    if kind == kinds.mjGEOM_HFIELD:
        return {**shapes.mesh(*_height_field(model, int(model.geom_dataid[geom]))), **look}
    if kind in (kinds.mjGEOM_MESH, kinds.mjGEOM_SDF):
        return {**shapes.mesh(*_mesh(model, int(model.geom_dataid[geom]))), **look}
    return {"type": "box", "size": [2.0 * a, 2.0 * b, 2.0 * c], **look}


def _mesh(model: Any, mesh: int) -> tuple[Array, NDArray[np.integer[Any]]]:
    """Vertices and faces."""
    at, first = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
    vertices = model.mesh_vert[at : at + int(model.mesh_vertnum[mesh])]
    return vertices, model.mesh_face[first : first + int(model.mesh_facenum[mesh])]


def _height_field(model: Any, field: int) -> tuple[Array, NDArray[np.integer[Any]]]:
    """Vertices and faces of its upper side."""
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    wide, deep, high, _ = model.hfield_size[field]
    at = int(model.hfield_adr[field])
    heights = model.hfield_data[at : at + rows * columns]
    x, y = np.meshgrid(np.linspace(-wide, wide, columns), np.linspace(-deep, deep, rows))
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.column_stack([corner, corner + 1, corner + columns + 1])
    upper = np.column_stack([corner, corner + columns + 1, corner + columns])
    return np.column_stack([x.ravel(), y.ravel(), high * heights]), np.vstack([lower, upper])


def _tile(shape: Shape, place: pin.SE3, places: Array, margin: float) -> tuple[Shape, pin.SE3]:
    """A plane as a thin box beneath it; where it has no end, about the places."""
    axes, middle, edges = place.rotation, np.zeros(3), []
    within = (places - place.translation) @ axes
    low, high = within.min(axis=0), within.max(axis=0)
    for i, half in enumerate(shape["size"]):
        if half <= 0.0:
            middle[i], half = 0.5 * (low[i] + high[i]), 0.5 * (high[i] - low[i]) + margin
        edges.append(float(2.0 * half))
    middle[2] = -0.5 * TILE
    box = {**shape, "type": "box", "size": [*edges, TILE]}
    return box, pin.SE3(axes, place.act(middle))
