"""What every controller is: a law from measurement and reference to a wrench on the platform.

A controller holds the NOMINAL vehicle, never sees a rotor, and returns the wrench in world axes at
the origin of {A}, force then moment. `controllers` has them by name.

A law of one's own is a class derived from `Controller`, registered under a name, in a notebook or
in a file of its own (`fullam new controller my_law.py` writes one that flies):

    @fullam.register("my-law")
    class MyLaw(fullam.Controller):
        Settings = MyLawSettings                         # a dataclass; may be left out
        estimator = "kalman"                             # what it is made for; may be left out

        def reset(self, measurement, reference): ...     # before the first period
        def wrench(self, t, measurement, reference):     # every period
            return ...                                   # six numbers, world axes [N, N m]
        def delivered(self, wrench_W, missing_W): ...    # only after one that fell short; optional

What it is given: `self.vehicle` (nominal; `.model` is Pinocchio's, `.mass`, `.gravity`),
`self.settings`, `self.period` [s] and `self.axes` (which of the six axes are controlled). It needs
no `__init__`. What it may set: `self.u_pid` and `self.u_dc`, which stand in the record.

What it need not do: blend steps of the reference or take known lags off it (the scenario's shaping
does, for every law alike), turn the wrench to {A}, or respect the rotors' bounds (the allocation
does).

Its settings are any frozen dataclass of numbers, strings, true or false, tuples, arrays of numbers
or dataclasses of these, each with a default; what a record cannot keep is refused before take-off.

Such a class flies in Python, a few times faster than real time, and on worker processes. Written as
kernels (`law`) it also flies as machine code, a hundred times faster.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fullam.exceptions import SettingsError
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

ALL_AXES = (True,) * 6
"""Force x, y, z and moment x, y, z all under control."""


class Measurement:
    """What a controller is told about the vehicle, rewritten in place every control period.

    Attributes:
        q: Configuration [p (3), quaternion xyzw (4), theta (n)], shape (nq,) [m, -, rad].
        v: Velocity [v_A (3), w_A (3), dtheta (n)], linear and angular in {A} axes, shape (nv,).
        arm_acceleration: ddtheta, the servos' known input, shape (n,) [rad/s^2].
    """

    __slots__ = ("arm_acceleration", "q", "v")

    def __init__(self, vehicle: Vehicle) -> None:
        """Start at the vehicle's neutral configuration, at rest."""
        self.q: Array = vehicle.neutral()
        self.v: Array = np.zeros(vehicle.model.nv)
        self.arm_acceleration: Array = np.zeros(vehicle.n_arm)


class ReferencePoint:
    """Where the platform should be at one instant.

    Attributes:
        pose: [p (3), quaternion xyzw (4)] of {A} in {W}, shape (7,) [m, -].
        velocity: [dp (3), w (3)] in world axes, shape (6,) [m/s, rad/s].
        acceleration: [ddp (3), dw (3)] in world axes, shape (6,) [m/s^2, rad/s^2].
    """

    __slots__ = ("acceleration", "pose", "velocity")

    def __init__(self) -> None:
        """Start at the origin, level, at rest."""
        self.pose: Array = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        self.velocity: Array = np.zeros(6)
        self.acceleration: Array = np.zeros(6)


@dataclass(frozen=True)
class NoSettings:
    """The settings of a law that has none."""


class Controller(ABC):
    """A control law on the nominal vehicle.

    Attributes:
        name: The name it is known under.
        Settings: Frozen dataclass of its settings; see the module's text.
        estimator: Name of the estimator that it is made for: flown unless another one is asked for.
        touches: Whether it knows that its vehicle may touch things.
        u_pid: Commanded acceleration of the last tick, world axes, shape (6,) [m/s^2, rad/s^2].
        u_dc: Compensation wrench of the last tick, eq. (20), world axes, shape (6,) [N, N m].
        attitude: R_WA of the measurement of the last tick, shape (3, 3), for whoever turns the
            wrench to {A}: one array for the life of the law, live, rewritten by every `wrench`.
            None for a law that does not share it; the attitude is then worked out again.
    """

    name: ClassVar[str]
    Settings: ClassVar[type] = NoSettings
    estimator: ClassVar[str] = "first-order"
    touches: ClassVar[bool] = False
    attitude: Array | None = None

    def __init__(
        self,
        vehicle: Vehicle,
        settings: Any = None,
        period: float = 0.01,
        axes: tuple[bool, ...] = ALL_AXES,
        anticipated: bool = True,
    ) -> None:
        """Bind the law to the nominal vehicle.

        Args:
            vehicle: The nominal vehicle.
            settings: An instance of `Settings`; its defaults if None.
            period: Control period [s].
            axes: Which of force x, y, z and moment x, y, z are controlled.
            anticipated: Whether known lags are taken off the motion that it is asked to follow; a
                command is then turned to {A} by the attitude at which the rotors will follow it.

        Raises:
            SettingsError: The period is not positive or the settings are of another class.
        """
        if not period > 0.0:
            raise SettingsError(self.name, "period", f"is {period!r}", "give seconds, above 0")
        settings = self.Settings() if settings is None else settings
        if type(settings) is not self.Settings:
            raise SettingsError(
                self.name,
                "settings",
                f"is a {type(settings).__name__}",
                f"give a {self.Settings.__name__}",
            )
        self.vehicle = vehicle
        self.settings = settings
        self.period = period
        self.axes = tuple(bool(a) for a in axes)
        self.anticipated = anticipated
        self.u_pid: Array = np.zeros(6)
        self.u_dc: Array = np.zeros(6)

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is a fresh controller: views into workspaces cannot be copied."""
        parts = self.vehicle, self.settings, self.period, self.axes, self.anticipated
        return type(self), parts

    def thrust_lag(self) -> float:
        """Time constant with which the law sees its wrench follow its command [s].

        The mean lag of the nominal rotors, unless the law does something about it.
        """
        return float(self.vehicle.rotors.lags.mean())

    @abstractmethod
    def reset(self, measurement: Measurement, reference: ReferencePoint) -> None:
        """Forget the past: integrators to zero, filters to the first measurement."""

    @abstractmethod
    def wrench(self, t: float, measurement: Measurement, reference: ReferencePoint) -> Array:
        """Wrench wanted from the rotors at time t [s].

        Returns:
            [force; moment] in world axes at the origin of {A}, shape (6,) [N, N m]. A live
            buffer: copy it to keep it.
        """

    def delivered(  # noqa: B027 - a law without memory ignores it
        self, wrench_W: Array, missing_W: Array
    ) -> None:
        """Learn what the allocation achieved, in world axes.

        Called only in a period whose command could not be delivered; without the call the command
        counts as delivered. The memory of the last wrench lives on the one, anti-windup on the
        other: where force falls short the moment at the origin is changed on purpose, to keep the
        one about the centre of mass, and no integrator shall be drained by that.

        Args:
            wrench_W: Wrench achieved at the origin of {A}, shape (6,) [N, N m].
            missing_W: Achieved minus commanded, the moment about the centre of mass, shape (6,).
        """
