"""`fullam check`."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from fullam.cli import options
from fullam.cli.output import say, say_json, table
from fullam.cli.verbs import FAILED, OK, argument, verb
from fullam.exceptions import SettingsError, VehicleError

if TYPE_CHECKING:
    from fullam.analysis.agreement import AgreementTable
    from fullam.analysis.margins import LoopMargins
    from fullam.model.vehicle import Vehicle

AGREEMENT = 1e-9
"""Largest relative difference at which the three ways to compute the dynamics agree.

Rounding costs about 1e-16 times the condition number of the 81 x 81 system (30, and up to 1e4 in
the states sampled on purpose near its worst), a wrong sign or a wrong frame about 1."""


@verb(
    "check",
    argument("vehicle", metavar="VEHICLE", help="name (see `fullam list`) or TOML file"),
    argument(
        "--samples",
        type=options.whole(1, 10_000_000, "whole number, from"),
        default=1000,
        metavar="N",
        help="random states (1000)",
    ),
    argument(
        "--seed", type=options.seed, default=0, metavar="N", help="seed of the states (default: 0)"
    ),
    argument("--failed", type=options.names, default=[], metavar="R,...", help=options.FAILED_HELP),
    argument("--controller", metavar="NAME", help="tell the margins of this law's loops as well"),
    *options.LAW[1:],
    argument("--estimator", metavar="NAME", help="with this estimator (default: the law's own)"),
    argument("--delay", type=options.delay, default=0.0, metavar="S", help="age of a pose [s] (0)"),
    argument("--control-rate", type=options.rate, metavar="HZ", help="of the law (100)"),
    argument("--weather", default="calm", metavar="NAME", help="whose noise there is (calm)"),
    options.JSON,
)
def check_vehicle(arguments: argparse.Namespace) -> int:
    """Report what a vehicle can and cannot do, and check its dynamics.

    First what its rotors can do: axes, lift, hover speeds, hover tilt; how far its joints go; and
    what loading let pass: joints that are held, odd inertias, missing meshes. Then the agreement of
    the paper's recursion, its matrix system and Pinocchio on random states, where the paper's
    equations hold for the arm. With --failed what is left without some rotors: which axes, and at
    which attitude it hovers. With --controller, or --settings that name it, also the phase, gain
    and delay margins of that law's loops on this vehicle, in hover. Exit code 1 says that the
    vehicle cannot hover (level; with failed rotors in no attitude), that the three disagree or that
    a loop has no margin.
    """
    from fullam.analysis.agreement import agreement
    from fullam.analysis.capability import assess
    from fullam.analysis.remaining import remaining
    from fullam.model.loading import load_vehicle
    from fullam.model.meshes import missing_remark

    law = law_of(arguments)
    vehicle = load_vehicle(arguments.vehicle)
    if arguments.failed:
        vehicle = vehicle.with_failed(*arguments.failed)
    left = remaining(vehicle) if arguments.failed else None
    capability = assess(vehicle)
    missing = missing_remark(vehicle)
    remarks = [*vehicle.remarks, *([missing] if missing else [])]
    witnesses: AgreementTable | None = None
    verdict: dict[str, Any]
    try:
        witnesses = agreement(vehicle, arguments.samples, arguments.seed)
        verdict = {"largest": witnesses.largest, "tolerance": AGREEMENT, **asdict(witnesses)}
    except VehicleError as error:
        verdict = {"not_applicable": f"{error.field} {error.problem}; {error.remedy}"}
    agree = witnesses is None or witnesses.largest <= AGREEMENT
    can_hover = capability.can_hover if left is None else left.holds
    margins = None
    if law is not None and can_hover:
        margins = margins_of(arguments, vehicle, *law)
    passed = can_hover and agree and (margins is None or margins.enough)
    if arguments.json:
        say_json(
            {
                "vehicle": vehicle.name,
                "capability": capability.to_dict(),
                **({} if left is None else {"remaining": left.to_dict()}),
                "remarks": remarks,
                "agreement": verdict,
                **({} if margins is None else {"margins": margins.to_dict()}),
                "passed": passed,
            }
        )
        return OK if passed else FAILED
    say(f"{vehicle.name}: {vehicle.description}\n")
    say(table([*capability.rows(), *vehicle.joints.rows()], left=3))
    for remark in remarks:
        say(f"remark: {remark}")
    if witnesses is None:
        say(f"\nagreement: not applicable, because {verdict['not_applicable']}")
    else:
        say(f"\n{witnesses}")
        say(f"\ndynamics: {'agree' if agree else 'DISAGREE'} (tolerance {AGREEMENT:g})")
    say(f"hover: {'possible' if can_hover else 'IMPOSSIBLE'}")
    if left is not None:
        say(str(left))
    if margins is not None:
        header = ["loop", "phase [deg]", "gain", "delay [ms]", "crossover [rad/s]"]
        say(f"\n{margins.controller} with the estimator {margins.estimator}, margins in hover:\n")
        say(table(margins.rows(), header))
        say(f"margins: {'enough' if margins.enough else f'NONE: {margins.worst}'}")
    return OK if passed else FAILED


def law_of(arguments: argparse.Namespace) -> tuple[str, Any] | None:
    """Controller and settings that were named; None if none were.

    Raises:
        SettingsError: Settings that it does not take, or settings of nobody.
    """
    if arguments.controller is not None or arguments.settings is not None:
        return options.law(arguments)
    if arguments.set:
        raise SettingsError("fullam check", "--set", "is given without a law", "add --controller")
    return None


def margins_of(
    arguments: argparse.Namespace, vehicle: Vehicle, controller: str, settings: Any
) -> LoopMargins:
    """Margins of a law, hovering."""
    from fullam.analysis.margins import loop_margins
    from fullam.model.wrench_axes import controllable_axes
    from fullam.simulation.scenarios.scenario import AXES, Scenario
    from fullam.simulation.simulate import prepare

    possible = zip(AXES, controllable_axes(vehicle.rotors), strict=True)
    scenario = Scenario(name="hover", axes=tuple(axis for axis, good in possible if good))
    simulation: dict[str, Any] = {"estimator": arguments.estimator, "delay": arguments.delay}
    if arguments.control_rate:
        simulation["control_period"] = 1.0 / arguments.control_rate
    plan = prepare(
        scenario,
        controller,
        vehicle=vehicle,
        settings=settings,
        weather=arguments.weather,
        simulation=simulation,
    )
    return loop_margins(plan)
