"""What stands around a vehicle: the world that its tool may touch, its task, what it carries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.dynamics.multibody import Multibody
from fullam.simulation.payloads.payload import Payload
from fullam.simulation.tool.kinematics import ToolKinematics
from fullam.simulation.world.scene_joints import SceneJoint
from fullam.simulation.world.surfaces import Box, Plane, Sphere, Surface
from fullam.viz.viewer import shapes
from fullam.viz.viewer.mjcf import DrawnScene, drawn_scene
from fullam.viz.viewer.shapes import Shape

if TYPE_CHECKING:
    from fullam.model.vehicle import Vehicle
    from fullam.simulation.scenarios.scenario import Scenario

Array = NDArray[np.float64]

WORLD, LINES, TASK, PAYLOAD = "#a9865b", "#6b4f2a", "#1f9e89", "#5e3c99"
"""Colours of what may be touched, of lines on it, of the path asked of the tool, and of what is
carried."""

SEE_THROUGH, DRAWN = 0.3, 0.5
"""Opacity of the world, whose surfaces so cast no shadows, and of the path asked for."""

THICK, LINE = 0.012, 0.004
"""Of a plane's tile, and of the lines on it [m]."""

CELL, MOST_CELLS = 0.25, 24
"""Size of a tile's cells [m], which doubles until there are no more than so many in a row."""

DASHES = 60
"""Of the path asked of the tool."""

DIRECTION = (0.72, -0.78, 0.25)
"""From the scene to the camera, unless there is a wall."""

ALONG_WALL, ALONG_SCENE = 0.9, 0.93
"""Share of the view's direction that is along a wall, or across the way from a scene to the
vehicle; the rest comes from the free side."""

BESIDE = 0.2
"""A scene whose middle is nearer to the flight's than this is all around [m]."""


