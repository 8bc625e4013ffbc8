"""The command line: each verb is one library call and a table.

A verb is one function, decorated with `fullam.cli.verbs.verb`, in any module of this package;
modules are found, not listed. Exit codes: 0 well, 1 the flight diverged or a check failed, 2 bad
usage or input, 130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import pkgutil
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from fullam import interrupt
from fullam.cli import output
from fullam.cli.verbs import FAILED, INTERRUPTED, USAGE, VERBS, argument
from fullam.exceptions import AllocationFailed, FullamError, FullamWarning, NonFiniteWrench
from fullam.plugins import blamed, load_plugin

DESCRIPTION = "Fly, compare and check fully-actuated aerial manipulators."

EPILOG = """examples:
  fullam list
  fullam run task-2 --figure task-2.png
  fullam run position-3 --calm --set compensation=previous_wrench --json
  fullam compare tilt-hover-2 --controllers dc-pid,pid --seed 7
  fullam check hextilt
  fullam new controller my_law.py
  fullam run task-2 --plugin my_law.py --controller my-law

`fullam VERB --help` explains a verb. Exit codes: 0 well, 1 the flight diverged or the check
failed, 2 bad usage or input, 130 interrupted."""


PLUGIN = argument(
    "--plugin",
    action="append",
    default=[],
    metavar="FILE",
    help="load laws, estimators, scenarios of your own first: a .py file, or a module's name; "
    "may be repeated (`fullam new` writes one)",
)
"""Every verb has it."""


HEAVY = "fullam.simulation.simulate"
"""What nearly every verb needs, Pinocchio below it; imported while an interrupt still ends the
process at once, since one that is raised within somebody else's extension may be lost."""

LIGHT = ("completion", "equations", "new")
"""Verbs that fly nothing."""


def build_parser() -> argparse.ArgumentParser:
    """The parser with every verb of the package."""
    for module in pkgutil.iter_modules(__path__):
        import_module(f"{__name__}.{module.name}")
    parser = _Parser(
        "fullam",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    verbs = parser.add_subparsers(title="verbs", dest="verb", metavar="VERB", required=True)
    for name, verb in sorted(VERBS.items()):
        sub = verbs.add_parser(name, help=verb.summary, description=verb.description)
        for flags, options in (*verb.arguments, PLUGIN):
            sub.add_argument(*flags, **options)
        sub.set_defaults(execute=verb.execute)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: Arguments after the program's name; those of the process by default.

    Returns:
        The exit code.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", FullamWarning)
            warnings.showwarning = _show_warning  # type: ignore[assignment]
            return _run(argv)
    except KeyboardInterrupt as stopped:
        interrupt.guard()  # whoever is impatient shall not see a traceback either
        output.complain(f"interrupted{stopped}")
        interrupt.leave()
        return INTERRUPTED
    finally:
        interrupt.guard()  # what is left is to leave


def _run(argv: Sequence[str] | None) -> int:
    try:
        arguments = build_parser().parse_args(argv)
    except SystemExit as end:  # argparse has printed what it had to say
        return end.code if isinstance(end.code, int) else USAGE
    if arguments.verb not in LIGHT:
        import_module(HEAVY)
    interrupt.release()
    try:
        for source in arguments.plugin:
            load_plugin(source)
        code: int = arguments.execute(arguments)
        sys.stdout.flush()
        return code
    except (AllocationFailed, NonFiniteWrench) as error:
        output.complain(str(error))
        return FAILED
    except FullamError as error:
        output.complain(str(error))
        return USAGE
    except BrokenPipeError:  # the reader, `head` say, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (OSError, MemoryError) as error:  # what cannot be read, written or held
        output.complain(str(error) or "there is not enough memory")
        return USAGE
    except Exception as error:
        told = blamed(error)
        if told is None:
            raise
        output.complain(str(told))
        return USAGE


def _show_warning(message: Warning | str, category: type[Warning], *_: object) -> None:
    """One line a warning: where in the code it was raised says nothing to who typed a command."""
    output.complain(f"warning: {message}")


class _Parser(argparse.ArgumentParser):
    """argparse repeats what was typed; a terminal shall not act on it."""

    def _print_message(self, message: str, file: Any = None) -> None:
        super()._print_message(output.harmless(message or ""), file)


class _Version(argparse.Action):
    """Prints the version; reading it from the package's metadata waits until it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from fullam.version import __version__

        output.say(f"fullam {__version__}")
        parser.exit()
