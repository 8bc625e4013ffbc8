"""`fullam export`."""

from __future__ import annotations

import argparse
from pathlib import Path

from fullam.cli.output import say
from fullam.cli.verbs import OK, argument, verb
from fullam.exceptions import RunFileError

FORMATS = ("mcap", "csv", "parquet")


@verb(
    "export",
    argument("run", metavar="FILE", help="a run file (.npz)"),
    argument("--to", choices=FORMATS, required=True, help="the other tool's format"),
    argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="default: FILE with the format's suffix, if nothing has that name yet",
    ),
)
def export(arguments: argparse.Namespace) -> int:
    """Write a record as a file of other tools.

    mcap for Foxglove and PlotJuggler, csv and parquet for tables: a column a component, `pose_x`,
    `rotor_speeds_1`, in SI units. mcap and parquet need the extra `fullam[export]`.
    """
    from fullam.simulation.record.export import FORMATS as writers
    from fullam.simulation.record.run import Run

    record = Run.load(arguments.run)
    out = arguments.out or Path(arguments.run).with_suffix(f".{arguments.to}")
    if arguments.out is None and out.exists():  # it may be the CSV that the motion came from
        raise RunFileError(str(out), "--out", "is not given and the file exists", "name it there")
    say(f"{arguments.to} saved to {writers[arguments.to](record, out)}")
    return OK
