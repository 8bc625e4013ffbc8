"""What is drawn: a scene as JSON for the page, and frames of numbers that move it.

A scene lists, per vehicle, its shapes and its tracks. A track names a node of the scene tree and
its kind; a frame is a row of 32-bit numbers, the time and then each track's values in order:

    pose (7)     p, quaternion xyzw of a body in world axes
    thrust (1)   share of a rotor's largest thrust: length and colour of its arrow
    spin (1)     angle of a propeller [rad]
    vector (6)   foot of an arrow and the vector it shows, in world axes
    trail (3)    point of the tool's path
    readout (4)  position error [m], attitude error [rad], saturated, height [m]
    ball (4)     centre of what may be carried, and whether it is
    wrench (6)   sizes of u_dc [N, N m], of the residual [N, N m], of a hand's pull and of the
                 world's on the tool [N]
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from fullam.analysis.atlas.envelope import Envelope
from fullam.dynamics.multibody import Multibody
from fullam.exceptions import FullamError
from fullam.model.vehicle import Vehicle
from fullam.viz import style
from fullam.viz.polytope import force_polytope
from fullam.viz.viewer import shapes
from fullam.viz.viewer.scenery import NOTHING, PAYLOAD, TASK, WORLD, Scenery
from fullam.viz.viewer.shapes import ROOT
from fullam.viz.viewer.snapshot import Snapshot

Array = NDArray[np.float64]
Track = dict[str, Any]

WIDTHS = {
    **{"pose": 7, "thrust": 1, "spin": 1, "vector": 6, "trail": 3},
    **{"ball": 4, "readout": 4, "wrench": 6},
}
"""How many numbers a track of each kind takes in a frame; the page has the same table."""

THRUST_COLOURS = ("#9fd0f0", "#3f8fd0", "#5b3fa0", "#b0236d", "#e8430f")
"""From idle to saturated: lightness falls, then red comes in, told apart by all eyes."""

FORCE, MOMENT = style.GREEN, style.SKY
JOINT_FORCE, JOINT_MOMENT = style.PURPLE, style.ORANGE
GHOST, HAND, CONTACT = "#1f9e89", "#c2185b", "#101418"
LABELS = (style.BLUE, style.VERMILION, style.PURPLE, style.GREEN)
"""Colours of vehicles side by side, of their names and their tool's trails."""

CONTACT_SCALE = 4.0
"""Of its arrow, in that of the rotors' force; as of a hand's."""

SPIN_RATE = 9.0
"""Rate at which a propeller at its largest speed is drawn to turn [rad/s]: one can see it turn."""


