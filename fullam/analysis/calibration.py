"""Calibration: rotor coefficients, masses, centres of mass and inertias from one flight's record.

What is read is what a vehicle of metal knows as well: the estimated pose and velocity, the joints'
positions and rates, and the speeds that were asked of the rotors, which follow with their nominal
lags. About a fixed point O the momentum of all bodies changes by the rotors, by gravity, and by
what else acts (d, gusts):

    h(t) - h(0) = integral of (U + g + d) dt,

linear in the factors theta of all parameters (`momentum_regressor`), A theta = noise, with no
acceleration in it. The noise is that of the estimated velocity (white, once every `SPACING`) and
the sum of the gusts (a random walk); how large both are the residuals themselves tell. With normal
priors about the nominal values this is Bayesian linear regression, solved by generalised least
squares.

The equation is homogeneous: twice the masses under rotors of twice the thrust fly alike. So the
flight tells all ratios, which are fitted with the total mass held, and the prior tells the scale:
the mean of n independent errors of +-10 % is +-10 % / sqrt(n). Weigh the vehicle, and the scale is
known (`mass`).
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from fullam.analysis.measured_motion import MeasuredMotion, about_start
from fullam.checks import Checker, Range, positive
from fullam.dynamics.momentum_regressor import PER_BODY, MomentumRegressor, parameters
from fullam.exceptions import SettingsError
from fullam.model.bodies import body_tables
from fullam.model.physics import body_inertia
from fullam.model.rotors import Rotors, coupling_matrix
from fullam.model.vehicle import Vehicle
from fullam.simulation.record.run import Run

Array = NDArray[np.float64]

SPACING = 0.25
"""Time between the momenta that are compared [s]: the errors of the estimated velocity, which the
filter colours over some 0.1 s, are then nearly independent."""

SHORTEST = 5.0
"""A record of less than this tells nothing [s]."""

ROUNDS = 4
"""Times that the noise is estimated from the residuals; after the second it changes little."""

FLOOR = 1e-4
"""Either noise is at least this share of the residuals' variance: nobody measures without."""

UNKNOWN = 1e6
"""Variance of the momentum at the start, in those of a measured one."""


@dataclass(frozen=True)
class Parameter:
    """One fitted parameter.

    Attributes:
        name: What it is of which body or rotor, "mass of platform", "k_f of rotor_3".
        value: Its value over the nominal one; of a centre of mass, its shift [mm].
        deviation: Standard deviation of the posterior.
        prior: That of the prior.
        unit: "" of a factor, "mm".
    """

    name: str
    value: float
    deviation: float
    prior: float
    unit: str

    @property
    def is_told(self) -> bool:
        """Whether the flight told more of it than was known before."""
        return self.deviation < 0.7 * self.prior


@dataclass(frozen=True, eq=False)
class Calibration:
    """What a flight tells of its vehicle.

    Attributes:
        nominal: The vehicle as it was known.
        vehicle: The vehicle as it is known now; `write_vehicle` saves it.
        parameters: All that was fitted.
        before: RMS of the steady wrench that the nominal model left unexplained over the record,
            force [N] and moment [N m].
        after: The same of the fitted one.
    """

    nominal: Vehicle
    vehicle: Vehicle
    parameters: tuple[Parameter, ...]
    before: tuple[float, float]
    after: tuple[float, float]

    def to_dict(self) -> dict[str, Any]:
        """JSON values, without the vehicles."""
        return {
            "vehicle": self.vehicle.name,
            "parameters": [asdict(parameter) for parameter in self.parameters],
            **{"before": list(self.before), "after": list(self.after)},
        }

    def rows(self) -> list[list[str]]:
        """Name, value, deviation, unit and whether the flight told it, as text."""
        return [
            [
                p.name,
                f"{p.value:.3f}" if not p.unit else f"{p.value:+.2f}",
                f"{p.deviation:.3f}" if not p.unit else f"{p.deviation:.2f}",
                p.unit,
                "" if p.is_told else "not told by this flight",
            ]
            for p in self.parameters
        ]


