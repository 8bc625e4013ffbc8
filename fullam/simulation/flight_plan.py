"""All that a flight is made of, fixed before it starts.

Everything that can be known before take-off is tabulated before take-off (reference, arm motion,
weather), so that the loop only reads rows and every engine starts from the same tables.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.control.allocation import Allocator
from fullam.control.controller import Controller
from fullam.control.controllers import controller_class, plain_settings, recommended_estimator
from fullam.control.estimator import Datasheet, Estimator
from fullam.control.estimators import estimator_class, make_estimator_settings
from fullam.control.trim import Trim
from fullam.exceptions import ScenarioError
from fullam.model.perturbation import perturb
from fullam.model.vehicle import Vehicle
from fullam.registry import made
from fullam.simulation.anticipation import Anticipation
from fullam.simulation.motions.arm_motion import ArmTable, tabulate_within_limits
from fullam.simulation.motions.references import ReferenceTable, tabulate
from fullam.simulation.payloads.payload import check_apart
from fullam.simulation.plants.settings import ServoSettings, plant_settings
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.tool.solution import with_tool_solved
from fullam.simulation.trimmed import trim_of, trim_reference
from fullam.simulation.weather import Forecast, Weather, forecast

Array = NDArray[np.float64]

DIVERGENCE_PERIOD = 0.01
"""Time between looks at the bounds of sense [s]."""


@dataclass(frozen=True, eq=False)
class FlightPlan:
    """All that a flight is made of, fixed before it starts.

    Attributes:
        scenario: The experiment, motions of one's own as rows and a tool's task solved.
        nominal: The vehicle as the controller knows it.
        controller: Name of the controller.
        settings: Its settings.
        simulation: Rates, integrator and sensors; the estimator by its name.
        weather: Statistics of what spoils the flight.
        seed: Seed of the draw.
        t: Control grid [s], shape (N,).
        asked: The scenario's reference on the grid.
        reference: What the controller is fed: `asked` with its jumps blended.
        anticipation: Known lags of the commanded motion; None if the scenario's shaping takes none
            off, or if a jump is left in `reference`.
        arm: The arm's motion on the half-step grid of the plant, (2 (N-1) substeps + 1) rows.
        trim: How a nominal vehicle with failed rotors hovers; None for a whole one, without a
            governor, and where not all six axes are controlled. If it is needed, `reference` has
            its attitude.
        replaced: Another vehicle to fly than the seed's, for studies; see `with_true`.
    """

    scenario: Scenario
    nominal: Vehicle
    controller: str
    settings: Any
    simulation: SimulationSettings
    weather: Weather
    seed: int
    t: Array
    asked: ReferenceTable
    reference: ReferenceTable
    anticipation: Anticipation | None
    arm: ArmTable
    trim: Trim | None = None
    replaced: Vehicle | None = None

    @classmethod
    def prepare(
        cls,
        scenario: Scenario,
        vehicle: Vehicle,
        controller: str,
        settings: Any,
        simulation: SimulationSettings,
        weather: Weather,
        seed: int,
    ) -> FlightPlan:
        """Tabulate reference and arm.

        Raises:
            ScenarioError: The arm angles do not fit the vehicle, the reference is not finite or
                starts beyond the bounds of divergence, the flight has more steps than fit into
                memory or a motion of one's own more rows than fit into a record, its steps are too
                long for the servos, two payloads that are to be learned hang together, or the seed
                is no whole number from 0 on.
            NotFullyActuated: The rotors cannot produce the axes that the scenario controls.
            SettingsError: The controller's settings hold what cannot be saved.
        """
        vehicle.require_full_actuation(np.array(scenario.axes_mask))
        plain_settings(controller, settings)  # what no record can keep is refused before take-off
        simulation.check_length(scenario.duration)
        simulation = simulation.with_estimator(recommended_estimator(controller))
        scenario = with_tool_solved(scenario, vehicle)
        scenario.check_plant(simulation.plant)
        plant = plant_settings(simulation.plant, simulation.plant_settings)
        if isinstance(plant, ServoSettings) and plant.payload == "learned":
            check_apart([body for body in scenario.payloads if not body.known])
        plant.check_step(vehicle, simulation.integrator, simulation.plant_period)
        period = simulation.control_period
        rows = round(scenario.duration / period) + 1
        t = np.arange(rows, dtype=np.float64) * period
        half_steps = np.arange(2 * (rows - 1) * simulation.substeps + 1, dtype=np.float64)
        arm = tabulate_within_limits(
            scenario.arm_motion,
            half_steps * (0.5 * simulation.plant_period),
            scenario.initial_arm(vehicle),
            vehicle.joints,
        )
        asked = tabulate(scenario.reference, t, scenario.initial_pose)
        scenario = scenario.with_rows(asked, arm, 0.5 * simulation.plant_period)
        start, anticipation, trim = scenario.initial_pose, None, None
        if simulation.governor is not None and all(scenario.axes_mask):
            trim = trim_of(vehicle, arm.theta, asked.pose[:, 3:])
        if trim is None or not trim.is_needed:
            reference = scenario.shaping.blend(asked, start)
        else:
            reference = trim_reference(asked, start, scenario.shaping, trim, vehicle.mass)
        if scenario.shaping.anticipates(asked, start):
            estimator = make_estimator(simulation, weather, vehicle.gravity)
            law = made(controller_class(controller), vehicle, settings, period, scenario.axes_mask)
            lag = law.thrust_lag() + 0.5 * period
            anticipation = Anticipation.of(reference, estimator, lag)
            reference = anticipation.reference
        plan = cls(
            scenario,
            vehicle,
            controller,
            settings,
            simulation,
            weather,
            checked_seed(seed),
            t,
            asked,
            reference,
            anticipation,
            arm,
            trim,
        )
        if too_far := divergence(plan, 0, scenario.initial_pose):
            raise ScenarioError(
                f"scenario '{scenario.name}'",
                "reference",
                f"no flight can start: {too_far}",
                "raise the bound (max_position_error, max_attitude_error_deg), or let the jump be "
                "blended (shaping: max_acceleration, max_angular_acceleration)",
            )
        return plan

    def with_seed(self, seed: int) -> FlightPlan:
        """The same flight in the weather, and with the true vehicle, of another seed.

        Equal to a plan prepared with that seed; all that does not depend on it is shared.

        Raises:
            ScenarioError: The seed is no whole number from 0 on.
        """
        return replace(self, seed=checked_seed(seed))

    def with_true(self, vehicle: Vehicle) -> FlightPlan:
        """The same flight with a true vehicle of one's own, of the nominal one's joints."""
        return replace(self, replaced=vehicle)

    @cached_property
    def forecast(self) -> Forecast:
        """The weather that the seed draws."""
        return forecast(self.weather, self.seed, self.t)

    @cached_property
    def true(self) -> Vehicle:
        """The vehicle that flies: the seed's, unless it is replaced."""
        if self.replaced is not None:
            return self.replaced
        # A draw of its own: whoever reads `forecast.parameters` moves that generator on.
        draw = forecast(self.weather, self.seed, self.t)
        return perturb(self.nominal, self.weather.uncertainty, draw.parameters)

    def make_controller(self) -> Controller:
        """A fresh law on the nominal vehicle."""
        return made(
            controller_class(self.controller),
            self.nominal,
            self.settings,
            self.simulation.control_period,
            self.scenario.axes_mask,
            self.anticipation is not None,
        )

    def arm_row(self, k: int) -> int:
        """Row of the arm table that belongs to control period k."""
        return 2 * k * self.simulation.substeps


