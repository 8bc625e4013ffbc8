"""The datasheet of a vehicle: everything that the atlas, the agreement and a trial flight say."""

from __future__ import annotations

import datetime
import platform
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.agreement import AgreementTable, agreement
from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.atlas.failures import Atlas
from fullam.analysis.capability import Capability, assess
from fullam.analysis.limits import ArmSurvey, SuggestedLimits, suggest_limits, survey_arm
from fullam.analysis.trial import Trial, fly_trial
from fullam.exceptions import VehicleError
from fullam.model.vehicle import Vehicle
from fullam.version import __version__

Array = NDArray[np.float64]

AZIMUTHS = np.arange(180) * (2.0 * np.pi / 180.0)
"""Azimuths of the roses and slices [rad]."""

SAMPLES = 200
"""Random states of the agreement."""

PAYLOADS = 41
"""Points of the payload curve."""

SPREAD = 1e-6
"""Arm poses that allow the same tilt up to this [rad] are not told apart."""

PACKAGES = ("pin", "numpy", "scipy")


@dataclass(frozen=True, eq=False)
class ArmPose:
    """The vehicle with its arm in one pose.

    Attributes:
        name: What the pose is.
        theta: Joint positions [rad or m].
        envelope: What it can do.
        rose: First exits from level over `AZIMUTHS` [rad].
    """

    name: str
    theta: Array
    envelope: Envelope
    rose: Array


@dataclass(frozen=True, eq=False)
class Datasheet:
    """All of it.

    Attributes:
        vehicle: The vehicle.
        capability: With the arm at rest.
        poses: Arm at rest, and where the survey found the least and the most tilt.
        survey: Worst tilts over many arm poses.
        failures: The envelope with each rotor stopped, arm at rest.
        payloads: Masses at the tool, shape (k,) [kg].
        payload_tilts: The worst tilt with each, shape (k,) [rad]; NaN without hover.
        limits: For controllers and autopilots.
        agreement: Of the three ways to compute the dynamics; None where the paper's equations do
            not hold for the arm.
        trial: A flight of the recommended law.
        date: Of the sheet, YYYY-MM-DD.
        versions: Of the software.
    """

    vehicle: Vehicle
    capability: Capability
    poses: tuple[ArmPose, ...]
    survey: ArmSurvey
    failures: tuple[Envelope, ...]
    payloads: Array
    payload_tilts: Array
    limits: SuggestedLimits
    agreement: AgreementTable | None
    trial: Trial
    date: str
    versions: dict[str, str]

    def to_dict(self) -> dict[str, Any]:
        """Every figure under its name and unit, for machines."""
        survey = self.survey
        return {
            "vehicle": self.vehicle.name,
            "description": self.vehicle.description,
            "date": self.date,
            "versions": self.versions,
            "capability": self.capability.to_dict(),
            "rotors": rotor_rows(self.vehicle),
            "arm_poses": [
                {
                    "name": pose.name,
                    "arm": self.vehicle.joints.to_typed(pose.theta).tolist(),
                    "rose_deg": np.rad2deg(pose.rose).tolist(),
                }
                | summary(pose.envelope)
                for pose in self.poses
            ],
            "azimuths_deg": np.rad2deg(AZIMUTHS).tolist(),
            "arm_survey": {
                "poses": len(survey.tilts),
                "share_hovering": survey.hovering,
                "least_tilt_deg": float(np.rad2deg(survey.tilts[survey.least])),
            },
            "failures": [summary(each) for each in self.failures],
            "payload_kg": self.payloads.tolist(),
            "payload_tilt_deg": np.rad2deg(self.payload_tilts).tolist(),
            "limits": self.limits.to_dict(),
            "agreement": None
            if self.agreement is None
            else asdict(self.agreement) | {"largest": self.agreement.largest},
            "trial": self.trial.to_dict(),
        }


