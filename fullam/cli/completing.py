"""`fullam completion`."""

from __future__ import annotations

import argparse
import shlex
import sys

from fullam.cli.verbs import OK, argument, verb
from fullam.exceptions import MissingDependency

SHELLS = ("bash", "zsh")

KINDS = {
    "scenario": "scenarios",
    "scenarios": "scenarios",
    "target": "scenarios",
    "controller": "controllers",
    "controllers": "controllers",
    "vehicle": "vehicles",
    "base": "vehicles",
    "estimator": "estimators",
    "weather": "weathers",
    "driver": "drivers",
}
"""What arguments take names of, by their own name."""

LISTS = ("scenarios", "controllers")
"""Arguments that take several names with commas between."""

PATHS = ("scenarios", "vehicles")
"""Kinds for which a file may be given as well."""

FILES = {"FILE": "file", "FOLDER": "directory"}

BASH = """_fullam_{name}() {{
  local before="" word="$1"
  if [[ "$word" == *,* ]]; then before="${{word%,*}},"; word="${{word##*,}}"; fi
  compgen -P "$before" -W {names} -- "$word"
}}
"""
BASH_OR_FILE = """_fullam_{name}() {{
  local before="" word="$1"
  if [[ "$word" == *,* ]]; then before="${{word%,*}},"; word="${{word##*,}}"; fi
  compgen -P "$before" -W {names} -- "$word"
  compgen -f -X '!*.toml' -- "$1"
  compgen -f -X '!*.npz' -- "$1"
  compgen -d -- "$1"
}}
"""
ZSH = """_fullam_{name}() {{ {how} - {names} }}
"""
ZSH_OR_FILE = """_fullam_{name}() {{
  {how} - {names}
  _files -g '*.(toml|npz)'
}}
"""


@verb("completion", argument("shell", choices=SHELLS, help="the shell"))
def completion(arguments: argparse.Namespace) -> int:
    """Print a script that completes verbs, options and names in a shell.

    bash: fullam completion bash > ~/.local/share/bash-completion/completions/fullam
    zsh:  fullam completion zsh > a file _fullam in a folder of $fpath

    Names of scenarios, vehicles, controllers, estimators and weathers are those of now. Needs the
    extra `fullam[completion]`; the script itself needs nothing.
    """
    sys.stdout.write(script(arguments.shell))
    return OK


def script(shell: str) -> str:
    """The script of a shell.

    Raises:
        MissingDependency: shtab is not installed.
    """
    try:
        import shtab
    except ImportError as error:
        raise MissingDependency("shell completion", "shtab", "completion") from error
    from fullam.cli import build_parser
    from fullam.cli.listing import registered
    from fullam.simulation.simulate import DRIVERS

    parser = build_parser()
    known = {kind: list(entries) for kind, entries in registered().items()}
    known["drivers"] = list(DRIVERS)
    preamble = ""
    used: set[str] = set()
    for action in _actions(parser):
        kind = KINDS.get(action.dest)
        name = f"{action.dest}_list" if action.dest in LISTS else kind
        if kind is not None and name is not None:
            action.complete = dict.fromkeys(SHELLS, f"_fullam_{name}")  # type: ignore[attr-defined]
            if name not in used:
                preamble += _function(shell, name, known[kind], kind in PATHS)
            used.add(name)
        elif action.metavar in FILES:
            action.complete = shtab.CHOICE_FUNCTIONS[FILES[str(action.metavar)]]  # type: ignore[attr-defined]
    text: str = shtab.complete(parser, shell, preamble=preamble)
    return text


def _actions(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Arguments of all verbs that take a value."""
    return [
        action
        for group in parser._actions
        if isinstance(group, argparse._SubParsersAction)
        for verb_parser in group.choices.values()
        for action in verb_parser._actions
        if action.nargs != 0
    ]


def _function(shell: str, name: str, names: list[str], or_file: bool) -> str:
    """A function of the shell that offers names, after each comma of a list."""
    if shell == "bash":
        form = BASH_OR_FILE if or_file else BASH
        # In lines: some versions of shtab let bash divide words there and nowhere else.
        return form.format(name=name, names=shlex.quote("\n".join(names)))
    how = "_sequence compadd" if name.endswith("_list") else "compadd"
    form = ZSH_OR_FILE if or_file else ZSH
    return form.format(name=name, how=how, names=" ".join(map(shlex.quote, names)))
