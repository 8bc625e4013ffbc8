"""Eight known motions, sensed and estimated: a flight without law and plant."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fullam.control.estimator import EstimateView, Inertial, Readings, estimate_stage
from fullam.control.signals import Estimate
from fullam.dynamics.spatial import Pose, Spatial
from fullam.numbers.kernel import kernel
from fullam.numbers.program import Stage, program
from fullam.numbers.records import Rows
from fullam.simulation.sensors import keep_pose, sense_inertial, sense_pose

FLIGHTS, STEP = 8, 1e-4
"""Flights, one a lane; step of the differences that give angular velocities [s]."""


EXACT = Inertial((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
"""Gains of sensors that read what there is."""


class True_(NamedTuple):
    """Pose, body velocity and its derivative."""

    pose: Pose
    velocity: Spatial
    acceleration: Spatial


class SenseView(NamedTuple):
    motion: Any
    noise: Any
    inertial_noise: Any
    every: Any
    ring: Any
    readings: Any


class KeepView(NamedTuple):
    estimate: Any
    told: Any


@kernel
def sense(view, k):
    true = view.motion[k]
    keep_pose(view.ring, true.pose, k)
    pose = sense_pose(view.ring, view.noise[k], view.readings[0].pose, view.every[0], k)
    felt = sense_inertial(
        true.pose.attitude, true.velocity, true.acceleration, 9.81, EXACT, view.inertial_noise[k]
    )
    is_new = 0.0 if k % int(view.every[0]) else 1.0
    view.readings[0] = Readings(pose, true.velocity, felt.gyroscope, felt.accelerometer, is_new)


@kernel
def keep(view, k):
    view.told[k] = view.estimate[0]


@dataclass
class Known:
    """Motions and noise of all flights, entries [period, entry, flight], from rest."""

    motion: Any
    noise: Any
    inertial_noise: Any

    @classmethod
    def of(cls, datasheet, periods, period, seed=0):
        """Smooth random motions, and noise by the datasheet."""
        rng, t = np.random.default_rng(seed), np.arange(periods) * period
        motion = np.zeros((periods, 19, FLIGHTS))
        for flight in range(FLIGHTS):
            amplitude, rate = rng.uniform(0.2, 1.0, (3, 1)), rng.uniform(1.0, 3.0, (3, 1))
            p = amplitude * (1.0 - np.cos(rate * t))
            dp, ddp = amplitude * rate * np.sin(rate * t), amplitude * rate**2 * np.cos(rate * t)
            swing, tempo = rng.uniform(-0.5, 0.5, 3), rng.uniform(1.0, 3.0, 3)

            def attitude(t, swing=swing, tempo=tempo):
                return Rotation.from_euler("XYZ", swing * np.sin(np.outer(t, tempo)))

            R = attitude(t)
            w = (attitude(t - STEP).inv() * attitude(t + STEP)).as_rotvec() / (2.0 * STEP)
            v = R.inv().apply(dp.T)
            a = R.inv().apply(ddp.T) - np.cross(w, v)
            motion[:, :, flight] = np.hstack([p.T, R.as_quat(), v, w, a, np.zeros_like(a)])
        sheet = datasheet
        sigma = np.repeat([sheet.position_noise, sheet.attitude_noise], 3)
        noise = rng.standard_normal((periods, 6, FLIGHTS)) * sigma[:, None]
        sigma = np.repeat([sheet.gyroscope_noise, sheet.accelerometer_noise], 3)
        return cls(motion, noise, rng.standard_normal(noise.shape) * sigma[:, None])


class SensedFlight:
    """An estimator at work on one of the known motions, or on all in lanes.

    Attributes:
        memory: What the estimator remembers.
        told: Rows of estimates.
    """

    def __init__(self, estimator, known, flight=None, compiled=None):
        lanes, which = (FLIGHTS, slice(None)) if flight is None else (0, flight)
        sheet, numbers = estimator.datasheet, estimator.numbers()
        readings = Rows.empty(Readings, 1, lanes=lanes)
        estimate = Rows.empty(Estimate, 1, lanes=lanes)
        self.memory = estimator.memory(lanes)
        self.told = Rows.empty(Estimate, len(known.motion), lanes=lanes)
        sensors = SenseView(
            Rows(True_, known.motion[..., which], lanes),
            Rows(Spatial, known.noise[..., which], lanes),
            Rows(Inertial, known.inertial_noise[..., which], lanes),
            Rows(float, [[sheet.pose_every]]),
            Rows.empty(Pose, sheet.delay_periods + 1, lanes=lanes),
            readings,
        )
        numbers = Rows.of(type(numbers), [numbers])
        view = EstimateView(numbers, self.memory, readings, estimate)
        stages = [
            Stage(sense, sensors),
            Stage(estimate_stage(estimator.kernel), view),
            Stage(keep, KeepView(estimate, self.told)),
        ]
        self.run = program(stages, compiled).run


@pytest.fixture(scope="session")
def known_motion():
    return Known.of


@pytest.fixture(scope="session")
def sensed_flight():
    return SensedFlight
