"""`fullam calibrate`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fullam.cli import options
from fullam.cli.output import progress, say, say_json, table
from fullam.cli.verbs import FAILED, OK, argument, verb

if TYPE_CHECKING:
    from fullam.model.vehicle import Vehicle
    from fullam.simulation.record.run import Run


def vehicle_file(text: str) -> Path:
    """A path for a vehicle, checked before the flight rather than after it."""
    if Path(text).suffix != ".toml":
        raise argparse.ArgumentTypeError(f"'{text}' does not end in .toml")
    return Path(text)


@verb(
    "calibrate",
    argument("vehicle", metavar="VEHICLE", help="name (see `fullam list`) or TOML file"),
    argument("--record", type=options.run_path, metavar="RUN.npz", help="fit this flight"),
    argument("--out", type=vehicle_file, metavar="V.toml", help="save the fitted vehicle"),
    argument("--mass", type=options.between(1e-6, 1e6, "mass in kg, from"), metavar="KG",
             help="what a scale says of the whole vehicle"),
    argument("--share", type=options.between(1e-4, 0.9, "share, from"), default=0.1, metavar="S",
             help="how far parameters may be from their nominal values (0.1)"),
    argument("--duration", type=options.between(5.0, 120.0, "time in seconds, from"), default=20.0,
             metavar="S", help="of the flight that is flown without --record (20)"),
    argument("--seed", type=options.seed, default=0, metavar="N", help="its seed (0)"),
    argument("--weather", default="paper", metavar="NAME", help="its weather (paper)"),
    options.JSON,
)  # fmt: skip
def calibrate_vehicle(arguments: argparse.Namespace) -> int:
    """Fit rotors, masses, centres of mass and inertias to one flight.

    Without --record a flight of 20 s is flown in which every axis and every joint swings, under
    dc-pid-plus, with the true vehicle that the seed draws. The fit reads what a real vehicle knows
    too: estimated pose and velocity, joints, speeds asked of the rotors. A flight tells ratios; the
    scale comes from the prior, or from --mass. Exit code 1 says that the flight was not well.
    """
    from fullam.analysis.calibration import calibrate
    from fullam.model.loading import load_vehicle
    from fullam.model.writing import write_vehicle
    from fullam.simulation.record.run import Run

    if arguments.record:
        run = Run.load(arguments.record)
    else:
        run = flown(load_vehicle(arguments.vehicle), arguments)
    if not run.well:
        say(f"{run.outcome.upper()}: {run.metadata['reason']}")
        return FAILED
    found = calibrate(run, share=arguments.share, mass=arguments.mass)
    files = {}
    if arguments.out:
        files = dict(zip(("toml", "urdf"), map(str, write_vehicle(found.vehicle, arguments.out)),
                         strict=True))  # fmt: skip
    if arguments.json:
        say_json(found.to_dict() | {"files": files})
        return OK
    say(f"{found.vehicle.name}: {len(run)} rows of {run.controller}, seed {run.seed}\n")
    say(table(found.rows(), ["parameter", "of nominal", "+-", "unit", ""]))
    say(f"\nunexplained wrench before: {found.before[0]:.2f} N, {found.before[1]:.3f} N m")
    say(f"unexplained wrench after:  {found.after[0]:.2f} N, {found.after[1]:.3f} N m")
    for kind, path in files.items():
        say(f"{kind} saved to {path}")
    return OK


def flown(vehicle: Vehicle, arguments: argparse.Namespace) -> Run:
    """The flight that tells the most."""
    from fullam.analysis.calibration_flight import excitation_flight
    from fullam.simulation.simulate import pilot, prepare
    from fullam.simulation.weather import weather

    scenario = excitation_flight(vehicle, arguments.duration, weather(arguments.weather))
    plan = prepare(scenario, "dc-pid-plus", vehicle=vehicle, seed=arguments.seed)
    with progress(f"{scenario.name}, {plan.controller}") as show:
        return pilot("fused")(plan, show)