def calibrate(
    run: Run, share: float = 0.1, center: float = 0.002, mass: float | None = None
) -> Calibration:
    """Fit a vehicle's parameters to a record; see the module's text.

    Args:
        run: The record, of a flight that moves in all axes and moves its arm:
            `excitation_flight` is made for it.
        share: How far masses, inertias, k_f and k_tau may be from their nominal values, as a share;
            taken as uniform within +-share, of which the prior has the variance.
        center: Standard deviation of the centres of mass [m].
        mass: What a scale says of the whole vehicle [kg], if it was weighed.

    Raises:
        SettingsError: The record is too short, or a number makes no sense.
    """
    check = Checker("calibrate", SettingsError)
    check.instance("run", run, Run)
    share = check.number("share", share, Range(1e-4, 0.9))
    center = check.number("center", center, Range(1e-6, 1.0, "m"))
    if mass is not None:
        mass = check.number("mass", mass, positive(1e6, "kg"))
    if len(run) < 2 or run.t[-1] - run.t[0] < SHORTEST:
        remedy = f"fly {SHORTEST:g} s or more"
        raise check.refuse("run", f"has {len(run)} rows", remedy)
    nominal = run.vehicle
    balance = Balance.of(run, nominal)
    prior = _Prior.of(nominal, share, center)
    A = np.concatenate([balance.bodies @ prior.directions, balance.rotors], axis=2)
    b = -(balance.bodies @ parameters(nominal.model) + balance.rotors.sum(axis=2))
    shift, covariance = _fit(prior, A, b, balance.times)
    factors = prior.factor + shift
    scale, scale_variance = _scale(prior, factors, nominal.mass, mass)
    values = scale * factors
    deviations = np.sqrt(scale**2 * np.diag(covariance) + factors**2 * scale_variance)
    vehicle = fitted(nominal, prior, values)
    return Calibration(
        nominal,
        vehicle,
        tuple(prior.parameters(values, deviations)),
        _steady(b, balance.times),
        _steady(b - A @ shift, balance.times),
    )


@dataclass(frozen=True, eq=False)
class Balance:
    """The momentum balance of a record, row i from the start to time i.

    Attributes:
        times: Times [s], shape (M,).
        bodies: H pi less what gravity has brought, as a map of pi, shape (M, 6, 10 bodies).
        rotors: Less what the rotors have brought, as a map of the factors of k_f and then of k_tau,
            shape (M, 6, 2 n).
    """

    times: Array
    bodies: Array
    rotors: Array

    @classmethod
    def of(cls, run: Run, vehicle: Vehicle) -> Balance:
        """The balance of what a record has measured, about where it began."""
        motion = MeasuredMotion.of(run, vehicle.rotors)
        regressor = MomentumRegressor(vehicle, motion.pose[0, :3])
        pairs = [regressor(*row) for row in zip(motion.q, motion.v, strict=True)]
        H, G = (np.array(part) for part in zip(*pairs, strict=True))
        period, t = motion.period, motion.t
        columns = rotor_columns(vehicle.rotors) * np.tile(motion.squares[:-1], 2)[:, None]
        rows = np.arange(0, len(t), max(1, round(SPACING / period)))
        gravity = _sums(0.5 * period * (G[1:] + G[:-1]))[rows]
        rotors = _sums(period * about_start(columns, motion))[rows]
        return cls(t[rows] - t[0], H[rows] - gravity, -rotors)


def _sums(steps: Array) -> Array:
    """Sums from the start, of nothing at first."""
    return np.concatenate([np.zeros((1, *steps.shape[1:])), np.cumsum(steps, axis=0)])


