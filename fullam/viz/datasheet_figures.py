"""Figures of the datasheet: the vehicle drawn, what it can do as roses, slices, maps and curves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.analysis.datasheet import AZIMUTHS, ArmPose, Datasheet
from fullam.viz import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fullam.analysis.atlas.envelope import Envelope
    from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

VIEWS = (("from above", 0, 1), ("from the side", 0, 2), ("from behind", 1, 2))
"""Name of a view of {A}, its horizontal and its vertical axis."""

LETTERS = "xyz"
DISC = 0.12
"""Radius at which a rotor's disc is drawn, as a share of the largest hub distance times three."""


def figure_drawing(sheet: Datasheet) -> Figure:
    """The vehicle from three sides: rotors as discs with their thrust axes, arm, centre of mass."""
    figure = style.new_figure(style.FULL_PAGE, 2.7)
    axes = figure.subplots(1, 3)
    for ax, (name, i, j) in zip(axes, VIEWS, strict=True):
        style.style(ax)
        _draw_rotors(ax, sheet.vehicle, i, j)
        for k, pose in enumerate(sheet.poses):
            points = arm_points(sheet.vehicle, pose.theta)
            ax.plot(
                points[:, i], points[:, j], color=style.BLACK if k == 0 else style.GREY,
                linewidth=2.0 if k == 0 else 1.0, marker="o", markersize=2.0,
            )  # fmt: skip
        center = sheet.poses[0].envelope.load.center
        ax.plot(center[i], center[j], marker="+", markersize=9, color=style.VERMILION)
        ax.set_aspect("equal")
        ax.set_title(name, fontsize=style.TEXT)
        ax.set_xlabel(f"{LETTERS[i]} [m]", fontsize=style.TEXT)
        style.label(ax, f"{LETTERS[j]} [m]")
    return figure


def _draw_rotors(ax: Axes, vehicle: Vehicle, i: int, j: int) -> None:
    rotors = vehicle.rotors
    reach = float(np.linalg.norm(rotors.positions, axis=1).max()) or 0.2
    turn = np.linspace(0.0, 2.0 * np.pi, 49)
    for k in range(rotors.count):
        hub, axis = rotors.positions[k], rotors.axes[k]
        colour = style.BLUE if rotors.spins[k] > 0 else style.VERMILION
        across = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
        across /= np.linalg.norm(across)
        disc = np.outer(np.cos(turn), across) + np.outer(np.sin(turn), np.cross(axis, across))
        rim = hub + 3.0 * DISC * reach * disc
        tip = hub + 0.45 * reach * axis
        ax.plot([0.0, hub[i]], [0.0, hub[j]], color=style.GREY, linewidth=0.8)
        ax.fill(rim[:, i], rim[:, j], color=colour, alpha=0.25, linewidth=0.0)
        ax.plot([hub[i], tip[i]], [hub[j], tip[j]], color=colour, linewidth=1.2)
        if (i, j) == (0, 1):
            ax.text(
                1.3 * hub[0], 1.3 * hub[1], f"{k + 1}", fontsize=style.SMALL_TEXT, ha="center",
                va="center", color=colour,
            )  # fmt: skip


def arm_points(vehicle: Vehicle, theta: Array) -> Array:
    """The platform's origin, the joints and the tool in {A}, shape (n_arm + 2, 3) [m]."""
    model, data, q = vehicle.model, vehicle.create_data(), vehicle.neutral(theta)
    pin.framesForwardKinematics(model, data, q)
    joints = [np.array(data.oMi[k].translation) for k in range(2, model.njoints)]
    tool = np.array(data.oMf[model.getFrameId(vehicle.tool)].translation)
    return np.array([np.zeros(3), *joints, tool])


def figure_roses(sheet: Datasheet) -> Figure:
    """Hover tilt over the azimuth, a line per arm pose; and its spread over the arm's poses."""
    figure = style.new_figure(style.FULL_PAGE, 3.2)
    polar: Any = figure.add_subplot(1, 2, 1, projection="polar")
    for k, pose in enumerate(sheet.poses):
        _rose(polar, pose, style.PALETTE[k])
    polar.tick_params(labelsize=style.SMALL_TEXT, pad=0.0)
    polar.grid(color="#E6E6E6", linewidth=0.5)
    polar.set_rlabel_position(112.5)
    most = max(float(np.rad2deg(np.nanmax(pose.rose))) for pose in sheet.poses)
    polar.set_rlim(0.0, 1.1 * max(most, 4.5))
    polar.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.06), fontsize=style.SMALL_TEXT, frameon=False
    )
    ax = figure.add_subplot(1, 2, 2)
    style.style(ax)
    tilts = np.rad2deg(sheet.survey.tilts)
    tilts = tilts[np.isfinite(tilts)]
    if tilts.size:
        spread = max(float(np.ptp(tilts)), 0.5)
        middle = 0.5 * float(tilts.min() + tilts.max())
        edges = (middle - 0.55 * spread, middle + 0.55 * spread)
        ax.hist(tilts, bins=40, range=edges, color=style.BLUE, linewidth=0.0)
    ax.set_xlabel("worst tilt [deg]", fontsize=style.TEXT)
    style.label(ax, f"arm poses, of {len(sheet.survey.tilts)}")
    return figure


