"""The command line, from its parsers."""

from __future__ import annotations

import argparse

from fullam.cli import build_parser
from fullam.cli.verbs import FAILED, INTERRUPTED, OK, USAGE
from fullam_book.tables import inline


def pages() -> dict[str, str]:
    """One page, a section a verb."""
    parser = build_parser()
    verbs = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction)).choices
    lines = [
        "# Command line",
        f"Exit codes: {OK} well, {FAILED} the flight failed or a check did, {USAGE} bad usage or "
        f"input, {INTERRUPTED} interrupted.",
        *(section(name, verb) for name, verb in verbs.items()),
    ]
    return {"reference/commands": "\n\n".join(lines) + "\n"}


def section(name: str, parser: argparse.ArgumentParser) -> str:
    """A verb: what it does, how it is called, its arguments."""
    arguments = [a for a in parser._actions if not isinstance(a, argparse._HelpAction)]
    width = argparse.HelpFormatter("fullam", width=76)
    width.add_usage(parser.usage, parser._actions, parser._mutually_exclusive_groups, prefix="")
    usage = width.format_help().strip().removeprefix("fullam").strip()
    parts = [
        f"## fullam {name}",
        "\n\n".join(inline(p) for p in (parser.description or "").split("\n\n")),
        f"```text\nfullam {name} {usage}\n```",
    ]
    if arguments:
        rows = "\n".join(f"| {called(a)} | {inline(told(parser, a))} |" for a in arguments)
        parts.append(f"| argument | meaning |\n|---|---|\n{rows}")
    return "\n\n".join(parts)


def called(action: argparse.Action) -> str:
    """How an argument is typed."""
    names = ", ".join(f"`{flag}`" for flag in action.option_strings)
    if action.nargs == 0:
        return names
    value = action.metavar or (
        "{" + ",".join(map(str, action.choices)) + "}" if action.choices else action.dest
    )
    return f"{names} `{value}`".strip().replace("|", "\\|")


def told(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    """Its help, with its default filled in."""
    help = action.help or ""
    return help % {**vars(action), "prog": parser.prog} if "%" in help else help
