"""The paper's equations with their homes, their tests and their errata."""

from __future__ import annotations

import inspect

from fullam import paper
from fullam.paper import EQUATIONS, ERRATA, SYMBOLS, Equation, Erratum
from fullam_book.tables import inline

GROUPS = (
    ("Kinematics", range(1, 12)),
    ("Dynamics", range(12, 15)),
    ("Attitude error", range(15, 19)),
    ("Control", range(19, 27)),
    ("Rotors", range(27, 36)),
)
"""Which equations are about what."""


def pages() -> dict[str, str]:
    """The page of the equations, and that of the errata."""
    return {"reference/equations": statements(), "reference/errata": errata()}


def statements() -> str:
    """Every equation with its home."""
    lines = [
        "# Equations",
        (inspect.getdoc(paper) or "").split("\n\n")[1].replace("\n", " "),
        "Each is stated as it is used, with the [errata](errata.md) applied, beside its homes in "
        "the code and the tests that hold it. `fullam equations N` shows the same.",
        "## Symbols",
        "| symbol | stands for | unit, frame |\n|---|---|---|\n"
        + "\n".join(f"| `{s.symbol}` | {inline(s.meaning)} | {inline(s.unit)} |" for s in SYMBOLS),
    ]
    for title, numbers in GROUPS:
        lines.append(f"## {title}")
        lines += [statement(EQUATIONS[number]) for number in numbers]
    return "\n\n".join(lines) + "\n"


def statement(equation: Equation) -> str:
    """One equation."""
    parts = [
        f"(equation-{equation.number})=\n### ({equation.number}) {inline(equation.topic)}",
        f"```{{math}}\n{equation.latex}\n```",
    ]
    if equation.errata:
        told = "\n\n".join(changed(erratum) for erratum in equation.errata)
        parts.append(f":::{{admonition}} Printed otherwise\n:class: erratum\n\n{told}\n:::")
    homes = ", ".join(f"{{py:obj}}`{name}`" for name in equation.functions)
    tests = ", ".join(f"`{name.partition('::')[2]}`" for name in equation.tests)
    parts.append(f"In the code: {homes}.  \nHeld by {tests}.")
    return "\n\n".join(parts)


def changed(erratum: Erratum) -> str:
    """What is printed, used, and why."""
    return (
        f"**{inline(erratum.where)}.** Printed: {inline(erratum.printed)}. "
        f"Used: {inline(erratum.used)}. Because: {inline(erratum.why)}."
    )


def errata() -> str:
    """The table of errata."""
    rows = "\n".join(
        f"| {inline(e.where)} | {inline(e.printed)} | {inline(e.used)} | {inline(e.why)} | "
        + ", ".join(f"[({n})](#equation-{n})" for n in e.equations)
        + " |"
        for e in ERRATA
    )
    return (
        "# Errata\n\nPlaces where the printed text cannot be used as it stands.\n\n"
        f"| where | printed | used | because | equations |\n|---|---|---|---|---|\n{rows}\n"
    )