def rotor_columns(rotors: Rotors) -> Array:
    """The coupling matrix (34) in two: of each rotor's thrust, then of its drag, shape (6, 2 n)."""
    still = np.zeros(rotors.count)
    parts = (rotors.k_f, still), (still, rotors.k_tau)
    return np.hstack(
        [coupling_matrix(rotors.positions, rotors.axes, rotors.spins, *part) for part in parts]
    )


@dataclass(frozen=True, eq=False)
class _Prior:
    """What is fitted, and what is known of it before.

    Attributes:
        names: Names.
        factor: 1 of a factor, 0 of a shift.
        deviation: Standard deviations.
        directions: How pi changes with each parameter of the bodies, shape (10 bodies, p).
        weights: Share of the total mass that each parameter carries.
    """

    names: tuple[str, ...]
    factor: Array
    deviation: Array
    directions: Array
    weights: Array

    @classmethod
    def of(cls, vehicle: Vehicle, share: float, center: float) -> _Prior:
        """Per body mass, inertia and three coordinates of the centre; k_f and k_tau per rotor."""
        model, spread = vehicle.model, share / np.sqrt(3.0)
        labels = (vehicle.platform, *(f"the body of {name}" for name in vehicle.arm_joints))
        names, deviation, factor, columns, weights = [], [], [], [], []
        for index, label in enumerate(labels, start=1):
            body = model.inertias[index]
            for name, change in _changes(body):
                column = np.zeros(PER_BODY * (model.njoints - 1))
                column[PER_BODY * (index - 1) : PER_BODY * index] = change
                shifts = name.startswith("center")
                names.append(f"{name} of {label}")
                columns.append(column)
                factor.append(0.0 if shifts else 1.0)
                deviation.append(center if shifts else spread)
                weights.append(body.mass / vehicle.mass if name == "mass" else 0.0)
        for name in ("k_f", "k_tau"):
            names += [f"{name} of {rotor}" for rotor in vehicle.rotors.names]
        rotors = 2 * vehicle.rotors.count
        return cls(
            tuple(names),
            np.array([*factor, *[1.0] * rotors]),
            np.array([*deviation, *[spread] * rotors]),
            np.array(columns).T,
            np.array([*weights, *[0.0] * rotors]),
        )

    def parameters(self, values: Array, deviations: Array) -> Iterator[Parameter]:
        """The fit, parameter by parameter; centres in mm."""
        rows = zip(self.names, values, deviations, self.deviation, self.factor, strict=True)
        for name, value, deviation, prior, factor in rows:
            unit, size = ("", 1.0) if factor else ("mm", 1e3)
            yield Parameter(name, size * value, size * deviation, size * prior, unit)


def _changes(body: pin.Inertia) -> Iterator[tuple[str, Array]]:
    """How the ten parameters of a body change with its mass, its inertia and its centre."""
    own = body_inertia(body.mass, np.zeros(3), body.inertia).toDynamicParameters()
    own[:4] = 0.0
    yield "mass", body.toDynamicParameters() - own
    yield "inertia", own
    for axis, unit in zip("xyz", np.eye(3), strict=True):
        # d/dc of [m, m c, I + m (|c|^2 1 - c c^T)]; quadratic, so central differences are exact.
        plus, minus = (
            body_inertia(body.mass, body.lever + sign * 0.5 * unit, body.inertia)
            for sign in (1, -1)
        )
        yield f"center {axis}", plus.toDynamicParameters() - minus.toDynamicParameters()


