"""`fullam datasheet`."""

from __future__ import annotations

import argparse
from pathlib import Path

from fullam.cli import options
from fullam.cli.output import say, say_json
from fullam.cli.verbs import FAILED, OK, argument, verb


def page_path(text: str) -> Path:
    """A path for the page, checked before the work rather than after it."""
    if Path(text).suffix.lower() not in (".html", ".htm"):
        raise argparse.ArgumentTypeError(f"'{text}' does not end in .html")
    return Path(text)


flights = options.whole(0, 1_000_000, "number of flights, from")


@verb(
    "datasheet",
    argument("vehicle", metavar="VEHICLE", help="name (see `fullam list`) or TOML file"),
    argument("--out", type=page_path, metavar="FILE", help="the page (default: VEHICLE.html)"),
    argument("--flights", type=flights, default=10, metavar="N", help="of the trial (10; 0: none)"),
    argument("--seed", type=options.seed, default=0, metavar="N", help="of poses and states (0)"),
    options.JSON,
)
def write_sheet(arguments: argparse.Namespace) -> int:
    """Write the datasheet of a vehicle: one page to read, print and pin to the wall.

    What it can do, exactly, by arm pose and with each rotor stopped: tilt, force, push, moment,
    payload; suggested limits for controllers; a trial flight; the agreement of the dynamics. With
    --json the same figures go to stdout, and a page is written only with --out. Exit code 1 says
    that the vehicle cannot hover level.
    """
    from fullam.analysis.datasheet import datasheet
    from fullam.model.loading import load_vehicle

    vehicle = load_vehicle(arguments.vehicle)
    sheet = datasheet(vehicle, seed=arguments.seed, flights=arguments.flights)
    if arguments.json:
        say_json(sheet.to_dict())
    if arguments.out or not arguments.json:
        from fullam.viz.datasheet import write_datasheet

        path = write_datasheet(sheet, arguments.out or Path(f"{vehicle.name}.html"))
        if not arguments.json:
            say(f"{path}")
    return OK if sheet.capability.can_hover else FAILED
