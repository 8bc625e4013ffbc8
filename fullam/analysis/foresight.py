"""Before take-off: does a scenario ask for what the vehicle cannot do."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.atlas.loads import centers_of, load_of
from fullam.dynamics.rotations import quaternion_rotation
from fullam.model.attainable.facets import facets_of
from fullam.model.joints import ArmJoints
from fullam.model.vehicle import Vehicle
from fullam.simulation.motions import arm_motion, references
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.tool.solution import with_tool_solved

Array = NDArray[np.float64]

SAMPLES = 400
"""Instants at which a scenario is looked at."""


@dataclass(frozen=True, eq=False)
class OutOfReach:
    """Where a scenario asks for an attitude that the vehicle cannot hold at rest.

    Attributes:
        t: When it misses most [s].
        tilt: Tilt asked for [rad].
        azimuth: Where the platform leans to, seen from {A} [rad].
        held: Tilt up to which this azimuth can be held with this arm pose [rad]; None if the
            vehicle cannot even hover level.
        arm: Joint positions then [rad or m].
        joints: The arm's joints.
    """

    t: float
    tilt: float
    azimuth: float
    held: float | None
    arm: Array
    joints: ArmJoints

    @property
    def short(self) -> float:
        """By how much [rad]."""
        return self.tilt - (self.held or 0.0)

    def __str__(self) -> str:
        """What is asked, what is there, in which arm pose."""
        typed = zip(self.joints.to_typed(self.arm), self.joints.units, strict=True)
        arm = ", ".join(f"{x:.0f} deg" if unit == "deg" else f"{x:.3f} m" for x, unit in typed)
        pose = f" with the arm at ({arm})" if arm else ""
        if self.held is None:
            return f"at {self.t:.2f} s the vehicle cannot hover level{pose}"
        return (
            f"at {self.t:.2f} s a tilt of {np.rad2deg(self.tilt):.1f} deg is asked for, towards "
            f"azimuth {np.rad2deg(self.azimuth) % 360.0:.0f} deg{pose}, and "
            f"{np.rad2deg(self.held):.1f} deg can be held: {np.rad2deg(self.short):.1f} deg short"
        )


def reach_warning(scenario: Scenario, vehicle: Vehicle) -> OutOfReach | None:
    """Where a scenario's targets are out of reach of the vehicle at rest; None if nowhere.

    A scenario that does not control all six axes is asked for level hover only. What accelerating,
    gusts and control take on top is not counted: no warning is no promise.

    Args:
        scenario: The scenario.
        vehicle: The vehicle that is to fly it.

    Raises:
        VehicleError: A vehicle without gravity.
    """
    t = np.linspace(0.0, scenario.duration, SAMPLES)
    joints = vehicle.joints
    scenario = with_tool_solved(scenario, vehicle)
    start = scenario.initial_arm(vehicle)
    arm = arm_motion.tabulate(scenario.arm_motion, t, start, joints).theta
    pose = references.tabulate(scenario.reference, t, scenario.initial_pose).pose
    up = quaternion_rotation(pose[:, 3:])[:, 2, :]
    if not all(scenario.axes_mask):
        up = np.tile([0.0, 0.0, 1.0], (len(t), 1))
    rows = np.round(np.hstack([up, arm]), 6)
    _, instants = np.unique(rows, axis=0, return_index=True)
    facets, load = facets_of(vehicle.rotors), load_of(vehicle)
    worst: OutOfReach | None = None
    for k, center in zip(instants, centers_of(vehicle, arm[instants]), strict=True):
        envelope = Envelope.from_rotors(vehicle.rotors, replace(load, center=center), facets)
        tilt = float(np.arccos(np.clip(up[k, 2], -1.0, 1.0)))
        azimuth = float(np.arctan2(up[k, 1], up[k, 0]))
        held = float(envelope.rose([azimuth])[0]) if envelope.can_hover else None
        found = OutOfReach(float(t[k]), tilt, azimuth, held, arm[k], joints)
        missing = held is None or tilt > held + 1e-9
        if missing and (worst is None or (worst.held is not None and found.short > worst.short)):
            worst = found
        if held is None:
            return found
    return worst
