"""The tool's part of a track: where it is in every control period, of an arm that yields.

Where joints follow their motion exactly, whoever reads the track knows the arm; where they are free
nobody does, and a campaign keeps no record of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.recursion import place_joints
from fullam.dynamics.so3 import rotation_matrix
from fullam.model.chain import LinkChain
from fullam.model.vehicle import Vehicle
from fullam.numbers.kernel import Number, kernel
from fullam.numbers.records import Rows
from fullam.numbers.vectors import ZERO, Vector, add, rotate


class ToolPoint(NamedTuple):
    """The tool on its link, whose joint is that many from the base; 0 is the platform."""

    link: Number
    point: Vector


class ToolView(NamedTuple):
    """What `write_tool` is shown; `joints` is room."""

    state: Any
    links: Any
    arm: Any
    joints: Any
    tool: Any
    places: Any


@kernel
def write_tool(view, k):
    """Write where the tool is in period k, before the vehicle moves on."""
    pose, tool, joints = view.state[0].pose, view.tool[0], view.joints
    place_joints(view.links, view.arm, joints)
    way, reach = ZERO, tool.point
    for i in range(int(tool.link)):
        way = add(way, joints[i].step)
        reach = rotate(joints[i].rotation, tool.point)
    R = rotation_matrix(pose.attitude)
    view.places[k] = add(pose.position, rotate(R, add(way, reach)))


def tool_point(vehicle: Vehicle) -> Rows:
    """A vehicle's tool, one row of `ToolPoint`."""
    chain = LinkChain.from_model(vehicle.model, vehicle.tool)
    point = LinkRows.of(chain).frames[chain.tool_link].T @ chain.tool_P
    return Rows(ToolPoint, np.array([[chain.tool_link, *point]]))