@dataclass(frozen=True, eq=False)
class Scenery:
    """What stands around a vehicle.

    Attributes:
        world: What the tool may touch.
        payloads: What it picks up.
        period: Control period, by which they are picked up and dropped [s].
        path: Where the tool should be, one time after the other, shape (n, 3) [m].
        places: Where it all happens, shape (n, 3) [m]; planes are drawn about there.
        scene: What is drawn of its scene in MJCF; None for nothing.
        touches: Whether there is anything to touch.
        remark: Why the scene is not drawn.
    """

    world: tuple[Surface, ...] = ()
    payloads: tuple[Payload, ...] = ()
    period: float = 0.01
    path: Array = field(default_factory=lambda: np.zeros((0, 3)))
    places: Array = field(default_factory=lambda: np.zeros((1, 3)))
    scene: DrawnScene | None = None
    touches: bool = False
    remark: str = ""

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        vehicle: Vehicle,
        period: float,
        places: Array,
        joints: Sequence[SceneJoint] = (),
    ) -> Scenery:
        """Those of a scenario.

        Args:
            scenario: The scenario.
            vehicle: Who flies it.
            period: Control period [s].
            places: Positions of the platform, as far as they are known, shape (n, 3) [m].
            joints: Of its scene in MJCF, whose coordinates are known moment by moment.

        Warns:
            FullamWarning: That scene cannot be drawn; the message says why.
        """
        path = np.zeros((0, 3))
        if scenario.tool is not None:
            begin = scenario.tool.at
            t = np.linspace(begin, min(begin + scenario.tool.path.duration, scenario.duration), 801)
            start = np.concatenate([scenario.initial_pose, scenario.initial_arm(vehicle)])
            path = ToolKinematics(vehicle).place(start) + scenario.tool.offsets(t)
        places = places[np.all(np.isfinite(places), axis=1)]
        scene, remark, file = None, "", scenario.world_file
        if file is not None:
            scene, remark = drawn_scene(file, joints)
        touches = bool(scenario.world) or file is not None
        around = scenario.world, scenario.payloads, period, path, places
        return cls(*around, scene, touches, remark)

    @property
    def direction(self) -> Array:
        """From the scene to the camera, shape (3,): along the first wall, on its free side.

        Without a wall, what a scene in MJCF holds is seen from the vehicle's side.
        """
        for plane in (s for s in self.world if isinstance(s, Plane)):
            normal = plane.unit_normal * [1.0, 1.0, 0.0]
            if np.linalg.norm(normal) > 0.5:
                return _beside(normal, ALONG_WALL)
        if self.scene is not None and self.scene.middle is not None:
            normal = (self.places.mean(axis=0) - self.scene.middle) * [1.0, 1.0, 0.0]
            if np.linalg.norm(normal) > BESIDE:
                return _beside(normal, ALONG_SCENE)
        return np.array(DIRECTION)

    def carried(self, k: int) -> NDArray[np.bool_]:
        """Which payloads are carried in a control period."""
        times = [(body.picked_up, body.dropped) for body in self.payloads]
        return np.array([round(a / self.period) <= k < round(b / self.period) for a, b in times])

    def laden(self, vehicle: Vehicle, carried: Sequence[bool] | NDArray[np.bool_]) -> Multibody:
        """The dynamics of a vehicle with what it carries."""
        if not np.any(carried):
            return Multibody(vehicle)
        model = vehicle.model.copy()
        tool = model.frames[model.getFrameId(vehicle.tool)]
        for body, is_carried in zip(self.payloads, carried, strict=True):
            if is_carried:
                own = 0.4 * body.mass * body.radius**2 * np.eye(3)
                center = tool.placement.translation + np.array(body.offset)
                model.inertias[tool.parentJoint] += pin.Inertia(body.mass, center, own)
        return Multibody(model, vehicle.tool)

    def shapes(self, prefix: str, offset: Array, size: float) -> list[Shape]:
        """All of it as shapes.

        Args:
            prefix: Scene path of the vehicle.
            offset: Where it is drawn, away from where it is [m].
            size: Of the vehicle [m].
        """
        found: list[Shape] = []
        for i, surface in enumerate(self.world):
            path = f"{prefix}/world/{surface.kind}_{i}"
            if isinstance(surface, Plane):
                found += self._tile(surface, path, offset, 1.2 * size)
            elif isinstance(surface, Sphere):
                place = pin.SE3(np.eye(3), np.array(surface.center) + offset)
                found.append(_solid(path, place, {"type": "sphere", "radius": surface.radius}))
            elif isinstance(surface, Box):
                place = pin.SE3(surface.rotation, np.array(surface.center) + offset)
                found.append(_solid(path, place, {"type": "box", "size": list(surface.size)}))
        if self.scene is not None:
            found += self.scene.shapes(prefix, offset, self.places, 2.0 * size)
        found += _dashes(f"{prefix}/task", self.path + offset, 0.013 * size)
        for i, body in enumerate(self.payloads):
            ball = {"type": "sphere", "radius": body.radius, "colour": PAYLOAD}
            found.append({"path": f"{prefix}/payload_{i}", **ball})
        return found

    def _tile(self, plane: Plane, path: str, offset: Array, margin: float) -> list[Shape]:
        """A plane about the places, with lines on it that tell how far things are."""
        normal = plane.unit_normal
        up = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
        right = np.cross(up, normal)
        right /= np.linalg.norm(right)
        axes = np.column_stack([right, np.cross(normal, right), normal])
        low, high = ((self.places @ axes).min(axis=0), (self.places @ axes).max(axis=0))
        middle = 0.5 * (low + high)
        middle[2] = normal @ np.array(plane.point)
        face = pin.SE3(axes, axes @ middle + offset)
        width, height = (float(x) + 2.0 * margin for x in (high - low)[:2])
        behind = face * pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.5 * THICK]))
        found = [_solid(path, behind, {"type": "box", "size": [width, height, THICK]})]
        cell = CELL
        while max(width, height) > MOST_CELLS * cell:
            cell *= 2.0
        for across, length, along in ((0, width, height), (1, height, width)):
            lines = np.arange(np.ceil(-0.5 * length / cell), 0.5 * length / cell) * cell
            for at in [-0.5 * length, *lines.tolist(), 0.5 * length]:
                place, edges = np.zeros(3), [along, along, LINE]
                place[across], edges[across] = at, LINE
                line = {"type": "box", "size": edges, "colour": LINES, "opacity": SEE_THROUGH}
                pose = shapes.pose_of(face * pin.SE3(np.eye(3), place))
                found.append({"path": f"{path}_lines/{len(found)}", "pose": pose, **line})
        return found


NOTHING = Scenery()
"""An empty world."""


def _beside(normal: Array, share: float) -> Array:
    """A direction to look from: along a wall by a share, the rest on the side of its normal."""
    away, normal = np.array(DIRECTION), normal / np.linalg.norm(normal)
    along = np.array([-normal[1], normal[0], 0.0])
    flat = share * np.copysign(1.0, along @ away) * along
    flat += np.sqrt(1.0 - share**2) * normal
    return np.asarray(np.hypot(*away[:2]) * flat + [0.0, 0.0, away[2]])


def _solid(path: str, place: pin.SE3, body: Shape) -> Shape:
    look = {"colour": WORLD, "opacity": SEE_THROUGH}
    return {"path": path, "pose": shapes.pose_of(place), **body, **look}


def _dashes(path: str, points: Array, radius: float) -> list[Shape]:
    """A dashed line through points, shape (n, 3)."""
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    if len(points) < 2 or length[-1] < 1e-6:
        return []
    at = np.linspace(0.0, length[-1], 2 * DASHES)
    ends = np.stack([np.interp(at, length, column) for column in points.T], axis=1)
    look = {"colour": TASK, "opacity": DRAWN}
    pairs = ends.reshape(DASHES, 2, 3)
    return [shapes.rod(f"{path}/{k}", a, b, radius) | look for k, (a, b) in enumerate(pairs)]
