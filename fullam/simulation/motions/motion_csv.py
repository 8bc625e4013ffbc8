"""Motions from CSV files: named columns with units, and the line of whatever is wrong."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, read_text, shown
from fullam.exceptions import ScenarioError

Array = NDArray[np.float64]

MOST_ROWS = 100_000
"""More rows than this are not read."""

SCALES = {
    "time": {"s": 1.0, "ms": 1e-3},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "angle": {"deg": 1.0, "rad": 180.0 / np.pi},
    "speed": {"m/s": 1.0, "mm/s": 1e-3},
    "number": {"": 1.0},
}
"""Units that a header may state, and what makes s, m, deg and m/s of them."""

UNITS = {unit for scales in SCALES.values() for unit in scales if unit}

PLATFORM = {
    **dict.fromkeys(("x", "y", "z"), "length"),
    **dict.fromkeys(("phi", "psi", "gamma"), "angle"),
    **dict.fromkeys(("qx", "qy", "qz", "qw"), "number"),
    **dict.fromkeys(("vx", "vy", "vz"), "speed"),
}
"""Columns of the platform, and what each measures."""


@dataclass(frozen=True, eq=False)
class Columns:
    """What a CSV file holds.

    Attributes:
        path: Where it was read.
        names: Names of the columns without their units.
        units: Unit of each as its header states it; empty if it states none.
        values: The numbers as they stand, shape (N, columns).
        lines: Line of the file that each row stands on.
    """

    path: Path
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    lines: tuple[int, ...]

    @property
    def check(self) -> Checker:
        """Raises what is wrong with the file."""
        return Checker(str(self.path), ScenarioError)

    def placed(self, error: ScenarioError) -> ScenarioError:
        """An error about row [i] of what the file holds, as one about its line."""
        where = re.search(r"\[(\d+)\]", error.field)
        line = f"line {self.lines[int(where[1])]}: " if where else ""
        return ScenarioError(
            str(self.path), f"{line}{error.field}", error.problem, error.remedy.rstrip(".")
        )

    def has(self, names: tuple[str, ...]) -> bool:
        """Whether all of these columns are there.

        Raises:
            ScenarioError: Some are and some are not.
        """
        missing = [name for name in names if name not in self.names]
        if missing and len(missing) < len(names):
            there = ", ".join(name for name in names if name not in missing)
            problem = f"has {there} and no {', '.join(missing)}"
            raise self.check.refuse("header", problem, f"give {', '.join(names)}, or none of them")
        return not missing

    def read(self, names: tuple[str, ...], measures: str) -> Array:
        """Columns in s, m, deg or m/s, shape (N, columns).

        Raises:
            ScenarioError: A unit that does not fit, or an angle without one.
        """
        scales = SCALES[measures]
        usual = "" if measures in ("angle", "number") else next(iter(scales))
        found = []
        for name in names:
            column = self.names.index(name)
            unit = self.units[column] or usual
            if unit not in scales:
                problem = f"column '{name}' is in '{unit}'" if unit else f"'{name}' has no unit"
                choices = " or ".join(f"'{name} [{u}]'" if u else f"'{name}'" for u in scales)
                raise self.check.refuse("header", problem, f"name it {choices}")
            found.append(self.values[:, column] * scales[unit])
        return np.stack(found, axis=1)

    def times(self) -> Array:
        """The column t [s].

        Raises:
            ScenarioError: There is none, or it does not ascend.
        """
        if "t" not in self.names:
            problem = f"has no column t (it has {', '.join(self.names)})"
            raise self.check.refuse("header", problem, "name the times 't [s]'")
        t = self.read(("t",), "time")[:, 0]
        for row in np.flatnonzero(np.diff(t) <= 0.0)[:1]:
            problem = f"t is {t[row + 1]:g} s after {t[row]:g} s"
            raise self.check.refuse(f"line {self.lines[row + 1]}", problem, "times ascend")
        return t


def read_columns(path: str | Path) -> Columns:
    """Read a CSV file with a header.

    Entries are separated by commas, semicolons or tabs; empty lines and those that begin with #
    are left out. A header names each column, with its unit in brackets or behind an underscore:
    "x [m]", "x_mm".

    Args:
        path: The file.

    Raises:
        ScenarioError: It is no such file; the message names the line.
    """
    if not isinstance(path, str | Path):
        raise ScenarioError("CSV", "path", f"is {shown(path)}", "give the path of a file")
    path = Path(path)
    check = Checker(str(path), ScenarioError)
    numbered = [
        (number, line)
        for number, line in enumerate(read_text(path, check).lstrip("\ufeff").splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if len(numbered) < 3:
        raise check.refuse("file", f"has {len(numbered)} lines", "give a header and two rows")
    if len(numbered) > MOST_ROWS + 1:
        raise check.refuse("file", f"has {len(numbered) - 1} rows", f"give at most {MOST_ROWS}")
    (first, header), *body = numbered
    separator = max(",;\t", key=header.count)
    names, units = zip(
        *map(_name_and_unit, _cells(header, separator, f"line {first}", check)), strict=True
    )
    for name in names:
        if not name or names.count(name) > 1:
            problem = f"names {names.count(name)} columns {shown(name)}"
            raise check.refuse(f"line {first}", problem, "name each column once")
    values = [_numbers(line, separator, names, f"line {n}", check) for n, line in body]
    return Columns(path, names, units, np.array(values), tuple(n for n, _ in body))


def _cells(line: str, separator: str, where: str, check: Checker) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    except csv.Error as error:  # an entry of a hundred thousand characters
        problem = f"cannot be read ({error})"
        raise check.refuse(where, problem, "give numbers of a few digits") from error


def _name_and_unit(header: str) -> tuple[str, str]:
    """The parts of "x [mm]", "x (mm)" or "x_mm"; a speed may be "vx_m_s"."""
    name = header.strip()
    if bracket := re.fullmatch(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]", name):
        return bracket[1], bracket[2]
    for unit in sorted(UNITS, key=len, reverse=True):
        suffix = f"_{unit.replace('/', '_')}"
        if name.endswith(suffix):
            return name[: -len(suffix)], unit
    return name, ""


def _numbers(
    line: str, separator: str, names: tuple[str, ...], where: str, check: Checker
) -> list[float]:
    cells = _cells(line, separator, where, check)
    if len(cells) != len(names):
        problem = f"has {len(cells)} entries"
        raise check.refuse(where, problem, f"give {len(names)}: {', '.join(names)}")
    found = []
    for name, cell in zip(names, cells, strict=True):
        try:
            found.append(float(cell))
        except ValueError:
            found.append(np.nan)
        if not np.isfinite(found[-1]):
            raise check.refuse(where, f"{name} is {shown(cell)}", "give a finite number")
    return found
