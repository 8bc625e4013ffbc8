"""Where the tool is on the arm's last link, for whatever touches or carries."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.link_rows import LinkRows
from fullam.exceptions import ScenarioError
from fullam.model.chain import LinkChain
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]


def held_tool(vehicle: Vehicle, deed: str) -> tuple[Array, Array]:
    """The tool's point in the last link's frame, and the rotation of the last row's axes to it.

    Args:
        vehicle: The vehicle.
        deed: What the tool is to do, for the message.

    Returns:
        Position, shape (3,) [m], and rotation, shape (3, 3); see `LinkRows.frames`.

    Raises:
        ScenarioError: The tool is not on the arm's last link.
    """
    chain = LinkChain.from_model(vehicle.model, vehicle.tool)
    if chain.tool_link != chain.n:
        raise ScenarioError(
            f"vehicle '{vehicle.name}'",
            "tool",
            f"'{vehicle.tool}' is on link {chain.tool_link} of {chain.n}",
            f"only a tool on the arm's last link can {deed}",
        )
    return np.array(chain.tool_P), LinkRows.of(chain).frames[-1]
