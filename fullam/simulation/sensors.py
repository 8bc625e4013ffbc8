"""What the vehicle senses of itself: late, slow and noisy poses, and inertial readings."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.control.estimator import Readings
from fullam.dynamics.pose_space import AttitudeView, pose_model
from fullam.simulation.plant import Plant
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.weather import Forecast

Array = NDArray[np.float64]


class Sensors:
    """Fills `Readings` from the plant, once a control period.

    Attributes:
        readings: The readings, rewritten in place.
    """

    def __init__(
        self, settings: SimulationSettings, forecast: Forecast, gravity: float, poses: Array
    ) -> None:
        """Bind the noise and the history of true poses.

        Args:
            settings: Rate and delay of the pose sensor.
            forecast: The noise.
            gravity: [m/s^2].
            poses: Log of true poses on the control grid, shape (N, 7); a delayed pose is read
                from it.
        """
        self.readings = Readings()
        self._every, self._delay = settings.pose_every, settings.delay_periods
        self._forecast, self._poses = forecast, poses
        self._noisy = bool(forecast.pose_noise.any())
        self._model = pose_model()
        self._attitude = AttitudeView()
        self._gravity = np.array([0.0, 0.0, -gravity])

    def read(self, k: int, plant: Plant) -> Readings:
        """Readings of control period k; row k of the pose log must be written."""
        out = self.readings
        out.pose_is_new = k % self._every == 0
        if out.pose_is_new:
            pose = self._poses[max(0, k - self._delay)]
            if self._noisy:
                pose = pin.integrate(self._model, pose, self._forecast.pose_noise[k])
            out.pose[:] = pose
        out.velocity[:] = plant.v[:6]
        return out

    def read_inertial(self, k: int, plant: Plant) -> None:
        """Gyroscope w_A and accelerometer R^T (ddp_A - g), with their noise, into the readings."""
        v, a, out = plant.v, plant.acceleration, self.readings
        np.add(v[3:6], self._forecast.gyroscope_noise[k], out=out.gyroscope)
        R_WA = self._attitude.look(plant.q[:7])
        out.accelerometer[:] = a[:3] + pin.skew(v[3:6]) @ v[:3] - self._gravity @ R_WA
        out.accelerometer += self._forecast.accelerometer_noise[k]
