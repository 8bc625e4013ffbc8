"""How fast a law may be, by how rough the estimate is that it acts on."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MEMORY = 0.3
"""Time constant of the running mean of the roughness [s]."""


class Caution:
    """Slows a law down while the measured velocity is rough, separately for force and moment.

    The roughness is the running mean of |v_k - 2 v_{k-1} + v_{k-2}| / T over control periods T: a
    smooth motion has next to none, white noise of standard deviation s on the velocity has about
    4 s / T (three axes). The factor is limit / roughness, at most 1. What differentiates the
    velocity takes it as it is: its noise then stays flat as the roughness grows.

    Attributes:
        factors: Of the linear and of the angular half, shape (2,), live.
    """

    def __init__(self, period: float, limits: tuple[float, float]) -> None:
        """Bind the limits.

        Args:
            period: Control period T [s].
            limits: Roughness up to which nothing slows down, linear [m/s^2], angular [rad/s^2].
        """
        self._share = 1.0 - float(np.exp(-period / MEMORY))
        self._T = period
        self._limits = limits
        self._before: Array = np.zeros(6)
        self._change: Array = np.zeros(6)
        self._roughness = [0.0, 0.0]
        self.factors: Array = np.ones(2)

    def reset(self, velocity: Array) -> None:
        """Trust the estimate; shape (6,)."""
        self._before[:] = velocity
        self._change[:] = 0.0
        self._roughness = [0.0, 0.0]
        self.factors[:] = 1.0

    def update(self, velocity: Array) -> bool:
        """Take in [v_A, w_A], shape (6,); True where `factors` changed."""
        change = velocity - self._before
        self._before[:] = velocity
        bend = change - self._change
        self._change = change
        changed = False
        for half in (0, 1):
            part = bend[3 * half : 3 * half + 3]
            now = sqrt(float(part @ part)) / self._T
            self._roughness[half] += self._share * (now - self._roughness[half])
            limit = self._limits[half]
            rough = self._roughness[half]
            factor = 1.0 if rough <= limit else limit / rough
            changed = changed or factor != self.factors[half]
            self.factors[half] = factor
        return changed
