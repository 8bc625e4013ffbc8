"""The scenario `turn-valve`, in MuJoCo: a handwheel is turned by its pin, which a hoop takes.

The wheel's hinge lies along +x; it resists with 0.1 N m of friction and some damping, and its pin,
0.12 m off, points at the vehicle. The tool carries a hoop. It is put over the pin from ahead and
led about the hinge by `TURN`, the platform's attitude held. The pin has `PLAY` in the hoop, for
errors of the approach in gusts; so the wheel turns up to 7 deg less than the hoop, and the hoop
less than asked where the servos give way.

Laws that hold their position keep the hoop off the wheel, and turn it by the pin alone; with
`hybrid-force` the hoop is pushed against the wheel's face with 3 N besides, and rubs on it. Plain
dc-PID winds up, turns late, and may miss the pin in gusts.

A record has the wheel's angle, `run.moved("valve")`; `hoop_angle` tells how far the hoop led it.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.simulation.motions.trajectory import Trajectory
from fullam.simulation.scenarios.interaction import AHEAD_DEG, HOME, YAW_DEG
from fullam.simulation.scenarios.scenario import Scenario, register_scenario
from fullam.simulation.tool.paths import SplinePath, minimum_jerk
from fullam.simulation.tool.task import ToolTask
from fullam.simulation.world.world_file import WorldFile

if TYPE_CHECKING:
    from fullam.simulation.record.run import Run

Array = NDArray[np.float64]

HINGE = (0.72, 0.0, 0.82)
"""Where the hinge's axis, +x, leaves the wheel's face [m]."""

RADIUS = 0.12
"""From the hinge to the pin [m]."""

FRICTION = 0.1
"""Of the hinge [N m]."""

HOOP = 0.05
"""From the tool's point to the hoop's plane, along the tool's z [m]."""

PIN, BEND, ROD = 0.005, 0.022, 0.004
"""Radii of the pin, of the circle in the hoop's octagon and of the hoop's rods [m]."""

PLAY = (BEND - ROD - PIN) / np.cos(np.pi / 8.0)
"""Farthest that the pin's axis gets from the hoop's, in a corner [m]."""

TURN = np.radians(120.0)
"""By which the tool is led about the hinge [rad]."""

APPROACH, ARC = (0.5, 3.5), (4.0, 12.0)
"""Of the path: when the hoop goes over the pin, and when it goes about the hinge [s]."""

REACH = 0.05
"""How far it goes over the pin [m]; 16 mm are left to the wheel's face."""


def hoop() -> str:
    """The hoop's eight rods, and two that hold it, as MJCF in the tool's axes.

    They weigh 5 g, as thin tubes of carbon do: the law is not told, and 20 g let the servos sag and
    dc-PID tilt so far that its hoop misses the pin.
    """
    corner = BEND / np.cos(np.pi / 8.0)
    angles = np.pi / 8.0 + np.pi / 4.0 * np.arange(9)
    points = [f"{corner * np.cos(a):.6f} {corner * np.sin(a):.6f} {HOOP}" for a in angles]
    ends = [*pairwise(points)]
    ends += [(f"{way * 0.01} 0 0.005", f"{way * BEND} 0 {HOOP}") for way in (1, -1)]
    return "\n".join(
        f'      <geom type="capsule" size="{ROD}" fromto="{a}  {b}" mass="0.0005"/>'
        for a, b in ends
    )


SCENE = f"""
<mujoco model="valve">
  <default><geom friction="0.2 0.005 0.0001" rgba="0.6 0.6 0.65 1"/></default>
  <worldbody>
    <body name="tool">
{hoop()}
    </body>
    <body name="valve" pos="{HINGE[0]} {HINGE[1]} {HINGE[2]}">
      <joint name="valve" type="hinge" axis="1 0 0" frictionloss="{FRICTION}" damping="0.02"/>
      <geom name="wheel" type="cylinder" size="0.16 0.01" pos="0.01 0 0" euler="0 90 0"
            mass="0.5" rgba="0.7 0.2 0.2 1"/>
      <geom name="pin" type="capsule" size="{PIN}" fromto="0 0 {RADIUS}  -0.045 0 {RADIUS}"
            mass="0"/>
    </body>
    <body name="pipe" pos="{HINGE[0]} {HINGE[1]} {HINGE[2]}">
      <geom name="pipe" type="cylinder" size="0.03 0.05" pos="0.075 0 0" euler="0 90 0"
            contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>
"""


def path() -> Trajectory:
    """Of the tool: over the pin, then about the hinge, each from rest to rest."""
    t = np.linspace(0.0, 12.5, 101)
    ahead = REACH * minimum_jerk(t - APPROACH[0], APPROACH[1] - APPROACH[0])
    angle = TURN * minimum_jerk(t - ARC[0], ARC[1] - ARC[0])
    places = np.column_stack([ahead, -RADIUS * np.sin(angle), RADIUS * np.cos(angle)])
    return Trajectory(tuple(t.tolist()), tuple(map(tuple, places.tolist())), degree=5, ends="rest")


def hoop_angle(run: Run) -> Array:
    """Angle of the hoop about the hinge over a flight, shape (N,) [rad].

    With the pin in it, the wheel's own, `run.moved("valve")`, is within asin(PLAY / RADIUS) of it,
    and behind as it turns.
    """
    model = run.vehicle.model
    data, frame = model.createData(), model.getFrameId(run.vehicle.tool)
    angles = np.empty(len(run))
    for k, q in enumerate(np.column_stack([run.pose, run.arm])):
        pin.framesForwardKinematics(model, data, q)
        tool = data.oMf[frame]
        _, y, z = tool.translation + HOOP * tool.rotation[:, 2] - HINGE
        angles[k] = np.arctan2(-y, z)
    return angles


register_scenario(
    Scenario(
        name="turn-valve",
        description="Put a hoop over a valve's pin and turn it by 100 deg, in MuJoCo",
        controller="dc-pid-plus",
        initial_position=HOME,
        initial_euler_deg=YAW_DEG,
        initial_arm_deg=AHEAD_DEG,
        tool=ToolTask(SplinePath(path()), attitude="fixed"),
        duration=14.0,
        world_file=WorldFile("turn-valve.xml", SCENE),
    )
)
