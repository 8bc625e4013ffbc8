"""Finding vehicles: names, TOML files and the URDFs that they point to."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fullam.checks import Checker, read_text, read_toml, shown
from fullam.exceptions import UnknownName, VehicleError
from fullam.model import definition as read
from fullam.model.composition import compose, move_meshes
from fullam.model.definition_keys import URDF, names_of
from fullam.model.packages import package_roots
from fullam.model.vehicle import Vehicle
from fullam.model.xacro_files import expand_xacro


def vehicle_folders() -> tuple[Path, ...]:
    """Folders that hold the registered vehicles.

    A wheel carries them as fullam/urdf; in an editable install they stay at the top of the
    repository, beside pyproject.toml.
    """
    package = Path(__file__).resolve().parents[1]
    folders = [package / "urdf"]
    if (package.parent / "pyproject.toml").is_file():
        folders.append(package.parent / "urdf")
    return tuple(folder for folder in folders if folder.is_dir())


def _registered() -> dict[str, Path]:
    files: dict[str, Path] = {}
    for folder in vehicle_folders():
        for path in sorted(folder.glob("*.toml")):
            files.setdefault(path.stem, path)
    return files


def vehicle_names() -> tuple[str, ...]:
    """Names that `load_vehicle` knows, sorted: the TOML files in `vehicle_folders`."""
    return tuple(sorted(_registered()))


def load_vehicle(name_or_path: str | Path) -> Vehicle:
    """Load a registered vehicle by name, or any vehicle by the path of its TOML.

    Args:
        name_or_path: One of `vehicle_names`, or a path (a `Path`, or a text that ends in ".toml"
            or names a folder).

    Raises:
        UnknownName: If the name is not registered.
        VehicleError: If the file is missing or describes no complete, physical vehicle.
    """
    path = vehicle_path(name_or_path)
    definition = read_definition(path)
    return Vehicle.from_definition(definition, read_urdf(definition, path), str(path))


def vehicle_path(name_or_path: str | Path) -> Path:
    """The TOML that a name or path means.

    Raises:
        UnknownName: If it looks like a name and is not registered.
        VehicleError: If it is a URDF.
    """
    if not isinstance(name_or_path, str | Path):
        raise VehicleError(
            "load_vehicle",
            "name_or_path",
            f"is {shown(name_or_path)}",
            f"give the path of a TOML, or one of {', '.join(vehicle_names())}",
        )
    path = Path(name_or_path)
    if path.suffix == ".urdf":
        raise VehicleError(
            str(path),
            "file",
            "is a URDF, which has no rotors",
            "give the TOML beside it, which names the platform, the arm and the rotors",
        )
    if isinstance(name_or_path, Path) or path.suffix == ".toml" or len(path.parts) > 1:
        return path
    registered = _registered()
    if name_or_path not in registered:
        raise UnknownName("vehicle", name_or_path, vehicle_names())
    return registered[name_or_path]


def read_definition(path: Path) -> dict[str, Any]:
    """Parse a vehicle's TOML.

    Raises:
        VehicleError: If there is no such file, or it is not TOML.
    """
    return read_toml(path, Checker(str(path), VehicleError))


def read_urdf(definition: Mapping[str, Any], path: Path) -> str:
    """Text of the URDF that a definition points to, with the arm mounted that it may name.

    `urdf` is a path relative to the TOML, or a table: `path`, `package` (a data package of the
    environment that installs its robots under share/<package>/robots), and `args` of a xacro file.
    `arm` may be a table with a `urdf` of its own, see `composition.compose`.

    Raises:
        VehicleError: A file is missing, or the two do not fit together.
        MissingDependency: A file is a xacro file, and `xacrodoc` is not installed.
    """
    where = str(path)
    file = _robot_file(definition, path, "urdf")
    text = _robot_text(definition, file, where)
    read.arm_joints(definition, where)  # refuses a key that nobody reads
    arm = definition.get("arm")
    if not isinstance(arm, Mapping) or "urdf" not in arm:
        return text
    arm_file = _robot_file(arm, path, "arm.urdf")
    between = os.path.relpath(arm_file.resolve().parent, file.resolve().parent)
    mounted = move_meshes(_robot_text(arm, arm_file, where), Path(between).as_posix())
    return compose(text, mounted, arm, read.text(definition, "platform", where), where)


def _robot_file(table: Mapping[str, Any], path: Path, field: str) -> Path:
    where, entry = str(path), table.get("urdf")
    if not isinstance(entry, Mapping):
        return path.parent / read.text(table, "urdf", where)
    read.check_keys(entry, names_of(URDF), where, field)
    inner = read.text(entry, "path", where)
    if "package" in entry:
        return _package_file(read.text(entry, "package", where), inner, where)
    return path.parent / inner


def _robot_text(table: Mapping[str, Any], file: Path, where: str) -> str:
    entry = table["urdf"]
    arguments = read.subtable(entry, "args", where) if isinstance(entry, Mapping) else {}
    try:
        text = read_text(file, Checker(str(file), VehicleError))
    except VehicleError as error:
        raise VehicleError(
            where,
            "urdf",
            f"'{file}' {error.problem}",
            "give a path relative to the TOML, or {package = ..., path = ...}",
        ) from error
    return expand_xacro(file, arguments, where) if file.suffix == ".xacro" else text


def _package_file(package: str, inner: str, where: str) -> Path:
    for root in package_roots(package):
        robots = root / "share" / package / "robots"
        if robots.is_dir():
            return robots / inner
    raise VehicleError(
        where, "urdf.package", f"'{package}' is not installed", f"pip install {package}"
    )
