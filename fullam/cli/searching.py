"""What verbs share that fly for a long time: threads, drivers, a bar, and how they go on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from fullam.cli import options
from fullam.cli.output import harmless
from fullam.cli.verbs import argument

JOBS = argument(
    "--jobs",
    type=options.jobs,
    default=1,
    metavar="N",
    help="threads; processes for laws that are no kernels (default: 1)",
)
ANY_DRIVER = argument(
    "--driver",
    default="fastest",
    metavar="NAME",
    help="python, fused, or the fastest that can fly a contender (default: fastest)",
)


@contextmanager
def continued(where: str) -> Iterator[None]:
    """Say on Ctrl-C that nothing is lost, if something is kept somewhere.

    Raises:
        KeyboardInterrupt: With what to say.
    """
    try:
        yield
    except KeyboardInterrupt as interrupt:
        text = f"; the same command continues ({where})" if where else ""
        raise KeyboardInterrupt(text) from interrupt


@contextmanager
def bar(unit: str) -> Iterator[Any]:
    """A bar on stderr if that is a terminal, started over whenever the work changes its name.

    Yields:
        A function of (text, done, total).
    """
    from tqdm import tqdm

    shown = tqdm(disable=None, unit=f" {unit}", dynamic_ncols=True, leave=False)

    def show(text: str, done: int, total: int) -> None:
        if shown.disable:
            return
        if shown.desc != f"{text}: ":
            shown.reset(total)
            shown.set_description(harmless(text), refresh=False)
        shown.total, shown.n = total, done
        shown.refresh()

    try:
        yield show
    finally:
        shown.close()
