"""`fullam new`."""

from __future__ import annotations

import argparse
import keyword
import re
import shlex
from pathlib import Path

from fullam.cli.output import say
from fullam.cli.verbs import OK, argument, verb
from fullam.exceptions import PluginError

TEMPLATES = Path(__file__).parent / "templates"
"""What is written: files that fly, in which the names are put."""

CALLED = {"controller": ("my-law", "MyLaw"), "estimator": ("my-estimator", "MyEstimator")}
"""Names in the templates: that of the registry, and the class."""

NEXT = {
    "controller": (
        "fullam run position-1 --plugin {file} --controller {name}",
        "fullam check fullam --plugin {file} --controller {name}",
        "fullam compare task-2 --plugin {file} --controllers {name},dc-pid",
        "fullam sweep task-2 --plugin {file} --controllers {name} --runs 20 --out {stem}.parquet",
    ),
    "estimator": (
        "fullam run position-1 --plugin {file} --controller dc-pid-plus --estimator {name}",
        "fullam sweep task-2 --plugin {file} --controllers dc-pid-plus@{name} --out {stem}.parquet",
    ),
}
"""What to type next."""


def plugin_path(text: str) -> Path:
    """A path for a plugin, which is to be a Python file of a name that Python can import."""
    path = Path(text)
    if path.suffix != ".py":
        raise argparse.ArgumentTypeError(f"'{text}' does not end in .py")
    if not (path.stem.isascii() and path.stem.isidentifier()):
        raise argparse.ArgumentTypeError(f"'{text}': give a name such as my_law.py")
    return path


@verb(
    "new",
    argument("kind", choices=tuple(CALLED), metavar="WHAT", help="controller or estimator"),
    argument("file", type=plugin_path, metavar="FILE", help="where it is written (.py)"),
    argument(
        "--kernel",
        action="store_true",
        help="a controller as kernels, which machine code flies too, instead of a class in numpy",
    ),
)
def new(arguments: argparse.Namespace) -> int:
    """Write a controller or an estimator of your own, which flies as it is.

    It goes by the file's name: my_law.py is the controller my-law. Nothing is overwritten. With
    --plugin FILE every verb knows it.
    """
    path, kind = arguments.file, arguments.kind
    name = path.stem.replace("_", "-").strip("-").lower()
    if kind != "controller" and arguments.kernel:
        raise PluginError("fullam new", "--kernel", "is given", "an estimator is a class")
    refuse_taken(kind, name, path)
    template = "kernel_controller" if arguments.kernel else kind
    text = (TEMPLATES / f"{template}.py").read_text(encoding="utf-8")
    for old, mine in zip(CALLED[kind], (name, class_name(name, text)), strict=True):
        text = text.replace(old, mine)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise PluginError(str(path), "file", "exists", "give another name") from error
    say(f"{path}: the {kind} '{name}', which flies as it is. Next:\n")
    for line in NEXT[kind]:
        say(f"  {line.format(file=shlex.quote(str(path)), name=name, stem=path.stem)}")
    return OK


def refuse_taken(kind: str, name: str, path: Path) -> None:
    """Refuse a name that somebody else's has: the plugin could not be loaded."""
    from fullam.control.controllers import CONTROLLERS
    from fullam.control.estimators import ESTIMATORS

    if not name or name in (CONTROLLERS if kind == "controller" else ESTIMATORS):
        problem = f"would be the {kind} '{name}', which there is already"
        raise PluginError(str(path), "name", problem, "give another name")


def class_name(name: str, text: str) -> str:
    """my-law -> MyLaw; OwnMemory for what the text calls Memory already, or Python cannot."""
    word = "".join(part.capitalize() for part in name.split("-"))
    taken = keyword.iskeyword(word) or re.search(rf"\b{word}\b", text)
    return word if word.isidentifier() and not taken else f"Own{word}"
