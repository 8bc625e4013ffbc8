"""`fullam check`."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from fullam.cli import options
from fullam.cli.output import say, say_json, table
from fullam.cli.verbs import FAILED, OK, argument, verb
from fullam.exceptions import VehicleError

if TYPE_CHECKING:
    from fullam.analysis.agreement import AgreementTable

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
    options.JSON,
)
def check_vehicle(arguments: argparse.Namespace) -> int:
    """Report what a vehicle can and cannot do, and check its dynamics.

    First what its rotors can do: axes, lift, hover speeds, hover tilt; how far its joints go; and
    what loading let pass: joints that are held, odd inertias, missing meshes. Then the agreement of
    the paper's recursion, its matrix system and Pinocchio on random states, where the paper's
    equations hold for the arm. Exit code 1 says that the vehicle cannot hover level or that the
    three disagree.
    """
    from fullam.analysis.agreement import agreement
    from fullam.analysis.capability import assess
    from fullam.model.loading import load_vehicle
    from fullam.model.meshes import missing_remark

    vehicle = load_vehicle(arguments.vehicle)
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
    passed = capability.can_hover and agree
    if arguments.json:
        say_json(
            {
                "vehicle": vehicle.name,
                "capability": capability.to_dict(),
                "remarks": remarks,
                "agreement": verdict,
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
    say(f"hover: {'possible' if capability.can_hover else 'IMPOSSIBLE'}")
    return OK if passed else FAILED
