"""Hybrid force and motion control on dc-PID+: push along a normal, follow the target elsewhere.

Along a normal n (into what is touched) the target's position counts for nothing; the platform is
driven at an approach speed v_a, and where something pushes back, by the force f that is wanted:

    a_n = K_d (v_a - v_n),    u_n += s (f - m K_d v_a),

so that the tool, at rest against a wall (v_n = 0, s = 1), is pushed with f. s rises from 0 to 1
while the observer feels something push back, and falls while it does not: a lost contact is
approached again at v_a. What the observer sees along n is held at its *tare*, the mean before the
law engages: cancelling all of it would cancel the contact. Everything else, friction and the moment
of the force at the tool among it, is rejected in full.

How well f is met is how well the rotors are known: an unknown +-10 % of eight thrust coefficients
is some 2 % of f, and the tare takes off what it does to the weight. `calibrate` for the rest.
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
from fullam.numbers.kernel import Number, both, clip, kernel, select
from fullam.numbers.vectors import axpy, dot, subtract


@dataclass(frozen=True)
class HybridForceSettings(TouchingSettings):
    """Settings of the hybrid law: those of a law that touches, and how it approaches.

    Attributes:
        approach_speed: v_a [m/s]; beyond 0.1 a stiff wall is bounced off.
        touch: Force that pushes back at which there is a contact [N].
        rise: In how long s rises to 1 [s].
    """

    approach_speed: float = 0.06
    touch: float = 0.7
    rise: float = 0.5

    def __post_init__(self) -> None:
        """Check the approach, then what every law that touches has."""
        super().__post_init__()
        self._above_zero("force", "approach_speed", "touch", "rise")


class ForceNumbers(NamedTuple):
    """The contact as numbers.

    When to weigh and push; f - m K_d v_a [N]; v_a; touch [N]; by how much s changes in a period.
    """

    tare: TareNumbers
    force: Number
    speed: Number
    touch: Number
    rise: Number


class ForceMemory(NamedTuple):
    """The tare, and s."""

    tare: TareMemory
    share: Number


class HybridNumbers(NamedTuple):
    """dc-PID+'s numbers and the contact's."""

    plus: DcPidPlusNumbers
    contact: ForceNumbers


@kernel
def untouched():
    """The contact's memory at the start."""
    return ForceMemory(TareMemory(0.0, 0.0), 0.0)


@kernel
def felt_contact(numbers, memory, along):
    """The contact's memory after the observer has seen a force `along` n."""
    pushing = engaged(numbers.tare, memory.tare)
    touching = both(pushing, memory.tare.value - along > numbers.touch)
    change = select(touching, numbers.rise, -numbers.rise)
    share = clip(memory.share + change, 0.0, 1.0)
    return ForceMemory(weighed(numbers.tare, memory.tare, along), share)


@kernel
def freed(numbers, estimate, target):
    """The target without a say along n, but for the approach speed."""
    n = numbers.tare.normal
    gap = dot(subtract(estimate.pose.position, target.pose.position), n)
    position = axpy(gap, n, target.pose.position)
    v, a = target.velocity, target.acceleration
    velocity = axpy(numbers.speed - dot(v.linear, n), n, v.linear)
    acceleration = axpy(-dot(a.linear, n), n, a.linear)
    return Target(
        Pose(position, target.pose.attitude),
        Spatial(velocity, v.angular),
        Spatial(acceleration, a.angular),
    )


@kernel
def contact(numbers, memory, along, estimate, target):
    """The force is added as far as something pushes back; see `Touching`."""
    after = felt_contact(numbers, memory, along)
    change = after.tare.value - along - after.share * numbers.force
    return after, freed(numbers, estimate, target), change


class HybridForce(Touching):
    """dc-PID+ that pushes along one direction and follows its target in all others."""

    name = "hybrid-force"
    Settings = HybridForceSettings
    settings: HybridForceSettings
    contact_memory = ForceMemory
    contact_kernels = contact, untouched

    def numbers(self) -> Any:
        """See `HybridNumbers`."""
        plus, s, period = super().numbers(), self.settings, self.period
        damping = np.array(plus.nominal.gains.derivative.linear) @ np.square(s.unit_normal)
        contact = ForceNumbers(
            tare_numbers(s, period),
            float(s.force - self.vehicle.mass * damping * s.approach_speed),
            s.approach_speed,
            s.touch,
            period / s.rise,
        )
        return HybridNumbers(plus, contact)
