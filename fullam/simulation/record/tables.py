"""A record where people work: one table for pandas and CSV, one set of arrays for xarray.

A column of a record has several components; in a table each has a column of its own, `pose_x` or
`rotor_speeds_1`. `COMPONENTS` names them and their units; joints have their own names.
"""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker
from fullam.exceptions import MissingDependency, RunFileError
from fullam.files import atomic_path
from fullam.simulation.world.scene_joints import COLUMN

if TYPE_CHECKING:
    import pandas
    import xarray

    from fullam.simulation.record.run import Run

Array = NDArray[Any]

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
TWIST = ("x", "y", "z", "wx", "wy", "wz")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
COMPONENTS = {
    "pose": POSE,
    "velocity": TWIST,
    "measured_pose": POSE,
    "measured_velocity": TWIST,
    "reference_pose": POSE,
    "u_pid": TWIST,
    **dict.fromkeys(("u_dc", "command", "delivered", "residual"), WRENCH),
    **dict.fromkeys(("rotor_wrench", "disturbance"), WRENCH),
}
"""Names of the components of columns that have the same ones for every vehicle."""

FORCE = ("x", "y", "z")
JOINTS = (
    *("arm", "arm_rate", "arm_goal", "arm_torque"),
    *("measured_arm", "measured_arm_rate"),
)
"""Columns that have a number for each joint."""

DIMENSIONS = {POSE: "pose_component", TWIST: "twist_component", WRENCH: "wrench_component"}
"""Names of their dimensions in xarray; the others are "joint", "rotor" and what `parts_of` says."""

EXTRA = "export"


@dataclass(frozen=True, eq=False)
class Part:
    """One column of a record with the names of its components.

    Attributes:
        name: Of the column.
        values: Shape (N,) or (N, k).
        components: Their names, k of them; none of a plain column.
        units: Their units, k of them, or the one of a plain column; "" has none.
        dimension: Name of the second dimension; "" of a plain column.
        meaning: What the column is.
    """

    name: str
    values: Array
    components: tuple[str, ...]
    units: tuple[str, ...]
    dimension: str
    meaning: str

    @property
    def table(self) -> dict[str, Array]:
        """Plain columns by their name, read-only views."""
        if not self.components:
            return {self.name: self.values}
        names = (f"{self.name}_{component}" for component in self.components)
        return dict(zip(names, self.values.T, strict=True))


def parts_of(run: Run) -> list[Part]:
    """The columns of a record, in its order, `t` first."""
    units, meanings, joints = run.units, run.meanings, run.vehicle.joints.names
    found = []
    for name, values in run.columns.items():
        components = COMPONENTS.get(name, ())
        dimension = DIMENSIONS[components] if components else ""
        if name in JOINTS:
            components, dimension = joints, "joint"
        elif name == "contact_force":
            components, dimension = FORCE, "force_component"
        elif name == COLUMN:
            found.append(_scene(run, values, meanings[name]))
            continue
        elif name in ("rotor_commands", "rotor_speeds"):
            components = tuple(str(k + 1) for k in range(values.shape[1]))
            dimension = "rotor"
        found.append(
            Part(
                name, values, components, _units(units[name], components), dimension, meanings[name]
            )
        )
    return found


def _scene(run: Run, values: Array, meaning: str) -> Part:
    """The coordinates of a scene's joints, named by these."""
    joints = run.scene_joints
    components = tuple(name for joint in joints for name in joint.components)
    units = tuple(unit for joint in joints for unit in joint.units)
    return Part(COLUMN, values, components, units, "scene_coordinate", meaning)


def _units(text: str, components: tuple[str, ...]) -> tuple[str, ...]:
    """Unit of each component from that of the column: "rad", "m, rad, rad", "N, N m", ..."""
    given = text.split(", ")
    if components == POSE:
        return (given[0],) * 3 + ("",) * 4
    if len(given) == 2 and len(components) == 6:
        return (given[0],) * 3 + (given[1],) * 3
    return tuple(given) if len(given) == len(components) else (text,) * max(1, len(components))


def columns_of(run: Run) -> dict[str, Array]:
    """Every number of a record as plain columns, (N,) each, `t` first."""
    return {name: values for part in parts_of(run) for name, values in part.table.items()}


def units_of(run: Run) -> dict[str, str]:
    """Unit of each of `columns_of`."""
    return {
        name: unit
        for part in parts_of(run)
        for name, unit in zip(part.table, part.units, strict=True)
    }


def identity_of(run: Run) -> dict[str, Any]:
    """What was flown, in a few words: text and numbers."""
    metadata = run.metadata
    names = ("controller", "seed", "outcome", "reason", "driver")
    return {
        "scenario": metadata["scenario"]["name"],
        "vehicle": metadata["vehicle"]["definition"]["name"],
        **{name: metadata[name] for name in names},
    }


def to_pandas(run: Run) -> pandas.DataFrame:
    """The record as a table; see `Run.to_pandas`."""
    try:
        import pandas
    except ImportError as error:
        raise MissingDependency("a record as a table", "pandas", EXTRA) from error
    columns = columns_of(run)
    index = pandas.Index(columns.pop("t"), name="t")
    frame = pandas.DataFrame(columns, index=index)
    frame.attrs |= identity_of(run) | {"units": units_of(run)}
    return frame


def to_xarray(run: Run) -> xarray.Dataset:
    """The record as labelled arrays; see `Run.to_xarray`."""
    try:
        import xarray
    except ImportError as error:
        raise MissingDependency("a record as labelled arrays", "xarray", EXTRA) from error
    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    units = run.units
    for part in parts_of(run):
        attributes = {"units": units[part.name], "long_name": part.meaning}
        if part.name == "t":
            coordinates["t"] = ("t", part.values, attributes)
        elif not part.components:
            variables[part.name] = ("t", part.values, attributes)
        else:
            coordinates[part.dimension] = list(part.components)
            variables[part.name] = (("t", part.dimension), part.values, attributes)
    attributes = identity_of(run) | {"metadata": json.dumps(run.metadata)}
    return xarray.Dataset(variables, coordinates, attributes)


def to_csv(run: Run, path: str | Path) -> Path:
    """The record as a text table; see `Run.to_csv`."""
    path = checked(path, ".csv")
    columns = {n: v.astype(int) if v.dtype == bool else v for n, v in columns_of(run).items()}
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(columns)
        # Python's shortest text of a float reads back to the same bits.
        file.writelines(f"{','.join(map(repr, row))}\n" for row in rows)
    return path


def checked(path: str | Path, suffix: str) -> Path:
    """The path of a file to be written, if it has its suffix.

    Raises:
        RunFileError: It has not.
    """
    return Checker("record", RunFileError).path("name", path, suffix)


def plain(values: Array) -> list[Any]:
    """Numbers as JSON has them: what is not finite is null."""
    finite = np.isfinite(values)
    listed: list[Any] = values.tolist()
    return (
        listed
        if finite.all()
        else [v if good else None for v, good in zip(listed, finite, strict=True)]
    )
