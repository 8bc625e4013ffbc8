"""The flight that tells a vehicle's parameters: every axis and every joint swings."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from fullam.analysis.capability import assess
from fullam.checks import Checker, Range
from fullam.exceptions import ScenarioError, VehicleError
from fullam.model.vehicle import Vehicle
from fullam.simulation.excitation import JOINT_ROUNDS, ArmExcitation, Excitation
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.weather import PAPER, Weather

Array = NDArray[np.float64]

SWING = 0.3
"""Amplitude in position [m]."""

MOST_TILT = np.radians(15.0)
TILT_SHARE = 0.5
"""Amplitude of each angle: three of them at once tilt by less than 1.7 times that, and gusts and
the arm need their share of what the vehicle can hold."""

JOINT_SWING = np.radians(30.0)
SLIDE_SWING = 0.05
RANGE_SHARE, RATE_SHARE = 0.4, 0.5
"""Amplitude of a joint: what it has room and speed for, at most this [rad, m]."""

HEIGHT = 2.0
"""Where it flies [m]."""


def excitation_flight(
    vehicle: Vehicle,
    duration: float = 20.0,
    weather: Weather = PAPER,
    arm: ArrayLike | None = None,
) -> Scenario:
    """A flight from which `calibrate` fits a vehicle.

    Args:
        vehicle: The nominal vehicle.
        duration: 15 to 20 s do, of which every part tells something [s].
        weather: In which it is flown; the quieter the better.
        arm: Joint positions about which the arm swings [rad or m]; hanging by default.

    Raises:
        VehicleError: The vehicle cannot hover, or holds no tilt.
        ScenarioError: A duration or an arm that makes no sense.
    """
    check = Checker("excitation_flight", ScenarioError)
    check.instance("vehicle", vehicle, Vehicle)
    check.instance("weather", weather, Weather)
    duration = check.number("duration", duration, Range(1.0, 1e4, "s"))
    if arm is not None:
        arm = check.array("arm", arm, (vehicle.n_arm,))
    joints = vehicle.joints
    amplitudes = joint_amplitudes(vehicle, duration)
    middle = hanging_arm(vehicle) if arm is None else np.asarray(arm, dtype=float)
    middle = np.clip(middle, joints.lower + amplitudes, joints.upper - amplitudes)
    tilt = assess(vehicle, middle).worst_hover_tilt
    if not tilt:
        raise VehicleError(
            f"vehicle '{vehicle.name}'",
            "rotors",
            "hold no tilt in every direction",
            "calibrate by a record of your own: calibrate(run)",
        )
    euler_deg = float(np.degrees(min(MOST_TILT, TILT_SHARE * tilt)))
    return Scenario(
        name="calibration",
        description="Every axis and every joint swings, so that all parameters show",
        vehicle=vehicle.name,
        initial_position=(0.0, 0.0, HEIGHT),
        initial_arm_deg=tuple(joints.to_typed(middle).tolist()),
        reference=Excitation((SWING,) * 3, (euler_deg,) * 3, duration),
        arm_motion=ArmExcitation(tuple(amplitudes.tolist()), duration),
        duration=duration,
        weather=weather,
    )


def joint_amplitudes(vehicle: Vehicle, duration: float) -> Array:
    """Amplitudes that the joints have room and speed for, shape (n,) [rad or m]."""
    joints = vehicle.joints
    wanted = np.where(joints.prismatic, SLIDE_SWING, JOINT_SWING)
    turns = np.array([sum(JOINT_ROUNDS[i % len(JOINT_ROUNDS)]) for i in range(vehicle.n_arm)])
    fastest = np.pi * turns / duration  # of a swing of amplitude 1
    room = np.minimum(RANGE_SHARE * (joints.upper - joints.lower), wanted)
    return np.minimum(room, RATE_SHARE * joints.max_rates / np.maximum(fastest, 1e-12))


def hanging_arm(vehicle: Vehicle) -> Array:
    """Where the arm of the level vehicle comes to rest without its motors, shape (n,) [rad or m].

    The least potential energy within the joints' limits, from rest.
    """
    from scipy.optimize import minimize

    model, data, joints = vehicle.model, vehicle.create_data(), vehicle.joints
    if not vehicle.n_arm:
        return np.zeros(0)

    def energy(theta: Array) -> float:
        return float(pin.computePotentialEnergy(model, data, vehicle.neutral(theta)))

    start = joints.rest + 1e-3  # off a balance on the very top
    bounds = list(
        zip(np.maximum(joints.lower, -np.pi), np.minimum(joints.upper, np.pi), strict=True)
    )
    found = minimize(energy, start, method="L-BFGS-B", bounds=bounds)
    return np.array(found.x)
