"""Sliders for a notebook: arm, tilt and cant against hover speeds and feasibility, live."""

from __future__ import annotations

import copy
import html
from typing import Any

import numpy as np

from fullam.exceptions import MissingDependency
from fullam.model.design import VehicleDesign
from fullam.model.loading import load_vehicle
from fullam.model.vehicle import Vehicle
from fullam.viz.polytope import rose_svg
from fullam.viz.viewer.frame import frame_html
from fullam.viz.viewer.portrait import Hover, hover, stage
from fullam.viz.viewer.scene import THRUST_COLOURS
from fullam.viz.viewer.server import ViewerServer

MOST_TILT_DEG, MOST_CANT_DEG = 60.0, 80.0


class Explorer:
    """A vehicle in the hand: the last expression of a notebook cell shows it.

    The scene is served to this machine only; where the kernel runs elsewhere it comes through the
    notebook's server, see `frame`.

    Attributes:
        vehicle: The vehicle as the sliders have it.
        hover: How it holds still.
        sliders: By name: the arm's joints, "tilt about x", "tilt about y", and "cant" for a
            vehicle made from a design.
        forces: Checkbox: draw the forces that can be attained about the platform.
        panel: The ipywidgets container.
        server: Serves the scene.
    """

    def __init__(self, vehicle: Vehicle | str = "fullam", height: int = 480) -> None:
        """Build the sliders and start to serve; see `fullam.explore`."""
        try:
            import ipywidgets
        except ImportError as error:
            raise MissingDependency("the explorer", "ipywidgets", "notebook") from error
        self.vehicle = load_vehicle(vehicle) if isinstance(vehicle, str) else vehicle
        self._base = self.vehicle
        self._cant = self.vehicle.definition.get("design", {}).get("cant_deg")
        self.sliders = self._sliders(ipywidgets)
        self.forces = ipywidgets.Checkbox(value=False, description="attainable forces")
        self.forces.observe(self.update, names="value")
        self._report = ipywidgets.HTML()
        self.server = ViewerServer(hosts=("*",))  # perhaps through the notebook's own server
        self._stage = stage(self.vehicle)
        self.server.show(self._stage.spec(clock=False))
        self.update()
        controls = ipywidgets.VBox([*self.sliders.values(), self.forces, self._report])
        controls.layout.flex = "0 0 340px"  # a frame of full width would lie over the readouts
        scene = ipywidgets.HTML(frame_html(self.server, height))
        scene.layout.flex, scene.layout.min_width = "1 1 0", "0"
        self.panel = ipywidgets.HBox([controls, scene])

    def _sliders(self, ipywidgets: Any) -> dict[str, Any]:
        joints, ranges = self._base.joints, {}
        limits = zip(joints.to_typed(joints.lower), joints.to_typed(joints.upper), strict=True)
        for name, unit, (low, high) in zip(joints.names, joints.units, limits, strict=True):
            most = 1.0 if unit == "m" else 180.0
            low, high = float(np.clip(low, -most, most)), float(np.clip(high, -most, most))
            ranges[name] = (low, high, float(np.clip(0.0, low, high)), unit)
        for axis in "xy":
            ranges[f"tilt about {axis}"] = (-MOST_TILT_DEG, MOST_TILT_DEG, 0.0, "deg")
        if self._cant is not None:
            ranges["cant"] = (0.0, MOST_CANT_DEG, float(self._cant), "deg")
        sliders = {}
        for name, (low, high, value, unit) in ranges.items():
            step, digits = (0.001, ".3f") if unit == "m" else (1.0, ".0f")
            slider = ipywidgets.FloatSlider(
                value=value, min=low, max=high, step=step, description=f"{_short(name)} [{unit}]",
                readout_format=digits, style={"description_width": "110px"},
            )  # fmt: skip
            slider.observe(self.update, names="value")
            sliders[name] = slider
        return sliders

    def update(self, _: Any = None) -> Hover:
        """Make the vehicle, the scene and the report what the sliders say."""
        values = {name: float(slider.value) for name, slider in self.sliders.items()}
        cant = values.get("cant")
        if cant is not None and cant != self._cant:
            self._cant = cant
            self.vehicle = canted(self._base, cant)
            self._stage = stage(self.vehicle, f"rotors canted by {cant:.0f} deg")
            self.server.show(self._stage.spec(clock=False, keep_camera=True))
        arm = [values[name] for name in self.vehicle.arm_joints]
        euler = [values["tilt about x"], values["tilt about y"], 0.0]
        self.hover = hover(self.vehicle, arm, euler)
        shown = self._stage.vehicles[0].forces is not None
        if self.forces.value or shown:  # the body is not the same in another arm pose
            wanted = self.hover.envelope if self.forces.value else None
            self._stage = stage(self.vehicle, forces=wanted)
            self.server.show(self._stage.spec(clock=False, keep_camera=True))
        self.server.push(self._stage.frame(0.0, [self.hover.snapshot()]))
        self._report.value = report(self.hover)
        return self.hover

    def close(self) -> None:
        """Stop to serve the scene and remove the sliders."""
        self.server.close()
        self.panel.close()

    def _ipython_display_(self) -> None:
        from IPython.display import display

        display(self.panel)