def checked_seed(seed: int) -> int:
    """The seed; ScenarioError if it is no whole number from 0 on."""
    if not isinstance(seed, int | np.integer) or isinstance(seed, bool) or seed < 0:
        raise ScenarioError("simulate", "seed", f"is {seed!r}", "give a whole number, 0 or more")
    return int(seed)


def make_estimator(simulation: SimulationSettings, weather: Weather, gravity: float) -> Estimator:
    """The estimator that the settings name, at their rates; it knows the noise's statistics."""
    sheet = datasheet(simulation, weather, gravity)
    assert simulation.estimator is not None, "FlightPlan.prepare names it"
    cls = estimator_class(simulation.estimator)
    settings = make_estimator_settings(simulation.estimator, simulation.estimator_settings)
    return made(cls, sheet, settings, simulation.control_period)


def datasheet(simulation: SimulationSettings, weather: Weather, gravity: float) -> Datasheet:
    """What the makers of the sensors state of them; a bound counts as sqrt(3) deviations."""
    gyroscope, accelerometer = weather.inertial_scale(simulation.control_period)
    drift = weather.sensors.drift
    sigma = weather.sensors.bounds.reshape(4, 3).max(axis=1) / np.sqrt(3.0)
    return Datasheet(
        position_noise=weather.position_noise,
        attitude_noise=float(np.radians(weather.attitude_noise_deg)),
        gyroscope_noise=gyroscope,
        accelerometer_noise=accelerometer,
        delay_periods=simulation.delay_periods,
        pose_every=simulation.pose_every,
        gravity=gravity,
        gyroscope_bias=float(sigma[0]),
        accelerometer_bias=float(sigma[1]),
        gyroscope_drift=float(drift[0]),
        accelerometer_drift=float(drift[1]),
        gyroscope_scale=float(sigma[2]),
        accelerometer_scale=float(sigma[3]),
    )


def hover_speeds(plan: FlightPlan, allocator: Allocator) -> Array:
    """Speeds that carry the nominal vehicle where it starts, so no flight begins in a fall."""
    model, q = plan.nominal.model, plan.nominal.neutral(plan.arm.theta[0])
    q[:7] = plan.scenario.initial_pose
    weight_A = pin.computeGeneralizedGravity(model, model.createData(), q)[:6]
    speeds = allocator.solve(weight_A).speeds
    allocator.reset()
    return speeds


def divergence(plan: FlightPlan, k: int, pose: Array) -> str | None:
    """How a true pose, shape (7,), is out of the bounds around row k of the reference (NaN is).

    None if it is within them.
    """
    target, settings, mask = plan.reference.pose[k], plan.simulation, plan.scenario.axes_mask
    distance = float(np.linalg.norm((pose[:3] - target[:3])[list(mask[:3])]))
    cosine = np.minimum(1.0, abs(pose[3:] @ target[3:]))
    angle = float(np.degrees(2.0 * np.arccos(cosine)))
    if not np.isfinite(pose).all():
        distance = np.nan
    if distance <= settings.max_position_error and angle <= settings.max_attitude_error_deg:
        return None
    return (
        f"at t = {plan.t[k]:.3f} s the platform is {distance:.3g} m and {angle:.3g} deg "
        f"from the reference (bounds: {settings.max_position_error:g} m, "
        f"{settings.max_attitude_error_deg:g} deg)"
    )
