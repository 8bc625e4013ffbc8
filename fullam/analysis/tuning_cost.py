"""What a flight costs a law that is being tuned.

The cost of a flight, in which 1 is roughly "as bad as the sensor's noise":

    J = integral |p - p_d| dt / |step| / 1 s  +  the same of the attitude    (0 for what is held)
      + RMS position / 10 mm                  +  RMS attitude / 1 deg        (steady part)
      + largest excursion / 25 mm             +  largest excursion / 5 deg   (off the straight path)

and `LOST` for a flight that does not end. Axes that a scenario does not control cost nothing. The
cost of a candidate is the mean over its flights; and `NO_MARGIN` is added if a loop of it has no
margin (`margins`), which a flight of some seconds need not show: what drifts away slowly, or swings
as soon as a parameter is off, is no tuning. Laws that are no kernels are not asked: it would take
longer than their flights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.judge import Figures
from fullam.simulation.scenarios.scenario import AXES

Array = NDArray[np.float64]

LOST = 50.0
"""Cost of a flight that diverges or fails; a bad one that ends has about 15."""

NO_MARGIN = 10.0
"""Added to the cost of settings whose loops have no margin: nothing that has one costs so much more
than what flies best."""

IN_WORDS = (
    "mean over the flights of: integral of the error over the step [s] + RMS / (10 mm, 1 deg) "
    f"+ largest excursion / (25 mm, 5 deg), position and attitude alike; {LOST:g} for one that is "
    f"lost; {NO_MARGIN:g} more if a loop has no margin"
)
"""The cost in one line."""


def flight_costs(figures: Figures) -> Array:
    """J of the module's text of each flight, shape (flights,)."""
    cost = (
        figures["rms_position_mm"] / 10.0
        + figures["rms_attitude_deg"]
        + figures["max_excursion_mm"] / 25.0
        + figures["max_excursion_deg"] / 5.0
    )
    for half, integral in ((AXES[:3], "integral_position"), (AXES[3:], "integral_attitude")):
        step = np.linalg.norm([figures[f"{axis}_step"] for axis in half], axis=0)
        cost += np.where(step > 0.0, figures[integral] / np.where(step > 0.0, step, 1.0), 0.0)
    ended = (figures["diverged"] == 0.0) & np.isfinite(cost)
    return np.where(ended, cost, LOST)
