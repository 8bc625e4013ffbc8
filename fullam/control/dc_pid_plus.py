"""dc-PID+: dynamic compensation with a wrench observer in place of integral action.

    u = blkdiag(m_A 1, I_A) u_pd + u_dc - d

with the compensation u_dc of eq. (20) and d the wrench that the nominal model does not explain
(`WrenchObserver`). dc-PID cancels the model; what the model has wrong stays as an offset until its
integrator has grown, and the integrator then answers every manoeuvre with an overshoot. The
observer sees the error of the model in the momentum, before it is an error of the pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fullam.control.controller import (
    ALL_AXES,
    Measurement,
    ReferencePoint,
    register,
)
from fullam.control.dc_pid import DcPid, DcPidSettings
from fullam.control.wrench_observer import WrenchObserver
from fullam.exceptions import SettingsError
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
    """

    position_gains: tuple[float, float, float] = (9.6, 0.0, 6.0)
    attitude_gains: tuple[float, float, float] = (30.0, 0.0, 10.0)
    observer_rates: tuple[float, float] = (8.0, 8.0)
    actuation_lag: float | None = None

    def __post_init__(self) -> None:
        """Check the observer's numbers, then dc-PID's."""
        super().__post_init__()
        name = type(self).__name__
        rates = np.asarray(self.observer_rates, dtype=float)
        if rates.shape != (2,) or not np.all(np.isfinite(rates)) or np.any(rates < 0.0):
            raise SettingsError(
                name, "observer_rates", f"is {self.observer_rates!r}", "give two rates >= 0"
            )
        object.__setattr__(self, "observer_rates", (float(rates[0]), float(rates[1])))
        lag = self.actuation_lag
        if lag is not None and not 0.0 <= lag < np.inf:
            raise SettingsError(name, "actuation_lag", f"is {lag!r}", "give a time >= 0, or None")


@register("dc-pid-plus")
class DcPidPlus(DcPid):
    """See the module's text and `DcPidPlusSettings`.

    Attributes:
        observer: The observer; its `wrench` is d.
    """

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
        lag = self.settings.actuation_lag
        if lag is None:
            lag = float(vehicle.rotors.lags.mean())
        self.observer = WrenchObserver(vehicle, period, self.settings.observer_rates, lag)
        self._fresh = True
        self._mask = np.asarray(self.axes, dtype=float)

    def reset(self, measurement: Measurement, reference: ReferencePoint) -> None:
        """Start with nothing unexplained."""
        super().reset(measurement, reference)
        self.observer.reset(measurement)
        self._fresh = True

    def wrench(self, t: float, measurement: Measurement, reference: ReferencePoint) -> Array:
        """Wrench of dc-PID less the observed one, world axes; see `Controller.wrench`."""
        if self._fresh:  # the observer was reset with this very measurement
            self._fresh = False
        else:
            self.observer.update(measurement)
        u = super().wrench(t, measurement, reference)
        u -= self._mask * self.observer.wrench
        if self._bounded:
            self._bound()
        self.observer.applied(u)
        return u

    def delivered(self, wrench_W: Array) -> None:
        """The observer must know what the rotors were really asked for."""
        super().delivered(wrench_W)
        self.observer.applied(wrench_W)
        if self._applied_W is not None:
            # Eq. (21) is the nominal model's: it moves under the observed wrench, too.
            self._applied_W += self.observer.wrench
