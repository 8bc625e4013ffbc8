"""dc-PID+: dynamic compensation with a wrench observer in place of integral action.

    u = blkdiag(m_A 1, I_A) u_pd + u_dc - d

with the compensation u_dc of eq. (20) and d the wrench that the nominal model does not explain
(`WrenchObserver`). dc-PID cancels the model; what the model has wrong stays as an offset until its
integrator has grown, and the integrator then answers every manoeuvre with an overshoot. The
observer sees the error of the model in the momentum, before it is an error of the pose.

**Lead.** The rotors follow with a first-order lag, so the wrench w they give now is known from
what they were asked for. Asking for u_c = w + n (u - w) makes them reach u with a lag n times
shorter: a lead filter (lag s + 1) / (lag/n s + 1) that differentiates no measurement.

**Gains.** On a double integrator behind a lag of 30 ms, 10 ms of sampling and 5 ms to spare, with
n = 2, the loop cut at the command has

    position  25, 10, observer 20 rad/s:  phase margin 45 deg, gain margin 4.7, delay margin 37 ms
    attitude  60, 15, observer 18 rad/s:  phase margin 38 deg, gain margin 4.0, delay margin 27 ms

and with a true lag 30 % longer than the nominal one the attitude keeps 31 deg and 4.4. That much
speed needs an estimate like the Kalman filter's. Behind the paper's first-order filter, whose
velocity has thirty times the noise, `Caution` slows the law down, and it is then about as good as
dc-PID.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.control.caution import Caution
from fullam.control.controller import ALL_AXES, Measurement, ReferencePoint
from fullam.control.dc_pid import DcPid, DcPidSettings
from fullam.control.wrench_observer import WrenchObserver
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DcPidPlusSettings(DcPidSettings):
    """Settings of dc-PID+: those of dc-PID, and the observer's.

    Attributes:
        observer_rates: Rate K of the observer, of force and of moment [rad/s]; 0 switches that
            half off.
        actuation_lag: Time constant with which the wrench follows its command [s]; None takes the
            mean lag of the nominal rotors.
        actuation_speedup: How many times shorter the lead makes that lag; 1 leaves it.
        roughness_limits: Roughness of the measured velocity up to which the law keeps its pace,
            linear [m/s^2] and angular [rad/s^2]; see `Caution`. The Kalman filter's stay below
            1 and 8, the first-order filter's are 74 and 128 in the paper's noise.
    """

    position_gains: tuple[float, float, float] = (25.0, 0.0, 10.0)
    attitude_gains: tuple[float, float, float] = (60.0, 0.0, 15.0)
    observer_rates: tuple[float, float] = (20.0, 18.0)
    actuation_lag: float | None = None
    actuation_speedup: float = 2.0
    roughness_limits: tuple[float, float] = (8.0, 15.0)

    def __post_init__(self) -> None:
        """Check the observer's numbers, then dc-PID's."""
        super().__post_init__()
        for field in ("observer_rates", "roughness_limits"):
            self._become(field, 2)
        if self.actuation_lag is not None and not 0.0 <= self.actuation_lag < np.inf:
            raise self._wrong("actuation_lag", "give a time >= 0, or None")
        if not 1.0 <= self.actuation_speedup < np.inf:
            raise self._wrong("actuation_speedup", "give 1 or more")

    def wrench_lag(self, vehicle: Vehicle) -> float:
        """Time constant with which the wrench follows its command [s]."""
        lag = self.actuation_lag
        return float(vehicle.rotors.lags.mean()) if lag is None else lag

    def thrust_lag(self, vehicle: Vehicle) -> float:
        """The same as the lead makes it appear; see `TrackingSettings.thrust_lag`."""
        return self.wrench_lag(vehicle) / self.actuation_speedup


class DcPidPlus(DcPid):
    """dc-PID with a wrench observer in place of integral action, and a lead on the rotors.

    Attributes:
        observer: The observer; its `wrench` is d.
    """

    name = "dc-pid-plus"
    Settings = DcPidPlusSettings
    settings: DcPidPlusSettings

    def __init__(
        self,
        vehicle: Vehicle,
        settings: DcPidPlusSettings | None = None,
        period: float = 0.01,
        axes: tuple[bool, ...] = ALL_AXES,
    ) -> None:
        """Bind the law; see `Controller`."""
        super().__init__(vehicle, settings, period, axes)
        lag, led = self.settings.wrench_lag(vehicle), self.settings.thrust_lag(vehicle)
        self.observer = WrenchObserver(vehicle, period, self.settings.observer_rates, lag)
        self._caution = Caution(period, self.settings.roughness_limits)
        self._gains = self.law.gains.copy()
        self._mask = np.asarray(self.axes, dtype=float)
        self._lead: Array = np.zeros(6)
        self._turn_ahead = led + 0.5 * period if self.settings.anticipate else 0.0
        self._w_ref: Array = np.zeros(3)
        self._beside: Array = np.zeros(6)
        self._total: Array = np.zeros(6)
        self._fresh = True
        # What is bounded is the wrench less the observed one, not dc-PID's share of it.
        self._bounds_total, self._bounded = self._bounded, False

    def reset(self, measurement: Measurement, reference: ReferencePoint) -> None:
        """Start with nothing unexplained."""
        super().reset(measurement, reference)
        self.observer.reset(measurement)
        self._fresh = True
        self._caution.reset(measurement.v[:6])
        self._pace()

    def _pace(self) -> None:
        """Slow down by the caution's factors: the observer and the lead by f, the PD by f^(1/4).

        Rates of the PD times f^(1/4) are K_d times that and K_p times its square.
        """
        f = np.repeat(self._caution.factors, 3)
        self.observer.slow_down(f)
        np.multiply(self._mask * (self.settings.actuation_speedup - 1.0), f, out=self._lead)
        K_p, K_d = self._gains[:, :6], self._gains[:, 12:]
        root = np.sqrt(f)
        np.multiply(K_p, root, out=self.law.gains[:, :6])
        np.multiply(K_d, np.sqrt(root), out=self.law.gains[:, 12:])

    def wrench(self, t: float, measurement: Measurement, reference: ReferencePoint) -> Array:
        """Wrench of dc-PID less the observed one, world axes; see `Controller.wrench`."""
        if self._fresh:  # the observer was reset with this very measurement
            self._fresh = False
        else:
            if self._caution.update(measurement.v[:6]):
                self._pace()
            self.observer.update(measurement)
        u, d = self._total, self.observer.wrench
        nominal = super().wrench(t, measurement, reference)
        np.subtract(nominal, self._mask * d, out=u)
        self._w_ref[:] = reference.velocity[3:]
        u += self._lead * (u - self._ahead(self.observer.actual(), 1.0))
        np.subtract(nominal, u, out=self._beside)
        if self._bounds_total:
            asked = u.copy()
            np.minimum(u, self._upper, out=u)
            np.maximum(u, self._lower, out=u)
            if not np.array_equal(asked, u):
                self.delivered(u, u - asked)
        self.observer.applied(self._ahead(u, -1.0))
        return u

    def delivered(self, wrench_W: Array, missing_W: Array) -> None:
        """Tell the observer what the rotors were asked for, and dc-PID what of it was its own."""
        self.observer.applied(self._ahead(wrench_W, -1.0))
        super().delivered(wrench_W + self._beside, missing_W)

    def _ahead(self, wrench_W: Array, sign: float) -> Array:
        """Turn a wrench with the platform on to when the rotors follow (+1), or back (-1).

        With `anticipate` a command is turned to {A} by the attitude that the reference has one lag
        ahead, so what is fixed to the rotors is turned on before, and back after.
        """
        if not (self._turn_ahead and self._w_ref.any()):
            return wrench_W
        turn = pin.skew(self._w_ref * (sign * self._turn_ahead))
        return wrench_W + (wrench_W.reshape(2, 3) @ turn.T).ravel()
