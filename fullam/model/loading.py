"""Finding vehicles: names, TOML files and the URDFs that they point to."""

from __future__ import annotations

import importlib.metadata
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fullam.checks import Checker, read_text, read_toml, shown
from fullam.exceptions import UnknownName, VehicleError
from fullam.model import definition as read
from fullam.model.vehicle import Vehicle


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
    """Text of the URDF that a definition points to.

    `urdf` is a path relative to the TOML, or a table with `package` and `path`: a data package of
    the environment that installs its robots under share/<package>/robots.

    Raises:
        VehicleError: If it is missing.
    """
    where, entry = str(path), definition.get("urdf")
    if isinstance(entry, Mapping):
        read.check_keys(entry, ("package", "path"), where, "urdf")
        package = read.text(entry, "package", where)
        file = _package_file(package, read.text(entry, "path", where), where)
    else:
        file = path.parent / read.text(definition, "urdf", where)
    try:
        return read_text(file, Checker(str(file), VehicleError))
    except VehicleError as error:
        raise VehicleError(
            where,
            "urdf",
            f"'{file}' {error.problem}",
            "give a path relative to the TOML, or {package = ..., path = ...}",
        ) from error


def _package_file(package: str, inner: str, where: str) -> Path:
    share = Path("share") / package / "robots"
    roots = [Path(sys.prefix) / share]
    try:
        # An installed name is letters, digits, ".", "_", "-"; others can break the search.
        if not re.fullmatch(r"[A-Za-z0-9._-]+", package):
            raise importlib.metadata.PackageNotFoundError(package)
        distribution = importlib.metadata.distribution(package)
        roots.insert(0, Path(str(distribution.locate_file("cmeel.prefix"))) / share)
    except importlib.metadata.PackageNotFoundError:
        pass  # conda and system packages have no such metadata
    for root in roots:
        if root.is_dir():
            return root / inner
    raise VehicleError(
        where, "urdf.package", f"'{package}' is not installed", f"pip install {package}"
    )