def datasheet(
    vehicle: Vehicle, *, seed: int = 0, flights: int | None = None, date: str | None = None
) -> Datasheet:
    """Work out the datasheet of a vehicle.

    Args:
        vehicle: The vehicle.
        seed: Of the arm poses, the random states of the agreement.
        flights: Of the trial; 10 by default, 0 for none.
        date: YYYY-MM-DD; today by default.

    Raises:
        VehicleError: A vehicle without gravity.
    """
    atlas, capability = Atlas(vehicle), assess(vehicle)
    survey = survey_arm(vehicle, atlas.facets, seed=seed)
    rest = vehicle.joints.rest
    named = {"arm at rest": rest}
    if np.ptp(np.nan_to_num(survey.tilts, nan=-1.0)) > SPREAD:
        named["least tilt of all poses tried"] = survey.thetas[survey.least]
        named["most tilt of all poses tried"] = survey.thetas[survey.most]
    poses = []
    for name, theta in named.items():
        envelope = atlas.envelope(theta)
        poses.append(ArmPose(name, theta, envelope, envelope.rose(AZIMUTHS)))
    first = poses[0].envelope
    most = first.payload if first.can_hover else 0.0
    payloads = np.linspace(0.0, most, PAYLOADS)
    loaded = [atlas.envelope(rest, payload=float(mass)).worst_tilt for mass in payloads]
    trial_arguments = {} if flights is None else {"seeds": flights}
    return Datasheet(
        vehicle=vehicle,
        capability=capability,
        poses=tuple(poses),
        survey=survey,
        failures=atlas.after_failures(rest),
        payloads=payloads,
        payload_tilts=np.array([np.nan if tilt is None else tilt[0] for tilt in loaded]),
        limits=suggest_limits(first, survey),
        agreement=_agreement(vehicle, seed),
        trial=Trial("", "", "", 0, 0, None, None, None, "not asked for")
        if flights == 0
        else fly_trial(vehicle, first, **trial_arguments),
        date=date or datetime.date.today().isoformat(),
        versions={"fullam": __version__, "python": platform.python_version()}
        | {name: version(name) for name in PACKAGES},
    )


def _agreement(vehicle: Vehicle, seed: int) -> AgreementTable | None:
    try:
        return agreement(vehicle, SAMPLES, seed)
    except VehicleError:
        return None


def summary(envelope: Envelope) -> dict[str, Any]:
    """The figures of an envelope as JSON values; null where it cannot hover."""
    worst, best = envelope.worst_tilt, envelope.best_tilt
    found = {
        "can_hover": envelope.can_hover,
        "worst_tilt_deg": None if worst is None else float(np.rad2deg(worst[0])),
        "best_tilt_deg": None if best is None else float(np.rad2deg(best[0])),
        "thrust_to_weight": envelope.thrust_to_weight,
        "level_force_N": envelope.least_level_force,
        "push_N": envelope.least_push,
        "moment_Nm": envelope.least_moment,
        "margin_N": envelope.margin.value,
        "margin_length_m": envelope.length,
        "payload_kg": envelope.payload,
        "hover_efficiency": envelope.hover_efficiency,
    }
    return {k: None if isinstance(v, float) and np.isnan(v) else v for k, v in found.items()}


def rotor_rows(vehicle: Vehicle) -> list[dict[str, Any]]:
    """The rotors as JSON values."""
    rotors = vehicle.rotors
    return [
        {
            "name": name,
            "position_m": rotors.positions[k].tolist(),
            "cant_deg": float(np.rad2deg(np.arccos(np.clip(rotors.axes[k, 2], -1.0, 1.0)))),
            "axis": rotors.axes[k].tolist(),
            "spin": int(rotors.spins[k]),
            "k_f": float(rotors.k_f[k]),
            "k_tau": float(rotors.k_tau[k]),
            "min_speed_rad_s": float(rotors.min_speeds[k]),
            "max_speed_rad_s": float(rotors.max_speeds[k]),
            "max_thrust_N": float(rotors.max_thrusts[k]),
        }
        for k, name in enumerate(rotors.names)
    ]
