"""Where the meshes of a URDF are, and which are not there."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fullam.model.packages import package_roots

if TYPE_CHECKING:
    from fullam.model.vehicle import Vehicle


def mesh_folders(vehicle: Vehicle) -> list[str]:
    """Folders in which the meshes of a URDF (`package://name/...`, or relative) are looked for."""
    folders = [Path(sys.prefix) / "share"]
    arm = vehicle.definition.get("arm")
    entries = [
        vehicle.definition.get("urdf"),
        arm.get("urdf") if isinstance(arm, Mapping) else None,
    ]
    home = None if vehicle.source is None else Path(vehicle.source).resolve().parent
    for entry in entries:
        if isinstance(entry, Mapping) and "package" in entry:
            folders[:0] = _package_folders(entry)
        elif home is not None and entry is not None:
            path = entry.get("path", "") if isinstance(entry, Mapping) else entry
            folders.append((home / str(path)).parent)
    if home is not None:
        folders.append(home)
    return list(dict.fromkeys(str(folder) for folder in folders))


def _package_folders(entry: Mapping[str, Any]) -> Iterator[Path]:
    """The package's share, and the folder of the URDF in it."""
    package = str(entry["package"])
    for root in package_roots(package):
        yield root / "share"
        yield (root / "share" / package / "robots" / str(entry.get("path", ""))).parent


def find_mesh(name: str, folders: list[str]) -> Path | None:
    """The file that a URDF's mesh means, or None.

    Args:
        name: `package://name/path`, `file:///path`, or a path.
        folders: Where packages, and relative paths, are looked for.
    """
    scheme, _, rest = name.partition("://")
    path = Path(rest if scheme in ("package", "model", "file") else name)
    candidates = [path] if path.is_absolute() else [Path(folder) / path for folder in folders]
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def resolve_meshes(vehicle: Vehicle) -> tuple[str, tuple[str, ...]]:
    """The vehicle's URDF with the meshes that it shows as absolute paths.

    Returns:
        The text, and the names of the meshes that were not found, as the URDF has them.
    """
    robot = ET.fromstring(vehicle.urdf)
    folders = mesh_folders(vehicle)
    missing: dict[str, None] = {}
    for element in robot.iterfind("link/visual/geometry/mesh"):
        name = element.get("filename", "")
        found = find_mesh(name, folders)
        if found is None:
            missing[name] = None
        else:
            element.set("filename", str(found))
    return ET.tostring(robot, encoding="unicode"), tuple(missing)


def missing_remark(vehicle: Vehicle) -> str | None:
    """Which meshes are missing and where they were looked for, in a sentence, or None."""
    _, missing = resolve_meshes(vehicle)
    if not missing:
        return None
    places = ", ".join(mesh_folders(vehicle))
    others = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
    return f"mesh '{missing[0]}'{others} not found, so it is drawn from its joints ({places})"
