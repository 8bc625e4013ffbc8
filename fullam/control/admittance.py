"""Admittance control on dc-PID+: a virtual mass, damper and spring between a force and the target.

Along a normal n the target's position is displaced by xi, which moves as a mass on a damper and a
spring would under the force that is wanted and the force that is felt,

    M xi'' + D xi' + K xi = f + f_felt,

and dc-PID follows the displaced target with its rate and acceleration. f_felt is what the observer
sees along n beyond its tare (see `tare`). With K = 0 a wall is approached at f / D and pushed with
f; with K > 0 a push f_p (and f = 0) is yielded to as by two springs in series, the virtual one and
the position loop's on the vehicle's mass m,

    x = f_p (1 / K + 1 / (m K_p)),

and come back from. All else, friction and the moment of the force at the tool among it, is rejected
in full. Small forces are no contact: up to the dead band b nothing is felt, from 2 b on everything,
with a line in between, so that a force of 2 b or more is met without an offset.

**Stability.** Against a rigid wall the position loop P = m (s^2 + K_d s + K_p) turns xi into force,
which is felt behind the observer's lag, L = K_o / (s + K_o). What is cancelled along n is held at
its tare, so that P is all that pushes, and M s^2 + D s + K + L P = 0, or

    M s^3 + (D + (M + m) K_o) s^2 + (K + K_o (D + m K_d)) s + K_o (K + m K_p) = 0,

which by Routh is stable for any M, D, K > 0 where K_o K_d > K_p (200 against 25). A real wall asks
for more, since the platform bounces on its stiffness k at sqrt(k / m): with the rotors' lag and the
sampling as A, the loop

    L A P k / ((M s^2 + D s + K) (m s^2 + A m (K_d s + K_p) + k))

has a peak there, of a height that only M / m brings down; D and K count for little. At 3e3 N/m,
where a wall of 1e5 N/m^(3/2) is under 0.8 N, the gain margin is 0.5 with M = m: the tool hammers
at 7 Hz; with 2 m it is 1.0, with 4 m, the default on the default vehicle, 2.2. So calculated, with
nothing in wall or arm that dissipates, it is below 1 again from 1e4 to 3e4 N/m; in flight the
default is steady at walls of 2e3 to 1e6 N/m^(3/2), and hammers at 1e7, as the hybrid law does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fullam.control.dc_pid_plus import DcPidPlusNumbers
from fullam.control.signals import Target
from fullam.control.tare import (
    TareMemory,
    TareNumbers,
    Touching,
    TouchingSettings,
    engaged,
    tare_numbers,
    weighed,
)
from fullam.dynamics.spatial import Pose, Spatial
from fullam.numbers.kernel import Number, absolute, clip, kernel, minimum, select
from fullam.numbers.vectors import axpy


@dataclass(frozen=True)
class AdmittanceSettings(TouchingSettings):
    """Settings of the admittance law: those of a law that touches, and what it is like to push.

    Attributes:
        virtual_mass: M [kg]; four times the vehicle's mass for a stiff wall.
        damping: D [N s/m].
        stiffness: K [N/m]; 0 pushes a wall with `force`, above 0 it yields and comes back.
        dead_band: b [N]: smaller forces are not felt.
    """

    virtual_mass: float = 9.0
    damping: float = 40.0
    stiffness: float = 0.0
    dead_band: float = 0.4

    def __post_init__(self) -> None:
        """Check mass, damper and spring, then what every law that touches has."""
        super().__post_init__()
        self._above_zero("virtual_mass", "damping")
        for field in ("stiffness", "dead_band"):
            if not 0.0 <= getattr(self, field) < np.inf:
                raise self._wrong(field, "give 0 or more")
        if not (self.force == 0.0 or 2.0 * self.dead_band <= self.force < np.inf):
            raise self._wrong("force", "give 0, or twice the dead band or more")
        if self.force == self.stiffness == 0.0:
            raise self._wrong("stiffness", "without a force to push with, give a spring above 0")


class AdmittanceNumbers(NamedTuple):
    """The virtual mass as numbers.

    When to weigh and push; f [N]; b [N]; K [N/m]; the period T [s]; what is left of xi' after T,
    M / (M + T D + T^2 K), and what a force makes of it, T / (M + T D + T^2 K).
    """

    tare: TareNumbers
    force: Number
    dead_band: Number
    stiffness: Number
    period: Number
    left: Number
    gain: Number


class AdmittanceMemory(NamedTuple):
    """The tare, xi [m], xi' [m/s], and xi'' over the last period [m/s^2]."""

    tare: TareMemory
    offset: Number
    rate: Number
    acceleration: Number


class Numbers(NamedTuple):
    """dc-PID+'s numbers and the contact's."""

    plus: DcPidPlusNumbers
    contact: AdmittanceNumbers


@kernel
def untouched():
    """The contact's memory at the start."""
    return AdmittanceMemory(TareMemory(0.0, 0.0), 0.0, 0.0, 0.0)


@kernel
def beyond(dead_band, force):
    """The force as it is felt: not below b, wholly from 2 b on."""
    size = minimum(absolute(force), 2.0 * clip(absolute(force) - dead_band, 0.0, absolute(force)))
    return select(force < 0.0, -size, size)


@kernel
def yielded(numbers, memory, along):
    """The displacement one period on, by implicit Euler, after a force `along` n was observed."""
    pushing = engaged(numbers.tare, memory.tare)
    tare = weighed(numbers.tare, memory.tare, along)
    felt = beyond(numbers.dead_band, along - tare.value)
    force = numbers.force + felt - numbers.stiffness * memory.offset
    rate = select(pushing, numbers.left * memory.rate + numbers.gain * force, 0.0)
    offset = select(pushing, memory.offset + numbers.period * rate, 0.0)
    return AdmittanceMemory(tare, offset, rate, (rate - memory.rate) / numbers.period)


@kernel
def displaced(n, contact, target):
    """The target, xi farther along n."""
    pose, v, a = target.pose, target.velocity, target.acceleration
    return Target(
        Pose(axpy(contact.offset, n, pose.position), pose.attitude),
        Spatial(axpy(contact.rate, n, v.linear), v.angular),
        Spatial(axpy(contact.acceleration, n, a.linear), a.angular),
    )


@kernel
def contact(numbers, memory, along, estimate, target):
    """The virtual mass moves, and takes the target with it; see `Touching`."""
    after = yielded(numbers, memory, along)
    return after, displaced(numbers.tare.normal, after, target), after.tare.value - along


class Admittance(Touching):
    """dc-PID+ whose target yields along one direction as a mass on a damper and a spring."""

    name = "admittance"
    Settings = AdmittanceSettings
    settings: AdmittanceSettings
    contact_memory = AdmittanceMemory
    contact_kernels = contact, untouched

    def numbers(self) -> Any:
        """See `AdmittanceNumbers`."""
        s, T = self.settings, self.period
        whole = s.virtual_mass + T * s.damping + T**2 * s.stiffness
        contact = AdmittanceNumbers(
            tare_numbers(s, T),
            s.force,
            s.dead_band,
            s.stiffness,
            T,
            s.virtual_mass / whole,
            T / whole,
        )
        return Numbers(super().numbers(), contact)

    @property
    def offset(self) -> float:
        """xi, how far the target is displaced along the normal [m]."""
        return float(self._memory.contact.offset)