def canted(vehicle: Vehicle, cant_deg: float) -> Vehicle:
    """The same design with its rotors tilted otherwise.

    Args:
        vehicle: A vehicle made from a design.
        cant_deg: Angle between thrust axes and z [deg].

    Raises:
        VehicleError: An angle that no design has.
    """
    definition = copy.deepcopy(vehicle.definition)
    design = VehicleDesign.from_table({**definition["design"], "cant_deg": cant_deg})
    definition["design"], definition["rotor"] = design.to_table(), design.rotor_tables()
    return Vehicle.from_definition(definition, design.urdf(vehicle.name))


def _short(name: str) -> str:
    """The tail of a long joint name."""
    return name if len(name) <= 14 else f"…{name[-13:]}"


def report(found: Hover) -> str:
    """Feasibility, the tilt rose and a bar per rotor, as HTML."""
    if found.feasible:
        verdict = f'<b style="color: #00704f">holds</b>, {found.shares.max():.0%} of full thrust'
    else:
        force, moment = np.linalg.norm(found.missing[:3]), np.linalg.norm(found.missing[3:])
        verdict = (
            f'<b style="color: #b34700">cannot hold</b>: {force:.1f} N and {moment:.2f} N m missing'
        )
    tilt, most = np.rad2deg(found.tilt), np.rad2deg(found.largest_tilt)
    rows = [f"<div>{verdict}</div><div>tilt {tilt:.0f}°; {most:.0f}° can be held this way</div>"]
    rows.append(f"<div>{rose_svg(found.envelope, found.tilt, found.azimuth)}</div>")
    colour = THRUST_COLOURS[1]
    for name, speed, share in zip(
        found.vehicle.rotors.names, found.speeds, found.shares, strict=True
    ):
        bar = f"width: {100.0 * share:.0f}px; background: {colour}"
        rows.append(
            '<div style="display: flex; align-items: center; line-height: 1.5">'
            f'<span style="width: 70px">{html.escape(_short(name))}</span>'
            f'<span style="width: 105px"><span style="display: block; height: 8px; {bar}"></span>'
            f"</span><span>{speed:.0f} rad/s</span></div>"
        )
    return "".join(rows)


def explore(vehicle: Vehicle | str = "fullam", height: int = 480) -> Explorer:
    """Sliders for arm, tilt and cant of a vehicle, with hover speeds and feasibility, live.

    Args:
        vehicle: A vehicle or its name; cant has a slider only for vehicles made from a design.
        height: Of the scene [px].

    Raises:
        MissingDependency: ipywidgets is not installed.
    """
    return Explorer(vehicle, height)
