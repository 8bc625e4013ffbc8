"""A trial flight of a vehicle under the recommended law: does it fly, and how well."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.metrics import measure
from fullam.analysis.statistics import Interval, quantile_interval
from fullam.exceptions import FullamError
from fullam.model.perturbation import Uncertainty
from fullam.model.vehicle import Vehicle
from fullam.model.wrench_axes import controllable_axes
from fullam.numbers.machine_code import available
from fullam.simulation.motions.references import Step
from fullam.simulation.scenarios.scenario import AXES, Scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.simulate import simulate
from fullam.simulation.weather import PAPER

LAWS = (("dc-pid-plus", "kalman"), ("dc-pid", "first-order"))
"""Controller and estimator: the recommended one, and what flies if that cannot."""

SEEDS = 10
GUST, GUST_ARM = 0.05, 0.02
"""Standard deviation of the gusts: force as a share of the weight, and its lever [m]."""

TILT_SHARE, LARGEST_TILT = 0.5, 20.0
"""Tilt that the trial asks for: share of the worst tilt, and at most so much [deg]."""


@dataclass(frozen=True, eq=False)
class Trial:
    """What came of it.

    Attributes:
        controller: Which law flew.
        estimator: Which estimator.
        text: The flight in a sentence.
        flights: How many.
        lost: How many diverged.
        position_mm: Median RMS position error of those that did not, steady part [mm].
        attitude_deg: Median RMS attitude error of them [deg].
        settling_s: Median settling time (2 %, never = infinity) [s].
        problem: Why nothing was flown; empty if it was.
    """

    controller: str
    estimator: str
    text: str
    flights: int
    lost: int
    position_mm: Interval | None
    attitude_deg: Interval | None
    settling_s: Interval | None
    problem: str = ""

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        data = {name: getattr(self, name) for name in ("controller", "estimator", "text")}
        data |= {"flights": self.flights, "lost": self.lost, "problem": self.problem}
        for name in ("position_mm", "attitude_deg", "settling_s"):
            found = getattr(self, name)
            data[name] = found and [found.estimate, found.low, found.high]
        return data


def fly_trial(vehicle: Vehicle, envelope: Envelope, seeds: int = SEEDS) -> Trial:
    """Fly a step of half a metre with half of the tilt that the vehicle can hold.

    Args:
        vehicle: The vehicle.
        envelope: With the arm at rest.
        seeds: How many flights.
    """
    if not envelope.can_hover or envelope.worst_tilt is None:
        return Trial("", "", "", 0, 0, None, None, None, "it cannot hover level")
    scenario, text = _scenario(vehicle, envelope)
    problem = ""
    for controller, estimator in LAWS:
        try:
            runs = [
                simulate(
                    scenario, controller, vehicle=vehicle, seed=seed, throw=False,
                    simulation=SimulationSettings(estimator=estimator),
                    driver="fused" if available() else "python",
                )
                for seed in range(seeds)
            ]  # fmt: skip
        except FullamError as error:
            problem = problem or str(error)
            continue
        found = [measure(run) for run in runs]
        good = [m for m in found if not m.diverged]
        kept = bool(good)
        return Trial(
            controller=controller,
            estimator=estimator,
            text=text,
            flights=seeds,
            lost=seeds - len(good),
            position_mm=quantile_interval([m.rms_position_mm for m in good]) if kept else None,
            attitude_deg=quantile_interval([m.rms_attitude_deg for m in good]) if kept else None,
            settling_s=quantile_interval(
                [np.inf if m.settling_time_s is None else m.settling_time_s for m in good]
            )
            if kept
            else None,
        )
    return Trial("", "", text, 0, 0, None, None, None, problem)


def _scenario(vehicle: Vehicle, envelope: Envelope) -> tuple[Scenario, str]:
    possible = controllable_axes(vehicle.rotors)
    weight = envelope.load.weight
    worst = np.rad2deg(envelope.worst_tilt[0]) if envelope.worst_tilt else 0.0
    tilt = float(np.floor(min(TILT_SHARE * worst, LARGEST_TILT))) if all(possible) else 0.0
    side = 0.5 if all(possible) else 0.0
    weather = replace(
        PAPER,
        force_disturbance=GUST * weight,
        moment_disturbance=GUST * weight * GUST_ARM,
        uncertainty=Uncertainty(share=0.02),
    )
    scenario = Scenario(
        name="trial",
        reference=Step((side, side, 2.5), (tilt, 0.0, 0.0), at=1.0),
        initial_position=(0.0, 0.0, 2.0),
        duration=8.0,
        axes=tuple(axis for axis, good in zip(AXES, possible, strict=True) if good),
        weather=weather,
    )
    step = f"x, y and z with {tilt:.0f}° of tilt" if all(possible) else "z"
    text = (
        f"a step of 0.5 m along {step}, arm at rest; noise as in the "
        f"paper, gusts of {100.0 * GUST:.0f} % of the weight (one sigma), ±2 % on the parameters"
    )
    if not all(possible):
        held = ", ".join(scenario.axes)
        text = f"{text}; only {held} are controlled"
    return scenario, text
