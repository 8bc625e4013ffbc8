"""Limits for a controller or an autopilot, from what the vehicle can do with its arm anywhere."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.atlas.batches import worst_tilts
from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.atlas.loads import centers_of, load_of
from fullam.model.attainable.facets import Facets
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

SHARE = 0.8
"""Share of what is there that a set point may ask for; the rest is for control and gusts."""

POSES = 2000
"""Arm poses drawn within the joints' limits."""

ENDLESS = 1.0
"""A prismatic joint without limits is tried so far both ways [m]; a revolute one by half a turn."""


@dataclass(frozen=True, eq=False)
class ArmSurvey:
    """The worst tilt over arm poses drawn evenly within the joints' limits.

    Attributes:
        thetas: Poses, shape (k, n_arm) [rad or m]; in the first one the arm is at rest.
        tilts: The worst tilt of each, exactly, shape (k,) [rad]; NaN without hover.
    """

    thetas: Array
    tilts: Array

    @property
    def hovering(self) -> float:
        """Share of the poses in which it can hover level."""
        return float(np.isfinite(self.tilts).mean())

    @property
    def least(self) -> int:
        """Index of the pose that allows the least tilt; one without hover, if there is one."""
        return int(np.where(np.isfinite(self.tilts), self.tilts, -1.0).argmin())

    @property
    def most(self) -> int:
        """Index of the pose that allows the most tilt."""
        return int(np.where(np.isfinite(self.tilts), self.tilts, -1.0).argmax())


def survey_arm(vehicle: Vehicle, facets: Facets, poses: int = POSES, seed: int = 0) -> ArmSurvey:
    """Worst tilts over random arm poses.

    Args:
        vehicle: The vehicle.
        facets: Of its rotors.
        poses: How many; a vehicle without an arm has one.
        seed: Seed of the draw.
    """
    joints, rng = vehicle.joints, np.random.default_rng(seed)
    endless = np.where(joints.prismatic, ENDLESS, np.pi)
    low, high = np.maximum(joints.lower, -endless), np.minimum(joints.upper, endless)
    thetas = rng.uniform(low, high, (poses if vehicle.n_arm else 1, vehicle.n_arm))
    thetas[0] = joints.rest
    centers = centers_of(vehicle, thetas)
    return ArmSurvey(thetas, worst_tilts(facets, load_of(vehicle), centers))


@dataclass(frozen=True)
class SuggestedLimits:
    """Limits that leave a reserve; None where the vehicle cannot hover level.

    Attributes:
        share: Share of what is there that they ask for.
        tilt_deg: Tilt of the platform, towards anywhere, in any arm pose surveyed [deg].
        lateral_ratio: Horizontal force over the weight while level, in any direction: what forks
            of PX4 for tilted rotors type in, MPC_FA_XY_RATIO say; not reduced by `share`.
        acceleration: Horizontal, while level, in any direction [m/s^2].
        up: Acceleration upwards, while level [m/s^2].
        down: Acceleration downwards, while level [m/s^2]: at most g.
        angular_acceleration: Least over the axes of {A}, arm locked [rad/s^2].
        hover_thrust: Sum of the thrusts at hover over the sum of the largest: MPC_THR_HOVER.
        payload: At the tool [kg].
    """

    share: float
    tilt_deg: float | None
    lateral_ratio: float | None
    acceleration: float | None
    up: float | None
    down: float | None
    angular_acceleration: float | None
    hover_thrust: float | None
    payload: float | None

    def to_dict(self) -> dict[str, Any]:
        """Under their names."""
        return asdict(self)


def suggest_limits(envelope: Envelope, survey: ArmSurvey, share: float = SHARE) -> SuggestedLimits:
    """Limits from the envelope of one arm pose, and the tilt from the survey of all.

    Args:
        envelope: With the arm in its usual pose.
        survey: Over the arm's poses.
        share: Share of what is there that a set point may ask for.
    """
    if not envelope.can_hover or envelope.hover_shares is None:
        return SuggestedLimits(share, *[None] * 8)
    load, thrusts = envelope.load, envelope.rotors.max_thrusts
    lowest = survey.tilts[survey.least]
    linear, angular = envelope.acceleration(), envelope.angular_acceleration()
    return SuggestedLimits(
        share=share,
        tilt_deg=float(np.rad2deg(share * lowest)) if np.isfinite(lowest) else None,
        lateral_ratio=envelope.least_level_force / load.weight,
        acceleration=share * envelope.least_level_force / load.mass,
        up=share * float(linear[2, 1]),
        down=share * float(linear[2, 0]),
        angular_acceleration=share * float(angular.min()),
        hover_thrust=float(thrusts @ envelope.hover_shares / thrusts.sum()),
        payload=share * envelope.payload,
    )
