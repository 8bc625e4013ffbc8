"""What an arm on servos does, and what its tool touches: panels of records that have them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fullam.exceptions import InvalidInput
from fullam.simulation.motions.arm_motion import tabulate
from fullam.viz import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fullam.simulation.record.run import Run

Array = NDArray[np.float64]


def has_contact(run: Run) -> bool:
    """Whether something was touched."""
    return bool(np.any(run.columns.get("contact_force", 0.0)))


def has_servos(run: Run) -> bool:
    """Whether the joints were moved by servos, and there are any."""
    return run.columns.get("arm_torque", np.zeros((0, 0))).size > 0


def force_asked(run: Run) -> tuple[Array, Array] | None:
    """What the law was told to push with: the unit normal (3,), and the force over time (N,) [N].

    None for a law that is told no such thing.
    """
    settings = run.settings
    if not {"normal", "force", "engage_at", "release_at"} <= settings.keys():
        return None
    normal = np.array(settings["normal"]) / np.linalg.norm(settings["normal"])
    pushing = (run.t >= settings["engage_at"]) & (run.t < settings["release_at"])
    return normal, np.where(pushing, settings["force"], np.nan)


def draw_contact(ax: Axes, run: Run) -> None:
    """The force of the tool on the world: along the normal that is pushed and across, or x, y, z.

    Raises:
        InvalidInput: Nothing could be touched in this record.
    """
    force = -_column(run, "contact_force", "contact", "fly a scenario with a world: push-wall")
    asked = force_asked(run)
    if asked is None:
        parts = {letter: force[:, i] for i, letter in enumerate("xyz")}
    else:
        along = force @ asked[0]
        across = np.linalg.norm(force - np.outer(along, asked[0]), axis=1)
        parts = {"along the normal": along, "across": across}
    for k, (name, values) in enumerate(parts.items()):
        ax.plot(run.t, values, color=style.PALETTE[k], linewidth=style.THIN, label=name)
    if asked is not None:
        ax.plot(
            run.t,
            asked[1],
            color=style.BLACK,
            linewidth=style.THIN,
            linestyle=(0, (5, 3)),
            label="asked",
            zorder=3.0,
        )
    style.label(ax, "tool's push [N]")
    style.legend(ax)
    ax.margins(x=0.01)


def draw_torques(ax: Axes, run: Run) -> None:
    """Torques at the joints, or forces at those that slide.

    Raises:
        InvalidInput: The joints followed their motion without any.
    """
    torques = _column(run, "arm_torque", "torques", "fly with the plant 'servo'")
    _draw_joints(ax, run, torques)
    units = dict.fromkeys(run.units["arm_torque"].split(", "))
    style.label(ax, f"torques [{', '.join(units)}]")


def draw_arm(ax: Axes, run: Run) -> None:
    """How far the joints are from what was asked of them; where hands asked, where they are."""
    vehicle, scenario = run.vehicle, run.scenario
    joints, shown, name = vehicle.joints, run.arm, "joints"
    if run.script is None:
        start = scenario.initial_arm(vehicle)
        shown = shown - tabulate(scenario.arm_motion, run.t, start, joints).theta
        name = "joint errors"
    _draw_joints(ax, run, joints.to_typed(shown))
    units = dict.fromkeys(joints.units)
    style.label(ax, f"{name} [{', '.join(units)}]")


def _draw_joints(ax: Axes, run: Run, values: Array) -> None:
    ax.axhline(0.0, color=style.BLACK, linewidth=style.THIN, linestyle=(0, (1, 1.5)))
    for i, column in enumerate(values.T):
        color = style.PALETTE[i % len(style.PALETTE)]
        ax.plot(run.t, column, color=color, linewidth=style.THIN, label=f"joint {i + 1}")
    style.legend(ax)
    ax.margins(x=0.01)


def _column(run: Run, name: str, panel: str, remedy: str) -> Array:
    if name not in run.columns or run.columns[name].size == 0:
        problem = f"is no part of a record of the plant '{run.simulation.plant}'"
        raise InvalidInput("plot", panel, problem, remedy)
    return run.columns[name]