def _rose(ax: Any, pose: ArmPose, colour: str) -> None:
    angles, tilts = np.append(AZIMUTHS, AZIMUTHS[0]), np.append(pose.rose, pose.rose[0])
    ax.plot(angles, np.rad2deg(tilts), color=colour, linewidth=style.LINE, label=pose.name)
    worst = pose.envelope.worst_tilt
    if worst is not None:
        ax.plot(worst[1], np.rad2deg(worst[0]), "o", color=colour, markersize=4)


def figure_slices(sheet: Datasheet) -> Figure:
    """Largest force through the centre of mass, and largest moment, in three planes, from hover."""
    figure = style.new_figure(style.FULL_PAGE, 4.6)
    grid = figure.subplots(2, 3)
    envelope = sheet.poses[0].envelope
    turn = np.linspace(0.0, 2.0 * np.pi, 1441)
    rows = ((envelope.force, "N", "force"), (envelope.moment, "N m", "moment"))
    for row, (measure, unit, name) in enumerate(rows):
        for column, (_, i, j) in enumerate(VIEWS):
            ax = grid[row, column]
            style.style(ax)
            directions = np.zeros((len(turn), 3))
            directions[:, i], directions[:, j] = np.cos(turn), np.sin(turn)
            ends = measure(directions)[:, None] * directions
            ax.fill(
                ends[:, i], ends[:, j], facecolor=style.BLUE, edgecolor=style.BLUE, alpha=0.3,
                linewidth=style.LINE,
            )  # fmt: skip
            ax.plot(0.0, 0.0, marker="+", color=style.BLACK, markersize=7)
            ax.update_datalim([(-1.0, -1.0), (1.0, 1.0)])  # a point is not blown up
            ax.set_aspect("equal", adjustable="datalim")
            ax.set_xlabel(f"{name} {LETTERS[i]} [{unit}]", fontsize=style.TEXT)
            style.label(ax, f"{name} {LETTERS[j]} [{unit}]")
    return figure


def figure_push(sheet: Datasheet) -> Figure:
    """Largest force of the tool on the world over all directions, the arm at rest."""
    figure = style.new_figure(style.FULL_PAGE, 2.8)
    ax = figure.subplots()
    azimuths, heights = np.linspace(-np.pi, np.pi, 145), np.linspace(-np.pi / 2, np.pi / 2, 73)
    a, h = np.meshgrid(azimuths, heights)
    directions = np.stack([np.cos(h) * np.cos(a), np.cos(h) * np.sin(a), np.sin(h)], axis=-1)
    pushes = sheet.poses[0].envelope.push(directions)
    mesh = ax.pcolormesh(np.rad2deg(a), np.rad2deg(h), pushes, cmap="cividis", rasterized=True)
    bar = figure.colorbar(mesh, ax=ax, pad=0.01)
    bar.set_label("largest push [N]", fontsize=style.TEXT)
    bar.ax.tick_params(labelsize=style.SMALL_TEXT)
    least = np.unravel_index(np.nanargmin(pushes), pushes.shape)
    ax.plot(np.rad2deg(a[least]), np.rad2deg(h[least]), "x", color="white", markersize=6)
    ax.tick_params(labelsize=style.SMALL_TEXT)
    ax.set_xticks(np.arange(-180, 181, 45))
    ax.set_yticks(np.arange(-90, 91, 45))
    ax.set_xlabel("azimuth of the push in {A} [deg]", fontsize=style.TEXT)
    style.label(ax, "elevation [deg]")
    return figure


def figure_payload(sheet: Datasheet) -> Figure:
    """The worst tilt over the mass at the tool, the arm at rest."""
    figure = style.new_figure(style.HALF_COLUMN * 1.4, 2.3)
    ax = figure.subplots()
    style.style(ax)
    ax.plot(sheet.payloads, np.rad2deg(sheet.payload_tilts), color=style.BLUE, linewidth=style.LINE)
    ax.set_ylim(bottom=0.0)
    ax.margins(x=0.01)
    ax.set_xlabel("payload at the tool [kg]", fontsize=style.TEXT)
    style.label(ax, "worst tilt [deg]")
    return figure


def tool_point(envelope: Envelope) -> str:
    """Where the tool pushes, in words."""
    x, y, z = envelope.load.tool
    return f"({x:.3f}, {y:.3f}, {z:.3f}) m in {{A}}"