class VehicleScene:
    """One vehicle in the scene: its shapes, its tracks, and the numbers of a frame.

    Attributes:
        vehicle: The vehicle; the joint-1 wrench is computed with its masses.
        label: Its name on the page.
        offset: Where it is drawn, away from where it flies, shape (3,) [m].
        ghost: Whether its target pose is drawn.
        colour: Of its name and its tool's trail.
        around: What stands around it.
        forces: Whose attainable forces are drawn about the platform; None for none.
        width: Numbers it takes in a frame.
    """

    forces: Envelope | None = None

    def __init__(
        self,
        vehicle: Vehicle,
        label: str,
        number: int = 1,
        offset: ArrayLike = (0.0, 0.0, 0.0),
        ghost: bool = True,
        around: Scenery = NOTHING,
    ) -> None:
        """Lay out the tracks.

        Args:
            vehicle: The vehicle.
            label: Its name on the page.
            number: 1, 2, ... among the vehicles of the scene.
            offset: Where it is drawn, away from where it flies [m].
            ghost: Whether the target pose is drawn.
            around: What stands around it.
        """
        self.vehicle, self.label = vehicle, label
        self.offset = np.array(offset, dtype=np.float64)
        self.ghost, self.around, self._path = ghost, around, f"vehicle_{number}"
        self.colour = LABELS[(number - 1) % len(LABELS)]
        self._data = vehicle.create_data()
        self._multibodies: dict[bytes, Multibody] = {}
        self._tool = vehicle.model.getFrameId(vehicle.tool)
        self._top = vehicle.rotors.max_thrusts
        self.tracks = self._tracks()
        self.width = sum(WIDTHS[track["kind"]] for track in self.tracks)

    @property
    def force_scale(self) -> float:
        """Length of a force arrow [m/N]: the vehicle's weight is as long as it is wide."""
        weight = self.vehicle.mass * (self.vehicle.gravity or 9.81)
        return 1.25 * shapes.reach(self.vehicle) / weight

    @property
    def moment_scale(self) -> float:
        """Length of a moment arrow [m/(N m)]: thirty times that of the same figure in newtons."""
        return 12.0 * self.force_scale

    def spec(self) -> dict[str, Any]:
        """Shapes and tracks as JSON values."""
        drawn = shapes.vehicle_shapes(self.vehicle, self._path)
        if self.ghost:
            drawn += shapes.platform_shapes(
                self.vehicle, f"{self._path}/target", colour=GHOST, opacity=0.22
            )
        drawn += self.around.shapes(self._path, self.offset, shapes.reach(self.vehicle))
        if self.forces is not None:
            drawn += self._force_shapes(self.forces)
        return {
            "label": self.label,
            "path": self._path,
            "colour": self.colour,
            "radius": shapes.reach(self.vehicle),
            "shapes": drawn,
            "tracks": self.tracks,
            "rotors": {
                "names": list(self.vehicle.rotors.names),
                "max_speeds": self.vehicle.rotors.max_speeds.tolist(),
            },
        }

    def _force_shapes(self, envelope: Envelope) -> list[shapes.Shape]:
        """The forces that the rotors give without a moment, as a body in the scale of arrows."""
        try:
            points, triangles = force_polytope(envelope)
        except FullamError:  # they fill no body
            return []
        path = f"{shapes.body_path(self._path, ROOT)}/forces"
        body = shapes.mesh(self.force_scale * points, triangles)
        return [{"path": path, **body, "colour": FORCE, "opacity": 0.12}]

    def _tracks(self) -> list[Track]:
        vehicle, path = self.vehicle, self._path
        rotors, size = vehicle.rotors, shapes.reach(vehicle)
        tracks: list[Track] = [
            {"kind": "pose", "path": shapes.body_path(path, joint), "main": joint == ROOT}
            for joint in range(ROOT, vehicle.model.njoints)
        ]
        for i, name in enumerate(rotors.names):
            foot = shapes.towards(rotors.axes[i], rotors.positions[i] + 0.008 * rotors.axes[i])
            tracks.append(
                {
                    "kind": "thrust",
                    "path": f"{path}/platform/thrust_{name}",
                    "pose": shapes.pose_of(foot),
                    "length": 0.85 * size,
                    "radius": 0.014 * size,
                    "colour": THRUST_COLOURS[0],
                }
            )
        tracks += [
            {"kind": "spin", "path": f"{path}/platform/propeller_{name}/spin"}
            for name in rotors.names
        ]
        tracks.append(self._vector("rotor_force", FORCE, self.force_scale, 0.016, 1))
        tracks.append(self._vector("rotor_moment", MOMENT, self.moment_scale, 0.016, 2))
        if vehicle.n_arm:
            tracks.append(self._vector("joint_force", JOINT_FORCE, 2 * self.force_scale, 0.024, 1))
            tracks.append(self._vector("joint_moment", JOINT_MOMENT, self.moment_scale, 0.018, 2))
        trail = {"path": f"{path}/trail", "radius": 0.007 * size, "colour": self.colour}
        tracks.append({"kind": "trail", "least": 0.002, **trail})
        if self.ghost:
            tracks.append({"kind": "pose", "path": f"{path}/target"})
        tracks.append(self._vector("hand", HAND, 4 * self.force_scale, 0.02, 1))
        if self.around.touches:
            scale = CONTACT_SCALE * self.force_scale
            tracks.append(self._vector("contact", CONTACT, scale, 0.02, 1))
        tracks += [
            {"kind": "ball", "path": f"{path}/payload_{i}"}
            for i in range(len(self.around.payloads))
        ]
        bodies = [] if self.around.scene is None else self.around.scene.bodies
        tracks += [{"kind": "pose", "path": f"{path}/{body}", "scene": True} for body in bodies]
        tracks += [{"kind": "readout"}, {"kind": "wrench"}]
        return tracks

    def _vector(self, name: str, colour: str, scale: float, thickness: float, heads: int) -> Track:
        radius = thickness * shapes.reach(self.vehicle)
        look = {"colour": colour, "scale": scale, "radius": radius, "heads": heads}
        return {"kind": "vector", "path": f"{self._path}/{name}", "through": True, **look}

    def write(self, now: Snapshot, out: NDArray[np.float32]) -> None:
        """Write this vehicle's part of a frame, shape (width,)."""
        model, data = self.vehicle.model, self._data
        q = np.concatenate([now.pose, now.arm])
        pin.forwardKinematics(model, data, q)
        at = 0
        for joint in range(ROOT, model.njoints):
            out[at : at + 7] = pin.SE3ToXYZQUAT(data.oMi[joint])
            out[at : at + 3] += self.offset
            at += 7
        n = self.vehicle.rotors.count
        thrusts = self.vehicle.rotors.k_f * np.square(now.rotor_speeds)
        out[at : at + n] = np.divide(thrusts, self._top, out=np.zeros(n), where=self._top > 0.0)
        out[at + n : at + 2 * n] = now.spin
        at += 2 * n
        hub = now.pose[:3] + self.offset
        vectors = [(hub, now.rotor_wrench)]
        if self.vehicle.n_arm:
            joint_1 = data.oMi[ROOT + 1].translation + self.offset
            vectors.append((joint_1, self.joint_wrench(q, now)))
        for foot, wrench in vectors:
            out[at : at + 3] = out[at + 6 : at + 9] = foot
            out[at + 3 : at + 6], out[at + 9 : at + 12] = wrench[:3], wrench[3:]
            at += 12
        tool = pin.updateFramePlacement(model, data, self._tool)
        tip = tool.translation + self.offset
        out[at : at + 3] = tip
        at += 3
        if self.ghost:
            out[at : at + 7] = now.target
            out[at : at + 3] += self.offset
            at += 7
        out[at : at + 6] = now.hand
        out[at : at + 3] += self.offset
        at += 6
        if self.around.touches:  # it ends where it pushes: begun there, it would hide in the arm
            out[at : at + 3] = tip - CONTACT_SCALE * self.force_scale * now.contact
            out[at + 3 : at + 6] = now.contact
            at += 6
        link = data.oMi[model.frames[self._tool].parentJoint].rotation
        for body, carried in zip(self.around.payloads, now.carried, strict=True):
            out[at : at + 3] = tip + link @ np.array(body.offset)
            out[at + 3] = carried
            at += 4
        if self.around.scene is not None:
            for body in self.around.scene.places(now.scene, tool):
                out[at : at + 7] = body
                out[at : at + 3] += self.offset
                at += 7
        cosine = min(1.0, abs(float(now.pose[3:] @ now.target[3:])))
        out[at] = np.linalg.norm(now.pose[:3] - now.target[:3])
        out[at + 1] = 2.0 * np.arccos(cosine)
        out[at + 2], out[at + 3] = now.saturated, now.pose[2]
        parts = (*np.split(now.u_dc, 2), *np.split(now.residual, 2), now.hand[3:], now.contact)
        out[at + 4 : at + 10] = [np.linalg.norm(part) for part in parts]

    def joint_wrench(self, q: Array, now: Snapshot) -> Array:
        """Wrench of the platform on link 1, world axes at joint 1, force then moment, (6,)."""
        R_AW = pin.Quaternion(now.pose[3:]).toRotationMatrix().T
        v = np.concatenate([R_AW @ now.velocity[:3], R_AW @ now.velocity[3:], now.arm_rate])
        wrench = now.rotor_wrench + now.disturbance
        wrench_A = np.concatenate([R_AW @ wrench[:3], R_AW @ wrench[3:]])
        on_world = np.concatenate([-now.contact, np.zeros(3)])
        laden = np.array(now.carried, dtype=bool)
        if (multibody := self._multibodies.get(laden.tobytes())) is None:
            multibody = self.around.laden(self.vehicle, laden)
            self._multibodies[laden.tobytes()] = multibody
        base = multibody.base_acceleration(q, v, now.arm_acceleration, wrench_A, on_world)
        force, moment = multibody.joint_wrenches(
            q, v, np.concatenate([base, now.arm_acceleration]), on_world
        )
        return np.concatenate([force[0], moment[0]])


