"""`fullam equations`."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from fullam.cli import options
from fullam.cli.output import say, say_json, table
from fullam.cli.verbs import OK, argument, verb


@verb(
    "equations",
    argument(
        "number",
        nargs="?",
        type=options.whole(0, 10**6, "whole number, from"),
        metavar="N",
        help="one equation, 1 to 35",
    ),
    options.JSON,
)
def show_equations(arguments: argparse.Namespace) -> int:
    """Show the paper's equations and where the code has them.

    Without a number the table of all of them; with one its statement, its errata, its functions
    and the tests that hold it.
    """
    from fullam.paper import EQUATIONS, ERRATA, SYMBOLS, equation

    if arguments.number is None:
        if arguments.json:
            say_json(
                {
                    "symbols": [asdict(symbol) for symbol in SYMBOLS],
                    "equations": [asdict(entry) for entry in EQUATIONS.values()],
                    "errata": [asdict(erratum) for erratum in ERRATA],
                }
            )
            return OK
        rows = [
            (f"({n})", entry.topic, "*" if entry.errata else "", entry.functions[0])
            for n, entry in EQUATIONS.items()
        ]
        say(table(rows, ("", "equation", "erratum", "home in fullam"), left=4))
        say("\n* printed otherwise: `fullam equations N` says what, and why.")
        return OK
    entry = equation(arguments.number)
    if arguments.json:
        say_json(asdict(entry) | {"errata": [asdict(erratum) for erratum in entry.errata]})
        return OK
    say(f"({entry.number}) {entry.topic}\n\n    {entry.statement}\n")
    for erratum in entry.errata:
        say(f"printed in {erratum.where}: {erratum.printed}")
        say(f"used: {erratum.used}")
        say(f"because: {erratum.why}\n")
    say("in the code:\n" + "\n".join(f"  {name}" for name in entry.functions))
    say("\nheld by:\n" + "\n".join(f"  {name}" for name in entry.tests))
    return OK
