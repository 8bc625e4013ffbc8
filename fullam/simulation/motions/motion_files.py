"""Motions that a scenario's file leaves to another file: read where the scenario is read.

What they hold becomes part of the scenario, so a record of it flies again without them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fullam.checks import Checker
from fullam.exceptions import ScenarioError
from fullam.simulation.motions.joint_trajectory import JointTrajectory
from fullam.simulation.motions.references import from_dict
from fullam.simulation.motions.trajectory import Trajectory
from fullam.simulation.world.world_file import WorldFile

READERS: dict[str, tuple[str, Any]] = {
    "reference": ("reference", Trajectory.from_csv),
    "arm_motion": ("arm motion", JointTrajectory.from_csv),
}
"""Entries of a scenario that may be {kind = "csv", path = ...}: their names, and who reads them."""


def with_files_read(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """A scenario's table with the motions of CSV files in the place of their paths.

    Args:
        data: The table.
        folder: Where relative paths begin, those of a scene in MJCF and of a vehicle's TOML (if it
            is there) as well.

    Raises:
        ScenarioError: A file that cannot be read as a motion; names file and line.
    """
    values = dict(data)
    if _same_file(values.get("reference"), values.get("arm_motion")):
        values["reference"] = {"with_arm": True} | dict(values["reference"])
    for entry, (what, read) in READERS.items():
        values |= {entry: _read(values[entry], what, read, folder)} if entry in values else {}
    tool = values.get("tool")
    if isinstance(tool, Mapping) and "path" in tool:
        path = _read(tool["path"], "tool path", Trajectory.from_csv, folder)
        values["tool"] = {**tool, "path": path}
    if isinstance(values.get("world_file"), str):
        values["world_file"] = WorldFile.read(folder / values["world_file"])
    vehicle = values.get("vehicle")
    if isinstance(vehicle, str) and vehicle.endswith(".toml") and (folder / vehicle).is_file():
        values["vehicle"] = str(folder / vehicle)
    return values


def _same_file(reference: Any, arm_motion: Any) -> bool:
    """Whether both motions stand in one CSV file, whose other columns the arm's reader judges."""
    tables = reference, arm_motion
    if not all(isinstance(t, Mapping) and t.get("kind") == "csv" for t in tables):
        return False
    return bool(reference.get("path") == arm_motion.get("path"))


def _read(table: Any, what: str, read: Any, folder: Path) -> Any:
    """The motion of a table that names a CSV file; any other table as it is."""
    if not isinstance(table, Mapping) or table.get("kind") != "csv":
        return table
    given = dict(table)
    if "path" in given:
        check = Checker(f"{what} 'csv'", ScenarioError)
        given["path"] = str(folder / check.text("path", given["path"]))
    return from_dict({"csv": read}, what, given)