class Scene:
    """Several vehicles, one title, one clock.

    Attributes:
        vehicles: What is in it.
        width: Numbers of a frame.
    """

    def __init__(
        self,
        vehicles: Sequence[VehicleScene],
        title: str,
        details: str,
        places: Array,
        duration: float | None = None,
    ) -> None:
        """Fit the view.

        Args:
            vehicles: What is in it.
            title: First line on the page.
            details: Second line.
            places: Positions that the view should hold, but for offsets, shape (n, 3) [m].
            duration: Length of the flight [s], if known.
        """
        self.vehicles = tuple(vehicles)
        self.width = 1 + sum(vehicle.width for vehicle in self.vehicles)
        size = max(shapes.reach(vehicle.vehicle) for vehicle in self.vehicles)
        # A flight that diverged may end in places that are none.
        places = places[np.all(np.isfinite(places), axis=1)]
        low, high = places.min(axis=0), places.max(axis=0)
        centre = 0.5 * (low + high) + np.array([0.0, 0.0, 0.02 * size])
        # Side by side they fill the width of the picture, which has room to spare.
        apart = 0.2 * float(np.linalg.norm(np.ptp([v.offset for v in self.vehicles], axis=0)))
        radius = apart + min(0.5 * float(np.linalg.norm(high - low)), 2.0 * size) + 1.4 * size
        floor = np.floor(2.0 * (low[2] - 2.0 * size)) / 2.0
        remarks = dict.fromkeys(v.around.remark for v in self.vehicles if v.around.remark)
        self._view = {
            "title": title,
            "details": " · ".join([details, *remarks]),
            "duration": duration,
            "centre": [float(x) for x in centre],
            "radius": radius,
            "ground": float(max(floor, 0.0) if low[2] > 0.0 else floor),
            "direction": self.vehicles[0].around.direction.tolist(),
        }

    def spec(self, **more: Any) -> dict[str, Any]:
        """The scene as JSON values; `more` goes to the page as it is."""
        ground = self._view["ground"]
        first = self.vehicles[0]
        per_newton, per_moment = 100.0 * first.force_scale, 100.0 * first.moment_scale
        legend = [
            (FORCE, f"rotors' force, {per_newton:.1f} cm/N"),
            (MOMENT, f"rotors' moment, {per_moment:.0f} cm/(N m)"),
        ]
        if first.forces is not None and "live" not in more:  # there it is a layer, off at first
            legend.append((FORCE, "body: forces without moment that it attains"))
        if first.vehicle.n_arm:
            legend.append((JOINT_FORCE, f"force on the arm, {2 * per_newton:.1f} cm/N"))
            legend.append((JOINT_MOMENT, f"moment on the arm, {per_moment:.0f} cm/(N m)"))
        if first.ghost:
            legend.append((HAND, f"pull of a hand, {4 * per_newton:.0f} cm/N"))
            legend += [(GHOST, "target pose"), (first.colour, "path of the tool")]
        legend += self._around_legend(first.around, CONTACT_SCALE * per_newton)
        legend.append(("#8a97a5", f"grid 0.5 m, at z = {ground:g} m"))
        return {
            **self._view,
            "colours": THRUST_COLOURS,
            "contact": first.around.touches,
            "legend": legend,
            "vehicles": [vehicle.spec() for vehicle in self.vehicles],
            **more,
        }

    @staticmethod
    def _around_legend(around: Scenery, per_newton: float) -> list[tuple[str, str]]:
        it = "it" if around.world else "the scene"
        lines = [
            (len(around.path), TASK, "path asked of the tool, dashed"),
            (len(around.world), WORLD, "what the tool may touch"),
            (around.touches, CONTACT, f"force of {it} on the tool, {per_newton:.0f} cm/N"),
            (len(around.payloads), PAYLOAD, "what is carried"),
        ]
        return [(colour, text) for shown, colour, text in lines if shown]

    def frame(self, t: float, moments: Sequence[Snapshot]) -> NDArray[np.float32]:
        """The numbers of one frame, one snapshot a vehicle."""
        out = np.empty(self.width, dtype=np.float32)
        out[0] = t
        at = 1
        for vehicle, now in zip(self.vehicles, moments, strict=True):
            vehicle.write(now, out[at : at + vehicle.width])
            at += vehicle.width
        return out