def _fit(prior: _Prior, A: Array, b: Array, t: Array) -> tuple[Array, Array]:
    """Generalised least squares with the total mass held: the shift from the nominal, and C."""
    # Columns of A per unit of the prior, so that everything is of one size.
    A, own = A * prior.deviation, np.eye(A.shape[2])
    held = prior.weights * prior.deviation
    held /= np.linalg.norm(held)
    free = own - np.outer(held, held)
    basis = np.linalg.svd(free)[0][:, :-1]
    shift = np.zeros(A.shape[2])
    for _ in range(ROUNDS):
        information, pull = basis.T @ basis, np.zeros(basis.shape[1])
        for axis in range(6):
            C = _noise(b[:, axis] - A[:, axis] @ shift, t)
            L = np.linalg.cholesky(C)
            X = solve_triangular(L, A[:, axis] @ basis, lower=True)
            y = solve_triangular(L, b[:, axis], lower=True)
            information += X.T @ X
            pull += X.T @ y
        covariance = np.linalg.inv(information)
        shift = basis @ (covariance @ pull)
    outer = np.outer(prior.deviation, prior.deviation)
    return prior.deviation * shift, outer * (basis @ covariance @ basis.T)


def _noise(residual: Array, t: Array) -> Array:
    """Covariance of a momentum: white noise r^2, a random walk of rate w, an unknown start.

    Of the steps between the rows, r^2 is minus the covariance of neighbours, and w the rest.
    """
    steps, spacing = np.diff(residual), t[1] - t[0]
    variance = float(np.mean(steps**2))
    white = max(-float(np.mean(steps[1:] * steps[:-1])), FLOOR * variance, 1e-12)
    walk = max(variance - 2.0 * white, FLOOR * variance, 1e-12) / spacing
    C: Array = walk * np.minimum.outer(t, t) + white * np.eye(len(t))
    return C + UNKNOWN * white


def _scale(
    prior: _Prior, factors: Array, nominal: float, mass: float | None
) -> tuple[float, float]:
    """By how much all factors are larger than with the nominal total mass, and its variance."""
    if mass is not None:
        return mass / nominal, 0.0
    weight = prior.factor / prior.deviation**2
    information = float(np.sum(weight * factors**2))
    return float(np.sum(weight * factors)) / information, 1.0 / information


def fitted(nominal: Vehicle, prior: _Prior, values: Array) -> Vehicle:
    """The nominal vehicle with parameters of these values, and a definition that says so."""
    model, bodies = pin.Model(nominal.model), nominal.model.njoints - 1
    of_bodies = values[: 5 * bodies].reshape(bodies, 5)
    for index, (mass, inertia, *shift) in enumerate(of_bodies, start=1):
        body = nominal.model.inertias[index]
        # The first moment is m c f + m shift; a share of less than nothing is no body's.
        mass, inertia = max(mass, 0.01), max(inertia, 0.01)
        model.inertias[index] = body_inertia(
            body.mass * mass, body.lever + np.array(shift) / mass, body.inertia * inertia
        )
    k_f, k_tau = np.maximum(values[5 * bodies :].reshape(2, -1), 0.01)
    rotors = replace(
        nominal.rotors, k_f=nominal.rotors.k_f * k_f, k_tau=nominal.rotors.k_tau * k_tau
    )
    return replace(
        nominal,
        model=model,
        rotors=rotors,
        definition=_definition(nominal, model, rotors),
        source=None,
    )


def _definition(nominal: Vehicle, model: pin.Model, rotors: Rotors) -> dict[str, Any]:
    definition = copy.deepcopy(nominal.definition)
    definition.pop("mass", None)  # which was the nominal one
    definition["body"] = body_tables(model)
    for table, k_f, k_tau in zip(definition["rotor"], rotors.k_f, rotors.k_tau, strict=True):
        table |= {"k_f": float(k_f), "k_tau": float(k_tau)}
    return definition


def _steady(residual: Array, t: Array) -> tuple[float, float]:
    """RMS of the mean rates of a residual over stretches of a second: force, moment."""
    stride = max(1, round(1.0 / (t[1] - t[0])))
    rates = (residual[stride:] - residual[:-stride]) / (t[stride] - t[0])
    squares = np.mean(rates**2, axis=0)
    return float(np.sqrt(squares[:3].sum())), float(np.sqrt(squares[3:].sum()))
