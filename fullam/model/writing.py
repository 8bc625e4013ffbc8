"""Writing a vehicle: its TOML and its URDF beside it, which `load_vehicle` reads back."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fullam.checks import Checker
from fullam.exceptions import VehicleError
from fullam.files import atomic_path
from fullam.model.vehicle import Vehicle


def write_vehicle(vehicle: Vehicle, path: str | Path) -> tuple[Path, Path]:
    """Write a vehicle as it was defined; changes made on the object since are not in it.

    Args:
        vehicle: The vehicle.
        path: Its TOML; the URDF goes beside it, under the same name.

    Returns:
        Both files, the TOML first.

    Raises:
        VehicleError: The path does not end in .toml, or there is no vehicle.
    """
    check = Checker("write_vehicle", VehicleError)
    check.instance("vehicle", vehicle, Vehicle)
    path = check.path("path", path)
    if path.suffix != ".toml":
        raise VehicleError(str(path), "file", "does not end in .toml", "give the path of a TOML")
    urdf = path.with_suffix(".urdf")
    definition = {**vehicle.definition, "urdf": urdf.name}
    with atomic_path(urdf) as temporary:
        temporary.write_text(vehicle.urdf, encoding="utf-8")
    with atomic_path(path) as temporary:
        temporary.write_text(toml_text(definition), encoding="utf-8")
    return path, urdf


def toml_text(definition: Mapping[str, Any]) -> str:
    """A document as TOML: values first, then tables, then arrays of tables."""
    values, tables, lists = [], [], []
    for key, value in definition.items():
        if isinstance(value, Mapping):
            tables.append(f"\n[{key}]\n" + _entries(value))
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            lists += [f"\n[[{key}]]\n" + _entries(row) for row in value]
        else:
            values.append(f"{key} = {_value(value)}\n")
    return "".join([*values, *tables, *lists])


def _entries(table: Mapping[str, Any]) -> str:
    return "".join(f"{key} = {_value(value)}\n" for key, value in table.items())


def _key(key: str) -> str:
    return key if re.fullmatch("[A-Za-z0-9_-]+", key) else json.dumps(key, ensure_ascii=False)


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        pairs = (f"{_key(key)} = {_value(entry)}" for key, entry in value.items())
        return f"{{ {', '.join(pairs)} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(entry) for entry in value)}]"
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, int):
        return str(value)
    return repr(float(value))
